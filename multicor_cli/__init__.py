"""multicor: thermomechanics of two-dimensional granular flows. Importing this package loads nothing
heavy.

For Python users::

    import multicor_cli as multicor

    scenario = multicor.load_scenario("shear.toml", overrides=["loading.1.duration=2.0"])
    multicor.run(scenario, "runs/shear")
    with multicor.open_run("runs/shear") as run:
        print(run.frames[-1].velocity.mean(axis=0))
"""

import sys

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def _picture(shown: object) -> bytes | None:
    # Loaded when it is first needed, as everything
    drawn: bytes | None = __getattr__("picture")(shown)
    return drawn


def _show_pictures() -> None:
    """Tell IPython, if this is a notebook or a console of its, that runs and frames look like a map
    of their grains.
    """
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is not None:
        pictures = shell.display_formatter.formatters["image/png"]
        for module, name in (
            ("multicor_cli.store.reader", "Run"),
            ("multicor_cli.store.frames", "Frame"),
        ):
            pictures.for_type_by_name(module, name, _picture)


_show_pictures()

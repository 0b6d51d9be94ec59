"""multicor: thermomechanics of two-dimensional granular flows. Importing this package loads nothing heavy.

For Python users::

    import multicor_cli as multicor

    scenario = multicor.load_scenario("shear.toml", overrides=["loading.1.duration=2.0"])
    multicor.run(scenario, "runs/shear")
    with multicor.open_run("runs/shear") as run:
        print(run.frames[-1].velocity.mean(axis=0))
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Arguments and options that commands share, help that lists choices, and completion."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand


def option(words: str, help: str, shown: str | bool = True, **more: Any) -> Any:  # noqa: A002
    """An option: its names and what stands for its value, its help, what the default is called."""
    names = [word for word in words.split() if word.startswith("-")]
    metavar = " ".join(word for word in words.split() if word not in names)
    return typer.Option(*names, metavar=metavar or None, help=help, show_default=shown, **more)


def output_option(*, metavar: str, help: str, show_default: str | bool = False) -> Any:  # noqa: A002  (Typer's name)
    """The option ``-o``, which names what is written."""
    remedy = "write . for the current directory" if metavar.startswith("DIR") else "give one"

    def named_path(text: str) -> Path:
        """A path; an empty one, as of an unset shell variable, would be the current directory."""
        if not text.strip():
            raise typer.BadParameter(f"the name is empty; {remedy}")
        return Path(text)

    return option(f"--output -o {metavar}", help, show_default, parser=named_path)


ScenarioFile = Annotated[
    Path, typer.Argument(metavar="SCENARIO.toml", help="Scenario file.", show_default=False)
]

RunPath = Annotated[
    Path,
    typer.Argument(
        metavar="DIR", help="Run directory, or a results.h5 on its own.", show_default=False
    ),
]

_OVERRIDE = (
    "Override a key of the scenario, as loading.1.duration=2.0 (indices from 0); may be given "
    "several times."
)
Overrides = Annotated[list[str] | None, option("--set KEY=VALUE", _OVERRIDE, False)]
AsJson = Annotated[bool, option("--json", "Print the result as JSON.")]
Quiet = Annotated[bool, option("--quiet -q", "Show warnings and errors only.")]

# ---- Help that lists what there is to choose from

_LISTS = {
    "profiled": ("multicor_cli.post", "PROFILED"),
    "groups": ("multicor_cli.post", "PROFILE_GROUPS"),
    "mapped": ("multicor_cli.post", "MAPPED"),
    "scenes": ("multicor_cli.bench.scenes", "SCENES"),
    "templates": ("multicor_cli.scenario.templates", "TEMPLATES"),
    "fits": ("multicor_cli.studies.figure", "FITS"),
}
"""What stands for ``{name}`` in a help text: the module, and the names in it."""


class ListingCommand(TyperCommand):
    """A command with lists in its help; they are loaded only for that, since some take long."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Fill the lists in, then write the help."""
        for parameter in self.params:
            text = getattr(parameter, "help", None) or ""
            if "{" in text:
                parameter.help = filled(text)  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)


def names_in(key: str) -> list[str]:
    """The names of a list."""
    module, name = _LISTS[key]
    return list(getattr(import_module(module), name))


def filled(text: str) -> str:
    """A help text with its lists."""
    for key in _LISTS:
        if (place := f"{{{key}}}") in text:
            text = text.replace(place, ", ".join(names_in(key)))
    return text


# ---- What the shell offers for the value of an option: `multicor --install-completion` turns it on


def listed(*keys: str) -> Callable[[str], list[str]]:
    """Names of the lists that help texts show under these keys."""

    def offer(incomplete: str) -> list[str]:
        return _beginning(incomplete, (name for key in keys for name in names_in(key)))

    return offer


def fields(ctx: typer.Context, incomplete: str) -> list[str]:
    """Coarse-grained fields, with components along the axes that the line asks for."""
    from multicor_cli.post.field_sums import Known, field_list

    known = field_list("rt" if ctx.params.get("center") else "xy", Known(True, True, True))
    return _beginning(incomplete, (field.name for field in known))


def columns(ctx: typer.Context, incomplete: str) -> list[str]:
    """Columns of the time series of the line's run; of walls and outlets what follows the colon."""
    from multicor_cli.store import open_run

    # a shell has no place for messages
    with contextlib.suppress(Exception), open_run(_place(ctx, "directory")) as run:
        names = (column.name.rpartition(": ")[2] for column in run.series_columns)
        return _beginning(incomplete, names)
    return []


def observables(ctx: typer.Context, incomplete: str) -> list[str]:
    """Observables of the study that the line names."""
    from multicor_cli.studies.study_file import load_study

    with contextlib.suppress(Exception):
        study = load_study(_place(ctx, "file"))
        return _beginning(incomplete, (each.name for each in study.model.observe))
    return []


def _place(ctx: typer.Context, name: str) -> str:
    """The first argument: the parser leaves it there if an option behind has no value yet."""
    return str(ctx.params.get(name) or ctx.args[0])


def _beginning(incomplete: str, names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(name for name in names if name.startswith(incomplete)))

"""Help that lists what there is to choose from."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from typer.core import TyperCommand

_LISTS = {
    "profiled": ("multicor_cli.post", "PROFILED"),
    "groups": ("multicor_cli.post", "PROFILE_GROUPS"),
    "mapped": ("multicor_cli.post", "MAPPED"),
    "scenes": ("multicor_cli.bench.scenes", "SCENES"),
    "templates": ("multicor_cli.scenario.templates", "TEMPLATES"),
    "fits": ("multicor_cli.studies.fits", "FITS"),
}
"""What stands for ``{name}`` in a help text: the module, and the names in it."""


class ListingCommand(TyperCommand):
    """A command with lists in the help of its parameters; they are loaded only when its help is shown, since some take long."""

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

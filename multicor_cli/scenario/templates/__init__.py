"""Commented scenarios to start from; some read a table that belongs beside them."""

from __future__ import annotations

import re
from importlib.resources import files

COOKBOOK = (
    "chute",
    "dense-packing",
    "vibrated-bed",
    "intruder",
    "silo",
    "annular-shear",
    "biaxial",
    "heap",
    "sieve-curve",
    "cell-shear",
    "cell-compression",
    "rods",
    "conductivity",
    "flash-heating",
    "polygons",
    "arch",
    "clumps",
)
"""Templates that are shipped as scenarios, too (docs/how-to/cookbook/index.md, shapes.md)."""

TEMPLATES = ("shear", "column", "hopper", "drum", *COOKBOOK)
"""Names of the templates."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_PLACE = "NAME"


def new_scenario(name: str, template: str = "shear") -> str:
    """Text of a new scenario file.

    Args:
        name: Name of the scenario: letters, digits and ``. _ -``.
        template: One of `TEMPLATES`.

    Raises:
        ValueError: The name has other characters, or there is no such template; the message is fit
            for users.
    """
    if template not in TEMPLATES:
        raise ValueError(f"there is no template '{template}': use one of {', '.join(TEMPLATES)}")
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"'{name}' cannot name a scenario: use letters, digits and . _ - (a letter or digit "
            "first)"
        )
    file = files(__package__).joinpath(f"{template}.toml")
    return file.read_text(encoding="utf-8").replace(_PLACE, name)


def template_table(template: str) -> str | None:
    """Text of the file NAME.csv that a scenario from a template reads; None if it reads none."""
    file = files(__package__).joinpath(f"{template}.csv")
    return file.read_text(encoding="utf-8") if file.is_file() else None

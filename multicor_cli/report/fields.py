"""What the grains on the page can be colored by: one row per quantity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post import MAP_FIELDS
from multicor_cli.report.quantize import Spacing
from multicor_cli.store import Run

Scale = Literal["linear", "centered", "logarithmic"]
"""How values become colors, as in `multicor_cli.post.MapField`."""


@dataclass(frozen=True)
class ViewField:
    """A quantity of every grain.

    Attributes:
        name: Name in the page.
        label: Name for people.
        unit: SI unit.
        colors: Name of its colors in the scripts of the page.
        values: Values of the grains of a frame, shape ``(n,)``, or None where the frame has none.
        needs_heat: Whether only runs with heat have it.
        scale: How values become colors.
        spacing: How they are stored.
    """

    name: str
    label: str
    unit: str
    colors: str
    values: Callable[[Run, int], Floats | None]
    needs_heat: bool = False
    scale: Scale = "linear"
    spacing: Spacing = "even"


def _speed(run: Run, frame: int) -> Floats:
    return np.asarray(np.hypot(*np.asarray(run.frames[frame].velocity, np.float64).T))


def _spin(run: Run, frame: int) -> Floats:
    return MAP_FIELDS["spin"].values(run, frame)


def _temperature(run: Run, frame: int) -> Floats:
    return MAP_FIELDS["temperature"].values(run, frame)


def _heat(run: Run, frame: int) -> Floats | None:
    return MAP_FIELDS["heat"].values(run, frame) if frame else None


def largest_forces(run: Run, frame: int) -> Floats | None:
    """Largest normal force of the contacts of each grain [N], shape ``(n,)``; None if the contacts are not in the file."""
    chosen = run.frames[frame]
    contacts = chosen.contacts
    if not contacts.recorded or not chosen.dt > 0.0:
        return None
    n = run.model.grain_count
    found, force = np.zeros(n), np.asarray(contacts.force[:, 0], np.float64)
    np.maximum.at(found, contacts.i, force)
    between = contacts.j < n
    np.maximum.at(found, contacts.j[between], force[between])
    return found


VIEW_FIELDS = (
    ViewField("speed", "speed", "m/s", "viridis", _speed, spacing="square"),
    ViewField("spin", "spin", "rad/s", "balance", _spin, scale="centered", spacing="signed"),
    ViewField("temperature", "temperature", "K", "plasma", _temperature, needs_heat=True),
    ViewField("heat", "generated heat", "W", "magma", _heat, needs_heat=True, scale="logarithmic", spacing="square"),
    ViewField("force", "largest contact force", "N", "viridis", largest_forces, spacing="square"),
)
"""All quantities, in the order of the page."""

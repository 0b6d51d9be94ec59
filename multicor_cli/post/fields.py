"""What a profile can be taken of: one row of the table per field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from multicor_cli.post.source import GrainFrame
from multicor_cli.state.model import Floats, Model


@dataclass(frozen=True)
class Field:
    """A quantity that every grain has.

    Attributes:
        name: Name on the command line.
        label: Name in tables and figures.
        symbol: Symbol in figures (TeX).
        unit: SI unit.
        of_grains: Values of the grains of a frame, shape ``(n,)``.
        of_walls: Values of the walls of a frame, shape ``(w,)``, or None where walls have none; normalizing needs them.
    """

    name: str
    label: str
    symbol: str
    unit: str
    of_grains: Callable[[GrainFrame, Model], Floats]
    of_walls: Callable[[GrainFrame, Model], Floats] | None = None


def _velocity(frame: GrainFrame, _model: Model) -> Floats:
    return np.asarray(frame.velocity[:, 0], np.float64)


def _wall_velocity(frame: GrainFrame, _model: Model) -> Floats:
    return np.asarray(frame.wall_velocity[:, 0], np.float64)


FIELDS: dict[str, Field] = {
    field.name: field for field in (Field("velocity", "velocity", "v_x", "m/s", _velocity, _wall_velocity),)
}
"""All fields, by name."""

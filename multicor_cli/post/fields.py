"""What a profile can be taken of: one row of the table per field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from multicor_cli.post.source import GrainFrame, need_heat
from multicor_cli.state.model import Floats, Model

Kind = Literal["mean", "rate", "share"]
"""How grains add up to the value of a bin.

``mean``: average over the grains, weighted by their area in the bin. ``rate``: increase of what the grains hold from frame to
frame, over the time between and the area of the bin. ``share``: area of the grains over the area of the bin.
"""

Scaling = Literal["walls", "shear", "none"]
"""What a normalized profile is divided by.

``walls``: from 0 at the lower to 1 at the upper wall. ``shear``: by the shear rate of the walls, the difference of their
velocities over their distance. ``none``: there is no normalized form.
"""


@dataclass(frozen=True)
class Field:
    """A quantity that every grain has.

    Attributes:
        name: Name on the command line.
        label: Name in tables and figures.
        symbol: Symbol in figures (TeX).
        unit: SI unit of the profile.
        of_grains: Values of the grains of a frame, shape ``(n,)``; what they hold since the start of the run for a rate.
        of_walls: Values of the walls of a frame, shape ``(w,)``, or None where walls have none.
        kind: How grains add up.
        scaling: What a normalized profile is divided by.
        is_relative: Whether ``of_grains`` wants the velocities relative to the mean flow at the height of each grain.
    """

    name: str
    label: str
    symbol: str
    unit: str
    of_grains: Callable[[GrainFrame, Model], Floats]
    of_walls: Callable[[GrainFrame, Model], Floats] | None = None
    kind: Kind = "mean"
    scaling: Scaling = "none"
    is_relative: bool = False


def _velocity(frame: GrainFrame, _model: Model) -> Floats:
    return np.asarray(frame.velocity[:, 0], np.float64)


def _wall_velocity(frame: GrainFrame, _model: Model) -> Floats:
    return np.asarray(frame.wall_velocity[:, 0], np.float64)


def _spin(frame: GrainFrame, _model: Model) -> Floats:
    return np.asarray(frame.spin, np.float64)


def _wall_spin(frame: GrainFrame, _model: Model) -> Floats:
    return np.asarray(frame.wall_velocity[:, 2], np.float64)


def _granular_temperature(frame: GrainFrame, _model: Model) -> Floats:
    velocity = np.asarray(frame.velocity, np.float64)[:, :2]
    return np.asarray(0.5 * (velocity**2).sum(axis=1))


def _temperature(frame: GrainFrame, _model: Model) -> Floats:
    return need_heat(frame.temperature)


def _wall_temperature(frame: GrainFrame, _model: Model) -> Floats:
    return need_heat(frame.wall_temperature)


def _generated(frame: GrainFrame, _model: Model) -> Floats:
    return need_heat(frame.generated)


def _one(_frame: GrainFrame, model: Model) -> Floats:
    return np.ones(model.grain_count)


FIELDS: dict[str, Field] = {
    field.name: field
    for field in (
        Field("velocity", "velocity", "v_x", "m/s", _velocity, _wall_velocity, scaling="walls"),
        Field("spin", "spin", r"\omega", "rad/s", _spin, _wall_spin, scaling="shear"),
        Field("temperature", "temperature", "T", "K", _temperature, _wall_temperature, scaling="walls"),
        Field("heat", "generated heat", r"\dot{q}", "W/m2", _generated, kind="rate"),
        Field("solid-fraction", "solid fraction", r"\phi", "1", _one, kind="share"),
        Field("granular-temperature", "granular temperature", r"T_g", "m2/s2", _granular_temperature, is_relative=True),
    )
}
"""All fields, by name."""

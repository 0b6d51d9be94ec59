"""What a profile can be taken of: one row of the table per field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts
from multicor_cli.post.source import GrainFrame, need_heat

Kind = Literal["mean", "number", "rate", "share", "contact"]
"""How grains or contacts add up to the value of a bin.

``mean``: average over the grains, weighted by their area in the bin. ``number``: average over the grains, which count alike, each
with the part of its area that lies in the bin. ``rate``: increase of what the grains hold from frame to frame, over the time
between and the area of the bin. ``share``: area of the grains in the bin times their value, over the area of the bin. ``contact``:
what contacts carry, spread evenly along the branch that joins the centers of two grains, free or glued (or the center of a grain
and the point where it touches a smooth wall), over the area of the bin. The area of a bin is its width times the period, or, where
there is none, times how far the grains of the frame reach in x.
"""

Scaling = Literal["walls", "shear", "none"]
"""What a normalized profile is divided by.

``walls``: from 0 at the lower to 1 at the upper wall. ``shear``: by the shear rate of the walls, the difference of their
velocities over their distance. ``none``: there is no normalized form.
"""


@dataclass(frozen=True)
class Field:
    """A quantity that every grain, or every contact, has.

    Attributes:
        name: Name on the command line.
        label: Name in tables and figures.
        symbol: Symbol in figures (TeX).
        unit: SI unit of the profile.
        of_grains: Values of the grains of a frame, shape ``(n,)``; what they hold since the start of the run for a rate;
            None if contacts have the values.
        of_walls: Values of the walls of a frame, shape ``(w,)``, or None where walls have none.
        kind: How grains add up.
        scaling: What a normalized profile is divided by.
        is_relative: Whether ``of_grains`` wants the velocities relative to the mean flow at the height of each grain.
        of_contacts: Values of the contacts of a frame that carry a force, shape ``(c,)``; for the kind ``contact``.
        needs_contacts: Whether frames without contact forces are left out.
    """

    name: str
    label: str
    symbol: str
    unit: str
    of_grains: Callable[[GrainFrame, Model], Floats] | None
    of_walls: Callable[[GrainFrame, Model], Floats] | None = None
    kind: Kind = "mean"
    scaling: Scaling = "none"
    is_relative: bool = False
    of_contacts: Callable[[LoadedContacts], Floats] | None = None
    needs_contacts: bool = False


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


def _coordination(frame: GrainFrame, model: Model) -> Floats:
    return loaded_contacts(frame, model).counts.astype(np.float64)


def _stress(a: int, b: int) -> Field:
    """Contact stress σ_ab = Σ f_a ℓ_b / area: force on a grain times the branch towards it, compression positive."""
    axes = "xy"[a] + "xy"[b]
    return Field(
        f"stress-{axes}",
        f"contact stress {axes}",
        rf"\sigma_{{{axes}}}",
        "N/m",
        None,
        kind="contact",
        of_contacts=lambda contacts: contacts.virial(a, b),
        needs_contacts=True,
    )


def _kinetic_stress(a: int, b: int) -> Field:
    """Kinetic stress Σ m v'_a v'_b / area of velocities relative to the mean flow."""
    axes = "xy"[a] + "xy"[b]

    def of_grains(frame: GrainFrame, model: Model) -> Floats:
        velocity, grains = np.asarray(frame.velocity, np.float64), model.grains
        return np.asarray(grains.mass * velocity[:, a] * velocity[:, b] / (np.pi * grains.radius**2))

    symbol = rf"\sigma^\mathrm{{kin}}_{{{axes}}}"
    return Field(f"kinetic-stress-{axes}", f"kinetic stress {axes}", symbol, "N/m", of_grains, kind="share", is_relative=True)


def _pressure(contacts: LoadedContacts) -> Floats:
    return np.asarray(0.5 * (contacts.virial(0, 0) + contacts.virial(1, 1)))


FIELDS: dict[str, Field] = {
    field.name: field
    for field in (
        Field("velocity", "velocity", "v_x", "m/s", _velocity, _wall_velocity, scaling="walls"),
        Field("spin", "spin", r"\omega", "rad/s", _spin, _wall_spin, scaling="shear"),
        Field("temperature", "temperature", "T", "K", _temperature, _wall_temperature, scaling="walls"),
        Field("heat", "generated heat", r"\dot{q}", "W/m2", _generated, kind="rate"),
        Field("solid-fraction", "solid fraction", r"\phi", "1", _one, kind="share"),
        Field("granular-temperature", "granular temperature", r"T_g", "m2/s2", _granular_temperature, is_relative=True),
        Field("coordination", "contacts per grain", "Z", "1", _coordination, kind="number", needs_contacts=True),
        Field("pressure", "contact pressure", "p", "N/m", None, kind="contact", of_contacts=_pressure, needs_contacts=True),
        *(_stress(a, b) for a in (0, 1) for b in (0, 1)),
        *(_kinetic_stress(a, b) for a, b in ((0, 0), (0, 1), (1, 1))),
    )
}
"""All fields, by name.

Only free grains count, not those glued to walls: the solid fraction is the area of the free grains (of spheres their cross-section)
over that of the plane. Heat is that of friction and impacts which the grains receive; what goes into walls is left out. The
granular temperature is ½⟨v'·v'⟩ per unit of mass (per degree of freedom in the plane) with velocities v' relative to the mean flow
of all selected frames at the height of the grain (`multicor_cli.post.flow.MeanFlow`). Contacts are those with a positive normal
force; Z is their number at each grain, those with walls included, averaged over all grains, rattlers included. Stresses are forces
per length, compression positive: σ_ab is the flux of the momentum along a through a line across b, so a flow in which the upper
layers move towards +x has σ_xy < 0. The pressure is half the trace of the contact stress.
"""

FIELD_GROUPS: dict[str, tuple[str, ...]] = {
    "stress": ("stress-xx", "stress-xy", "stress-yx", "stress-yy"),
    "kinetic-stress": ("kinetic-stress-xx", "kinetic-stress-xy", "kinetic-stress-yy"),
}
"""Fields that are asked for together, by the name of the group."""

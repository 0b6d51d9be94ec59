"""Every quantity of grains or contacts, once: what profiles, maps, page and help know of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.contacts import (
    LoadedContacts,
    heat_flows,
    loaded_contacts,
    own_stress,
    with_conduction,
    with_forces,
)
from multicor_cli.post.flow import d2min, fluctuations
from multicor_cli.post.lattice import Complexes, leant_between
from multicor_cli.post.rings import axes_of, degrees_of, need_axes
from multicor_cli.post.source import Frame, PostError, Run, need_heat, need_same_grains
from multicor_cli.post.sums import OfMeans
from multicor_cli.post.table import Quantity
from multicor_cli.post.voronoi import Cells, cells_of

Kind = Literal["mean", "number", "rate", "share", "contact"]
"""How grains or contacts add up to the value of a bin.

``mean``: average over the grains, weighted by their area in the bin. ``number``: average over the
grains, which count alike, each with the part of its area that lies in the bin. ``rate``: increase
of what the grains hold from frame to frame, over the time between and the area of the bin.
``share``: area of the grains in the bin times their value, over the area of the bin. ``contact``:
what contacts carry, spread evenly along the branch that joins the centers of two grains, free or
glued (or the center of a grain and the point where it touches a smooth wall), over the area of the
bin. The area of a bin is its width times the period, or, where there is none, times how far the
grains of the frame reach in x.
"""

Scaling = Literal["walls", "shear", "none"]
"""What a normalized profile is divided by.

``walls``: from 0 at the lower to 1 at the upper wall. ``shear``: by the shear rate of the walls,
the difference of their velocities over their distance. ``none``: there is no normalized form.
"""

Colors = Literal["viridis", "plasma", "magma", "cividis", "balance", "twilight"]
"""Color maps; ``balance`` goes from blue through white to red, ``twilight`` ends as it begins."""

Scale = Literal["linear", "from zero", "centered", "logarithmic", "half turn"]
"""How values become colors: ``centered`` scales are symmetric about zero, and a ``half turn`` of
axes ends where it begins, 180° from there.
"""

_ENOUGH = 400  # with fewer grains colors span all values
_QUANTILE = 0.995  # with more of them colors may span this part
# Values are left out of the colors at an end only if that shortens the scale by more than this part
_WORTH = 0.1
_DECADES = 1e-4  # lowest color of a logarithmic scale over the highest


@dataclass(frozen=True)
class GrainQuantity(Quantity):
    """A quantity that every grain, or every contact, has.

    Attributes:
        of_grain: Values that a map shows, ``(n,)`` or of vectors ``(n, 2)``; None without a map.
        colors: Color map of its maps.
        scale: How values become colors.
        needs_heat: Whether only runs with heat have it.
        needs_axes: Whether only runs have it in which some grains have a long axis.
        averaged: Values of grains that a profile averages, shape ``(n,)``; of a rate what they hold
            since the start of the run; None if contacts have the values, or without a profile.
        of_walls: Values of the walls of a frame, shape ``(w,)``, or None where walls have none.
        kind: How grains add up in a profile.
        scaling: What a normalized profile is divided by.
        is_relative: Whether ``averaged`` wants the velocities relative to the mean flow.
        of_contacts: Values of contacts that carry a force, ``(c,)``; of the kind ``contact``.
        needs_contacts: Whether profiles leave out frames without contact forces.
        per_area: Symbol and unit of a profile, where they are not those of a grain.
        names_of: Names that the values 0, 1, … stand for, where they are no amounts.
        of_velocity: Values of velocities, ``(n, 2)``, where they follow from them alone: those of
            images in a cell.
        of_others: Whether the value of a grain is about others, too, of whatever group.
        since_before: Whether ``averaged`` wants a `FrameSince`: what happens between two frames.
        of_means: What a profile tells of its means, where ``averaged`` gives complex numbers.
    """

    of_grain: Callable[[Run, int], Floats] | None = None
    colors: Colors = "viridis"
    scale: Scale = "linear"
    needs_heat: bool = False
    averaged: Callable[[Frame, Model], Floats | Complexes] | None = None
    of_walls: Callable[[Frame, Model], Floats] | None = None
    kind: Kind = "mean"
    scaling: Scaling = "none"
    is_relative: bool = False
    of_contacts: Callable[[LoadedContacts], Floats] | None = None
    needs_contacts: bool = False
    per_area: tuple[str, str] | None = None
    names_of: Callable[[Model], tuple[str, ...]] | None = None
    of_velocity: Callable[[Floats], Floats] | None = None
    of_others: bool = False
    since_before: bool = False
    needs_axes: bool = False
    of_means: OfMeans | None = None

    def of_profile(self) -> GrainQuantity:
        """The same with the symbol and the unit of its profiles."""
        if self.per_area is None:
            return self
        return replace(self, symbol=self.per_area[0], unit=self.per_area[1])


def color_range(quantity: GrainQuantity, values: NDArray[Any], grains: int) -> tuple[float, float]:
    """Smallest and largest value with a color of its own, of finite values of so many grains."""
    if quantity.scale == "half turn":
        return 0.0, 180.0
    if not values.size:
        return (_DECADES if quantity.scale == "logarithmic" else 0.0), 1.0
    low, high = float(values.min()), float(values.max())
    if quantity.scale == "logarithmic":
        high = high if high > 0.0 else 1.0
        return _DECADES * high, high  # what has received nothing, or less, has a color of its own
    if grains >= _ENOUGH:
        inner = np.quantile(values, (1.0 - _QUANTILE, _QUANTILE)).tolist()
        room = _WORTH * (inner[1] - inner[0])
        low = low if low >= inner[0] - room else inner[0]
        high = high if high <= inner[1] + room else inner[1]
    if quantity.scale == "from zero":
        return 0.0, high or 1.0
    if quantity.scale == "centered":
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    if low == high:
        low, high = low - (abs(low) * 1e-3 or 1.0), high + (abs(high) * 1e-3 or 1.0)
    return low, high


def _each(values: Callable[[Frame], Any]) -> dict[str, Any]:
    """What a map shows and a profile averages, where that is the same."""
    return {
        "of_grain": lambda source, frame: np.array(values(source.frames[frame]), np.float64),
        "averaged": lambda frame, _model: np.asarray(values(frame), np.float64),
    }


def _wall(column: int) -> Callable[[Frame, Model], Floats]:
    return lambda frame, _model: np.asarray(frame.wall_velocity[:, column], np.float64)


def _kinds(name: str) -> Callable[[Run, int], Floats]:
    return lambda source, frame: np.asarray(
        getattr(source.frames[frame].model.grains, name), np.float64
    )


def _displacements(source: Run, frame: int) -> Floats:
    """Distances from where grains were in the first frame, periods included [m], shape ``(n,)``.

    In a cell those from where its mean flow would have taken them.
    """
    first, now = source.frames[0], source.frames[frame]
    need_same_grains(first, now)
    if source.model.is_cell:
        if now.nonaffine is None:
            raise PostError(
                "an older version began this run and kept no displacements: run it again"
            )
        return np.asarray(np.hypot(*(now.nonaffine - first.nonaffine).T), np.float64)
    moved = np.asarray(now.unwrapped, np.float64) - np.asarray(first.unwrapped, np.float64)
    return np.asarray(np.hypot(*moved.T[:2]))


def _rotations(source: Run, frame: int) -> Floats:
    """Angles by which grains have turned since the first frame [rad], shape ``(n,)``."""
    first, now = source.frames[0], source.frames[frame]
    need_same_grains(first, now)
    return np.asarray(now.angle, np.float64) - np.asarray(first.angle, np.float64)


def _heat_rates(source: Run, frame: int) -> Floats:
    """Mean heat of friction and impacts per time since the frame before [W], shape ``(n,)``."""
    after = need_heat(source.frames[frame].generated)
    if frame == 0:
        raise PostError(
            "the map of heat shows what was generated since the frame before; frame 0 has none"
        )
    need_same_grains(source.frames[frame - 1], source.frames[frame])
    times = np.asarray(source.frames.time)
    gained = after - need_heat(source.frames[frame - 1].generated)
    return np.asarray(gained / float(times[frame] - times[frame - 1]))


def _of_contacts(values: Callable[[LoadedContacts], Any]) -> Callable[[Run, int], Floats]:
    def of_grain(source: Run, frame: int) -> Floats:
        with_forces(source, np.array([frame]))
        contacts = loaded_contacts(source.frames[frame], source.frames[frame].model)
        return np.asarray(values(contacts), np.float64)

    return of_grain


def _pressures(source: Run, frame: int) -> Floats:
    """Half the trace of the stress of each grain [N/m]; of discs Σ f_n/(2π a), shape ``(n,)``."""
    with_forces(source, np.array([frame]))
    there = source.frames[frame]
    model = there.model
    contacts = loaded_contacts(there, model)
    if model.outlines is None:
        return np.asarray(contacts.loads / (2.0 * np.pi * model.grains.radius))
    xx, _, _, yy = own_stress(contacts, model).T
    return np.asarray(0.5 * (xx + yy))


def _of_cells(values: Callable[[Cells, Model], Any]) -> dict[str, Any]:
    """What a map shows and a profile averages of radical cells; open ones have no value."""

    def averaged(frame: Frame, model: Model) -> Floats:
        return np.asarray(values(cells_of(model, frame), model), np.float64)

    def of_grain(source: Run, frame: int) -> Floats:
        return averaged(source.frames[frame], source.frames[frame].model)

    return {"of_grain": of_grain, "averaged": averaged, "kind": "number", "of_others": True}


def _since_before(frame: Any, model: Model) -> Floats:  # a FrameSince
    leant = leant_between(frame.run, frame.before, frame.frame)
    return d2min(model, frame.before, frame.frame, leant)


def _d2min(source: Run, frame: int) -> Floats:
    if frame == 0:
        raise PostError(
            "the map of d2min shows what has moved since the frame before; frame 0 has none"
        )
    there, before = source.frames[frame], source.frames[frame - 1]
    return d2min(there.model, before, there, leant_between(source, before, there))


def _directions(source: Run, frame: int) -> Floats:
    """θ of the long axes of the grains [°], shape ``(n,)``."""
    need_axes(source.model)
    there = source.frames[frame]
    return degrees_of(axes_of(there.model, there))


def _direction(mean: Complexes, whole: Complexes) -> Floats:
    """θ of means of e^{2iθ} [°], within 90° of those of the whole."""
    return np.asarray(degrees_of(whole) + np.degrees(0.5 * np.angle(mean * whole.conj())))


def _heat_flux(source: Run, frame: int) -> Floats:
    """Flux of the heat that the contacts of each grain conduct [W/m], shape ``(n, 2)``.

    Heat flow times branch, of which each of two grains has half and one beside a wall all, over the
    area of the grain: its mean by area times the solid fraction is the flux in a bed.
    """
    with_conduction(source, np.array([frame]))
    model = source.frames[frame].model
    flows = heat_flows(source.frames[frame], model)
    contacts, n, flux = flows.contacts, model.grain_count, np.zeros((model.grain_count, 2))
    part, between = np.where(contacts.is_wall, 1.0, 0.5), ~contacts.is_wall
    for axis in (0, 1):
        carried = part * flows.virial(axis)
        flux[:, axis] = np.bincount(contacts.i, carried, n)
        flux[:, axis] += np.bincount(contacts.j[between], carried[between], n)
    return np.asarray(flux / model.area[:, np.newaxis])


def _stress(a: int, b: int) -> GrainQuantity:
    """Contact stress Σ f_a ℓ_b/area, force on a grain times branch to it; compression positive."""
    axes = "xy"[a] + "xy"[b]
    return GrainQuantity(
        f"stress-{axes}", f"contact stress {axes}", rf"\sigma_{{{axes}}}", "N/m", kind="contact",
        of_contacts=lambda contacts: contacts.virial(a, b), needs_contacts=True,
    )  # fmt: skip


def _kinetic_stress(a: int, b: int) -> GrainQuantity:
    """Kinetic stress Σ m v'_a v'_b / area of velocities relative to the mean flow."""
    axes = "xy"[a] + "xy"[b]

    def averaged(frame: Frame, model: Model) -> Floats:
        velocity = np.asarray(frame.velocity, np.float64)
        flux = model.grains.mass * velocity[:, a] * velocity[:, b]
        return np.asarray(flux / model.area)

    symbol = rf"\sigma^\mathrm{{kin}}_{{{axes}}}"
    name, label = f"kinetic-stress-{axes}", f"kinetic stress {axes}"
    return GrainQuantity(
        name, label, symbol, "N/m", averaged=averaged, kind="share", is_relative=True
    )


QUANTITIES: dict[str, GrainQuantity] = {
    quantity.name: quantity
    for quantity in (
        GrainQuantity(
            "velocity", "horizontal velocity", "v_x", "m/s",
            **_each(lambda frame: frame.velocity[:, 0]),
            of_walls=_wall(0), scaling="walls", of_velocity=lambda velocity: velocity[:, 0],
            colors="balance", scale="centered",
        ),
        GrainQuantity(
            "velocity-y", "vertical velocity", "v_y", "m/s",
            **_each(lambda frame: frame.velocity[:, 1]),
            of_walls=_wall(1), of_velocity=lambda velocity: velocity[:, 1],
            colors="balance", scale="centered",
        ),
        GrainQuantity(
            "speed", "speed", r"|v|", "m/s",
            _each(lambda frame: np.hypot(*frame.velocity.T[:2]))["of_grain"], scale="from zero",
            of_velocity=lambda velocity: np.hypot(*velocity.T),
        ),
        GrainQuantity("displacement", "displacement", r"|\Delta x|", "m", _displacements,
            scale="from zero"),
        GrainQuantity(
            "rotation", "rotation since the start", r"\theta", "rad", _rotations, "balance",
            "centered",
        ),
        GrainQuantity(
            "spin", "spin", r"\omega", "rad/s", **_each(lambda frame: frame.spin),
            of_walls=_wall(2), scaling="shear", colors="balance", scale="centered",
        ),
        GrainQuantity(
            "temperature", "temperature", "T", "K",
            **_each(lambda frame: need_heat(frame.temperature)),
            of_walls=lambda frame, _model: need_heat(frame.wall_temperature), scaling="walls",
            colors="plasma", needs_heat=True,
        ),
        GrainQuantity(
            "heat", "generated heat", r"\dot{Q}", "W", _heat_rates, "magma", "logarithmic",
            needs_heat=True,
            averaged=lambda frame, _model: need_heat(frame.generated), kind="rate",
            per_area=(r"\dot{q}", "W/m2"),
        ),
        GrainQuantity("heat-flux", "heat flux of contacts", r"|q|", "W/m", _heat_flux, "plasma",
            "from zero", needs_heat=True),
        GrainQuantity("fluctuation", "velocity fluctuation", r"|v - \langle v_x \rangle|", "m/s",
            fluctuations, scale="from zero"),
        GrainQuantity("solid-fraction", "solid fraction", r"\nu", "1",
            averaged=lambda _frame, model: np.ones(model.grain_count), kind="share"),
        GrainQuantity(
            "granular-temperature", "granular temperature", r"T_g", "m2/s2",
            averaged=lambda frame, _model: 0.5 * (frame.velocity[:, :2] ** 2).sum(axis=1),
            is_relative=True,
        ),
        GrainQuantity(
            "coordination", "coordination number", "Z", "1",
            _of_contacts(lambda contacts: contacts.counts),
            averaged=lambda frame, model: loaded_contacts(frame, model).counts.astype(np.float64),
            kind="number", needs_contacts=True,
        ),
        GrainQuantity(
            "force", "largest contact force", r"f_\mathrm{max}", "N",
            _of_contacts(lambda contacts: contacts.largest),
            scale="from zero",
        ),
        GrainQuantity("local-solid-fraction", "local solid fraction", r"\nu_i", "1", **_of_cells(
            lambda cells, model: model.area / cells.area)),
        GrainQuantity("hexatic", "hexatic order", r"|\psi_6|", "1", colors="cividis",
            scale="from zero", **_of_cells(lambda cells, _model: np.abs(cells.order()))),
        GrainQuantity("d2min", "non-affine motion", r"D^2_\mathrm{min}", "m2", _d2min, "magma",
            "logarithmic", averaged=_since_before, kind="number", of_others=True,
            since_before=True),
        GrainQuantity(
            "orientation", "direction of the long axis", r"\theta", "deg",
            _directions, "twilight", "half turn", needs_axes=True,
        ),
        GrainQuantity("nematic-order", "nematic order", "S", "1", kind="number",
            averaged=lambda frame, model: axes_of(model, frame), needs_axes=True,
            of_means=lambda mean, _whole: np.abs(mean)),
        GrainQuantity("nematic-director", "director of the long axes", r"\theta_S", "deg",
            averaged=lambda frame, model: axes_of(model, frame), needs_axes=True,
            kind="number", of_means=_direction),
        GrainQuantity("group", "group", "", "1", _kinds("group"),
            names_of=lambda model: model.groups),
        GrainQuantity("material", "material", "", "1", _kinds("material"),
            names_of=lambda model: model.materials),
        GrainQuantity(
            "stress", "contact pressure in a grain", "p", "N/m", _pressures,
            "cividis", "from zero",
        ),
        GrainQuantity("pressure", "contact pressure", "p", "N/m", kind="contact",
            of_contacts=lambda contacts: 0.5 * (contacts.virial(0, 0) + contacts.virial(1, 1)),
            needs_contacts=True),
        *(_stress(a, b) for a in (0, 1) for b in (0, 1)),
        *(_kinetic_stress(a, b) for a, b in ((0, 0), (0, 1), (1, 1))),
    )
}  # fmt: skip
"""All quantities, by name.

Only free grains count, not those glued to walls: the solid fraction is the area of the free grains
(of spheres their cross-section) over that of the plane. Heat is that of friction and impacts which
the grains receive; what goes into walls is left out. The granular temperature is ½⟨v'·v'⟩ per unit
of mass (per degree of freedom in the plane) with velocities v' relative to the mean flow of all
selected frames at the height of the grain (`multicor_cli.post.flow.MeanFlow`). Contacts are those
that carry a normal force (tension is negative); Z is their number at each grain, those with walls
included, averaged over all grains, rattlers included. Stresses are forces per length, compression
positive: σ_ab is the flux of the momentum along a through a line across b, so a flow in which the
upper layers move towards +x has σ_xy < 0. The pressure is half the trace of the contact stress. The
local solid fraction is the area of a grain over that of its radical cell, hexatic order the modulus
of ψ₆ of its neighbors there (`multicor_cli.post.voronoi.Cells`), and d2min the motion beside
that of the neighborhood from a frame to the next (`multicor_cli.post.flow.d2min`).
The nematic order of n long axes is |Σ e^{2iθ}|/n, 1 of parallel ones and about 1/√n by chance,
their director ½ arg Σ e^{2iθ}; grains without a long axis do not count.
"""

PROFILED: dict[str, GrainQuantity] = {
    name: quantity.of_profile()
    for name, quantity in QUANTITIES.items()
    if quantity.averaged is not None or quantity.of_contacts is not None
}
"""What a profile can be taken of, by name."""

MAPPED: dict[str, GrainQuantity] = {
    name: quantity for name, quantity in QUANTITIES.items() if quantity.of_grain is not None
}
"""What can be shown as a map of the grains, by name."""

SAME = {"velocity-x": "velocity"}
"""Names of fields (`multicor_cli.post.fields`) that profiles and maps call otherwise."""

PROFILE_GROUPS: dict[str, tuple[str, ...]] = {
    "stress": ("stress-xx", "stress-xy", "stress-yx", "stress-yy"),
    "nematic": ("nematic-order", "nematic-director"),
    "kinetic-stress": ("kinetic-stress-xx", "kinetic-stress-xy", "kinetic-stress-yy"),
}
"""Profiles that are asked for together, by the name of the group."""

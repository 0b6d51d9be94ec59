"""The contacts of a frame that carry a force: what stresses and networks are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import ShapeKind
from multicor_cli.post.source import Frame, PostError, Run, need_heat

if TYPE_CHECKING:
    from multicor_cli.store.frames import Contacts


@dataclass(frozen=True)
class LoadedContacts:
    """Contacts with a normal force (tension is negative), or that conduct heat: ``c`` between ``n``
    grains and walls.

    Attributes:
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below n), shape ``(c,)``.
        force: Normal and tangential force on i, mean of the last step [N], shape ``(c, 2)``.
        row: Numbers of these contacts among all of the frame, shape ``(c,)``.
        rows: All contacts of the frame; what is not needed is not read.
        reach_of: Radii of grains, then of wall shapes, 0 of smooth ones [m], shape ``(n + m,)``.
    """

    i: NDArray[Any]
    j: NDArray[Any]
    force: Floats
    row: NDArray[np.int64]
    rows: Contacts
    reach_of: Floats
    grain_count: int

    def only(self, which: NDArray[np.int64]) -> LoadedContacts:
        """These of them."""
        kept = {name: getattr(self, name)[which] for name in ("i", "j", "force", "row")}
        return replace(self, **kept)

    @cached_property
    def normal(self) -> Floats:
        """Unit normal from j to i, shape ``(c, 2)``."""
        return np.asarray(self.rows.normal, np.float64)[self.row]

    @cached_property
    def reach(self) -> Floats:
        """From the center of i to that of j, or to a smooth wall [m], shape ``(c,)``."""
        gap = np.asarray(self.rows.gap, np.float64)[self.row]
        return np.asarray(self.reach_of[self.i] + gap + self.reach_of[self.j])

    @cached_property
    def is_wall(self) -> NDArray[np.bool_]:
        """Whether a contact is one of a grain with a wall, shape ``(c,)``."""
        return np.asarray(self.j >= self.grain_count)

    @cached_property
    def vector(self) -> Floats:
        """Force on i in x and y [N], shape ``(c, 2)``; the tangent is the normal turned by +90°."""
        (x, y), (f, g) = self.normal.T, self.force.T
        return np.column_stack([f * x - g * y, f * y + g * x])

    @cached_property
    def branch(self) -> Floats:
        """From the center of j, or where i touches a smooth wall, to that of i [m], ``(c, 2)``."""
        return np.asarray(self.normal * self.reach[:, np.newaxis])

    @cached_property
    def arm(self) -> Floats:
        """From the center of i to the point where it touches j [m], shape ``(c, 2)``."""
        arm = getattr(self.rows, "arm", None)
        if arm is None:
            return np.asarray(-self.normal * self.reach_of[self.i][:, np.newaxis])
        return np.asarray(arm, np.float64)[self.row]

    def virial(self, a: int, b: int) -> Floats:
        """Force on i along the axis ``a`` times the branch along ``b`` [N m], shape ``(c,)``.

        Its sum over an area is the stress times the area, compression positive.
        """
        return np.asarray(self.vector[:, a] * self.branch[:, b])

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """Contacts of each grain; those with walls count once, shape ``(n,)``."""
        n, between = self.grain_count, self.j[~self.is_wall]
        return np.bincount(self.i, minlength=n) + np.bincount(between, minlength=n)

    @property
    def loads(self) -> Floats:
        """Sum of the normal forces on each grain [N], shape ``(n,)``."""
        n, between = self.grain_count, ~self.is_wall
        load = np.bincount(self.i, self.force[:, 0], minlength=n)
        return np.asarray(load + np.bincount(self.j[between], self.force[between, 0], minlength=n))

    def parts(self, grains: NDArray[np.int64]) -> Floats:
        """Which part of each contact is that of the grains with these numbers, shape ``(c,)``.

        Half for each of two grains, all if with a wall: the parts of all groups add up to 1.
        """
        counts = np.zeros(self.reach_of.size)
        counts[grains] = 1.0
        first, second = counts[self.i], counts[self.j]
        return np.asarray(np.where(self.is_wall, first, 0.5 * (first + second)))

    @property
    def largest(self) -> Floats:
        """Largest normal force on each grain [N], shape ``(n,)``."""
        found, between = np.zeros(self.grain_count), ~self.is_wall
        np.maximum.at(found, self.i, self.force[:, 0])
        np.maximum.at(found, self.j[between], self.force[between, 0])
        return found


def shape_temperatures(frame: Frame, model: Model) -> Floats:
    """Temperatures of grains, then of wall shapes [K], nan where a wall has none, ``(n + m,)``."""
    of_walls = need_heat(frame.wall_temperature)[model.shapes.wall]
    return np.concatenate([need_heat(frame.temperature), of_walls])


def has_forces(frame: Frame) -> bool:
    """Whether contact forces belong to a frame: they were recorded, and a step came before it."""
    return bool(frame.contacts.recorded) and frame.dt > 0.0


def loaded_contacts(frame: Frame, model: Model) -> LoadedContacts:
    """The contacts of a frame that carry a force."""
    return contacts_at(frame, model, np.flatnonzero(frame.contacts.force[:, 0]))


def conducting_contacts(
    frame: Frame, model: Model, *, has_walls: bool = False
) -> tuple[LoadedContacts, Floats]:
    """The contacts of a frame that conduct heat, and their conductances [W/K], ``(c,)``.

    Those between grains, and those with walls if asked for; raises `PostError` without heat.
    """
    conductance = need_heat(frame.contacts.conductance)
    is_asked = has_walls | (frame.contacts.j < model.grain_count)
    row = np.flatnonzero((conductance > 0.0) & is_asked)
    return contacts_at(frame, model, row), conductance[row]


class HeatFlows(NamedTuple):
    """Contacts through which heat flows, and how much from j into i [W], shape ``(c,)``."""

    contacts: LoadedContacts
    flow: Floats

    def virial(self, axis: int) -> Floats:
        """Heat flow times its branch along an axis [W m], shape ``(c,)``.

        The branch leads from j to i, as the heat does. Its sum over an area is the flux times the
        area (Irving & Kirkwood 1950).
        """
        return np.asarray(self.flow * self.contacts.branch[:, axis])


def has_conduction(frame: Frame) -> bool:
    """Whether the contacts of a frame with heat say what they conduct: recorded, after a step."""
    return bool(frame.contacts.recorded) and frame.step > 0


def heat_flows(frame: Frame, model: Model) -> HeatFlows:
    """What the contacts of a frame conduct, H (T_j − T_i), with temperatures of the frame.

    In a cell with a mean gradient G, where temperatures are those beside it, it is
    H (T_j − T_i − G·ℓ) with the branch ℓ from j to i. A wall without temperature conducts nothing.
    """
    contacts, conductance = conducting_contacts(frame, model, has_walls=True)
    temperature = shape_temperatures(frame, model)
    rise = temperature[contacts.j] - temperature[contacts.i]
    if any(model.heat_gradient):
        rise -= contacts.branch @ np.array(model.heat_gradient)
    known = np.flatnonzero(np.isfinite(rise))
    return HeatFlows(contacts.only(known), (conductance * rise)[known])


def contacts_at(frame: Frame, model: Model, row: NDArray[np.int64]) -> LoadedContacts:
    """The contacts of a frame in these rows, whether they carry a force or not."""
    contacts, force = frame.contacts, np.asarray(frame.contacts.force, np.float64)
    glued = np.where(model.shapes.kind == ShapeKind.DISC, model.shapes.geometry[:, 2], 0.0)
    reach_of = np.concatenate([model.grains.radius, glued])
    return LoadedContacts(
        contacts.i[row], contacts.j[row], force[row], row, contacts, reach_of, model.grain_count
    )


def with_forces(source: Run, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the frames ``chosen`` with contact forces; raises `PostError` if there is none."""
    found = [int(k) for k in chosen if has_forces(source.frames[int(k)])]
    if found:
        return np.array(found, np.int64)
    name = "the selected frames" if chosen.size > 1 else f"frame {int(chosen[0])}"
    if not source.frames[int(chosen[-1])].contacts.recorded:
        raise PostError(
            f"the contacts of {name} were not recorded; set contacts = true in [output] and run "
            "it again"
        )
    why = "no step of the mechanics was done before (frozen stages do none)"
    raise PostError(f"there are no contact forces in {name}: {why}; choose other frames")


def with_conduction(source: Run, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the frames ``chosen`` whose contacts say what they conduct.

    Raises:
        PostError: If the run has no heat, or if there is none.
    """
    if source.model.thermal is None:
        need_heat(None)
    found = [int(k) for k in chosen if has_conduction(source.frames[int(k)])]
    if not found:
        raise PostError(
            "these frames have no contacts, which begin with the first step and need contacts = "
            "true in [output]: choose other frames, or run it again"
        )
    return np.array(found, np.int64)


NOTHING_CONDUCTS = (
    "no contact conducts in these frames: grains are apart, heat is off in the stage, or "
    'conduction is "none" in [heat]; choose other frames, or run it again'
)
"""What is said of frames without conducting contacts."""

"""The contacts of a frame that carry a force: what stresses and networks are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import ShapeKind
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.source import Frame, PostError, Run, need_heat, places_of

if TYPE_CHECKING:
    from multicor_cli.store.frames import Contacts

_SAME = 1e-9  # length of a mean normal from which on normals do not cancel


class OfShapes(NamedTuple):
    """What contacts have between grains of any shape; ``c`` of them.

    Attributes:
        normal: Unit normal from j to i, shape ``(c, 2)``.
        branch: From the center of j, or where i touches a smooth wall, to that of i [m], likewise.
        arm: From the center of i to where it touches j [m], likewise.
        virial: Force on i times branch: xx, xy, yx, yy [N m], shape ``(c, 4)``.
        own: Force on i times the way from where it touches j to its center [N m], likewise.
        other: The same of j, with the force on it.
        number: At how many points they touch, shape ``(c,)``.
        sliding: Whether they slide at all points that carry a force, shape ``(c,)``.
    """

    normal: Floats
    branch: Floats
    arm: Floats
    virial: Floats
    own: Floats
    other: Floats
    number: NDArray[np.int64]
    sliding: NDArray[np.bool_]

    def only(self, which: NDArray[np.int64]) -> OfShapes:
        """Those of some of them."""
        kept: list[Any] = [values[which] for values in self]
        return OfShapes(*kept)


class Points(NamedTuple):
    """The points of contacts, and to which contact each of them belongs, shape ``(p,)``."""

    contacts: LoadedContacts
    of: NDArray[np.int64]


@dataclass(frozen=True)
class LoadedContacts:
    """Contacts with a normal force (tension is negative), or that conduct heat: ``c`` between ``n``
    grains and walls.

    Two grains, or a grain and a shape of a wall, that touch at several points have one contact,
    which carries the sum of the forces (Azéma, Radjaï, Peyroux & Saussine, Phys. Rev. E 76, 011301,
    2007): its normal and where it touches are means weighted by the normal forces of the points.

    Attributes:
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below n), shape ``(c,)``.
        force: Normal and tangential force on i, mean of the last step [N], shape ``(c, 2)``.
        row: Numbers of these contacts, or their first points, among all of the frame, ``(c,)``.
        rows: All contacts of the frame; what is not needed is not read.
        reach_of: Radii of grains, then of wall shapes, 0 of smooth ones [m], shape ``(n + m,)``.
        shaped: What they have where not all grains are discs.
        joined: Their points, likewise; None of points themselves.
    """

    i: NDArray[Any]
    j: NDArray[Any]
    force: Floats
    row: NDArray[np.int64]
    rows: Contacts
    reach_of: Floats
    grain_count: int
    shaped: OfShapes | None = None
    joined: Points | None = None

    def only(self, which: NDArray[np.int64]) -> LoadedContacts:
        """These of them."""
        kept: dict[str, Any]
        kept = {name: getattr(self, name)[which] for name in ("i", "j", "force", "row")}
        if self.shaped is not None:
            kept |= {"shaped": self.shaped.only(which), "joined": None}
        return replace(self, **kept)

    @property
    def points(self) -> Points:
        """Their points; of discs each has one."""
        return self.joined or Points(self, np.arange(self.i.size))

    @cached_property
    def normal(self) -> Floats:
        """Unit normal from j to i, shape ``(c, 2)``."""
        if self.shaped is not None:
            return self.shaped.normal
        return np.asarray(self.rows.normal, np.float64)[self.row]

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """Whether a contact slides, shape ``(c,)``."""
        if self.shaped is not None:
            return self.shaped.sliding
        return np.asarray(self.rows.sliding, np.bool_)[self.row]

    @cached_property
    def arm(self) -> Floats:
        """From the center of i to where it touches j [m], shape ``(c, 2)``."""
        if self.shaped is not None:
            return self.shaped.arm
        return np.asarray(-self.normal * self.reach_of[self.i][:, np.newaxis])

    @cached_property
    def reach(self) -> Floats:
        """From the center of i to that of j, or to a smooth wall [m], shape ``(c,)``."""
        if self.shaped is not None:
            return np.asarray(np.hypot(*self.shaped.branch.T))
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
        if self.shaped is not None:
            return self.shaped.branch
        return np.asarray(self.normal * self.reach[:, np.newaxis])

    @property
    def along(self) -> Floats:
        """Unit vectors along the branches, of discs the normals, shape ``(c, 2)``."""
        if self.shaped is None:
            return self.normal
        return self.branch / np.where(self.reach > 0.0, self.reach, 1.0)[:, np.newaxis]

    def virial(self, a: int, b: int) -> Floats:
        """Force on i along the axis ``a`` times the branch along ``b`` [N m], shape ``(c,)``.

        Its sum over an area is the stress times the area, compression positive.
        """
        if self.shaped is not None:
            return self.shaped.virial[:, 2 * a + b]
        return np.asarray(self.vector[:, a] * self.branch[:, b])

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """Contacts of each grain; those with walls count once, shape ``(n,)``."""
        n, between = self.grain_count, self.j[~self.is_wall]
        return np.bincount(self.i, minlength=n) + np.bincount(between, minlength=n)

    @property
    def point_counts(self) -> NDArray[np.int64]:
        """Points at which each grain touches others or walls, shape ``(n,)``."""
        return self.points.contacts.counts

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


def own_stress(contacts: LoadedContacts, model: Model) -> Floats:
    """Σ f⊗r/A of each grain over its contacts, with r from each to its center and its area A.

    Compression is positive. Shape ``(n, 4)``: xx, xy, yx, yy [N/m].
    """
    n, between = contacts.grain_count, ~contacts.is_wall
    grain = np.concatenate([contacts.i, contacts.j[between]])
    # The force on j and the way to its center have both the other sign.
    if contacts.shaped is None:
        dyad = np.einsum("ca,cb->cab", contacts.vector, contacts.normal).reshape(-1, 4)
        dyads = np.concatenate([dyad, dyad[between]])
        dyads /= (np.pi * model.grains.radius[grain])[:, np.newaxis]
    else:
        dyads = np.concatenate([contacts.shaped.own, contacts.shaped.other[between]])
        dyads /= model.area[grain][:, np.newaxis]
    return np.column_stack([np.bincount(grain, own, minlength=n) for own in dyads.T])


def has_forces(frame: Frame) -> bool:
    """Whether contact forces belong to a frame: they were recorded, and a step came before it."""
    return bool(frame.contacts.recorded) and frame.dt > 0.0


def pressure_of(frame: Frame, model: Model, area: float) -> float:
    """½ tr Σ f⊗ℓ/area of the contacts of a frame [N/m]; nan where no forces belong to it."""
    if not has_forces(frame):
        return np.nan
    loaded = loaded_contacts(frame, model)
    return 0.5 * float((loaded.virial(0, 0) + loaded.virial(1, 1)).sum()) / area


def loaded_contacts(frame: Frame, model: Model) -> LoadedContacts:
    """The contacts of a frame that carry a force."""
    return contacts_at(frame, model, np.flatnonzero(frame.contacts.force[:, 0]))


def conducting_contacts(
    frame: Frame, model: Model, *, has_walls: bool = False
) -> tuple[LoadedContacts, Floats]:
    """The contacts of a frame that conduct heat, and their conductances [W/K], ``(c,)``.

    Those between grains, and those with walls if asked for; raises `PostError` without heat. What
    conducts at several points has the sum of their conductances.
    """
    conductance = need_heat(frame.contacts.conductance)
    is_asked = has_walls | (frame.contacts.j < model.grain_count)
    row = np.flatnonzero((conductance > 0.0) & is_asked)
    contacts = contacts_at(frame, model, row, conductance[row])
    if contacts.joined is None:
        return contacts, conductance[row]
    total = np.bincount(contacts.joined.of, conductance[row])
    return contacts, np.asarray(total, np.float64)


class HeatFlows(NamedTuple):
    """Contacts through which heat flows, how much from j into i [W], and H [W/K], ``(c,)``."""

    contacts: LoadedContacts
    flow: Floats
    conductance: Floats

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
    return HeatFlows(contacts.only(known), (conductance * rise)[known], conductance[known])


def contacts_at(
    frame: Frame, model: Model, row: NDArray[np.int64], weight: Floats | None = None
) -> LoadedContacts:
    """The contacts of a frame in these rows, whether they carry a force or not.

    Where grains touch at several points, these count with weights, by default the normal forces.
    """
    contacts, force = frame.contacts, np.asarray(frame.contacts.force, np.float64)
    glued = np.where(model.shapes.kind == ShapeKind.DISC, model.shapes.geometry[:, 2], 0.0)
    reach_of = np.concatenate([model.grains.radius, glued])
    found = LoadedContacts(
        contacts.i[row], contacts.j[row], force[row], row, contacts, reach_of, model.grain_count
    )
    if model.outlines is None:
        return found
    points, pair = _points_of(frame, model, found)
    return _joined(points, pair, np.abs(found.force[:, 0]) if weight is None else weight)


def _points_of(
    frame: Frame, model: Model, found: LoadedContacts
) -> tuple[LoadedContacts, NDArray[np.int64]]:
    """Points as contacts of their own, and the first point of the frame of the same pair, ``(p,)``.

    The image of a grain j that i touches is the one whose center is nearest to where they touch.
    """
    rows, lattice, row = found.rows, lattice_of(model, frame).reduced, found.row
    i, j = np.asarray(rows.i, np.int64), np.asarray(rows.j, np.int64)
    normal, arm = (np.asarray(each, np.float64) for each in (rows.normal, rows.arm))
    is_wall, place = j >= model.grain_count, places_of(frame)
    gap = np.asarray(rows.gap, np.float64)[:, np.newaxis] * normal
    way = place[i] + arm - place[np.where(is_wall, i, j)]  # from the center of j
    image = lattice.nearest(way)
    image[is_wall] = 0
    way -= image @ lattice.vectors
    way[is_wall] = (gap + found.reach_of[j][:, np.newaxis] * normal)[is_wall]
    normal, arm, way, gap = (each[row] for each in (normal, arm, way, gap))
    virial, own, other = (
        np.einsum("pa,pb->pab", found.vector, to).reshape(-1, 4)
        for to in (way - arm, -arm, way - gap)
    )
    one = np.ones(row.size, np.int64)
    of_points = OfShapes(normal, way - arm, arm, virial, own, other, one, found.sliding)
    points = replace(found, shaped=of_points)
    return points, _first_alike(np.column_stack([i, j, image]))[row]


def _joined(points: LoadedContacts, pair: NDArray[np.int64], weight: Floats) -> LoadedContacts:
    """Contacts of points with these first ones and weights, shapes ``(p,)``."""
    shaped = points.shaped
    assert shaped is not None
    row, one, of = np.unique(pair, return_index=True, return_inverse=True)

    def total(values: Floats) -> Floats:
        columns = [np.bincount(of, own, row.size) for own in values.T]
        return np.column_stack(columns).astype(np.float64, copy=False)  # integers of none

    is_single = np.bincount(of)[of] == 1
    weight = np.where(is_single | (np.bincount(of, weight)[of] == 0.0), 1.0, weight)
    weight = (weight / np.bincount(of, weight)[of])[:, np.newaxis]
    mean, is_single = total(weight * shaped.normal), is_single[one, np.newaxis]
    length = np.hypot(*mean.T)[:, np.newaxis]
    is_clear = (length > _SAME) & ~is_single
    normal = np.where(is_clear, mean / np.where(is_clear, length, 1.0), shaped.normal[one])
    (x, y), (f, g) = normal.T, total(points.vector).T
    force = np.column_stack([f * x + g * y, g * x - f * y])
    is_loaded = points.force[:, 0] != 0.0
    slides, loaded = (np.bincount(of, own & is_loaded) for own in (shaped.sliding, True))
    return replace(
        points, i=points.i[one], j=points.j[one], row=row, joined=Points(points, of),
        force=np.where(is_single, points.force[one], force),
        shaped=OfShapes(
            normal, total(weight * shaped.branch), total(weight * shaped.arm),
            total(shaped.virial), total(shaped.own), total(shaped.other),
            np.bincount(of), (slides == loaded) & (slides > 0),
        ),
    )  # fmt: skip


def _first_alike(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """The first of the rows that are alike, for each row of ``(k, q)`` numbers, shape ``(k,)``."""
    order = np.lexsort(keys.T)
    is_new = np.ones(order.size, np.bool_)
    is_new[1:] = (np.diff(keys[order], axis=0) != 0).any(axis=1)
    first = np.empty_like(order)
    first[order] = order[is_new][np.cumsum(is_new) - 1]
    return first


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

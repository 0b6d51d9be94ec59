"""The bulk of a layer or a cell: where it is, its strain, its contacts and sums over them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import ShapeKind
from multicor_cli.model.columns import Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.post.bins import Between, Extent, find_extent, heights, part_between
from multicor_cli.post.contacts import LoadedContacts, has_forces, loaded_contacts
from multicor_cli.post.lattice import sheared_between
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    frames_of,
    need_grains,
    need_same_grains,
    refuse_cell,
    times_of,
)
from multicor_cli.post.table import Quantity

# ---- The bulk of a layer, far enough from both walls

MARGIN = 8.0
"""Mean diameters next to a wall that are no bulk: a rough wall disturbs the spins that far."""

_LARGEST = 0.25
"""Margin of a thin layer over the distance of the walls."""
_CLEAR = 1.0 / 3.0
"""Margin between large glued grains over what is free between the surfaces of the walls."""


@dataclass(frozen=True)
class Band:
    """The heights between which the bulk lies.

    Attributes:
        bottom: What is left out above the line of the lower wall [m].
        top: What is left out below the line of the upper wall [m].
        margin: What is left out next to the surface of each wall [m].
    """

    extent: Extent
    bottom: float
    top: float
    margin: float

    def edges(self, frame: Frame) -> tuple[float, float]:
        """Lowest and highest y of the bulk [m]; raises `PostError` if the walls come too near."""
        floor, span = self.extent.origin(frame), self.extent.span(frame)
        if not self.bottom + self.top < span:
            raise PostError(
                f"no bulk is left between the walls where they come nearest, {span:.4g} m: lower "
                "--margin, or choose other frames"
            )
        return floor + self.bottom, floor + span - self.top


def find_band(model: Model, extent: Extent, margin: float | None) -> Band:
    """The bulk between two walls, ``margin`` mean diameters off their surfaces; see `rheology`.

    Raises:
        PostError: If the margin is negative or leaves nothing.
    """
    diameter = model.mean_diameter
    if margin is not None and not margin >= 0.0:
        raise PostError(f"the margin {margin:g} must not be negative")
    below, above = _glued_radius(model, extent.lower), _glued_radius(model, extent.upper)
    if margin is None:
        clear = max(extent.height - below - above, 0.0)
        edge = min(MARGIN * diameter, _LARGEST * extent.height, _CLEAR * clear)
    else:
        edge = margin * diameter
    band = Band(extent, edge + below, edge + above, edge)
    if not band.bottom + band.top < extent.height:
        raise PostError(
            f"no bulk is left between the walls, {extent.height / diameter:.3g} mean diameters "
            "apart: lower --margin"
        )
    return band


def _glued_radius(model: Model, wall: int | None) -> float:
    """Mean radius of the grains glued to a wall [m]; 0 for a smooth wall."""
    glued = (model.shapes.wall == wall) & (model.shapes.kind == ShapeKind.DISC)
    return float(model.shapes.geometry[glued, 2].mean()) if glued.any() else 0.0


def strain_and_spin(band: Band, model: Model, first: Frame, second: Frame) -> tuple[float, float]:
    """Strain and rotation of the bulk in an interval; the grains are where they are halfway."""
    edges = np.mean([band.edges(first), band.edges(second)], axis=0)
    y = 0.5 * (heights(first) + heights(second))
    inside = (y > edges[0]) & (y < edges[1])
    if np.count_nonzero(inside) < 2:
        raise PostError("there are no two grains in the bulk: lower --margin")
    turn = _change(first, second, "angle")
    way = _change(first, second, "position") + model.period * _change(first, second, "image")
    # The slope of the least-squares line
    x, away = y[inside] - y[inside].mean(), way[inside] - way[inside].mean()
    square = float((x * x).sum())
    strain = float((x * away).sum()) / square if square > 0.0 else math.nan
    # It weighs the local shear with (y − low)(high − y); so must the rotation.
    weight = ((y - edges[0]) * (edges[1] - y))[inside]
    return strain, float(np.average(turn[inside], weights=weight))


def _change(first: Frame, second: Frame, name: str) -> Floats:
    """How much an array of the grains (its first column) differs between two frames."""
    before, after = (np.asarray(getattr(frame, name), np.float64) for frame in (first, second))
    change = after - before
    return np.asarray(change if change.ndim == 1 else change[:, 0])


# ---- Which contacts count as those of the bulk


class Bulk(NamedTuple):
    """Where contacts count: between two heights of a layer, or everywhere.

    Attributes:
        band: The heights; None: everywhere.
    """

    band: Band | None = None

    @property
    def margin(self) -> float:
        """What is left out next to the surface of each wall [m]; 0 if nothing is."""
        return self.band.margin if self.band else 0.0

    def holds(self, frame: Frame, contacts: LoadedContacts) -> NDArray[np.bool_]:
        """Which contacts of a frame have the middle of their branch inside, shape ``(c,)``."""
        if self.band is None:
            return np.ones(contacts.i.size, np.bool_)
        low, high = self.band.edges(frame)
        middle = heights(frame)[contacts.i] - 0.5 * contacts.branch[:, Y]
        return np.asarray((middle > low) & (middle < high))

    def inside(self, frame: Frame) -> NDArray[np.bool_]:
        """Which grains of a frame have their center inside, shape ``(n,)``."""
        y = heights(frame)
        if self.band is None:
            return np.ones(y.size, np.bool_)
        low, high = self.band.edges(frame)
        return np.asarray((y > low) & (y < high))

    def strains(self, source: Run, chosen: NDArray[np.int64]) -> Floats:
        """Strain of the mean flow between consecutive frames, ``(f − 1,)``; nan where not known.

        In a cell ∫ √((ε_xx − ε_yy)² + (2ε_xy)²) dt, in a layer that of the slope of displacements,
        if the same grains are there in both frames; elsewhere there is no one strain.
        """
        if source.model.is_cell:
            return sheared_between(source, times_of(source, chosen))
        return np.array([self._strain(*pair) for pair in pairwise(frames_of(source, chosen))])

    def _strain(self, first: Frame, second: Frame) -> float:
        if self.band is None:
            return np.nan
        try:
            need_same_grains(first, second)
            return abs(strain_and_spin(self.band, second.model, first, second)[0])
        except PostError:
            return np.nan


def refuse_walls_of_cell(margin: float | None, between: Between | None) -> None:
    """Raises `PostError` if a margin, or walls, are given for a cell."""
    if margin is not None or between is not None:
        raise PostError(
            "a cell that is periodic in x and y has no walls: leave out --margin and --between"
        )


def find_bulk(
    source: Run, chosen: NDArray[np.int64], margin: float | None, between: Between | None
) -> Bulk:
    """A cell as a whole; the bulk of a layer between two walls that is periodic in x; else all.

    Args:
        source: The run.
        chosen: The frames.
        margin: As `multicor_cli.post.rheology.rheology`.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If a frame has no grain, nothing is left between the margins, or one of the two
            is given and there is no such layer.
    """
    need_grains(source, chosen)
    is_told = margin is not None or between is not None
    if source.model.is_cell:
        if is_told:
            refuse_cell(source.model, "there are no walls", "leave out --margin and --between")
        return Bulk()
    extent = find_extent(source, chosen, between)
    if extent.lower is not None and extent.upper is not None and source.model.period > 0.0:
        return Bulk(find_band(source.model, extent, margin))
    if is_told:
        raise PostError(
            "--margin and --between are about a layer between two walls in a domain that is "
            "periodic in x, which this is not: leave them out, so that all contacts count"
        )
    return Bulk()


# ---- Sums over the contacts of a bulk, and what is made of them

CONTACT_SUMS = (
    "xx", "xy", "yx", "yy", "contacts", "grains", "loaded_contacts", "loaded_grains",
    "normal_xx", "normal_xy", "normal_yy", "normal_count",
)  # fmt: skip
"""Names of the sums of `contact_sums`."""

OF_CONTACTS = (
    Quantity("coordination", "coordination number", "Z"),
    Quantity("coordination_loaded", "coordination number without rattlers", "Z'"),
    Quantity("fabric_anisotropy", "fabric anisotropy a_c", "a_c"),
    Quantity("fabric_direction", "its direction, from x counter-clockwise", r"\theta_c", "deg"),
)
"""What is made of them."""

INERTIAL_NUMBERS = (
    Quantity("inertial_number", "inertial number (rate × √(m/P))", "I"),
    Quantity("inertial_number_density", "inertial number (rate × d/√(P/ρ))", "I_\\rho"),
)


def contact_sums(
    model: Model, frame: Frame, inside: NDArray[np.bool_], low: float, high: float
) -> list[float]:
    """`CONTACT_SUMS` over the grains ``inside`` and the branches between two heights [m].

    They are zero if no forces belong to the frame.
    """
    if not has_forces(frame):
        return [0.0] * len(CONTACT_SUMS)
    contacts = loaded_contacts(frame, model)
    start = heights(frame)[contacts.i]
    part = part_between(start, start - contacts.branch[:, 1], low, high)
    stress = [float((part * contacts.virial(a, b)).sum()) for a in (0, 1) for b in (0, 1)]
    counts = contacts.counts[inside]
    loaded = counts[contacts.point_counts[inside] >= 2]
    numbers = (counts.sum(), counts.size, loaded.sum(), loaded.size)
    # n⊗n of the contacts whose branch has its middle in the bulk, and their number
    middle = start - 0.5 * contacts.branch[:, 1]
    is_near = ((middle > low) & (middle < high)).astype(np.float64)
    x, y = contacts.normal.T
    # Products by hand: BLAS would start threads for each, and wait for busy cores.
    normals = [float((is_near * a * b).sum()) for a, b in ((x, x), (x, y), (y, y))]
    return [*stress, *map(float, numbers), *normals, float(is_near.sum())]


def derive_contacts(sums: dict[str, Floats]) -> dict[str, Floats]:
    """The quantities `OF_CONTACTS` by name."""
    # ⟨n⊗n⟩ = ½ 1 + ¼ a_c (cos 2θ_c, sin 2θ_c; sin 2θ_c, −cos 2θ_c)
    along = (sums["normal_xx"] - sums["normal_yy"]) / sums["normal_count"]
    across = 2.0 * sums["normal_xy"] / sums["normal_count"]
    return {
        "coordination": sums["contacts"] / sums["grains"],
        "coordination_loaded": sums["loaded_contacts"] / sums["loaded_grains"],
        "fabric_anisotropy": 2.0 * np.hypot(along, across),
        "fabric_direction": np.degrees(0.5 * np.arctan2(across, along)) % 180.0,
    }


SIZE_SUMS = ("bodies", "mass", "covered", "diameters")
"""Names of the sums of `size_sums`."""


def size_sums(model: Model) -> list[float]:
    """`SIZE_SUMS` over all grains of a frame, which may grow and wear: number, mass, area, size."""
    grains = model.grains
    sums = (grains.mass.sum(), model.area.sum(), 2.0 * grains.radius.sum())
    return [float(model.grain_count), *map(float, sums)]


def inertial_numbers(sums: dict[str, Floats], rate: Floats, pressure: Floats) -> dict[str, Floats]:
    """Both `INERTIAL_NUMBERS` by name, of `SIZE_SUMS`, shear rates [1/s] and pressures [N/m]."""
    mass, diameter = (sums[name] / sums["bodies"] for name in ("mass", "diameters"))
    density = sums["mass"] / sums["covered"]
    return {
        "inertial_number": np.abs(rate) * np.sqrt(mass / pressure),
        "inertial_number_density": np.abs(rate) * diameter * np.sqrt(density / pressure),
    }

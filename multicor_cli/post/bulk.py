"""The bulk of a sheared layer: what lies far enough from both walls, and what is summed over it in one interval of frames."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.model import Floats
from multicor_cli.post.binning import area_below, part_between
from multicor_cli.post.bins import heights
from multicor_cli.post.contacts import LoadedContacts, has_forces, loaded_contacts
from multicor_cli.post.extent import Extent
from multicor_cli.post.flow import MeanFlow
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, model_of, need_same_grains

MARGIN = 8.0
"""Mean diameters next to a wall that do not count as bulk: a rough wall disturbs the spins that far."""

_LARGEST = 0.25  # of the distance of the walls: the margin of a thin layer
_CLEAR = 1.0 / 3.0  # of what is free between the surfaces of the walls: the margin between large glued grains

SUM_NAMES = (
    "lapse", "rate", "spin", "solid", "area", "kinetic", "weight",
    "xx", "xy", "yx", "yy", "stress_area", "contacts", "grains", "loaded_contacts", "loaded_grains",
    "normal_xx", "normal_xy", "normal_yy", "normal_count",
)  # fmt: skip
"""Names of the sums of `interval_sums`."""


@dataclass(frozen=True)
class Band:
    """The heights between which the bulk lies.

    Attributes:
        extent: The walls.
        bottom: What is left out above the line of the lower wall [m].
        top: What is left out below the line of the upper wall [m].
        margin: What is left out next to the surface of each wall [m].
    """

    extent: Extent
    bottom: float
    top: float
    margin: float

    def edges(self, frame: GrainFrame) -> tuple[float, float]:
        """Lowest and highest y of the bulk in a frame [m]; raises `PostError` if the walls come too near to each other."""
        floor, span = self.extent.origin(frame), self.extent.span(frame)
        if not self.bottom + self.top < span:
            raise PostError(
                f"no bulk is left between the walls where they come nearest, {span:.4g} m: lower --margin, or choose other frames"
            )
        return floor + self.bottom, floor + span - self.top


def find_band(model: Model, extent: Extent, margin: float | None) -> Band:
    """The bulk between two walls.

    Args:
        model: Grains and walls.
        extent: The walls, both of them.
        margin: Mean diameters to leave out next to the surface of each wall; default: `MARGIN`, or a quarter of the distance of
            the walls or a third of what is free between their surfaces if that is less.

    Raises:
        PostError: If the margin is negative or leaves nothing.
    """
    diameter = model.mean_diameter
    if margin is not None and not margin >= 0.0:
        raise PostError(f"the margin {margin:g} must not be negative")
    assert extent.lower is not None
    assert extent.upper is not None
    below, above = _glued_radius(model, extent.lower), _glued_radius(model, extent.upper)
    clear = max(extent.height - below - above, 0.0)
    edge = min(MARGIN * diameter, _LARGEST * extent.height, _CLEAR * clear) if margin is None else margin * diameter
    band = Band(extent, edge + below, edge + above, edge)
    if not band.bottom + band.top < extent.height:
        raise PostError(f"no bulk is left between the walls, {extent.height / diameter:.3g} mean diameters apart: lower --margin")
    return band


def _glued_radius(model: Model, wall: int) -> float:
    """Mean radius of the grains glued to a wall [m]; 0 for a smooth wall."""
    glued = (model.shapes.wall == wall) & (model.shapes.kind == ShapeKind.DISC)
    return float(model.shapes.geometry[glued, 2].mean()) if glued.any() else 0.0


def interval_sums(source: FrameSource, band: Band, flow: MeanFlow, first: GrainFrame, second: GrainFrame, lapse: float) -> Floats:
    """The sums `SUM_NAMES` over the bulk between two frames that are ``lapse`` apart [s].

    Velocity and spin are displacements over the interval, so nothing of the fluctuations in between is missed; the shear rate is a
    least-squares slope. The rest belongs to the second frame; what belongs to contacts is zero if it has none.
    """
    need_same_grains(first, second)
    model = model_of(source, second)
    low, high = band.edges(second)
    y, radius = heights(second), model.grains.radius
    area = area_below(high - y, radius) - area_below(low - y, radius)
    inside = (y > low) & (y < high)
    slip = flow.fluctuation(second)[inside]
    return np.array(
        [
            lapse,
            *_shear_and_spin(band, model, first, second),
            area.sum(),
            (high - low) * model.period,
            0.5 * (slip**2).sum(),
            np.count_nonzero(inside),
            *_contact_sums(model, second, inside, (low, high)),
        ]
    )


def _shear_and_spin(band: Band, model: Model, first: GrainFrame, second: GrainFrame) -> tuple[float, float]:
    """Strain and rotation of the bulk in an interval; the grains are where they are halfway."""
    edges = np.mean([band.edges(first), band.edges(second)], axis=0)
    y = 0.5 * (heights(first) + heights(second))
    inside = (y > edges[0]) & (y < edges[1])
    if np.count_nonzero(inside) < 2:
        raise PostError("there are no two grains in the bulk: lower --margin")
    turn = _change(first, second, "angle")
    way = _change(first, second, "position") + model.period * _change(first, second, "image")
    strain = _slope(y[inside], way[inside])
    # A least-squares slope weighs the local shear with (y − low)(high − y); so must the rotation it is compared with.
    weight = ((y - edges[0]) * (edges[1] - y))[inside]
    return strain, float(np.average(turn[inside], weights=weight))


def _slope(x: Floats, y: Floats) -> float:
    """Slope of the least-squares line; nan if all x are the same."""
    apart = x - x.mean()
    square = float((apart * apart).sum())
    return float((apart * (y - y.mean())).sum()) / square if square > 0.0 else math.nan


def _change(first: GrainFrame, second: GrainFrame, name: str) -> Floats:
    """How much an array of the grains (its first column) differs between two frames."""
    before, after = (np.asarray(getattr(frame, name), np.float64) for frame in (first, second))
    change = after - before
    return np.asarray(change if change.ndim == 1 else change[:, 0])


def _contact_sums(model: Model, frame: GrainFrame, inside: NDArray[np.bool_], edges: tuple[float, float]) -> list[float]:
    if not has_forces(frame):
        return [0.0] * (len(SUM_NAMES) - SUM_NAMES.index("xx"))
    contacts, (low, high) = loaded_contacts(frame, model), edges
    start = heights(frame)[contacts.i]
    part = part_between(start, start - contacts.branch[:, 1], low, high)
    stress = [float((part * contacts.virial(a, b)).sum()) for a in (0, 1) for b in (0, 1)]
    counts = contacts.counts[inside]
    loaded = counts >= 2
    return [
        *stress,
        (high - low) * model.period,
        float(counts.sum()),
        float(counts.size),
        float(counts[loaded].sum()),
        float(np.count_nonzero(loaded)),
        *_normal_sums(contacts, start, edges),
    ]


def _normal_sums(contacts: LoadedContacts, start: Floats, edges: tuple[float, float]) -> list[float]:
    """Sum of n⊗n over the contacts whose branch has its middle in the bulk, and their number."""
    middle = start - 0.5 * contacts.branch[:, 1]
    inside = ((middle > edges[0]) & (middle < edges[1])).astype(np.float64)
    x, y = contacts.normal.T
    # Products by hand: BLAS would start threads for each, and wait for busy cores.
    return [float((inside * a * b).sum()) for a, b in ((x, x), (x, y), (y, y))] + [float(inside.sum())]

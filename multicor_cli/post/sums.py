"""Sums over grains, contacts, bins and frames, of which every profile is a ratio."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.averages import pseudo_values, spread, standard_error
from multicor_cli.post.bins import BinPlace, Bins, heights
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts
from multicor_cli.post.groups import FrameOfGroups
from multicor_cli.post.source import FrameSource, GrainFrame, model_of, need_same_grains
from multicor_cli.text import count_noun

Values = Callable[[GrainFrame], Floats]
"""Values of the grains of a frame, shape ``(n,)``."""

ContactValues = Callable[[LoadedContacts], Floats]
"""Values of the contacts of a frame, shape ``(c,)``."""


class Sums(NamedTuple):
    """The value of a bin is the sum of ``value`` over that of ``weight``; shape ``(rows, b)``, one row per frame or interval.

    Attributes:
        value: Numerators.
        weight: Denominators.
        area: Areas of the grains [m²].
    """

    value: Floats
    weight: Floats
    area: Floats


def sum_means(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Sequence[Values]) -> list[Sums]:
    """For averages over grains, weighted by their area; one row per frame, one result for each of ``values``."""
    return _sum_grains(source, chosen, bins, values, np.ones_like)


def sum_numbers(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Sequence[Values]) -> list[Sums]:
    """For averages over grains that count alike, each with the part of its area that lies in a bin; one row per frame."""
    return _sum_grains(source, chosen, bins, values, lambda radius: 1.0 / (np.pi * radius**2))


def _sum_grains(
    source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Sequence[Values], per_area: Callable[[Floats], Floats]
) -> list[Sums]:
    """Sums over grains that count with their area in a bin times ``per_area`` of their radii."""
    area, weight = _empty(chosen.size, bins), _empty(chosen.size, bins)
    weighted = [_empty(chosen.size, bins) for _ in values]
    for row, k in enumerate(chosen):
        frame = source.frames[int(k)]
        radius = model_of(source, frame).grains.radius
        shares = bins.share(heights(frame), radius, bins.place(frame))
        counting = shares.area * per_area(radius)[shares.grain]
        area[row], weight[row] = bins.total(shares, shares.area), bins.total(shares, counting)
        for column, value in zip(weighted, values, strict=True):
            column[row] = bins.total(shares, counting * value(frame)[shares.grain])
    return [Sums(column, weight, area) for column in weighted]


def sum_shares(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Sequence[Values]) -> list[Sums]:
    """For values per area of the plane; one row per frame, one result for each of ``values``."""
    sums = sum_means(source, chosen, bins, values)
    frames = (source.frames[int(k)] for k in chosen)
    areas = np.array([bins.place(frame).width * plane_width(source, frame) for frame in frames])
    weight = np.repeat(areas[:, np.newaxis], bins.count, axis=1)
    return [found._replace(weight=weight) for found in sums]


def sum_contacts(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Sequence[ContactValues]) -> list[Sums]:
    """For what contacts carry per area of the plane, spread along their branches; one row per frame with forces."""
    area, weight = _empty(chosen.size, bins), _empty(chosen.size, bins)
    spread = [_empty(chosen.size, bins) for _ in values]
    for row, k in enumerate(chosen):
        frame = source.frames[int(k)]
        whole = frame.whole if isinstance(frame, FrameOfGroups) else frame
        y, place = heights(frame), bins.place(frame)
        contacts = loaded_contacts(whole, model_of(source, whole))
        lines = bins.share_branches(contacts, heights(whole), place)
        length = lines.area * frame.parts(contacts)[lines.grain] if isinstance(frame, FrameOfGroups) else lines.area
        for column, value in zip(spread, values, strict=True):
            column[row] = bins.total(lines, length * value(contacts)[lines.grain])
        weight[row] = place.width * plane_width(source, frame)
        discs = bins.share(y, model_of(source, frame).grains.radius, place)
        area[row] = bins.total(discs, discs.area)
    return [Sums(column, weight, area) for column in spread]


def sum_rates(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Sequence[Values]) -> list[Sums]:
    """For increases per time and area of the plane; one row per interval between consecutive frames.

    What a grain has gained in the interval lies where the grain is halfway between its two positions.
    """
    times = np.asarray(source.frames.time)
    area, weight = _empty(chosen.size - 1, bins), _empty(chosen.size - 1, bins)
    gained = [_empty(chosen.size - 1, bins) for _ in values]
    before = source.frames[int(chosen[0])]
    radius = model_of(source, before).grains.radius
    for row, (first, last) in enumerate(pairwise(chosen)):
        after = source.frames[int(last)]
        need_same_grains(before, after)
        place = BinPlace(*(0.5 * (a + b) for a, b in zip(bins.place(before), bins.place(after), strict=True)))
        shares = bins.share(0.5 * (heights(before) + heights(after)), radius, place)
        area[row] = bins.total(shares, shares.area)
        for column, value in zip(gained, values, strict=True):
            gain = (value(after) - value(before)) / (np.pi * radius**2)
            column[row] = bins.total(shares, shares.area * gain[shares.grain])
        width = 0.5 * (plane_width(source, before) + plane_width(source, after))
        weight[row] = place.width * width * float(times[last] - times[first])
        before = after
    return [Sums(column, weight, area) for column in gained]


def plane_width(source: FrameSource, frame: GrainFrame) -> float:
    """Width of the plane that the grains fill [m]: the period, or how far they reach in x where there is none."""
    if source.model.period > 0.0:
        return source.model.period
    frame = getattr(frame, "whole", frame)  # of some groups: all grains fill the plane
    x, radius = np.asarray(frame.position, np.float64)[:, 0], model_of(source, frame).grains.radius
    return float((x + radius).max() - (x - radius).min())


def average(sums: Sums) -> tuple[Floats, Floats]:
    """Means over the rows and their standard errors (`multicor_cli.post.averages`); nan where there is nothing."""
    return _ratio(sums.value.sum(axis=0), sums.weight.sum(axis=0)), standard_error(row_values(sums))


def drift_note(sums: Sums) -> str:
    """A line on the bins whose means drift, or have too few frames for a good error; empty if there are none."""
    found = spread(row_values(sums))
    known = np.isfinite(found.drift)
    drifting, unsure = found.is_drifting & known, known & found.is_unsure & ~found.is_drifting
    told = []
    if drifting.any():
        ratio = np.where(drifting, np.abs(found.drift), 0.0)
        worst = int(np.argmax(ratio))
        told.append(
            f"the means of {count_noun(int(drifting.sum()), 'bin')} drift, most in bin {worst + 1}: by {found.drift[worst]:.2g}"
        )
    if unsure.any():
        told.append(f"too few frames for good errors of {count_noun(int(unsure.sum()), 'bin')}")
    return "; ".join(told)


def row_values(sums: Sums) -> Floats:
    """What each row says of the means, shape of ``sums.value``; nan where a mean has no value without one of the rows."""
    value, weight = sums.value.sum(axis=0), sums.weight.sum(axis=0)
    return pseudo_values(_ratio(value, weight), _ratio(value - sums.value, weight - sums.weight))


def _ratio(value: Floats, weight: Floats) -> Floats:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(value / weight)


def _empty(rows: int, bins: Bins) -> Floats:
    return np.zeros((rows, bins.count))

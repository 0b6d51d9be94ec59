"""Means over time with their errors, and the sums of which every profile is a ratio."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import BinPlace, Bins, Shares, heights, share_lines
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.rings import cut_of, reach_of
from multicor_cli.post.source import (
    Frame,
    FrameOfGroups,
    Run,
    frames_of,
    need_same_grains,
    times_of,
)
from multicor_cli.text import count_noun

# ---- Means over time, their standard errors and drifts: the one place where errors are made

FEW_ROWS = 16
"""Rows below which errors are a guess: what so few remember of each other can hardly be seen."""

SURE = 3.0
"""Standard errors from which on a drift is none of chance."""

_AT_ONCE = 512  # columns whose errors are made together: they stay in the cache
_LEAST_INDEPENDENT = 2.0  # rows that count as independent, for a mean; a slope needs twice as many


class Spread(NamedTuple):
    """What rows over time say of their mean; arrays have the shape of a row.

    Attributes:
        error: Standard error of the mean; nan where rows are too few, or remember for too long.
        drift: Least-squares slope times the time from first to last row; nan with fewer than two.
        drift_error: Standard error of the drift; nan as that of the mean.
        memory: Rows g ≥ 1 that count as one: the mean has g times the variance of independent rows.
        number: How many rows count.
    """

    error: Floats
    drift: Floats
    drift_error: Floats
    memory: Floats
    number: Floats

    @property
    def is_drifting(self) -> NDArray[np.bool_]:
        """Whether the drift is beyond `SURE` standard errors; of few rows it is not known."""
        return np.asarray(
            (np.abs(self.drift) > SURE * self.drift_error) & (self.number >= FEW_ROWS), np.bool_
        )

    @property
    def is_unsure(self) -> NDArray[np.bool_]:
        """Whether the error is not known, or a guess from `FEW_ROWS`."""
        return np.asarray(
            np.isnan(self.error) | (self.number < FEW_ROWS) & (self.error > 0.0), np.bool_
        )

    def note(self) -> str:
        """That a single column's mean drifts, or has too few rows for a good error; else empty."""
        if bool(self.is_drifting):
            return "drifts"
        return "too short" if bool(self.is_unsure) else ""


def spread(rows: Floats, times: Floats | None = None) -> Spread:
    """Standard errors and drifts of means over rows that may remember each other.

    The variance of the mean of n rows is s² g/(n − g) with their variance s² (divisor n) and the
    statistical inefficiency g = 1 + 2 Σ ρ(k). The term −g in the divisor stands for what
    subtracting the mean takes from s². g is the larger of two estimates, and at least 1:

    - the initial monotone sequence: sums ρ(2k) + ρ(2k+1) are added as long as they are positive,
    none larger than that before it (Geyer, Stat. Sci. 7, 473, 1992, section 3.3); - (1 + φ)/(1 − φ)
    of an autoregressive process of first order, with φ = ρ(1) + (1 + 3ρ(1))/n: correlations of
    short series come out that much too small (Kendall, Biometrika 41, 403, 1954).

    Drifts are least-squares slopes; their errors are those of a slope with the residuals as noise
    of the same kind. A mean that drifts has an error that holds the drift, if it has one. What is
    constant has the error 0, however few its rows.

    On autoregressive series of first order, intervals of ±2 errors cover the true mean in 94 to 96
    % of series of 400 rows that hold 20 independent ones or more; in 90 % of series of 18 rows that
    hold 6.5; in 73 % of those that hold 2.6, where ten blocks cover in 53 %. No estimate from a few
    rows does better than that: for a number to rely on, let the flow go on for longer. Errors of
    fewer than `FEW_ROWS` are a guess, most often too small.

    Args:
        rows: Values, one row per time; those that are not finite do not count, shape ``(r, …)``.
        times: Their times; default: evenly spaced, shape ``(r,)``.
    """
    at = np.arange(len(rows), dtype=np.float64) if times is None else np.asarray(times, np.float64)
    found, number = _of_columns(rows, 4, lambda x, known: _spread(x, at[known]))
    return Spread(found[0], found[1], found[2], found[3], number)


def standard_errors(rows: Floats) -> Floats:
    """The errors of `spread`, which takes twice as long."""
    return np.asarray(_of_columns(rows, 1, lambda x, _: _standard_error(x)[np.newaxis])[0][0])


def _of_columns(
    rows: Floats, count: int, make: Callable[[Floats, NDArray[np.bool_]], Floats]
) -> tuple[Floats, Floats]:
    """What is made ``(count, c)`` of columns and of which rows they are; how many rows these are.

    Rows that are not finite do not count; nan of fewer than two. Shapes of the results are those of
    a row, ``(count, …)`` and ``(…)``.
    """
    columns = np.asarray(rows, np.float64).reshape(len(rows), math.prod(rows.shape[1:]))
    known = np.isfinite(columns)
    number = known.sum(axis=0)
    found = np.full((count, number.size), np.nan)
    if len(rows) > 1:
        complete = np.flatnonzero(number == len(rows))
        for part in np.array_split(complete, complete.size // _AT_ONCE + 1):
            found[:, part] = make(columns[:, part], np.ones(len(rows), np.bool_))
    for k in np.flatnonzero((number > 1) & (number < len(rows))).tolist():
        found[:, [k]] = make(columns[known[:, k]][:, [k]], known[:, k])
    shape = rows.shape[1:]
    return found.reshape(count, *shape), number.astype(np.float64).reshape(shape)


def scatter(rows: Floats) -> Floats:
    """Standard deviation of frames (rows) about their mean; it is no error of the mean.

    Values that are not finite do not count; nan with fewer than two.
    """
    known = np.isfinite(rows)
    number = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(known, rows, 0.0).sum(axis=0) / number
        squares = (np.where(known, rows - mean, 0.0) ** 2).sum(axis=0)
        return np.asarray(np.sqrt(squares / np.where(number > 1, number - 1, np.nan)))


def pseudo_values(total: Floats, without: Floats) -> Floats:
    """What each row adds to a quantity of sums over all rows: its errors are those of their mean.

    n θ − (n − 1) θ₋ₖ, with the quantity θ of all rows and θ₋ₖ of all rows but k, ``(r, …)``: the
    jackknife (Quenouille, Biometrika 43, 353, 1956; Tukey 1958). For ratios whose denominators are
    alike these are the ratios of the rows. They are nan throughout where one θ₋ₖ has no value.
    """
    rows = len(without)
    values = rows * total - (rows - 1) * without
    return np.asarray(np.where(np.isfinite(values).all(axis=0), values, np.nan))


def of_sums(
    derive: Callable[[Floats], Floats], rows: Floats, times: Floats | None = None
) -> tuple[Floats, Spread]:
    """Quantities that ``derive`` makes of the sums of all rows, and the spread of what each adds.

    Args:
        derive: Makes quantities ``(…, b)`` of sums ``(…, q)``; what is 0/0 has no value.
        rows: Sums of each row, shape ``(r, q)``.
        times: Their times, as `spread`.
    """
    whole = rows.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value, without = derive(whole), derive(whole - rows)
    return value, spread(pseudo_values(value, without), times)


def _spread(x: Floats, times: Floats) -> Floats:
    """Errors, drifts, errors of these and memory of columns ``(n, c)`` with n > 1: ``(4, c)``."""
    n, t_away = len(x), ((times - times.mean()) / (times[-1] - times[0]))[:, np.newaxis]
    square = float((t_away**2).sum())
    x_away = x - x.mean(axis=0)
    drift = (t_away * x_away).sum(axis=0) / square
    memory = _inefficiency(x_away)
    rest = x_away - drift * t_away
    drift_error = _error(rest, _inefficiency(rest), 2.0) / math.sqrt(square / n)
    found = np.stack([_error(x_away, memory, 1.0), drift, drift_error, memory])
    constant = np.array([0.0, 0.0, 0.0, 1.0])[:, np.newaxis]
    return np.where(_is_constant(x, x_away), constant, found)


def _standard_error(x: Floats) -> Floats:
    """The first row of `_spread`."""
    x_away = x - x.mean(axis=0)
    found = _error(x_away, _inefficiency(x_away), 1.0)
    return np.where(_is_constant(x, x_away), 0.0, found)


def _is_constant(x: Floats, away: Floats) -> NDArray[np.bool_]:
    """Means of what is constant, and pseudo-values of it, differ by rounding alone."""
    rounding = 8.0 * len(x) * np.finfo(float).eps * np.abs(x).max(axis=0)
    return np.asarray(np.abs(away).max(axis=0) <= rounding, np.bool_)


def _error(away: Floats, memory: Floats, parameters: float) -> Floats:
    """√(s² g/(n − p g)) with p fitted parameters; nan if fewer than 2p rows are independent."""
    n = len(away)
    is_known = n >= _LEAST_INDEPENDENT * parameters * memory
    left = np.where(is_known, n - parameters * memory, np.nan)
    return np.asarray(np.sqrt((away**2).sum(axis=0) / n * memory / left))


def _inefficiency(away: Floats) -> Floats:
    """Statistical inefficiency of deviations from the mean ``(n, c)``; see `spread`."""
    n, power = len(away), (away**2).sum(axis=0)
    transform = np.fft.rfft(away, 2 * n, axis=0)
    lags = np.fft.irfft(transform.real**2 + transform.imag**2, axis=0)[: 2 * (n // 2)]
    correlation = lags / np.where(power > 0.0, power, 1.0)
    pairs = np.minimum.accumulate(correlation[::2] + correlation[1::2], axis=0)
    first = correlation[1]
    phi = np.minimum(first + (1.0 + 3.0 * first) / n, 1.0 - 1.0 / n**2)
    sequence = 2.0 * np.where(pairs > 0.0, pairs, 0.0).sum(axis=0) - 1.0
    found = np.maximum(np.maximum(sequence, (1.0 + phi) / (1.0 - phi)), 1.0)
    return np.where(power > 0.0, found, 1.0)


# ---- Sums over grains, contacts, bins and frames

Values = Callable[[Frame, Shares], Floats]
"""Values of the grains of a frame for each of some shares, real or complex, shape ``(k,)``."""

ContactValues = Callable[[LoadedContacts], Floats]
"""Values of the contacts of a frame, shape ``(c,)``."""


class Sums(NamedTuple):
    """A row per frame or interval ``(rows, b)``: bins are Σ value/Σ weight; area of grains [m²]."""

    value: Floats
    weight: Floats
    area: Floats


def _gathered(rows: Iterable[tuple[list[Floats], Floats, Floats]]) -> list[Sums]:
    """Sums of rows with values (an array for each of several fields), weights and areas."""
    values, weights, areas = zip(*rows, strict=True)
    weight, area = np.array(weights), np.array(areas)
    return [Sums(np.array(column), weight, area) for column in zip(*values, strict=True)]


def sum_grains(
    source: Run,
    chosen: NDArray[np.int64],
    bins: Bins,
    values: Sequence[Values],
    kind: Literal["mean", "number", "share"],
) -> list[Sums]:
    """For what grains have, see `multicor_cli.post.quantities.Kind`; a row per frame.

    A result for each of ``values``. Grains count with their area in a bin, or the part of it; those
    without a value do not.
    """

    def row(frame: Frame) -> tuple[list[Floats], Floats, Floats]:
        model, place = frame.model, bins.place(frame)
        shares = bins.share(heights(frame), cut_of(model, frame), place)
        counting = shares.area
        if kind == "number":
            counting = shares.area * (1.0 / model.area)[shares.grain]
        found = [value(frame, shares) for value in values]
        if not (known := np.isfinite(found).all(axis=0)).all():
            counting = np.where(known, counting, 0.0)
            found = [np.where(known, each, 0.0) for each in found]
        if kind == "share":
            weight = np.full(bins.count, place.width * plane_width(source, frame))
        else:
            weight = bins.total(shares, counting)
        weighted = [bins.total(shares, counting * each) for each in found]
        return weighted, weight, bins.total(shares, shares.area)

    return _gathered(map(row, frames_of(source, chosen)))


def sum_contacts(
    source: Run, chosen: NDArray[np.int64], bins: Bins, values: Sequence[ContactValues]
) -> list[Sums]:
    """For what contacts carry per area, spread along branches; a row per frame with forces."""

    def row(frame: Frame) -> tuple[list[Floats], Floats, Floats]:
        place, group = bins.place(frame), frame if isinstance(frame, FrameOfGroups) else None
        whole: Frame = frame if group is None else group.whole
        contacts = loaded_contacts(whole, whole.model)
        start = heights(whole)[contacts.i]
        end, is_around = start - contacts.branch[:, 1], bins.extent.is_cell
        lines = share_lines(start, end, *place, bins.count, is_around=is_around)
        length = lines.area
        if group is not None:
            length = lines.area * contacts.parts(group.rows)[lines.grain]
        carried = [bins.total(lines, length * value(contacts)[lines.grain]) for value in values]
        weight = np.full(bins.count, place.width * plane_width(source, frame))
        grains = bins.share(heights(frame), cut_of(frame.model, frame), place)
        return carried, weight, bins.total(grains, grains.area)

    return _gathered(map(row, frames_of(source, chosen)))


def sum_rates(
    source: Run, chosen: NDArray[np.int64], bins: Bins, values: Sequence[Values]
) -> list[Sums]:
    """For increases per time and area, where grains are halfway; a row per interval of frames."""
    model = source.frames[int(chosen[0])].model

    def row(before: Frame, after: Frame, lapse: float) -> tuple[list[Floats], Floats, Floats]:
        need_same_grains(before, after)
        places = zip(bins.place(before), bins.place(after), strict=True)
        place = BinPlace(*(0.5 * (a + b) for a, b in places))
        rise = heights(after) - heights(before)
        if bins.extent.is_cell:  # to the nearest image
            rise -= bins.extent.height * np.round(rise / bins.extent.height)
        shares = bins.share(heights(before) + 0.5 * rise, cut_of(model, before, after), place)
        gained = []
        for value in values:
            gain = (value(after, shares) - value(before, shares)) / model.area[shares.grain]
            gained.append(bins.total(shares, shares.area * gain))
        width = 0.5 * (plane_width(source, before) + plane_width(source, after))
        weight = np.full(bins.count, place.width * width * lapse)
        return gained, weight, bins.total(shares, shares.area)

    lapses = np.diff(times_of(source, chosen)).tolist()
    pairs = zip(pairwise(frames_of(source, chosen)), lapses, strict=True)
    return _gathered(row(before, after, lapse) for (before, after), lapse in pairs)


def plane_width(source: Run, frame: Frame) -> float:
    """Width of the plane [m]: the period, or without one how far the grains reach in x."""
    if source.model.period > 0.0:
        return lattice_of(source.model, frame).width
    frame = getattr(frame, "whole", frame)  # of some groups: all grains fill the plane
    x = np.asarray(frame.position, np.float64)[:, 0]
    left, right = reach_of(frame.model, frame)[..., 0]
    return float((x + right).max() - (x + left).min())


OfMeans = Callable[[NDArray[Any], NDArray[Any]], Floats]
"""What is told of means over all rows or over some ``(…, b)``; the second ones are over all."""


def average(sums: Sums, of_means: OfMeans | None = None) -> tuple[Floats, Floats]:
    """Means over the rows, or what is told of them, and standard errors; nan where nothing is."""
    mean = _ratio(sums.value.sum(axis=0), sums.weight.sum(axis=0))
    told = mean if of_means is None else of_means(mean, mean)
    return told, spread(row_values(sums, of_means)).error


def drift_note(sums: Sums, of_means: OfMeans | None = None) -> str:
    """A line on bins whose means drift, or have too few frames for good errors; empty for none."""
    return note_on_bins(spread(row_values(sums, of_means)))


def note_on_bins(found: Spread) -> str:
    """The same of the spread of the means of bins, shape ``(b,)``."""
    known = np.isfinite(found.drift)
    drifting, unsure = found.is_drifting & known, known & found.is_unsure & ~found.is_drifting
    told = []
    if drifting.any():
        ratio = np.where(drifting, np.abs(found.drift), 0.0)
        worst = int(np.argmax(ratio))
        told.append(
            f"the means of {count_noun(int(drifting.sum()), 'bin')} drift, most in bin "
            f"{worst + 1}: by {found.drift[worst]:.2g}"
        )
    if unsure.any():
        told.append(f"too few frames for good errors of {count_noun(int(unsure.sum()), 'bin')}")
    return "; ".join(told)


def row_values(sums: Sums, of_means: OfMeans | None = None) -> Floats:
    """What each row says of the means; nan where a mean has no value without one of the rows."""
    value, weight = sums.value.sum(axis=0), sums.weight.sum(axis=0)
    mean, without = _ratio(value, weight), _ratio(value - sums.value, weight - sums.weight)
    if of_means is not None:
        mean, without = of_means(mean, mean), of_means(without, mean)
    return pseudo_values(mean, without)


def _ratio(value: Floats, weight: Floats) -> Floats:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(value / weight)

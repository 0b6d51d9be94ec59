"""What part of a grain lies below a level line, and how far grains reach: discs, and any shape."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.rings import Rings, rings_of
from multicor_cli.post.source import Frame

_AT_ONCE = 1 << 20  # lines of outlines that are looked at together


class Cut(Protocol):
    """Grains as they lie in a frame, which level lines cut; ``n`` of them."""

    @property
    def low(self) -> Floats:
        """How far below their centers they end [m], a negative number, shape ``(n,)``."""

    @property
    def high(self) -> Floats:
        """How far above their centers they end [m], shape ``(n,)``."""

    def below(self, grain: NDArray[np.int64], height: Floats) -> Floats:
        """Area of grains, by their numbers, below lines so far above their centers [m²]."""


def cut_of(model: Model, *frames: Frame) -> Cut:
    """The grains as they lie in a frame, or halfway between two."""
    if model.outlines is None:
        return _Discs(model.grains.radius)
    return turned(model, np.mean([np.asarray(f.angle, np.float64) for f in frames], axis=0))


def turned(model: Model, angle: Floats) -> Cut:
    """Grains of any shape, turned by angles [rad], shape ``(n,)``."""
    assert model.outlines is not None
    rings, (low, high) = rings_of(model.outlines), spans(model, angle)[:, :, 1]
    grain, *ends = sides_of(rings)
    c, s = np.cos(angle)[grain], np.sin(angle)[grain]
    (x, start), (u, end) = ((c * a - s * b, s * a + c * b) for a, b in (at.T for at in ends))
    first = np.concatenate([[0], np.cumsum(np.bincount(grain, minlength=angle.size))])
    # So that grains have their true area
    return _Shapes(low, high, first, start, end, (u - x) * (model.area / rings.area)[grain])


def reach_of(model: Model, frame: Frame) -> Floats:
    """How far grains reach to the left and down, and to the right and up [m], ``(2, n, 2)``."""
    if model.outlines is None:
        radius = np.stack([model.grains.radius] * 2, axis=1)
        return np.stack([-radius, radius])
    return spans(model, np.asarray(frame.angle, np.float64))


def spans(model: Model, angle: Floats) -> Floats:
    """The same of grains of any shape, turned by angles [rad], shape ``(n,)``."""
    outlines = model.outlines
    assert outlines is not None
    piece = np.repeat(np.arange(outlines.rounding.size), np.diff(outlines.start))
    grain = np.repeat(np.arange(angle.size), np.diff(outlines.piece))[piece]
    (x, y), c, s = outlines.corner.T, np.cos(angle)[grain], np.sin(angle)[grain]
    at = np.column_stack([c * x - s * y, s * x + c * y])
    rounding, first = outlines.rounding[piece, np.newaxis], outlines.start[outlines.piece[:-1]]
    if not first.size:
        return np.zeros((2, 0, 2))
    ends = np.minimum.reduceat(at - rounding, first), np.maximum.reduceat(at + rounding, first)
    return np.stack(ends)


def area_below(height: Floats, radius: Floats) -> Floats:
    """Area of discs below a level line at ``height`` above their centers [m²].

    a²(π − arccos s + s√(1−s²)) with s = height/a cut to −1 … 1.
    """
    s = np.clip(height / radius, -1.0, 1.0)
    return np.asarray(radius * radius * (np.pi - np.arccos(s) + s * np.sqrt(1.0 - s * s)))


class _Discs(NamedTuple):
    radius: Floats

    @property
    def low(self) -> Floats:
        return -self.radius

    @property
    def high(self) -> Floats:
        return self.radius

    def below(self, grain: NDArray[np.int64], height: Floats) -> Floats:
        return area_below(height, self.radius[grain])


class _Shapes(NamedTuple):
    """Lines around grains of any shape, those of a grain next to each other.

    Attributes:
        low, high: As of `Cut`.
        first: First line of each grain, shape ``(n + 1,)``.
        start, end: Heights of the ends of lines above the center [m], shape ``(s,)``.
        right: How far lines lead to the right [m], shape ``(s,)``.
    """

    low: Floats
    high: Floats
    first: NDArray[np.int64]
    start: Floats
    end: Floats
    right: Floats

    def below(self, grain: NDArray[np.int64], height: Floats) -> Floats:
        """∮ max(h − y, 0) dx around each grain, by Green's theorem; along a line it is a mean."""
        number = np.diff(self.first)[grain]
        ends, found = np.cumsum(number), []
        parts = np.flatnonzero(np.diff(ends // _AT_ONCE)) + 1
        for own, h, count in zip(
            *(np.split(each, parts) for each in (grain, height, number)), strict=True
        ):
            before = np.cumsum(count) - count
            line = np.arange(count.sum()) + np.repeat(self.first[own] - before, count)
            level = np.repeat(h, count)
            a, b = level - self.start[line], level - self.end[line]
            above = np.maximum(a, 0.0) + np.maximum(b, 0.0)
            crossing = a * b < 0.0
            share = above / np.where(crossing, np.abs(a - b), 1.0)
            depth = 0.5 * above * np.where(crossing, share, 1.0)
            found.append(np.add.reduceat(depth * self.right[line], before) if own.size else h)
        return np.concatenate(found)


def sides_of(rings: Rings) -> tuple[NDArray[np.int64], Floats, Floats]:
    """The grain of each line around grains, where it begins and ends [m], ``(s,)``, ``(s, 2)``."""
    after = np.arange(1, len(rings.point) + 1)
    after[rings.start[1:] - 1] = rings.start[:-1]
    return rings.grain.repeat(np.diff(rings.start)), rings.point, rings.point[after]

"""Whether the pieces of clumps make one grain: none lies apart, is there twice, or is tiny."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Prepared, Rule
from multicor_cli.model.outlines import Piece
from multicor_cli.scenario.shapes import ClumpShape


def _clumps(run: Prepared) -> Iterator[tuple[str, list[Piece]]]:
    """Names of the groups of clumps, and their pieces in the unit of the scenario."""
    for group in run.scenario.particles:
        if isinstance(group.outline, ClumpShape):
            yield group.name, [part.piece for part in group.outline.pieces]


def _extent(pieces: list[Piece]) -> float:
    """The longer side of the box around some pieces, along the axes."""
    low = np.min([corners.min(axis=0) - rounding for corners, rounding in pieces], axis=0)
    high = np.max([corners.max(axis=0) + rounding for corners, rounding in pieces], axis=0)
    return float((high - low).max())


def _gap(one: Piece, other: Piece) -> float:
    """Distance of two pieces, below 0 if they overlap: in the direction that parts them most.

    It is normal to a side, or leads from a corner to a corner. Corners are counter-clockwise.
    """
    (a, r_a), (b, r_b) = one, other
    sides = np.concatenate([np.roll(a, -1, axis=0) - a, b - np.roll(b, -1, axis=0)])
    ways = np.concatenate([sides[:, ::-1] * [1.0, -1.0], (b[None] - a[:, None]).reshape(-1, 2)])
    length = np.hypot(*ways.T)
    ways = (ways / np.where(length > 0.0, length, 1.0)[:, None])[length > 0.0]
    if not len(ways):  # two discs with one center
        return -(r_a + r_b)
    return float(((b @ ways.T).min(axis=0) - (a @ ways.T).max(axis=0)).max()) - r_a - r_b


def _widest_gap(pieces: list[Piece]) -> float:
    """The widest gap that stays if pieces are joined over the narrowest ones; 0 without any.

    The longest edge of the minimum spanning tree (Prim's algorithm).
    """
    near, widest = np.full(len(pieces), np.inf), 0.0
    left, k = np.ones(len(pieces), bool), 0
    for _ in range(len(pieces) - 1):
        left[k] = False
        for m in np.flatnonzero(left):
            near[m] = min(near[m], _gap(pieces[k], pieces[m]))
        k = int(np.argmin(np.where(left, near, np.inf)))
        widest = max(widest, float(near[k]))
    return widest


def _gaps(run: Prepared) -> Iterator[Measured]:
    for name, pieces in _clumps(run):
        yield Measured(_widest_gap(pieces) / _extent(pieces), name)


def _twice(run: Prepared) -> Iterator[Measured]:
    for name, pieces in _clumps(run):
        unlike = {(rounding, frozenset(map(tuple, at.tolist()))) for at, rounding in pieces}
        yield Measured(float(len(pieces) - len(unlike)), name)


def _smallest(run: Prepared) -> Iterator[Measured]:
    for name, pieces in _clumps(run):
        yield Measured(min(_extent([piece]) for piece in pieces) / _extent(pieces), name)


BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule(
        "gaps in clumps", _gaps, unit="of the clump's length", warning=1e-6,
        meaning="Widest gap between pieces of a clump that nothing bridges. They move as one body "
            "all the same, and other grains may come in between.",
        remedy="Let the pieces touch, or put a rod between them; it may be meant.",
    ),
    Rule(
        "pieces twice in clumps", _twice, unit="pieces", warning=0.0,
        meaning="Pieces of a clump that are the same as another one. They change neither outline "
            "nor mass, and take their time in every contact.",
        remedy="Remove them, or correct their place.",
    ),
    Rule(
        "smallest piece of clumps", _smallest, unit="of the clump's length", least=1e-3,
        meaning="Length of the smallest piece of a clump over that of the clump. What is smaller "
            "than the overlap that contacts may have hardly takes part in them.",
        remedy="Give all pieces of a clump in the same unit, or leave small ones out.",
    ),
)  # fmt: skip
"""What is checked of clumps before a run; pieces of outlines in files are not given by anybody."""

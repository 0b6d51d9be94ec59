"""Position correction: which grains it may move, and what it leaves of overlaps."""

import numpy as np
from scene_parts import FLOOR, make_engine, make_model

from multicor_cli.kernels.separation import near_pairs, surround
from multicor_cli.solver import correction

ROW = np.array([0, 1, 2, 3, 4, 5, 6], np.int64)  # a chain: grain k is near grain k + 1, and the last near a wall
PARTNER = np.array([1, 2, 3, 4, 5, 7], np.int32)


def test_rings_grow_along_near_pairs_only():
    i, j = near_pairs(ROW, PARTNER, np.array([0.1, 0.1, 0.1, 0.9, 0.1, 0.1]), 0.5)
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == [(0, 1), (1, 2), (2, 3), (4, 5), (5, 7)]
    marked = np.array([False, True, False, False, False, False])
    assert surround(i, j, 1, marked) == 3
    assert marked.tolist() == [True, True, True, False, False, False]
    assert surround(i, j, 9, marked) == 4  # the gap between 3 and 4 is too wide
    assert marked.tolist() == [True] * 4 + [False] * 2


def corrected(overlap, count=60):
    """A row of discs on a floor, none of which touches another but two in the middle, after a correction."""
    radius = np.full(count, 0.5)
    model = make_model(radius, FLOOR, gravity=(0.0, 0.0))
    x = 1.0002 * np.arange(count)
    x[count // 2 :] -= 0.0002 + overlap
    engine = make_engine(model, np.column_stack([x, np.full(count, 0.5)]))
    report = engine.step(1e-3, 0.0)
    return engine.state.position[:, 0] - x, report.overlap


def test_few_overlaps_move_the_grains_nearby_only():
    moved, overlap = corrected(6e-4)
    assert overlap <= correction.ALLOWED
    middle = len(moved) // 2
    assert moved[middle - 1] < 0.0 < moved[middle]
    assert abs(moved.sum()) < 1e-12  # equal masses: the center of mass stays
    far = correction.RINGS + 2
    assert np.all(moved[: middle - far] == 0.0)
    assert np.all(moved[middle + far :] == 0.0)


def test_what_cannot_be_done_nearby_is_done_everywhere(monkeypatch):
    """A cage of held grains that leaves no room: only moving everything helps."""
    monkeypatch.setattr(correction, "RINGS", 0)
    moved, overlap = corrected(9e-3)
    assert overlap <= correction.ALLOWED
    assert np.count_nonzero(moved) > 10

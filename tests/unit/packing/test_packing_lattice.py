"""Lattices: contacts, rounding-level gaps, periodic closure, jitter, refusals."""

import numpy as np
import pytest
from packing_support import generator, pair_gaps, smallest_gap

from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.lattice import lay_out
from multicor_cli.scenario import Refused

R = 1e-3
BOX = PackingRegion(0.0, 0.0, 0.02, 0.02)


def sites(count, region=BOX, kind="triangular", spacing=None, jitter=0.0, seed=3):
    return lay_out(R, region, kind, spacing, jitter).sites(count, generator(seed))


def test_triangular_rows_touch_floor_sides_and_each_other():
    position = sites(10 + 9 + 10)
    assert position[:, 1].min() == R
    assert position[:, 0].min() == pytest.approx(R, abs=1e-18)
    assert position[:, 0].max() == pytest.approx(0.02 - R, abs=1e-17)
    _, _, gap = pair_gaps(position, np.full(29, R), 1e-9)
    # 9 + 8 + 9 within the rows, and every grain of the middle row touches two above and two below
    assert gap.size == 26 + 4 * 9
    assert np.abs(gap).max() < 1e-17


def test_contacts_of_periodic_and_square_lattices():
    position = sites(10 * 40, PackingRegion(0.0, 0.0, 0.02, 1.0, True))
    _, _, gap = pair_gaps(position, np.full(400, R), 1e-9, 0.02)
    assert gap.size == 10 * 40 + 2 * 10 * 39
    assert gap.min() > -1e-15
    _, _, gap = pair_gaps(sites(100, kind="square"), np.full(100, R), 1e-9)
    assert gap.size == 2 * 9 * 10


def test_rows_are_centered_or_opened_to_close_the_period():
    region = PackingRegion(0.0, 0.0, 0.0215, 0.05, True)
    position = sites(10 * 6, region)
    row = np.sort(position[:10, 0])
    np.testing.assert_allclose(np.diff(np.append(row, row[0] + 0.0215)), 0.00215, rtol=1e-12)
    _, _, gap = pair_gaps(position, np.full(60, R), 1e-9, 0.0215)
    assert gap.size == 2 * 10 * 5  # along the rows a gap has opened, across them grains still touch
    assert np.abs(gap).max() < 1e-16
    position = sites(9 + 9, PackingRegion(0.0, 0.0, 0.0196, 0.02))
    assert position[:, 0].min() + position[:, 0].max() == pytest.approx(0.0196, rel=1e-12)


@pytest.mark.parametrize("kind", ["triangular", "square"])
def test_capacity_is_what_fits_and_one_more_is_refused(kind):
    capacity = lay_out(R, BOX, kind, None, 0.0).capacity()
    position = sites(capacity, kind=kind)
    assert position[:, 1].max() <= 0.02 - R + 1e-12
    assert position[:, 1].max() > 0.02 - R - 2 * R  # one more row would not fit
    with pytest.raises(Refused, match=f"it holds {capacity}"):
        sites(capacity + 1, kind=kind)


def test_region_too_low_for_a_grain_holds_none():
    with pytest.raises(Refused, match="holds no site"):
        lay_out(R, PackingRegion(0.0, 0.0, 0.02, 1.9e-3), "square", None, 0.0).capacity()


def test_jitter_moves_grains_but_never_into_each_other_or_out_of_the_region():
    count = lay_out(R, BOX, "triangular", 2.5e-3, 0.1).capacity()
    position = sites(count, spacing=2.5e-3, jitter=0.1)
    still = sites(count, spacing=2.5e-3)
    assert smallest_gap(position, np.full(count, R)) >= -1e-15
    assert position.min() >= R
    assert position.max() <= 0.02 - R
    assert not np.array_equal(position, still)
    assert not np.array_equal(position, sites(count, spacing=2.5e-3, jitter=0.1, seed=4))
    np.testing.assert_array_equal(position, sites(count, spacing=2.5e-3, jitter=0.1))


@pytest.mark.parametrize(
    ("spacing", "jitter", "key"),
    [(1.9e-3, 0.0, "spacing"), (2.2e-3, 0.1, "jitter"), (None, 0.01, "jitter")],
)
def test_overlapping_lattices_are_refused_at_their_key(spacing, jitter, key):
    with pytest.raises(Refused) as caught:
        sites(10, spacing=spacing, jitter=jitter)
    assert caught.value.where == ("packing", key)

"""The mixing index and the separation of groups: apart, at random, and against plain loops."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import frame_of, source_of
from made_up_groups import source_of_groups

from multicor_cli.post import PostError, Selection, mixing
from multicor_cli.post.mixing import cells_of, lacey


def rows_of(width, height):
    """Places of a square lattice, row by row from below."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.column_stack([x.ravel(), y.ravel()])


# --- closed forms


@pytest.mark.parametrize("period", [0.0, 16.0])
@pytest.mark.parametrize("above", ["a", "b"])
def test_groups_that_are_apart(above, period):
    """Nothing is mixed, and the separation is as large as it can be."""
    places = rows_of(16, 32)
    is_above = places[:, 1] > 16.0
    groups = np.where(is_above, "ab".index(above), "ab".index("ab".replace(above, "")))
    table = mixing(source_of_groups(groups, [places], period=period), cell=16.0)
    assert (table.cells, table.cell_grains) == (32.0, 16.0)
    assert table.values["mixing_index"] == pytest.approx([0.0], abs=1e-12)
    assert table.values["separation"] == pytest.approx([1.0 if above == "a" else -1.0])
    assert table.values[f"height_{above}"] == pytest.approx([24.0])
    turned = mixing(source_of_groups(groups, [places]), cell=16.0, groups=("b", "a"))
    assert turned.groups == ("b", "a")
    assert turned.values["separation"] == pytest.approx(-table.values["separation"])
    assert turned.values["mixing_index"] == pytest.approx(table.values["mixing_index"], abs=1e-12)


@pytest.mark.parametrize("groups", [("a", "b"), ("b", "a")])
@pytest.mark.parametrize("is_above", [True, False])
def test_what_is_apart_is_so_however_unevenly_it_lies(is_above, groups):
    """1 with the first group on top, −1 with it at the bottom: few grains, denser below."""
    y = 10.0 * (np.arange(25) / 24.0) ** 3
    few = np.arange(25) >= 20 if is_above else np.arange(25) < 5
    places = np.column_stack([np.arange(25) % 5 + 0.5, y])
    table = mixing(source_of_groups(np.where(few, 0, 1), [places]), cell=5.0, groups=groups)
    expected = 1.0 if is_above == (groups[0] == "a") else -1.0
    assert table.values["separation"] == pytest.approx([expected])


@pytest.mark.parametrize("cell", [3.0, 10.0, 33.3])
@pytest.mark.parametrize("shares", [(0.5, 0.5), (0.1, 0.9), (0.2, 0.5, 0.3)])
def test_chance_mixes_completely(shares, cell):
    """On average 1, with the scatter that is told, whatever the shares and the cells."""
    random = np.random.default_rng(5)
    n, names = 700, tuple("abc"[: len(shares)])
    groups = np.repeat(range(len(shares)), [round(n * share) for share in shares])
    places = random.random((n, 2)) * [40.0, 25.0]
    frames = [random.permutation(places) for _ in range(400)]
    table = mixing(source_of_groups(groups, frames, names), cell=cell)
    found = table.values["mixing_index"]
    assert abs(found.mean() - 1.0) < 4.0 * found.std() / np.sqrt(len(found))
    assert found.std() == pytest.approx(table.random_scatter, rel=0.15)
    if len(shares) == 2:
        apart = table.values["separation"]
        assert abs(apart.mean()) < 4.0 * apart.std() / np.sqrt(len(apart))


def test_every_assignment_of_six_grains():
    """The mean over all of them is exactly 1, cells of unequal sizes included."""
    cells = np.array([0, 0, 0, 1, 1, 2])
    found = [lacey(cells, np.array(each), 2) for each in set(permutations([0, 0, 1, 1, 1, 1]))]
    assert len(found) == 15
    assert np.mean(found) == pytest.approx(1.0, abs=1e-12)


# --- against plain loops


def test_one_cell_after_the_other():
    random = np.random.default_rng(2)
    places, groups = random.random((211, 2)) * [30.0, 10.0], random.integers(0, 3, 211)
    cells = cells_of(places, 12.0, np.ptp(places[:, 1]) / 30.0)
    total, shares = 0.0, [(groups == g).sum() / 211 for g in range(3)]
    for cell in range(cells.max() + 1):
        inside = groups[cells == cell]
        for g, share in enumerate(shares):
            total += len(inside) * (np.sum(inside == g) / len(inside) - share) ** 2
    apart = sum(share * (1.0 - share) for share in shares)
    k = cells.max() + 1
    expected = (apart - total / 211) / (apart - apart * (k - 1) / 210)
    assert lacey(cells, groups, 3) == pytest.approx(expected, rel=1e-12)
    source = source_of_groups(groups, [places], ("a", "b", "c"), period=30.0)
    table = mixing(source, cell=12.0)
    assert table.values["mixing_index"][0] == pytest.approx(expected, rel=1e-12)
    assert "separation" not in table.values


@pytest.mark.parametrize("count", [7, 100, 1003])
@pytest.mark.parametrize("shape", [(1.0, 1.0), (50.0, 1.0), (1.0, 50.0)])
def test_cells_hold_equal_numbers_and_are_about_square(count, shape):
    places = np.random.default_rng(3).random((count, 2)) * shape
    cells = cells_of(places, 6.0, shape[1] / shape[0])
    sizes = np.bincount(cells)
    assert sizes.size == round(count / 6.0)
    assert sizes.sum() == count
    assert np.ptp(sizes) <= 2
    if count > 1000:
        extents = np.array([np.ptp(places[cells == k], axis=0) for k in range(sizes.size)])
        assert 0.5 < np.prod(np.median(extents, axis=0) ** [1, -1]) < 2.0


@pytest.mark.parametrize("shape", [(40.0, 2.0), (2.0, 40.0)])
def test_what_lies_beside_each_other_in_a_thin_layer_is_not_mixed(shape):
    """Two bands along the layer: cells as large as it is thick would hold both."""
    places = np.random.default_rng(6).random((240, 2)) * shape
    across = int(shape[1] > shape[0])  # the axis along which the layer is thick
    group = (places[:, 1 - across] > 1.0).astype(np.int64)
    assert lacey(cells_of(places, 12.0, shape[1] / shape[0]), group, 2) < 0.5


def test_a_cell_is_the_same_in_whatever_way_it_is_told():
    """Images of grains, and a tilt by a width, change nothing; there are no heights."""
    random = np.random.default_rng(4)
    places, groups = random.random((120, 2)) * [12.0, 10.0], np.arange(120) % 2
    found = []
    for tilt, shift in ((0.0, 0.0), (0.0, 36.0)):
        model, _ = make_cell(places, np.full(120, 0.5), (12.0, 10.0), tilt=tilt)
        model = replace(
            model, groups=("a", "b"), grains=replace(model.grains, group=groups.astype(np.int32))
        )
        frame = frame_of(places + np.array([shift, -20.0 * (shift > 0.0)]), walls=1)
        frame.wall_position = np.array([[12.0, 10.0, tilt]])
        found.append(mixing(source_of(model, [frame]), cell=6.0))
    assert found[0].values["mixing_index"] == pytest.approx(found[1].values["mixing_index"])
    assert set(found[0].values) == {"mixing_index"}


# --- what cannot be


def test_what_is_no_mixing_is_said():
    places = rows_of(4, 4)
    one = source_of_groups(np.zeros(16), [places])
    assert np.isnan(lacey(np.arange(16) // 4, np.zeros(16, int), 2))
    with pytest.raises(PostError, match="no frame has two cells of several grains"):
        mixing(one, cell=4.0)
    both = source_of_groups(np.arange(16) % 2, [places, places[:0]])
    both.frames[1].model = both.model.with_grains(np.zeros(0, int))
    values = mixing(both, cell=4.0).values["mixing_index"]
    assert np.isfinite(values).tolist() == [True, False]  # no grain is there
    with pytest.raises(PostError, match="choose another --cell"):
        mixing(both, cell=100.0)
    with pytest.raises(PostError, match="choose 1 or more"):
        mixing(both, cell=0.0)
    with pytest.raises(PostError, match="there is no group 'c'"):
        mixing(both, groups=("a", "c"))
    with pytest.raises(PostError, match="there is only 'a'"):
        mixing(both, groups=("a",))
    assert mixing(both, Selection(frames=slice(0, 1)), cell=4.0).frames.tolist() == [0]

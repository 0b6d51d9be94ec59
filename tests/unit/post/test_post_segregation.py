"""Profiles of groups and sizes over the height and time: layers by hand, and plain loops."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_frames import frame_of, source_of
from made_up_groups import source_of_groups
from scene_parts import between_planes, make_model

from multicor_cli.post import PostError, Selection, segregation
from multicor_cli.post.sums import pseudo_values, spread

COLUMNS, ROWS = 10, 4
PLACES = np.column_stack(
    [np.arange(COLUMNS * ROWS) % COLUMNS, np.arange(COLUMNS * ROWS) // COLUMNS]
).astype(float)


def risen(frames):
    """Rows of ten discs of diameter 1: of the lowest row k discs of group b have changed places
    with discs of group a of the highest row in frame k."""
    groups = np.where(PLACES[:, 1] == 0.0, 1, 0)
    at = []
    for k in frames:
        place = PLACES.copy()
        place[:k], place[-COLUMNS : k - COLUMNS or None] = (
            PLACES[-COLUMNS : k - COLUMNS or None], PLACES[:k]
        )  # fmt: skip
        at.append(place)
    return source_of_groups(groups, at)


def test_what_rises_is_seen_in_each_row():
    counts = [0, 3, 4, 9]
    table = segregation(risen(counts), groups=("b", "a"))
    expected = np.zeros((4, ROWS))
    expected[:, 0], expected[:, -1] = 1.0 - np.array(counts) / 10.0, np.array(counts) / 10.0
    np.testing.assert_allclose(table.value, expected, atol=1e-12)
    np.testing.assert_allclose(table.area, 0.25 * np.pi * COLUMNS)
    assert (table.time.tolist(), table.y.tolist()) == ([0, 1, 2, 3], [0.5, 1.5, 2.5, 3.5])
    assert np.isnan(table.standard_error).all()  # of single frames
    assert (table.label, table.group) == ("share of b", "b")
    assert table.time_edges.tolist() == [0.0, 0.5, 1.5, 2.5, 3.0]
    assert table.y_edges.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    other = segregation(risen(counts))
    np.testing.assert_allclose(other.value, 1.0 - expected, atol=1e-12)


def test_parts_are_means_over_their_frames_with_errors():
    counts = np.random.default_rng(2).integers(1, 10, 80).tolist()
    table = segregation(risen(counts), times=2, groups=("b", "a"))
    assert table.time.tolist() == [19.5, 59.5]
    for part, half in enumerate((counts[:40], counts[40:])):
        top = np.array(half) / 10.0
        assert table.value[part, -1] == pytest.approx(top.mean())
        error = top.std(ddof=1) / np.sqrt(40)
        assert table.standard_error[part, -1] == pytest.approx(error, rel=0.35)
        # equal areas: pseudo-values are the shares themselves
        total = (top.sum() - top) / 39.0
        found = spread(pseudo_values(np.asarray(top.mean()), total)).error
        assert table.standard_error[part, -1] == pytest.approx(float(found), rel=1e-9)
        assert table.standard_error[part, 1] == 0.0
    assert [segregation(risen([0] * n)).time.size for n in (3, 15, 16, 80, 400)] == [
        3, 15, 4, 20, 40,
    ]  # fmt: skip


def area_between(y, radius, low, high, slices=4000):
    """Area of a disc between two heights, in thin slices."""
    edges = np.linspace(max(low, y - radius), min(high, y + radius), slices + 1)
    if edges[0] >= edges[-1]:
        return 0.0
    middle = 0.5 * (edges[1:] + edges[:-1]) - y
    return float((2.0 * np.sqrt(np.maximum(radius**2 - middle**2, 0.0)) * np.diff(edges)).sum())


@pytest.mark.parametrize("of", ["share", "size"])
def test_against_plain_loops(of):
    """Discs of many sizes between planes that move apart."""
    random, n = np.random.default_rng(4), 30
    radius, group = random.uniform(0.03, 0.09, n), random.integers(0, 3, n)
    model = between_planes(radius)
    model = replace(
        model, groups=("a", "b", "c"), grains=replace(model.grains, group=group.astype(np.int32))
    )
    frames = []
    for k in range(6):
        walls = np.array([[0.0, -0.02 * k, 0.0], [0.0, 0.01 * k, 0.0]])
        at = np.column_stack([random.uniform(0, 4, n), random.uniform(0.1, 0.9, n)])
        frames.append(frame_of(at, wall_position=walls))
    table = segregation(
        source_of(model, frames), Selection(frames=slice(None)), of, groups=("c", "a"), bins=5,
        times=2,
    )  # fmt: skip
    for part, rows in enumerate((frames[:3], frames[3:])):
        for bin_ in range(5):
            value = weight = 0.0
            for frame in rows:
                low, high = frame.wall_position[0, 1], 1.0 + frame.wall_position[1, 1]
                width = (high - low) / 5
                for k in range(n):
                    if group[k] == 1:
                        continue
                    y, bottom = frame.position[k, 1], low + bin_ * width
                    inside = area_between(y, radius[k], bottom, bottom + width)
                    weight += inside
                    value += inside * (2.0 * radius[k] if of == "size" else group[k] == 2)
            assert table.value[part, bin_] == pytest.approx(value / weight, rel=1e-4)
            assert table.area[part, bin_] == pytest.approx(weight / 3.0, rel=1e-4)
    assert table.walls == ("bottom", "top")


def test_where_no_grain_is_there_is_no_value():
    table = segregation(source_of_groups([0, 1], [[(0.0, 0.5), (0.0, 4.5)]]))
    np.testing.assert_array_equal(table.value, [[1.0, np.nan, np.nan, np.nan, 0.0]])


def test_what_cannot_be_is_said():
    with pytest.raises(PostError, match="mixing is one of several groups"):
        segregation(source_of(make_model([0.5]), [frame_of([(0.0, 0.5)], walls=1)]))
    one = segregation(source_of(make_model([0.5]), [frame_of([(0.0, 0.5)], walls=1)]), of="size")
    assert one.value == pytest.approx(np.array([[1.0]]))
    for wrong, text in (
        ({"groups": ("a", "c")}, "there is no group 'c'"),
        ({"of": "mass"}, "there is no profile of 'mass' against time; choose from: share, size"),
        ({"times": 3}, "2 frames cannot be parted into 3 times: choose between 1 and 2"),
        ({"bins": 0}, "0 bins"),
        ({"between": ("a", "b")}, "there is no wall 'a'"),
        ({"groups": ("c",), "of": "size"}, "there is no group 'c'"),
    ):
        with pytest.raises(PostError, match=text):
            segregation(risen([0, 1]), **wrong)

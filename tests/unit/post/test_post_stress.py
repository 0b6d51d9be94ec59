"""Stress and contacts of made-up runs against closed forms."""

import numpy as np
import pytest
from from_wall_to_wall import profile, profiles
from hypothesis import given, settings
from hypothesis import strategies as st

from multicor_cli.post import PROFILE_GROUPS, PostError, Selection, grain_map
from multicor_cli.post.bins import part_between, share_lines

ALL, LAST = Selection(start=0.0), Selection(frames=slice(-1, None))


def test_shares_of_lines_are_those_of_their_length():
    """From 0.05 to 0.35 with bins of 0.1; a level line; one that ends outside."""
    shares = share_lines(np.array([0.05, 0.25, 0.25]), np.array([0.35, 0.25, 0.85]), 0.0, 0.1, 4)
    table = np.zeros((3, 4))
    table[shares.grain, shares.bin] = shares.area
    assert table == pytest.approx(np.array([[1, 2, 2, 1], [0, 0, 6, 0], [0, 0, 0.5, 1]]) / 6.0)


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=20),
    st.floats(-2, 2),
    st.floats(0.01, 3),
)
def test_part_between_two_heights_is_the_share_of_one_bin(ends, low, width):
    start, end = (np.array(values) for values in zip(*ends, strict=True))
    shares = share_lines(start, end, low, width, 1)
    expected = np.bincount(shares.grain, shares.area, minlength=start.size)
    long = np.abs(end - start) > 1e-6  # shorter ones are decided by rounding at the edges
    found = part_between(start, end, low, low + width)
    assert found[long] == pytest.approx(expected[long], abs=1e-6)


def test_frames_without_forces_are_left_out(column, silent):
    assert profile(column, "stress-yy", ALL).frames.tolist() == [1, 2, 3, 4]
    with pytest.raises(PostError, match="no step of the mechanics was done before"):
        profile(column, "coordination", Selection(frames=slice(0, 1)))
    for of in ("stress", "coordination", "pressure"):
        with pytest.raises(PostError, match=r"contacts = true in \[output\]"):
            profiles(silent, of)
    with pytest.raises(PostError, match="were not recorded"):
        grain_map(silent, "stress")


def test_bins_by_width_and_without_the_walls(column):
    table = profile(column, "velocity", ALL, bin_width=2.0, exclude_walls=2.0)
    assert table.y == pytest.approx([0.3, 0.5, 0.7])
    assert table.width == pytest.approx(0.2)
    assert table.height == pytest.approx(1.0)
    whole = profile(column, "velocity", ALL, bins=5)
    assert table.value == pytest.approx(whole.value[1:4])
    assert table.normalized().y == pytest.approx([0.3, 0.5, 0.7])
    inner = profile(column, "stress-yy", LAST, bin_width=1.0, exclude_walls=3.0)
    outer = profile(column, "stress-yy", LAST, 10)
    assert inner.value == pytest.approx(outer.value[3:7])
    for options, message in (
        ({"exclude_walls": 5.0}, "nothing is left"), ({"exclude_walls": -1.0}, "choose 0 or more"),
        ({"bin_width": 0.0}, "cannot be 0 .* choose at least"),
        ({"bin_width": 1e-9}, "cannot be 1e-09 .* choose at least"),
    ):  # fmt: skip
        with pytest.raises(PostError, match=message):
            profile(column, "velocity", ALL, **options)


def test_groups_of_fields_come_as_one_table(column):
    found = profiles(column, "stress", ALL, 4)
    assert [table.field.name for table in found.tables] == list(PROFILE_GROUPS["stress"])
    assert len(found.headings) == len(found.rows[0]) == 10
    data, alone = found.as_dict()["fields"]["stress-yy"], profile(column, "stress-yy", ALL, 4)
    assert data["value"] == alone.value.tolist()
    one, many = profile(column, "velocity", ALL), profiles(column, "velocity", ALL)
    assert str(many.as_dict()) == str(one.as_dict())
    with pytest.raises(PostError, match="stress-xx, stress-xy"):
        profile(column, "stress")
    with pytest.raises(PostError, match="no normalized"):
        found.normalized()

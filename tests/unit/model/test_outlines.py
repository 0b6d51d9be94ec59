"""Outlines of many grains: joined, chosen and scaled as one by one."""

import numpy as np
import pytest

from multicor_cli.model.outlines import Outlines

GRAINS = [
    [(np.array([[0.0, 0.0]]), 2.0)],
    [(np.array([[-1.0, 0.0], [1.0, 0.0]]), 0.5), (np.array([[0.0, 1.0]]), 0.25)],
    [(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]]), 0.0)],
]
AREA, PERIMETER = np.array([1.0, 2.0, 6.0]), np.array([4.0, 5.0, 12.0])


def outlines(which=(0, 1, 2)):
    which = list(which)
    return Outlines.of([GRAINS[k] for k in which], AREA[which], PERIMETER[which])


def same(found, wanted):
    for a, b in zip(found, wanted, strict=True):
        assert np.array_equal(a, b)
        assert a.dtype == b.dtype


@pytest.mark.parametrize("which", [[], [1], [2, 0], [1, 1, 2, 0, 1]])
def test_chosen_grains_are_those_of_a_list(which):
    chosen = outlines().of_grains(np.array(which, np.int64))
    same(chosen, outlines(which))
    assert chosen.fit(len(which))


def test_groups_are_joined():
    parts = [outlines([1]), outlines([]), outlines([2, 0])]
    same(Outlines.joined(parts), outlines([1, 2, 0]))


def test_scaled_shapes_reach_and_cover_more():
    factor = np.array([1.0, 2.0, 3.0])
    found = outlines().scaled(factor)
    assert found.radius == pytest.approx(outlines().radius * factor)
    assert list(found.radius) == [2.0, 3.0, 12.0]
    assert list(found.area) == [1.0, 8.0, 54.0]
    assert list(found.perimeter) == [4.0, 10.0, 36.0]


def test_discs_are_discs():
    found = Outlines.of_discs(np.array([1.0, 2.0]))
    assert found.fit(2)
    assert found.is_disc.all()
    assert list(found.radius) == [1.0, 2.0]
    assert found.area == pytest.approx(np.pi * np.array([1.0, 4.0]))
    assert not outlines().is_disc[1:].any()
    assert outlines().is_disc[0]

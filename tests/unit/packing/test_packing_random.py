"""Random packings: no overlaps at any fill that is reached, clear of obstacles, reproducible,
refused where impossible."""

import re

import numpy as np
import pytest
from packing_support import generator, smallest_gap, uniform

from multicor_cli.model import ShapeKind
from multicor_cli.packing import random
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.random import random_packing
from multicor_cli.packing.sizes import disc_area, draw_to_total
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import Refused

WIDTH = 0.05


def radii(fill, low=0.8e-3, high=1.2e-3):
    return draw_to_total(uniform(low, high), disc_area, fill * WIDTH * WIDTH, generator)


def pack(radius, periodic=False, obstacles=None, separation=0.0, in_y=False):
    region = PackingRegion(0.0, 0.0, WIDTH, WIDTH, periodic, in_y)
    obstacles = Obstacles.none() if obstacles is None else obstacles
    return random_packing(radius, region, obstacles, separation, 1000, generator())


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(
    ("fill", "low"), [(0.3, 0.8e-3), (0.55, 0.8e-3), (0.75, 0.8e-3), (0.8, 0.8e-3), (0.75, 0.1e-3)]
)
def test_fill_is_reached_without_overlap(periodic, fill, low):
    radius = radii(fill, low)
    assert disc_area(radius).sum() == pytest.approx(fill * WIDTH**2, rel=2e-3)
    position = pack(radius, periodic)
    assert smallest_gap(position, radius, WIDTH if periodic else 0.0) >= -1e-9 * low
    x, y = position.T
    assert np.all((y - radius >= -1e-12) & (y + radius <= WIDTH + 1e-12))
    if periodic:
        assert np.all((x >= 0.0) & (x < WIDTH))
        assert np.any(x < radius)  # some reach across the boundary
    else:
        assert np.all((x - radius >= -1e-12) & (x + radius <= WIDTH + 1e-12))


def test_dense_packings_are_disordered_and_keep_their_separation():
    position = pack(radii(0.75), True)
    # A lattice would show a strong peak here; the structure factor of a disordered packing stays of
    # the order of one.
    k = 2 * np.pi * np.arange(1, 60) / WIDTH
    factor = np.abs(np.exp(1j * np.outer(k, position[:, 0])).sum(axis=1)) ** 2 / len(position)
    assert factor.max() < 0.05 * len(position)
    for fill, separation in ((0.3, 0.2), (0.5, 0.1)):
        radius = radii(fill)
        gap = smallest_gap(pack(radius, separation=separation), radius)
        assert gap >= separation * 2 * radius.mean() * (1 - 1e-9)


def test_obstacles_are_kept_clear_of():
    discs = np.array([[0.01, 0.01, 4e-3], [0.03, 0.035, 6e-3]])
    ends = np.array([0.01, 0.04]), np.array([0.04, 0.01])
    rows = {
        ShapeKind.CIRCLE: [[0.025, 0.025, 0.025, 0.0]],
        ShapeKind.SEGMENT: [[*ends[0], *ends[1]]],
        ShapeKind.VERTEX: [[*ends[0], -1, 1], [*ends[1], 1, -1]],
    }
    kind = np.repeat(np.array(list(rows), np.int32), [1, 1, 2])
    solid = Obstacles(kind, np.concatenate(list(rows.values()))).with_discs(discs)
    radius = radii(0.4)
    position = pack(radius, obstacles=solid)
    for x, y, r in discs:
        assert np.all(np.hypot(*(position - (x, y)).T) >= radius + r - 1e-12)
    assert np.all(np.hypot(*(position - 0.025).T) + radius <= 0.025 + 1e-12)
    along = np.clip(((position - ends[0]) @ (ends[1] - ends[0])) / (2 * 0.03**2), 0, 1)
    foot = ends[0] + along[:, None] * (ends[1] - ends[0])
    assert np.all(np.hypot(*(position - foot).T) >= radius - 1e-12)


def test_periodic_in_both_directions():
    radius = radii(0.78)
    position = pack(radius, True, in_y=True)
    images = np.concatenate([position, position + np.array([0.0, WIDTH])])
    assert smallest_gap(images, np.tile(radius, 2), WIDTH) >= -1e-9 * radius.min()
    assert np.any(position[:, 1] < radius)  # no floor


@pytest.mark.parametrize(("fill", "words"), [(0.95, "more than any packing"), (0.88, "overlap")])
def test_impossible_fill_is_refused_with_the_number_that_fits(fill, words):
    radius = radii(fill)
    with pytest.raises(Refused, match=words) as caught:
        pack(radius, True)
    fits = int(caught.value.remedy.split()[1])
    assert fits == pytest.approx(0.8 / fill * radius.size, rel=0.02)
    pack(radius[:fits], True)


def test_a_remedy_never_promises_more_grains_than_were_refused():
    for fraction in (0.7, 0.785, 0.8, 0.81, 0.9):
        words = random.refusal(622, fraction, "and so on").remedy
        assert all(int(number) < 622 for number in re.findall(r"\b\d{3}\b", words)), words

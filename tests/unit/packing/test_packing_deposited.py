"""Deposits: every grain is supported, nothing overlaps, the fill is that of the construction."""

import numpy as np
import pytest
from packing_support import (
    GRAVITY,
    built,
    generator,
    pair_gaps,
    problems,
    smallest_gap,
    uniform,
    wall,
)

from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.placing import deposit
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import Refused

WIDTH = 0.06


def drop(radius, periodic=False, discs=(), height=10.0):
    region = PackingRegion(0.0, 0.0, WIDTH, height, periodic)
    obstacles = Obstacles.none().with_discs(np.reshape(discs, (-1, 3)))
    return deposit(radius, region, obstacles, generator())


def supports(position, radius, periodic):
    """For each grain: is it on the floor, and has it contacts on its left and right, at least one
    of them below."""
    n, tolerance = radius.size, 1e-9 * radius.max()
    i, j, _ = pair_gaps(position, radius, tolerance, WIDTH if periodic else 0.0)
    a, b = np.concatenate([i, j]), np.concatenate([j, i])
    dx, dy = (position[b] - position[a]).T
    if periodic:
        dx -= WIDTH * np.round(dx / WIDTH)
    left, right, below = (np.zeros(n, bool) for _ in range(3))
    # As deposited, a grain can only be held by earlier ones.
    for found, which in ((left, dx < 0), (right, dx > 0), (below, dy < 0)):
        found[a[(b < a) & which]] = True
    if not periodic:
        left |= position[:, 0] - radius < tolerance
        right |= position[:, 0] + radius > WIDTH - tolerance
    return position[:, 1] - radius < tolerance, left & right & below


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("low", "high"), [(1e-3, 1e-3), (0.8e-3, 1.2e-3), (0.1e-3, 2e-3)])
def test_every_grain_rests_and_none_overlap(periodic, low, high):
    radius = uniform(low, high).draw(3000, generator())
    position = drop(radius, periodic)
    assert smallest_gap(position, radius, WIDTH if periodic else 0.0) > -1e-9 * 2 * low
    assert (position[:, 1] - radius).min() > -1e-15
    if not periodic:
        assert (position[:, 0] - radius).min() > -1e-15
        assert (position[:, 0] + radius).max() < WIDTH + 1e-15
    on_floor, held = supports(position, radius, periodic)
    assert np.all(on_floor | held)
    assert on_floor.sum() > 5
    surface = position[:, 1].max()
    deep = position[:, 1] < 0.8 * surface
    fill = np.pi * (radius[deep] ** 2).sum() / (WIDTH * 0.8 * surface)
    assert 0.77 < fill < 0.85


def test_second_layer_falls_on_obstacles():
    radius = np.full(300, 1e-3)
    discs = np.column_stack([np.arange(0.5, 30) * 2e-3, np.zeros(30), np.full(30, 1e-3)])
    position = drop(radius, True, discs)
    together, both = np.concatenate([discs[:, :2], position]), np.concatenate([discs[:, 2], radius])
    assert smallest_gap(together, both, WIDTH) > -1e-12
    assert position[:, 1].min() == pytest.approx(np.sqrt(3) * 1e-3, rel=1e-9)


def test_full_region_is_refused_with_the_number_that_fits():
    radius = np.full(2000, 1e-3)
    with pytest.raises(Refused, match="full with") as caught:
        drop(radius, height=0.06)
    fits = int(caught.value.what.split("full with ")[1].split()[0])
    assert 0.75 < fits * np.pi * 1e-6 / (WIDTH * 0.06) < 0.85
    position = drop(radius[:fits], height=0.06)
    assert (position[:, 1] + 1e-3).max() <= 0.06 * (1 + 1e-9)
    with pytest.raises(Refused, match="width of the region"):
        drop(np.array([0.04]))


LIDS = {
    "rough": 'kind = "rough", from = [0, 0.05], to = [0.06, 0.05], side = "right"',
    "rough, tilted": 'kind = "rough", from = [0, 0.05], to = [0.06, 0.055], side = "right"',
    "plane": 'kind = "plane", point = [0, 0.05], normal = [0, -1]',
    "polyline": 'kind = "polyline", points = [[0.01, 0.05], [0.05, 0.05]]',
    "box": 'kind = "box", min = [0, 0], max = [0.06, 0.05], open = ["left", "right", "bottom"]',
    "disc": 'kind = "disc", center = [0.03, 0.06], radius = 0.01',
    "rough disc": 'kind = "disc", center = [0.03, 0.064], radius = 0.01, rough = { kind = "list", radii = [1e-3] }',
}


def under(kind, top, count):
    """What `built` makes grains of that are deposited below a lid."""
    return {"extra": wall("lid", LIDS[kind])}, (
        "particles.0.packing.kind = 'deposited'",
        f"particles.0.region = {{ min = [0.0, 0.0], max = [0.06, {top}] }}",
        f"particles.0.count = {count}",
        GRAVITY,
        f"domain.periodic = {str(kind in ('rough', 'plane', 'box')).lower()}",
    )


@pytest.mark.parametrize("top", [0.045, 0.049, 0.0499, 0.07])
@pytest.mark.parametrize("kind", LIDS)
def test_grains_are_deposited_below_a_lid_of_every_kind(kind, top):
    """Also where the region reaches into a rough lid, or beyond it; a solid disc that lies in the
    region is piled upon."""
    lid, overrides = under(kind, top, 200)
    model, state = built(*overrides, **lid)
    assert state.position[:, 1].max() < 0.05
    assert model.grain_count == 200


@pytest.mark.parametrize("top", [0.0495, 0.05, 0.07])
def test_a_region_is_full_where_a_rough_lid_begins(top):
    lid, overrides = under("rough", top, 900)
    (problem,) = problems(*overrides, **lid)
    text, number = problem.message.split(" m with ")
    assert "full up to the rough wall above them at y = 0.048" in text
    assert number.split(" of them")[0].isdigit()

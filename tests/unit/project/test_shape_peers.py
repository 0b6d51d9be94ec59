"""The benchmarks of polygons, beside other codes and beside discs: their measures, and short runs
where the codes are."""

import os
import sys
from runpy import run_path

import numpy as np
import pytest
from benchmark_modules import benchmark_modules
from places import ROOT

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
DIAGONAL = 0.5**0.5


@pytest.fixture(scope="module", autouse=True)
def peers():
    with benchmark_modules("peers") as modules:
        yield modules


def test_center_and_inertia_of_polygons(peers):
    center, area, second = peers.polygons.center_and_gyration(SQUARE * [3.0, 2.0] + [7.0, 5.0])
    assert center == pytest.approx([8.5, 6.0])
    assert (area, second) == (pytest.approx(6.0), pytest.approx((9.0 + 4.0) / 12.0))
    angle = 2.0 * np.pi * np.arange(5) / 5.0
    pentagon = np.column_stack([np.cos(angle), np.sin(angle)])
    center, area, second = peers.polygons.center_and_gyration(pentagon)
    assert center == pytest.approx([0.0, 0.0], abs=1e-15)
    assert area == pytest.approx(2.5 * np.sin(0.4 * np.pi))
    assert second == pytest.approx((2.0 + np.cos(0.4 * np.pi)) / 6.0)


def test_overlaps_of_squares_with_each_other_floor_and_sides(peers):
    bodies = peers.polygons.Bodies([], 0.5, width=5.0)
    corners = np.array([SQUARE + at for at in ([1.0, 3.0], [1.9, 2.5], [2.95, 3.0], [4.2, -0.05])])
    turned = (SQUARE - 0.5) @ np.array([[1.0, 1.0], [-1.0, 1.0]]) * DIAGONAL + [1.5, 4.5]
    corners = np.concatenate([corners, [turned]])  # a corner of it is in the first
    found = peers.polygons.overlaps(corners, np.full(5, DIAGONAL), bodies) * DIAGONAL
    deep = 4.0 - (4.5 - DIAGONAL)
    assert np.sort(found) == pytest.approx(np.sort([0.1, 0.05, 0.2, deep]))


def test_energy_of_a_fall_is_kept_and_what_is_added_shows(peers):
    bodies, g = peers.polygons.Bodies([SQUARE + np.array([0.0, 9.5])], 0.5), peers.polygons.GRAVITY
    t = np.array([0.1, 0.2, 0.3, 0.4])
    position, velocity = np.zeros((2, 4, 1, 3))
    position[:, 0, 1], velocity[:, 0, 1] = 10.0 - 0.5 * g * t * t, -g * t
    fall = peers.polygons.describe_pour(bodies, peers.polygons.Seen(position, velocity, t))
    assert (fall.largest, fall.mean) == (0.0, 0.0)
    assert fall.made == pytest.approx(0.0, abs=1e-14)
    assert fall.kinetic == pytest.approx(0.5 * (0.4 * g) ** 2 / (g * DIAGONAL))
    assert fall.height == pytest.approx(10.0 - 0.08 * g)
    velocity[2, 0, 2] = 3.0  # turns all of a sudden
    odd = peers.polygons.describe_pour(bodies, peers.polygons.Seen(position, velocity, t))
    assert odd.made == pytest.approx(0.5 * 9.0 / 6.0 / (g * DIAGONAL))


def sliding(peers, error):
    """A run of a block whose friction is wrong by this factor."""

    def run(bodies, between, frames):
        t = between * np.arange(1, frames + 1)
        gx, gy = bodies.gravity
        a = max(0.0, gx + bodies.friction * gy) * (1.0 + error)
        position, velocity = np.zeros((2, frames, 1, 3))
        position[:, 0, 0], velocity[:, 0, 0] = 0.5 * a * t * t, a * t
        return peers.polygons.Seen(position, velocity, t)

    return run


def test_errors_on_the_slope(peers):
    slides, slips = peers.polygons.slope_errors(sliding(peers, 0.01))
    assert (slides, slips) == (pytest.approx(0.01), 0.0)


def test_the_least_thickness_is_found_by_halving(peers):
    def run(bodies, between, frames):
        inner, outer = bodies.outlines[0][:2, 0]  # of the joint on the ground
        falls = outer - inner < 1.1 * 0.10459 * peers.polygons.RADIUS
        return peers.polygons.Seen(np.full((frames, 11, 3), 0.3 * falls), None, None)

    assert peers.polygons.least_thickness(run) == pytest.approx(1.1, abs=5e-4)


def test_masonry_fills_its_rectangle(peers):
    bodies = peers.polygons.masonry(4)
    areas = [peers.polygons.center_and_gyration(brick)[1] for brick in bodies.outlines]
    assert sum(areas) == pytest.approx(4.0 * 8.0)
    corners = [brick for brick in bodies.outlines if np.ptp(brick[:, 0]) == 2.0]
    found = peers.polygons.overlaps(np.array(corners), np.ones(len(corners)), bodies)
    assert found.max(initial=0.0) < 1e-12


def test_a_block_slides_here_as_it_should(peers, tmp_path):
    def run(bodies, between, frames):
        return peers.shapes.run_ours(bodies, between, frames, 1e-2, 2e-3, tmp_path)

    slides, slips = peers.polygons.slope_errors(run)
    assert (slides, slips) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize("name", ["box2d", "lmgc90"])
def test_a_block_slides_in_other_codes(peers, name, tmp_path):
    python = os.environ.get("SHAPE_PEERS_PYTHON", sys.executable)
    peer = peers.shape_peers.find_shape_peer(name, python)
    if peer is None:
        pytest.skip(f"{name} is not installed")
    settings = {"box2d": peers.shapes.BOX2D_SETTINGS, "lmgc90": peers.shapes.LMGC90_SETTINGS}[name]
    dt, tuning = settings[0]

    def run(bodies, between, frames):
        return peer.run(bodies, between, frames, dt, tuning, tmp_path)

    slides, slips = peers.polygons.slope_errors(run)
    assert slides < 1e-3
    assert slips < 1e-3


def test_grains_beside_discs_have_their_area_and_near_pairs_are_counted():
    beside_discs = run_path(str(ROOT / "benchmarks" / "shapes" / "__main__.py"))
    discs, rods = (beside_discs["Flow"](shape, 90, 0.2, 2) for shape in ("disc", "rod 5"))
    model, state = rods.engine.model, rods.engine.state
    assert model.area.sum() == pytest.approx(discs.engine.model.area.sum(), rel=1e-9)
    width, height, tilt = state.wall_position[0]
    images = [(a * width + b * tilt, b * height) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    place, radius, near = state.position[:, :2], model.grains.radius, 0
    for i in range(90):
        for j in range(i):
            away = min(np.hypot(*(place[i] - place[j] + image)) for image in images)
            near += away - radius[i] - radius[j] < 0.3 * model.mean_diameter
    assert beside_discs["circles_near"](rods.engine) == near

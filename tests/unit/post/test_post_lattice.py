"""Images across a period and around a cell, against all images within reach."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from cells import strained
from scenarios import scenario
from scipy.linalg import expm

from multicor_cli import post
from multicor_cli.post import Selection
from multicor_cli.post.flow import d2min, deformation
from multicor_cli.post.lattice import (
    Lattice,
    lattice_of,
    leant_between,
    sheared_between,
    strains_of,
)


def test_images_across_a_period_reach_over_its_ends():
    points = np.array([[0.1, 7.0], [2.0, 0.0], [3.9, 1.0]])
    which, shift = Lattice(4.0).images(points, np.full(3, 0.2))
    found = sorted(zip(which.tolist(), shift[:, 0].tolist(), strict=True))
    assert found == [(0, 0.0), (0, 4.0), (1, 0.0), (2, -4.0), (2, 0.0)]
    assert not shift[:, 1].any()
    assert Lattice().images(np.array([[-1.0, 0.0]]), np.ones(1))[0].tolist() == [0]


@pytest.mark.parametrize("tilt", [-2.0, 0.0, 1.3])
def test_images_of_discs_and_lines_cover_the_cell(tilt):
    random, cell = np.random.default_rng(1), Lattice(4.0, 3.0, tilt)
    part = random.uniform(0.0, 1.0, (200, 2))
    points = part @ np.array([[4.0, 0.0], [tilt, 3.0]])
    radius = random.uniform(0.1, 0.5, 200)
    inside = random.uniform(0.0, 1.0, (20_000, 2)) @ np.array([[4.0, 0.0], [tilt, 3.0]])
    moves = [(a * 4.0 + b * tilt, b * 3.0) for a in range(-3, 4) for b in range(-3, 4)]

    def covered(centers, radii):
        x, y = (np.subtract.outer(inside[:, k], centers[:, k]) for k in range(2))
        return (x * x + y * y < radii**2).any(axis=1)

    which, shift = cell.images(points, radius)
    everywhere = np.any([covered(points + move, radius) for move in moves], axis=0)
    assert np.array_equal(covered(points[which] + shift, radius[which]), everywhere)
    # of lines from places in the cell: an image wherever some point of one is in the cell
    half = random.uniform(-0.4, 0.4, (200, 2))
    which, shift = cell.images(points + half, half)
    found = {(k, *np.round(move, 9)) for k, move in zip(which.tolist(), shift, strict=True)}
    along = points[:, np.newaxis] + np.linspace(0.0, 2.0, 401)[:, np.newaxis] * half[:, np.newaxis]
    for move in moves:
        y = (along[..., 1] + move[1]) / 3.0
        x = (along[..., 0] + move[0] - tilt * y) / 4.0
        meets = ((x > 0.0) & (x < 1.0) & (y > 0.0) & (y < 1.0)).any(axis=1)
        for k in np.flatnonzero(meets).tolist():
            assert (k, *np.round(move, 9)) in found
    assert len(found) < 2 * len(points)


def test_points_are_wrapped_into_the_cell():
    cell = Lattice(4.0, 3.0, 1.0)
    at = cell.wrapped(np.array([[0.2, 1.0], [0.4, 1.0], [1.2, 3.1], [6.0, -0.5]]))
    assert at == pytest.approx(np.array([[4.2, 1.0], [0.4, 1.0], [0.2, 0.1], [3.0, 2.5]]))
    assert cell.span == pytest.approx(3.0)
    assert Lattice(4.0, 10.0, 5.0).span == pytest.approx(4.0 * np.cos(np.arctan(0.5)))


# ---- How a cell is strained


@pytest.mark.parametrize("gradient", [(0.0, 0.0, 0.7), (0.1, -0.2, 0.7), (-0.3, -0.3, -0.4)])
def test_strains_are_those_of_the_sides(gradient):
    """However often the tilt goes around, and whatever the area does."""
    times = np.linspace(0.0, 12.0, 41)
    source = SimpleNamespace(series=strained((4.0, 3.0, 1.2), gradient, times))
    found = strains_of(source)
    np.testing.assert_allclose(found.strain, np.outer(times, gradient), atol=1e-12)
    xx, yy, xy = gradient
    tensor = expm(np.array([[xx, xy], [0.0, yy]]) * times[-1])
    expected = tensor[[0, 1, 0], [0, 1, 1]]
    np.testing.assert_allclose(found.stretch[-1], expected, rtol=1e-10, atol=1e-12)
    strain, _ = found.at(np.array([0.45]))
    assert strain[0] == pytest.approx(0.45 * np.array(gradient), abs=1e-12)


def test_a_cell_is_not_strained_in_frozen_stages(run):
    """Compressed, sheared, frozen for long and sheared again: what tables of the cell tell of the
    strain is what its sides say, and nothing moves beside the mean flow while nothing moves.
    """
    flow = {"xx": {"rate": 0.5}, "yy": {"rate": -0.4}, "xy": {"rate": 60.0}}
    still = {"frozen": True, "duration": 5.0, "dt": 0.5}
    found = run(scenario(
        size=[0.0125, 0.0125], periodic=["x", "y"], gravity=[0.0, 0.0], grains={"count": 30},
        materials={"glass": {"density": 2500.0, "conductivity": 1.0, "heat_capacity": 800.0,
            "young": 7e10, "poisson": 0.2}},
        walls=[], heat={}, frame_interval=2e-3, series_interval=1e-3,
        loading=[
            {"duration": 0.01, "cell": {"xx": {"rate": -2.0}, "yy": {"rate": -2.0}}},
            {"duration": 0.04, "cell": flow}, still, {"duration": 0.02, "cell": flow},
        ],
    ))  # fmt: skip
    stage, time = np.asarray(found.frames.stage), np.asarray(found.frames.time)
    moved = (stage == 1) | (stage == 3)
    chosen = Selection(frames=slice(int(np.argmax(moved)) - 1, None))
    assert sheared_between(found, time)[stage[1:] == 2].tolist() == [0.0] * 10
    whole = float(sheared_between(found, time[chosen.indices(found.frames)]).sum())
    # The first step takes its speed up: half of it is lost
    assert whole == pytest.approx(np.hypot(0.9, 60.0) * 0.06, rel=1e-2)
    table = post.diffusion(found, chosen)
    assert table.shear_rate == pytest.approx(whole / (time[-1] - 0.01))
    mean = post.rheology(found, chosen).mean
    assert mean["shear_rate"] == pytest.approx(whole / 0.06, rel=1e-3)
    assert 0.5 < mean["spin_over_flow"] < 1.5
    first, last = (found.frames[k].wall_position[0] for k in (int(np.argmax(moved)) - 1, -1))
    swell = np.log(last[0] * last[1] / (first[0] * first[1]))
    assert mean["dilation_rate"] == pytest.approx(swell / 0.06, rel=1e-9)
    standing = int(np.flatnonzero(stage == 2)[3])
    assert np.nanmax(post.grain_map(found, "d2min", standing).value) < 1e-20
    # Over all of it: the tilt has gone around several times
    before, after = found.frames[chosen.indices(found.frames)[0]], found.frames[-1]
    there = d2min(found.model, before, after, leant_between(found, before, after))
    steps = [found.frames[int(k)] for k in chosen.indices(found.frames)]
    tensor = np.eye(2)
    for one, two in pairwise(steps):
        lattices = lattice_of(found.model, one), lattice_of(found.model, two)
        tensor = deformation(*lattices, one, two, leant_between(found, one, two)) @ tensor
    assert leant_between(found, before, after) == pytest.approx(tensor[0, 1], rel=1e-6)
    assert np.isfinite(there).all()

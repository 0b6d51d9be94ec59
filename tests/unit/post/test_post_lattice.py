"""Images across a period and around a cell, against all images within reach."""

import numpy as np
import pytest

from multicor_cli.post.lattice import Lattice


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

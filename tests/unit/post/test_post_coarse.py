"""Coarse graining along branches against fine quadrature, and at points of any kind."""

import numpy as np
import pytest

from multicor_cli.post import coarse
from multicor_cli.post.coarse import CoarseGrid
from multicor_cli.post.field_sums import grid, line, polar_grid
from multicor_cli.post.lattice import Lattice

LAYER, CELL = Lattice(8.0), Lattice(8.0, 7.0, 1.5)


def quadrature(points, start, branch, reach, sides=None, nodes=3000):
    """Means of the kernel along branches at points, of all images; midpoint rule, ``(p, b)``."""
    sides, total = sides or Lattice(), 0.0
    part = (np.arange(nodes) + 0.5) / nodes
    for right in range(-2, 3) if sides.width else [0]:
        for up in range(-2, 3) if sides.height else [0]:
            move = np.array([right * sides.width + up * sides.tilt, up * sides.height])
            for at in part:
                way = points[:, np.newaxis] - (start + at * branch + move)
                q = np.minimum(np.hypot(*np.moveaxis(way, -1, 0)) / reach, 1.0)
                total = total + (1.0 + 3.0 * q) * (1.0 - q) ** 3 / nodes
    return 5.0 / (np.pi * reach**2) * total


@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-4, 0.02, 0.5, 1.9, 7.0])
def test_means_along_lines_are_those_of_a_fine_quadrature(length):
    """Lines through the point, near it, grazing the circle, with ends in and out of it, beside it."""
    across = np.concatenate([[0.0, 1e-12, 1e-6, 0.01, 0.3, 0.9, 0.999, 1.0, 1.001, 2.0]])
    along = np.concatenate([[0.0, 1e-6], np.linspace(0.1, 4.7, 24)])
    along, across = (values.ravel() for values in np.meshgrid(along, across))
    points, half = np.column_stack([along, across]), max(0.5 * length, 1e-6)
    found = coarse.mean_along(along, across, np.full(along.shape, half))
    start, branch = np.array([[-0.5 * length, 0.0]]), np.array([[length, 0.0]])
    expected = quadrature(points, start, branch, 1.0)[:, 0] / coarse.kernel_height(1.0)
    assert found == pytest.approx(expected, abs=3e-6)
    assert (found[across >= 1.0] == 0.0).all()
    mirrored = coarse.mean_along(-along, -across, np.full(along.shape, half))
    assert mirrored == pytest.approx(found, abs=1e-9)  # short lines are quotients of roundings
    assert coarse.directions(0.5 * branch)[1] == pytest.approx([half])


def test_means_along_lines_in_single_steps():
    """Against more than ten digits, where the primitive has cancellations."""
    node, weight = np.polynomial.legendre.leggauss(400)
    for half, along, across in [
        (1e-3, 0.4, 0.2),
        (0.25, 0.1, 0.3),
        (0.25, 0.6, 0.6),
        (0.9, 0.0, 0.5),
    ]:
        q = np.minimum(np.hypot(along - half * node, across), 1.0)
        expected = 0.5 * weight @ ((1.0 + 3.0 * q) * (1.0 - q) ** 3)
        found = coarse.mean_along(*(np.array([value]) for value in (along, across, half)))
        assert found == pytest.approx([expected], abs=1e-9)


def branches(count, lengths, sides=None):
    """Branches of some lengths, in all directions and along the axes, in and about a box."""
    rng = np.random.default_rng(2)
    low, high = ((0.0, 0.0), (8.0, 7.0)) if sides else ((-2.0, -2.0), (10.0, 9.0))
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    turn[: count // 4] = rng.integers(0, 4, count // 4) * 0.5 * np.pi
    length = rng.choice(lengths, count)
    way = length[:, np.newaxis] * np.column_stack([np.cos(turn), np.sin(turn)])
    return rng.uniform(low, high, (count, 2)), way


@pytest.mark.parametrize("sides", [None, LAYER, CELL])
def test_densities_along_branches_at_any_points(sides):
    points = np.random.default_rng(3).uniform((0.0, 0.5), (8.0, 6.5), (60, 2))
    start, branch = branches(25, [1e-7, 0.1, 1.0, 3.0], sides)
    found = CoarseGrid(points, 1.7, sides).densities_along(start, branch, np.eye(25))
    expected = quadrature(points, start, branch, 1.7, sides, nodes=400)
    assert found == pytest.approx(expected, abs=2e-5 * coarse.kernel_height(1.7))


# --- which sources reach which points


def of_all_pairs(points, middle, half, reach, sides):
    """The kernel, or its means along lines, of all pairs and their images, ``(p, b)``."""
    sides, total = sides or Lattice(), 0.0
    ahead, length = coarse.directions(half / reach)
    for right in range(-3, 4) if sides.width else [0]:
        for up in range(-3, 4) if sides.height else [0]:
            move = np.array([right * sides.width + up * sides.tilt, up * sides.height])
            x, y = np.moveaxis(points[:, np.newaxis] - middle - move, -1, 0) / reach
            (c, s), size = ahead.T, np.broadcast_to(length, x.shape)
            total = total + coarse.mean_along(x * c + y * s, y * c - x * s, size)
    return coarse.kernel_height(reach) * total


def places(kind, sides):
    area = sides or Lattice(8.0, 7.0)
    if kind == "mesh":
        return grid((0.0, 0.0), (8.0, area.height or 7.0), 0.45, area.slant).at
    if kind == "few":
        return grid((0.0, 0.0), (8.0, area.height or 7.0), 2.6, area.slant).at
    if kind == "polar":
        return polar_grid((4.0, 3.5), 0.0, 3.4, 0.4).at
    return line((0.3, 6.0), (7.7, 0.4), 0.1).at


@pytest.mark.parametrize("sides", [None, LAYER, CELL])
@pytest.mark.parametrize("kind", ["mesh", "few", "polar", "line"])
@pytest.mark.parametrize("reach", [0.05, 0.46, 1.7, 5.0])
def test_every_pair_counts(reach, kind, sides):
    """Branches along the axes and slanted ones, shorter than the reach and far longer."""
    points = places(kind, sides)
    start, branch = branches(60, [1e-3, 0.4, 1.0, 2.5, 6.0], sides)
    values = np.eye(60)
    found = CoarseGrid(points, reach, sides).densities_along(start, branch, values)
    middle = (sides or Lattice()).wrapped(start + 0.5 * branch)
    expected = of_all_pairs(points, middle, 0.5 * branch, reach, sides)
    assert expected.any()
    assert found == pytest.approx(expected, abs=1e-11 * coarse.kernel_height(reach))


def of_both(points, sides, reach=1.7):
    """Densities, gradients and densities along branches at points."""
    position, branch = branches(300, [0.1, 0.5, 2.0], sides)
    values, made = np.random.default_rng(5).normal(size=(300, 4)), CoarseGrid(points, reach, sides)
    along = made.densities_along(position, branch, values)
    return [*made.of_grains(position, values, slice(1, 3)), along]


@pytest.mark.parametrize("sides", [None, LAYER, CELL])
def test_a_mesh_has_the_sums_of_the_same_points_without_order(sides):
    points = places("mesh", sides)
    order = np.random.default_rng(1).permutation(len(points))
    alone = [of_both(points[[k]], sides) for k in order[:20]]
    for one, other, *single in zip(
        of_both(points, sides), of_both(points[order], sides), *alone, strict=True
    ):
        assert other == pytest.approx(one[order], abs=1e-14 * np.abs(one).max())
        assert np.concatenate(single) == pytest.approx(other[:20], abs=1e-14 * np.abs(one).max())


@pytest.mark.parametrize("changed", ["find_spec", "_SOURCES", "_TOGETHER", "_AT_ONCE"])
def test_sums_without_scipy_and_in_small_parts_are_the_same(monkeypatch, changed):
    whole = of_both(places("mesh", CELL), CELL)
    monkeypatch.setattr(coarse, changed, 7 if changed != "find_spec" else lambda _: None)
    for one, other in zip(whole, of_both(places("mesh", CELL), CELL), strict=True):
        assert other == pytest.approx(one, abs=1e-14 * np.abs(one).max())

"""Coarse graining along branches, and at the points of grids, against fine quadrature."""

import numpy as np
import pytest

from multicor_cli.post import coarse, kernel
from multicor_cli.post.coarse import CoarseGrid
from multicor_cli.post.field_sums import grid
from multicor_cli.post.lattice import Lattice

LAYER, CELL = Lattice(8.0), Lattice(8.0, 7.0, 1.5)
ALL = slice(None)


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
    found = kernel.mean_along(along, across, np.full(along.shape, half))
    start, branch = np.array([[-0.5 * length, 0.0]]), np.array([[length, 0.0]])
    expected = quadrature(points, start, branch, 1.0)[:, 0] / kernel.height(1.0)
    assert found == pytest.approx(expected, abs=3e-6)
    assert (found[across >= 1.0] == 0.0).all()
    mirrored = kernel.mean_along(-along, -across, np.full(along.shape, half))
    assert mirrored == pytest.approx(found, abs=1e-9)  # short lines are quotients of roundings
    assert kernel.directions(0.5 * branch)[1] == pytest.approx([half])


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
        found = kernel.mean_along(*(np.array([value]) for value in (along, across, half)))
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
    assert found == pytest.approx(expected, abs=2e-5 * kernel.height(1.7))


def on_mesh(sides=None, reach=1.7, spacing=0.45, frames=10**7):
    """Points of a grid, what sums at them with tables, and without."""
    pytest.importorskip("scipy")
    area = sides or Lattice(8.0, 7.0)
    points = grid((0.0, 0.0), (8.0, area.height or 7.0), spacing, area.slant)
    return points.at, *(
        CoarseGrid(points.at, reach, sides, mesh, frames) for mesh in (points.mesh, None)
    )


@pytest.mark.parametrize("sides", [None, LAYER, CELL])
@pytest.mark.parametrize("reach", [0.46, 1.7, 3.0])
def test_tables_of_branches_agree_with_the_closed_form(sides, reach):
    start, branch = branches(300, reach * np.array([1e-7, 0.1, 0.5, 1.0, 1.9]), sides)
    _, fast, exact = on_mesh(sides, reach)
    values = np.random.default_rng(5).normal(size=(300, 3))
    found = fast.densities_along(start, branch, values)
    assert fast._stencils._branches
    expected = exact.densities_along(start, branch, values)
    assert expected.any()
    assert found == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    one = np.eye(300)[:, :40]
    weight, right = (by.densities_along(start, branch, one) for by in (fast, exact))
    assert weight == pytest.approx(right, abs=2e-5 * kernel.height(reach))


def test_tables_of_branches_agree_with_a_fine_quadrature():
    start, branch = branches(40, [1e-7, 0.1, 1.0, 3.0], CELL)
    points, fast, _ = on_mesh(CELL, spacing=1.0)
    found = fast.densities_along(start, branch, np.eye(40))
    assert fast._stencils._branches
    expected = quadrature(points, start, branch, 1.7, CELL, nodes=400)
    assert found == pytest.approx(expected, abs=2e-5 * kernel.height(1.7))


@pytest.mark.parametrize("sides", [None, LAYER, CELL])
def test_grains_at_the_points_of_a_mesh(sides):
    position, _ = branches(500, [1.0], sides)
    _, fast, exact = on_mesh(sides)
    values = np.random.default_rng(6).normal(size=(500, 4))
    for found, expected in zip(
        *(by.of_grains(position, values, slice(1, 3)) for by in (fast, exact)), strict=True
    ):
        assert found.shape == expected.shape
        assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_groups_of_sources_add_up(monkeypatch):
    position, branch = branches(200, [0.5, 1.0])
    _, fast, _ = on_mesh()
    values = np.ones((200, 2))
    whole = (*fast.of_grains(position, values, ALL), fast.densities_along(position, branch, values))
    monkeypatch.setattr("multicor_cli.post.stencils._MOST", 1000)
    monkeypatch.setattr("multicor_cli.post.stencils._PER_POINT", 0)
    _, fast, _ = on_mesh()
    parts = (*fast.of_grains(position, values, ALL), fast.densities_along(position, branch, values))
    for one, other in zip(whole, parts, strict=True):
        assert one == pytest.approx(other, abs=1e-6 * np.abs(other).max())


def test_what_is_not_worth_a_table_has_none(monkeypatch):
    position, branch = branches(50, [0.5])
    values = np.ones((50, 1))
    for by in (on_mesh(frames=3)[1], on_mesh(reach=0.2)[1], on_mesh(reach=40.0, spacing=0.5)[1]):
        assert by._stencils is None
    for by, way in ((on_mesh(frames=100)[1], branch), (on_mesh()[1], 10.0 * branch)):
        by.densities_along(position, way, values)
        assert not by._stencils._branches
    beyond = grid((1.0, 0.0), (9.0, 7.0), 0.5)  # the period
    assert CoarseGrid(beyond.at, 1.7, LAYER, beyond.mesh, 100)._stencils is None
    assert CoarseGrid(beyond.at, 1.7, None, beyond.mesh, 100)._stencils is not None
    monkeypatch.setattr(coarse, "is_installed", lambda name: name != "scipy")
    assert on_mesh()[1]._stencils is None

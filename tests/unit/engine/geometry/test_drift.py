"""Bounds on how fast shapes approach: never below what happens, and independent of the height of a
sheared layer."""

import numpy as np
import pytest
from scene_parts import make_model
from scipy.spatial import cKDTree

from multicor_cli.engine.geometry.drift import Box, bound_approach, closing_gap, fit_drift
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.model.shapes import ShapeKind

NOTHING = np.empty((0, 2))  # no origin: the vectors themselves are split


def sheared(height, rng, rate=3.0, rest=0.01):
    position = np.column_stack(
        [rng.uniform(0.0, 10.0, 20 * height), rng.uniform(0.0, height, 20 * height)]
    )
    velocity = np.column_stack([rate * position[:, 1] + 7.0, np.full(len(position), -2.0)])
    return position, velocity + rng.uniform(-rest, rest, velocity.shape)


@pytest.mark.parametrize("height", [5, 500])
def test_the_bound_does_not_grow_with_the_height_of_a_layer(height):
    position, velocity = sheared(height, np.random.default_rng(1))
    drift = fit_drift(velocity, position, Box(10.0), NOTHING)
    assert drift.gradient == pytest.approx(3.0, rel=0.01)
    assert drift.rest < 0.04
    assert drift.largest == pytest.approx(np.abs(velocity).max(axis=0))


def test_a_turning_heap_is_an_affine_field_unless_x_has_no_end():
    rng = np.random.default_rng(2)
    position = rng.uniform(-1.0, 1.0, (300, 2))
    velocity = np.column_stack([-4.0 * position[:, 1], 4.0 * position[:, 0]])
    assert fit_drift(velocity, position, Box(0.0), NOTHING).rest < 1e-6
    assert fit_drift(velocity, position, Box(10.0), NOTHING).rest > 1.0


@pytest.mark.parametrize(
    "position", [np.zeros((1, 2)), np.column_stack([np.arange(9.0), np.zeros(9)])]
)
def test_one_grain_or_a_row_of_grains_has_a_fit(position):
    drift = fit_drift(np.ones_like(position), position, Box(0.0), NOTHING)
    assert drift.rest < 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_no_pair_closes_more_than_the_bound(seed):
    """Random flows of discs, some of them parts of a wall: every pair, against its own relative
    velocity."""
    rng = np.random.default_rng(seed)
    grains, discs = 60, 10
    position = rng.uniform(0.0, 1.0, (grains + discs, 2))
    velocity = (
        position @ rng.normal(size=(2, 2))
        + rng.normal(size=2)
        + 0.1 * rng.normal(size=position.shape)
    )
    world = np.column_stack([position[grains:], np.full(discs, 0.01), np.zeros(discs)])
    drift = fit_drift(velocity[:grains], position[:grains], Box(0.0), NOTHING)
    closing = bound_approach(
        np.full(discs, ShapeKind.DISC, np.int32), drift, world, velocity[grains:], np.zeros(discs)
    )
    apart = position[:, None] - position[None]
    distance = np.hypot(apart[..., 0], apart[..., 1])
    np.fill_diagonal(distance, 1.0)
    approach = -(apart * (velocity[:, None] - velocity[None])).sum(axis=2) / distance
    assert (approach <= closing.rest + closing.gradient * distance).all()
    assert (approach <= closing.disc).all()
    dt = 1e-2
    gap = distance - 0.02
    after = np.sqrt(((apart + dt * (velocity[:, None] - velocity[None])) ** 2).sum(axis=2)) - 0.02
    np.fill_diagonal(after, 1.0)
    assert not ((gap > closing_gap(closing, dt, 0.02)) & (after < 0.0)).any()


def test_planes_are_approached_along_their_normal_only():
    drift = fit_drift(np.array([[50.0, -0.25]]), np.zeros((1, 2)), Box(0.0), NOTHING)
    kind = np.array([ShapeKind.PLANE], np.int32)
    closing = bound_approach(
        kind, drift, np.array([[0.0, 0.0, 0.0, 1.0]]), np.array([[80.0, 0.5]]), np.zeros(1)
    )
    assert closing.wall == pytest.approx(0.75)


def test_a_list_stays_complete_while_a_layer_is_sheared():
    """As the layer moves on, every pair within reach is listed, and the list is not built at each
    step."""
    rng = np.random.default_rng(3)
    period, height = 40.0, 40.0
    x, y = np.meshgrid(np.arange(40.0) + 0.5, np.arange(40.0) + 0.5)
    position = np.zeros((1600, 3))
    position[:, 0], position[:, 1] = x.ravel(), y.ravel()
    model = make_model(np.full(1600, 0.49), walls=(), period=period, gravity=(0.0, 0.0))
    lists = NeighborList(model)
    reach = 0.05
    for _ in range(40):
        position[:, 0] = (position[:, 0] + 0.01 * position[:, 1]) % period
        position[:, :2] += rng.normal(size=(1600, 2)) * 2e-4
        position[:, 1] = np.clip(position[:, 1], 0.0, height)
        lists.update(scene_of(model, position, np.zeros((0, 3))), reach)
        wide = np.concatenate([position[:, :2] + (shift, 0.0) for shift in (0.0, period, -period)])
        near = {
            tuple(sorted((a % 1600, b % 1600))) for a, b in cKDTree(wide).query_pairs(0.98 + reach)
        }
        listed = {
            (i, j)
            for i in range(1600)
            for j in lists.partner[lists.row[i] : lists.row[i + 1]].tolist()
        }
        assert near <= listed
    assert lists.builds < 10

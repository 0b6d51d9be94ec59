"""What a grain passes it does not hit: flush joints of walls, points below them, other grains."""

from itertools import pairwise

import numpy as np
import pytest
from scenarios import scenario
from scene_parts import advance, make_engine, make_model

from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind

HEIGHT = 0.02  # of the floor [m]


def floor(*joints, size=0.6):
    """Lines that meet at these places [m], each a wall of its own."""
    edges = pairwise([0.0, *joints, size])
    return {
        f"line-{k}": {"kind": "polyline", "points": [[a, HEIGHT], [b, HEIGHT]]}
        for k, (a, b) in enumerate(edges)
    }


def rolling(radius, speed, walls, **said):
    """A disc that rolls without slip, from x = 0.05 m over some 0.4 m."""
    start = [[0.05, HEIGHT + radius, radius, speed, 0.0, -speed / radius]]
    given = {"friction": 0.5, "restitution": 0.9, "duration": 0.4 / speed, **said}
    return scenario("solver = { dt = 'auto' }", size=[0.6, 0.1], grains=start, walls=walls, **given)


def rolls(frame, speed, radius):
    """Whether it rolls as fast as it began."""
    assert frame.velocity[0] == pytest.approx([speed, 0.0], rel=1e-9, abs=1e-9)
    return frame.spin[0] == pytest.approx(-speed / radius, rel=1e-9)


@pytest.mark.parametrize(("radius", "speed", "restitution"), [
    (0.001, 2.0, 0.9), (0.005, 2.0, 0.9), (0.02, 2.0, 0.9),
    (0.005, 0.5, 0.0), (0.02, 0.5, 0.0), (0.02, 0.07, 0.5),
    *[pytest.param(*slow, marks=pytest.mark.reliability) for slow in (
        (0.001, 0.5, 0.0), (0.001, 0.07, 0.5), (0.005, 0.07, 0.5),
    )],
])  # fmt: skip
def test_a_disc_rolls_on_over_flush_joints(run, radius, speed, restitution):
    joints = 0.0823, 0.1317, 0.1951, 0.2123, 0.2771, 0.3533, 0.3989
    end = run(rolling(radius, speed, floor(*joints), restitution=restitution)).frames[-1]
    assert end.position[0, 1] == pytest.approx(HEIGHT + radius, abs=1e-9)
    assert rolls(end, speed, radius)


def test_it_does_where_everything_moves_with_the_floor(run):
    """Floors that run along at 1.2 m/s: the disc is as fast over them as over a whole one."""
    walls = floor(0.1123, 0.2123, 0.3123, size=0.59)
    drives = {name: {"x": {"velocity": 1.2}} for name in walls}
    moving = rolling(0.005, 2.0, walls, drives=drives, duration=0.1)
    end = run(moving).frames[-1]
    assert end.position[0, 1] == pytest.approx(HEIGHT + 0.005, abs=1e-9)
    whole = floor(size=0.59)
    drives = {name: {"x": {"velocity": 1.2}} for name in whole}
    other = run(rolling(0.005, 2.0, whole, drives=drives, duration=0.1), "whole").frames[-1]
    assert end.velocity[0] == pytest.approx(other.velocity[0], rel=1e-9, abs=1e-9)


def test_a_disc_rolls_on_over_the_edge_of_the_period(run):
    walls = floor(0.04, 0.1, size=0.16)
    given = scenario(
        "solver = { dt = 'auto' }", size=[0.16, 0.1], periodic=True, walls=walls, friction=0.5,
        grains=[[0.05, HEIGHT + 0.005, 0.005, 1.0, 0.0, -200.0]], restitution=0.9, duration=0.5,
    )  # fmt: skip
    assert rolls(run(given).frames[-1], 1.0, 0.005)


@pytest.mark.parametrize("depth", [1e-4, 2e-4, 5e-4])
def test_a_point_below_the_floor_is_not_there(run, depth):
    """A peg of another wall, whose tip is below the surface."""
    peg = {"kind": "polyline", "points": [[0.2123, 0.001], [0.2123, HEIGHT - depth]]}
    assert rolls(run(rolling(0.005, 2.0, {**floor(), "peg": peg})).frames[-1], 2.0, 0.005)


def test_a_point_above_the_floor_is(run):
    peg = {"kind": "polyline", "points": [[0.2123, 0.001], [0.2123, HEIGHT + 5e-4]]}
    end = run(rolling(0.005, 2.0, {**floor(), "peg": peg})).frames[-1]
    assert end.velocity[0, 0] < 1.9


def shot(clearance, way, phase, restitution=1.0):
    """A disc of 1 m that flies past another one at rest, by a ``way`` per step; both diameters 1.

    Returns velocities and positions at the end, after ten diameters.
    """
    model = make_model([0.5, 0.5], friction=0.3, restitution=restitution, gravity=(0.0, 0.0))
    places = [[-5.0 - phase * way, 0.0], [0.0, 1.0 + clearance]]
    engine = make_engine(model, places, [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    advance(engine, way, round(10.0 / way))
    return engine.state


def phases(way):
    """Parts of a step at which they are side by side: the more, the farther they go in one."""
    return np.linspace(0.0, 1.0, min(20, round(200.0 * way)), endpoint=False)


@pytest.mark.parametrize("clearance", [1e-6, 1e-4, 0.001, 0.01, 0.03])
@pytest.mark.parametrize("way", [0.03, 0.1, 0.3])
def test_discs_that_pass_do_not_touch(clearance, way):
    for phase in phases(way):
        state = shot(clearance, way, phase)
        assert state.velocity.tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]


@pytest.mark.parametrize("way", [0.03, 0.1, 0.3])
def test_discs_that_meet_do(way):
    """Deeper than what is left alone; without losses momentum and energy are kept."""
    for phase in phases(way):
        velocity = shot(-0.02, way, phase).velocity
        assert np.abs(velocity[1, :2]).max() > 0.01
        assert velocity[:, :2].sum(axis=0) == pytest.approx([1.0, 0.0], abs=1e-12)


def test_a_grain_passes_the_corner_of_a_wall_that_turns():
    """The tip of a blade sweeps by at 1 mm, in a frame that turns: nothing happens to the grain."""
    blade = [
        (ShapeKind.SEGMENT, 0, (0.0, 0.0, 1.0, 0.0)),
        (ShapeKind.VERTEX, 0, (1.0, 0.0, -1.0, -1.0)),
    ]
    model = make_model([0.1], blade, ("blade",), gravity=(0.0, 0.0))
    turning = WallDrive(spin=DofDrive(velocity=Constant(1.0)))
    engine = make_engine(model, [[1.101 * np.cos(0.5), 1.101 * np.sin(0.5)]], drives=[turning])
    advance(engine, 0.03, 40)
    assert engine.state.velocity.tolist() == [[0.0, 0.0, 0.0]]

"""Lines and boxes are where they are drawn: at ends, over the period, on both sides, moving."""

import math
from functools import partial

import numpy as np
import pytest
from scenarios import plane, scenario
from scene_parts import TIGHT, G, make_engine, make_model

import multicor_cli as multicor
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind
from multicor_cli.scenario import ScenarioError

case = partial(scenario, size=[0.2, 0.15], duration=0.2)
periodic = partial(case, size=[0.1, 0.1], periodic=True)
BOX = {"kind": "box", "min": [0.1, 0.0], "max": [0.12, 0.04], "open": ["top"]}


@pytest.mark.parametrize(("x", "speed", "end"), [(0.117, 0.3, 0.118), (0.123, -0.3, 0.122)])
def test_a_side_of_a_box_holds_on_both_sides(run, x, speed, end):
    """A disc thrown at a side from inside or outside stays on that side, at its radius from it."""
    walls = {"ground": plane(), "box": BOX}
    frame = run(case(grains=[[x, 0.02, 0.002, speed, 0.0]], walls=walls, gravity=[0, 0])).frames[-1]
    assert frame.position[0, 0] == pytest.approx(end, abs=2e-6)


def test_what_flies_over_the_rim_falls_beside_the_box(run):
    """It leaves at 0.5 m/s, 0.038 m above where it lands: 0.044 m farther."""
    away = 0.5 * math.sqrt(2.0 * 0.038 / G)
    start = 0.121 + 0.0025
    walls = {"ground": plane(), "box": {**BOX, "max": [0.12, 0.035]}}
    thrown, until = [[start, 0.04, 0.002, 0.5, 0.0]], {"duration": 0.0881, "dt": 1e-4}
    frame = run(case(grains=thrown, walls=walls, friction=0.0, **until)).frames[-1]
    assert frame.position[0, 0] == pytest.approx(start + away, rel=2e-3)
    assert frame.position[0, 1] == pytest.approx(0.002, abs=2e-5)


def test_grains_may_lie_outside_of_a_box(run):
    """Beside it, at its corners, on it and far above it."""
    places = [(0.0979, 0.01), (0.1221, 0.0382), (0.11, 0.0421), (0.09, 0.0021), (0.11, 0.06)]
    grains = [[*place, 0.002] for place in places]
    closed = {"box": {**BOX, "open": []}}
    frame = run(case(grains=grains, walls=closed, gravity=[0, 0], duration=0.02)).frames[-1]
    assert frame.position[:, :2] == pytest.approx(np.array(places), abs=1e-12)


SIDES = {
    side: {"kind": "polyline", "points": [[x, 0.0], [x, 0.06]]}
    for side, x in (("left", 0.09), ("right", 0.11))
}
OPEN = {"box": {"kind": "box", "min": [0.09, 0.0], "max": [0.11, 0.06], "open": ["top", "bottom"]}}


@pytest.mark.parametrize("container", [SIDES, OPEN], ids=["two lines", "box"])
def test_a_lifted_container_lets_its_grains_go(run, container):
    """A column 18 mm wide and 25 mm high spreads far wider than the container, now above it."""
    grains = [
        [0.0912 + 0.0021 * (k % 9) + 0.0007 * (k // 9 % 2), 0.0011 + 0.0021 * (k // 9), 1e-3]
        for k in range(108)
    ]
    up = {name: {"y": {"velocity": 0.3}} for name in container}
    walls = {"ground": plane(), **container}
    lifted = case(grains=grains, walls=walls, drives=up, duration=0.3, dt=2e-4)
    position = run(lifted).frames[-1].position
    assert np.ptp(position[:, 0]) > 0.06
    assert position[:, 1].max() < 0.012


def test_a_box_that_turns_and_moves_keeps_its_grains_and_keeps_others_out(run):
    walls = {"ground": plane(), "box": {"kind": "box", "min": [0.08, 0.08], "max": [0.12, 0.11]}}
    inside = [[0.085 + 0.006 * k, 0.085 + 0.006 * m, 0.002] for k in range(5) for m in range(3)]
    outside = [[0.06 + 0.01 * k, 0.13, 0.002] for k in range(8)]
    turning = {"box": {"spin": {"velocity": 10.0}, "x": {"velocity": 0.02}}}
    moving = case(grains=inside + outside, walls=walls, drives=turning, duration=0.5, dt=2e-4)
    frame = run(moving).frames[-1]
    x, y, angle = frame.wall_position[1]
    c, s = math.cos(angle), math.sin(angle)
    local = np.abs((frame.position[:, :2] - (x, y)) @ [[c, -s], [s, c]])
    depth = np.maximum(local[:, 0] - 0.02, local[:, 1] - 0.015)
    assert depth[: len(inside)].max() < -0.002 + 4e-6
    corner = np.hypot(*np.maximum(local[len(inside) :] - (0.02, 0.015), 0.0).T)
    assert corner.min() > 0.002 - 4e-6


@pytest.mark.parametrize("speed", [0.0, 3.0])
@pytest.mark.parametrize("ends", [(0.0, 0.1), (0.03, -0.07), (0.0, 0.6)])
def test_a_floor_as_wide_as_the_period_carries_grains_anywhere(run, ends, speed):
    """Also at its seam, and while it moves through the period under them."""
    places = [0.0125 * k for k in range(8)]
    floor = {"kind": "polyline", "points": [[x, 0.02] for x in ends]}
    drives, grains = {"floor": {"x": {"velocity": speed}}}, [[x, 0.03, 0.005] for x in places]
    carried = periodic(grains=grains, walls={"floor": floor}, friction=0.0, drives=drives)
    checks = {check.name: check.value for check in multicor.check_scenario(carried)}
    assert checks["grains without a floor"] == 0.0
    frame = run(carried).frames[-1]
    assert frame.position[:, 0] == pytest.approx(places, abs=1e-9)
    assert frame.position[:, 1] == pytest.approx(0.025, abs=1e-5)


RAMP = {"kind": "polyline", "points": [[0.01, 0.03], [0.09, 0.02]]}


def test_packings_keep_off_long_ramps_which_hold_grains_as_their_pieces(run):
    pieces = {**RAMP, "points": [[0.01 + 0.01 * k, 0.03 - 0.00125 * k] for k in range(9)]}
    grains, held = [[0.004 + 0.0082 * k, 0.045, 0.002] for k in range(12)], []
    for name, ramp in (("whole", RAMP), ("pieces", pieces)):
        walls = {"ground": plane(), "ramp": ramp}
        frame = run(periodic(grains=grains, walls=walls), name).frames[-1]
        held.append(int((frame.position[:, 1] > 0.015).sum()))
    assert held[0] == held[1] > 8
    position = run(periodic(grains=900, walls={"ramp": RAMP}, duration=5e-4)).frames[0].position
    x, y = position[:, 0] - 0.01, position[:, 1] - 0.03
    along = np.clip(x / 0.08, 0.0, 1.0)
    assert np.hypot(x - 0.08 * along, y + 0.01 * along).min() > 0.9e-3


@pytest.mark.parametrize("offset", [0.0, 0.3, 0.77])
@pytest.mark.parametrize("turn", [0.4, -0.7, 2.5])
def test_torques_know_which_image_of_a_grain_touches(offset, turn):
    """A beam of 0.96 periods, free to turn, is hit at its tip: it keeps angular momentum."""
    half = 0.48
    tip = np.array([half * math.cos(turn), half * math.sin(turn)])
    # Towards the grain, beyond the end
    normal = np.array([math.cos(turn + 0.9), math.sin(turn + 0.9)])
    shapes = [
        (ShapeKind.SEGMENT, 0, (-half, 0.0, 0.0, 0.0)),
        (ShapeKind.SEGMENT, 0, (0.0, 0.0, half, 0.0)),
        (ShapeKind.VERTEX, 0, (-half, 0.0, -1.0, 0.0)),
        (ShapeKind.VERTEX, 0, (half, 0.0, 1.0, -1.0)),
    ]
    model = make_model(
        [0.1], shapes, ("beam",), gravity=(0.0, 0.0), period=1.0, mass=1.0, inertia=2e-3,
        friction=0.7,
    )  # fmt: skip
    start = tip + 0.13 * normal
    engine = make_engine(
        model, [[(offset + start[0]) % 1.0, start[1], 0.0]], [[*-normal, 5.0]], settings=TIGHT,
        drives=[WallDrive(spin=DofDrive(force=Constant(0.0)))],
    )  # fmt: skip
    engine.state.wall_position[0] = offset, 0.0, turn
    mass, inertia = model.grains.mass[0], model.grains.inertia[0]
    before = inertia * 5.0 - mass * (start[0] * normal[1] - start[1] * normal[0])
    for k in range(60):
        engine.step(1e-3, 1e-3 * k)
        if engine.state.wall_velocity[0, 2] != 0.0:
            break
    position, velocity = engine.state.position[0], engine.state.velocity[0]
    away = np.array([position[0] + engine.state.image[0] - offset, position[1]])
    away[0] -= np.rint(away[0] - start[0])
    after = (
        inertia * velocity[2]
        + mass * (away[0] * velocity[1] - away[1] * velocity[0])
        + 2e-3 * engine.state.wall_velocity[0, 2]
    )
    assert abs(engine.state.wall_velocity[0, 2]) > 0.1
    # The lever is that of the middle of the step, the grain moves on for half of one.
    assert after == pytest.approx(before, rel=2e-3)


def post(x):
    return {"kind": "disc", "center": [x, 0.1], "radius": 0.04}


@pytest.mark.parametrize("disc", [post(0.05), {"kind": "cluster", "discs": [[0.05, 0.1, 0.04]]}])
def test_a_grain_that_may_touch_a_disc_and_its_image_is_refused(run, disc):
    words = "leave 0.02 m between them, less than 2 times the largest diameter of 0.022 m"
    with pytest.raises(ScenarioError, match=words):
        run(periodic(grains=[[0.0, 0.15, 0.011]], walls={"post": disc}, size=[0.1, 0.3]))


def test_a_grain_rests_on_two_discs_in_a_period_twice_as_wide(run):
    """m g/(2 cos) on each."""
    grains = [[0.0, 0.15, 0.011], [0.1, 0.15, 0.011]]
    walls = {"first": post(0.05), "second": post(0.15)}
    resting = periodic(grains=grains, walls=walls, size=[0.2, 0.3], friction=0.0, duration=0.6)
    frame, above = run(resting).frames[-1], math.sqrt(0.051**2 - 0.05**2)
    assert frame.position[:, 1] == pytest.approx(0.1 + above, abs=1e-5)
    expected = 2500.0 * math.pi * 0.011**2 * 1e-3 * G / (2.0 * above / 0.051)
    forces = np.asarray(frame.contacts.impulse)[:, 0] / frame.dt
    assert forces == pytest.approx(expected, rel=1e-3)

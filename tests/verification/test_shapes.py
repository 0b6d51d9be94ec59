"""Grains of any shape against closed forms: blocks, arches, impacts, rolling and rocking."""

from dataclasses import replace

import numpy as np
import pytest
from scene_parts import FLOOR, G, advance, book, make_engine, make_model, tally
from scipy.integrate import quad
from scipy.optimize import linprog
from shapes import (
    POINT,
    box,
    disc,
    on_slope,
    outlines_of,
    regular,
    rod,
    shaped_engine,
    shaped_model,
    wall_line,
    wall_shapes,
)

from multicor_cli.engine import Settings
from multicor_cli.model import ShapeKind

SHARP = Settings(tolerance_rms=1e-5, tolerance_max=1e-3, tolerance_energy=1e-4)


# ---- Blocks: sliding, tipping, stacks


@pytest.mark.parametrize("rounding", [0.0, 0.05])
@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_a_block_slides_where_the_slope_is_its_friction(rounding, dt):
    """tan θ = μ within 0.1 %; beyond it the acceleration is g (sin θ − μ cos θ)."""
    friction, time = 0.5, 0.5
    for factor in (0.999, 1.001):
        gravity = on_slope(factor * friction)
        block = [(box(1.0 - 2 * rounding, 0.5 - 2 * rounding), rounding)]
        model = shaped_model([block], friction=friction, gravity=gravity)
        state = advance(shaped_engine(model, [[0.0, 0.25]], settings=SHARP), dt, round(time / dt))
        slides = max(0.0, gravity[0] + friction * gravity[1]) * time
        assert state.velocity[0, 0] == pytest.approx(slides, rel=2e-3, abs=1e-9)
        assert abs(state.position[0, 2]) < 1e-9
        assert abs(book(state, "closure")) < 1e-12


@pytest.mark.parametrize("dt", [1e-2, 2e-3])
@pytest.mark.parametrize(("grain", "half", "height"), [
    ([(box(0.5, 1.0), 0.0)], 0.25, 0.5),
    ([(box(0.4, 0.9), 0.05)], 0.2, 0.5),  # it stands on the flat part
    ([(np.array([[-0.2, 0.0]]), 0.5), (np.array([[0.2, 0.0]]), 0.5)], 0.2, 0.5),
], ids=["sharp", "rounded", "two discs"])  # fmt: skip
def test_a_block_tips_where_its_weight_leaves_its_base(grain, half, height, dt):
    """tan θ = b/h within 0.1 %."""
    for factor, tips in ((0.999, False), (1.001, True)):
        gravity = on_slope(factor * half / height)
        model = shaped_model([grain], friction=0.9, gravity=gravity)
        engine = shaped_engine(model, [[0.0, height]], settings=SHARP)
        state = advance(engine, dt, round(2.5 / dt))
        turned = -state.position[0, 2]
        assert turned > 0.01 if tips else abs(turned) < 1e-4


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_blocks_overhang_as_far_as_the_harmonic_series(factor):
    """Block k from the top reaches L/(2k) beyond the one below: 0.1 % less stands, more falls."""
    count, length, height, dt = 5, 1.0, 0.2, 5e-3
    reach = np.cumsum(factor * length / (2.0 * np.arange(count, 0, -1)))
    places = np.column_stack([reach - 0.5 * length, height * (np.arange(count) + 0.5)])
    table = wall_line([[0.0, -3.0], [0.0, 0.0], [-9.0, 0.0]], kind=ShapeKind.SIDE)
    model = shaped_model([[(box(length, height), 0.0)]] * count, table, friction=0.7)
    state = advance(shaped_engine(model, places, settings=SHARP), dt, round(2.5 / dt))
    turned = np.abs(state.position[:, 2]).max()
    assert turned > 0.02 if factor > 1.0 else turned < 1e-4


# ---- Arches


def voussoirs(count, thickness):
    """Corners of equal voussoirs of a semicircular arch of mean radius 1, from the right."""
    angle = np.pi * np.arange(count + 1) / count
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    inner, outer = (1.0 - 0.5 * thickness) * ray, (1.0 + 0.5 * thickness) * ray
    return [np.array([inner[k], outer[k], outer[k + 1], inner[k + 1]]) for k in range(count)], ray


def stands(count, thickness):
    """Whether thrusts without tension balance the weights, friction without limit (Heyman 1966).

    Joints push at their two ends and shear: a linear program for three balances of each block.
    """
    blocks, ray = voussoirs(count, thickness)
    balance, weight = np.zeros((3 * count, 3 * count + 3)), np.zeros(3 * count)
    for k, corners in enumerate(blocks):
        x, y = corners.T
        cross = x * np.roll(y, -1) - y * np.roll(x, -1)
        area = cross.sum() / 2.0
        center = ((corners + np.roll(corners, -1, axis=0)) * cross[:, np.newaxis]).sum(0)
        center /= 6.0 * area
        weight[3 * k + 1] = area
        for joint, sign in ((k, 1.0), (k + 1, -1.0)):
            along, out = np.array([-ray[joint, 1], ray[joint, 0]]), ray[joint]
            pushes = [(sign * along, (1.0 - 0.5 * thickness) * out),
                      (sign * along, (1.0 + 0.5 * thickness) * out), (sign * out, out)]  # fmt: skip
            for column, (force, at) in enumerate(pushes):
                arm = at - center
                balance[3 * k : 3 * k + 3, 3 * joint + column] = (
                    *force, arm[0] * force[1] - arm[1] * force[0],
                )  # fmt: skip
    bounds = [(0.0, None), (0.0, None), (None, None)] * (count + 1)
    found = linprog(np.zeros(len(bounds)), A_eq=balance, b_eq=weight, bounds=bounds)
    return found.status == 0


def least_thickness(count):
    low, high = 0.05, 0.2
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stands(count, middle) else (middle, high)
    return high


def arch_after(count, thickness, time, dt=2e-3):
    """State of an arch on its springings, and how far neighbors have turned against each other."""
    floor = [wall_line([[side * 0.5, 0.0], [side * 1.5, 0.0]], k) for k, side in enumerate((-1, 1))]
    blocks, _ = voussoirs(count, thickness)
    grains = [[(corners, 0.0)] for corners in blocks]
    model = shaped_model(grains, wall_shapes(*floor), ("left", "right"), friction=1.0)
    engine = shaped_engine(model, outlines_of(grains)[1], settings=SHARP)
    for k in range(round(time / dt)):
        engine.step(dt, k * dt)
        if np.abs(engine.state.position[:, 2]).max() > 0.02:
            break
    angle = engine.state.position[:, 2]
    return engine.state, np.diff(angle, prepend=0.0, append=0.0)


def check_arch(count):
    """Falls at 0.99 of the least thickness, stands at 1.01; that, and the joints that open."""
    least = least_thickness(count)
    state, hinges = arch_after(count, 0.99 * least, 3.0)
    assert np.abs(state.position[:, 2]).max() > 0.02
    opened = np.flatnonzero(np.abs(hinges) > 0.1 * np.abs(hinges).max())
    state, _ = arch_after(count, 1.01 * least, 3.0)
    assert np.abs(state.position[:, 2]).max() < 1e-3
    return least, opened


def test_an_arch_falls_where_limit_analysis_says():
    """Eleven voussoirs: hinges at both springings, both haunches and, with no joint there, around
    the crown; four of the five regions would do, all open by symmetry."""
    least, opened = check_arch(11)
    assert least == pytest.approx(0.10459, rel=1e-3)
    assert opened.tolist() == [0, 2, 5, 6, 9, 11]


@pytest.mark.validation
@pytest.mark.parametrize("count", [20, 31])
def test_an_arch_of_many_voussoirs(count):
    """Milankovitch's 0.1075 for as many as one likes."""
    least, opened = check_arch(count)
    print(f"{count} voussoirs: least thickness {least:.5f} of the mean radius, joints {opened}")
    assert least == pytest.approx(0.1075, rel=0.01)


# ---- Sliding over flush joints

STEPS_OF_FLOOR = 0.7 * np.arange(-3, 8)
FLOORS = {
    "segments": wall_line(np.column_stack([STEPS_OF_FLOOR, np.zeros(11)])),
    "sides": wall_line(np.column_stack([STEPS_OF_FLOOR, np.zeros(11)])[::-1], kind=ShapeKind.SIDE),
}
SLIDERS = {
    "box": ([(box(1.0, 0.5), 0.0)], 0.25),
    "rounded box": ([(box(0.9, 0.4), 0.05)], 0.25),
    "rod": ([(rod(0.6), 0.1)], 0.1),
    "pentagon": ([(regular(5, 0.4, -0.3 * np.pi), 0.0)], 0.4 * np.cos(0.2 * np.pi)),
}


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("name", SLIDERS)
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_flush_joints_of_a_wall_stop_nothing(name, floor, friction):
    """v = v₀ − μ g t over joints as on a plane; nothing is lifted or turned."""
    grain, height = SLIDERS[name]
    dt, time, speed = 4e-3, 1.0, 3.0
    model = shaped_model([grain], FLOORS[floor], friction=friction)
    engine = shaped_engine(model, [[0.0, height]], [[speed, 0.0, 0.0]], settings=SHARP)
    state = advance(engine, dt, round(time / dt))
    slowed = speed - friction * G * time
    assert state.velocity[0, 0] == pytest.approx(slowed, rel=1e-5)
    assert state.position[0, 0] == pytest.approx(0.5 * (speed + slowed) * time, rel=1e-5)
    assert np.abs(state.velocity[0, 1:]).max() < 1e-5
    assert abs(state.position[0, 2]) < 1e-6


TILES = 9
STEPS = {"flush": 0.0, "to rounding": 1e-9, "up and down": 1e-4, "a step": 0.05}


def over_walls(step):
    """A box on boxes that are walls of their own; every other one, or all from one on, higher."""
    tops = [step * (k > 2 if step > 1e-2 else k % 2) for k in range(TILES)]
    shapes = []
    for k, top in enumerate(tops):
        x = 0.7 * (k - 1)
        around = [[x, -1.0], [x + 0.7, -1.0], [x + 0.7, top], [x, top]]
        line = wall_line(around, k, kind=ShapeKind.SIDE, is_closed=True)
        shapes = wall_shapes(shapes, line)
    names = [f"tile {k}" for k in range(TILES)]
    return [], [], shapes, names, 0.0


def over_grains(step):
    """The same on free boxes that lie side by side on a floor."""
    heights = [0.5 + step * (k > 2 if step > 1e-2 else k % 2) for k in range(TILES)]
    tiles = [[(box(0.7, height), 0.0)] for height in heights]
    places = [[0.7 * (k - 1) + 0.35, 0.5 * height, 0.0] for k, height in enumerate(heights)]
    return tiles, places, FLOOR, ("floor",), 0.5


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("floor", [over_walls, over_grains])
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_flush_joints_of_several_bodies_stop_nothing(floor, step, friction):
    """The corner of the next box is passed, unless it is higher: then it is hit."""
    tiles, places, shapes, walls, height = floor(STEPS[step])
    dt, time, speed = 2e-3, 1.0, 3.0
    grains = [[(box(1.0, 0.5), 0.0)], [(box(1.0, 1.0), 0.0)], *tiles]
    model = shaped_model(grains, shapes, walls, friction=friction)
    # The second one falls beside them
    places = [[0.0, height + 0.25 + 1e-9, 0.0], [-30.0, 50.0, 0.0], *places]
    start = np.zeros((len(grains), 3))
    start[0, 0] = speed
    engine = shaped_engine(model, places, start, settings=SHARP)
    state = advance(engine, dt, round(time / dt))
    slowed = speed - friction * G * time
    if step == "a step":
        assert state.velocity[0, 0] < 0.5 * slowed
        return
    assert state.velocity[0, 0] == pytest.approx(slowed, abs=1e-3)
    assert state.position[0, 0] == pytest.approx(0.5 * (speed + slowed) * time, abs=2e-3)
    assert abs(state.position[0, 2]) < 1e-3
    assert tally(state, "max_overlap") <= 1e-3


@pytest.mark.parametrize(("sides", "way"), [(5, 0.06), (6, 0.06), (8, 0.03), (8, 0.06)])
@pytest.mark.parametrize("start", [0.2, 0.31])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_side_that_leans_meets_no_joint_ahead(sides, way, start, friction):
    """As far up as the grain slides in a step (``way`` over its reach) is the next corner on it."""
    _, _, shapes, walls, _ = over_walls(0.0)
    reach, dt, time = 0.3, 4e-3, 0.4
    low, speed = reach * np.cos(np.pi / sides), way * reach / dt
    grain = [(regular(sides, reach, (1.0 / sides - 0.5) * np.pi), 0.0)]
    model = shaped_model([grain], shapes, walls, friction=friction)
    engine = shaped_engine(model, [[start, low, 0.0]], [[speed, 0.0, 0.0]], settings=SHARP)
    state = advance(engine, dt, round(time / dt))
    assert state.velocity[0, 0] == pytest.approx(speed - friction * G * time, abs=1e-3 * speed)
    assert tally(state, "max_overlap") <= 1e-3


@pytest.mark.parametrize("place", [(0.3, 0.1, 0.0), (0.25, 0.4, 0.4)])
@pytest.mark.parametrize("gravity", [(-3.0, -9.0), (-9.0, -3.0)])
@pytest.mark.parametrize("step", [1e-2, 2e-3])
def test_a_box_comes_to_rest_in_the_corner_of_a_line(place, gravity, step):
    """Sharp as it is: the sides hold it at the corner of the line, no way leads to behind that."""
    line = wall_line([[0.0, 2.0], [0.0, 0.0], [2.0, 0.0]])
    model = shaped_model([[(box(0.2, 0.2), 0.0)]], line, friction=0.0, gravity=gravity)
    state = advance(shaped_engine(model, [place]), step, round(2.0 / step))
    assert state.position[0] == pytest.approx([0.1, 0.1, 0.0], abs=1e-3)
    assert tally(state, "max_overlap") <= 1e-3


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("push", [1e-3, 3.0])
def test_both_ends_of_a_side_stand_in_the_corner_of_a_line(push, angle):
    """Without friction the wall bears what pushes, and both ends of the floor half of the weight."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    line = wall_line(np.array([[0.0, 2.0], [0.0, 0.0], [2.0, 0.0]]) @ turn)
    gravity = np.array([-push, -9.0]) @ turn
    model = shaped_model([[(box(0.2, 0.2), 0.0)]], line, friction=0.0, gravity=gravity)
    place = np.array([0.1, 0.1]) @ turn
    engine = shaped_engine(model, [[*place, angle]])
    state = advance(engine, 1e-3, 300)
    assert state.position[0] == pytest.approx([*place, angle], abs=1e-7)
    table = engine.contacts()
    force = table.impulse[:, 0] / (1e-3 * model.grains.mass[0])
    wall, floor = (force[table.j == shape] for shape in (1, 2))
    assert wall.sum() == pytest.approx(push, abs=1e-6)
    assert floor.sum() == pytest.approx(9.0, abs=1e-6)
    assert floor == pytest.approx([4.5, 4.5], abs=0.5 * push + 1e-6)  # the wall may turn it back


@pytest.mark.parametrize("offset", [0.0, 0.3, 0.4995])
def test_a_tip_that_meets_a_side_hits_it(offset):
    """With 2/(2/m + l²/I), off its middle too and near its end."""
    model = shaped_model([[(box(1.0, 1.0), 0.0)]] * 2, friction=0.0, gravity=(0.0, 0.0))
    places = [[0.0, 1.0, 0.25 * np.pi], [np.sqrt(0.5) + 0.5113, 1.0 + offset, 0.0]]
    start = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    state = advance(shaped_engine(model, places, start, settings=SHARP), 2e-3, 5)
    left = 1.0 - 2.0 / (2.0 + 6.0 * offset**2)
    assert state.velocity[0] == pytest.approx([left, 0.0, 0.0], abs=3e-3)
    assert state.velocity[1, 0] == pytest.approx(-left, abs=3e-3)


def test_a_disc_among_shapes_rolls_over_flush_joints():
    """A disc that starts with v₀ rolls at 2 v₀/3, at v₀ − μ g t."""
    friction, dt = 0.2, 4e-3
    other = [(box(1.0, 1.0), 0.0)]
    model = shaped_model([disc(0.3), other], FLOORS["sides"], friction=friction)
    places, start = [[0.0, 0.3], [-1.2, 0.5]], [[3.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    state = advance(shaped_engine(model, places, start, settings=SHARP), dt, 250)
    assert state.velocity[0] == pytest.approx([2.0, 0.0, -2.0 / 0.3], abs=1e-6)
    until = 1.0 / (friction * G)
    assert state.position[0, 0] == pytest.approx(2.5 * until + 2.0 * (1.0 - until), abs=1e-2)


# ---- Rolling and rocking


def rimless_wheel(sides, before=2.0, radius=1.0):
    """Slope on which a regular polygon rolls with this spin before each impact, its mean spin.

    And after how many cycles a deviation from this has gone: each keeps the same share of it.

    About a corner J = I + m R²; an impact without restitution leaves (I + m R² cos 2α)/J of the
    spin, α = π/n, and between impacts energy is kept (McGeer 1990).
    """
    model = shaped_model([[(regular(sides, radius), 0.0)]])
    mass, inertia = model.grains.mass[0], model.grains.inertia[0]
    half = np.pi / sides
    about = inertia + mass * radius**2
    kept = (inertia + mass * radius**2 * np.cos(2.0 * half)) / about
    weight = mass * G * radius
    slope = np.arcsin(before**2 * (1.0 - kept**2) * about / (4.0 * weight * np.sin(half)))

    def spin(angle):
        gained = 2.0 * weight / about * (np.cos(slope - half) - np.cos(angle + slope))
        return np.sqrt((kept * before) ** 2 + gained)

    period = quad(lambda angle: 1.0 / spin(angle), -half, half)[0]
    return slope, 2.0 * half / period, round(4.0 / (1.0 - kept**2))


def rolling_spin(sides, slope, mean, settle, dt, cycles=6):
    """Mean spin over some cycles of a polygon after those that settle it."""
    half = np.pi / sides
    gravity = on_slope(np.tan(slope), G)
    model = shaped_model([[(regular(sides, 1.0, half - 0.5 * np.pi), 0.0)]], friction=10.0,
                         gravity=gravity)  # fmt: skip
    start = [[2.0 * np.cos(half), 0.0, -2.0]]
    engine = shaped_engine(model, [[0.0, np.cos(half)]], start, settings=SHARP)
    settled = round(settle * 2.0 * half / mean / dt)
    advance(engine, dt, settled)
    first, k = engine.state.position[0, 2], settled
    target = first - 2.0 * half * cycles
    while engine.state.position[0, 2] > target:
        before = engine.state.position[0, 2]
        engine.step(dt, k * dt)
        k += 1
    part = (before - target) / (before - engine.state.position[0, 2])
    return 2.0 * half * cycles / ((k - 1 - settled + part) * dt)


@pytest.mark.parametrize("sides", [8, 12])
def test_a_polygon_rolls_as_a_rimless_wheel(sides):
    """The limit cycle to first order: an impact costs about a step."""
    slope, mean, settle = rimless_wheel(sides)
    errors = [rolling_spin(sides, slope, mean, settle, dt) / mean - 1.0 for dt in (8e-3, 2e-3)]
    print(errors)
    assert abs(errors[1]) < 0.015
    assert 2.5 < errors[0] / errors[1] < 7.0


def rocking_period(dt, angle=0.01, radius=1.0, rounding=0.1):
    """Period of a rod that rocks on a disc, and of small swings in theory."""
    shapes = [(ShapeKind.DISC, 0, (0.0, 0.0, radius, 0.0))]
    model = shaped_model([[(rod(2.0), rounding)]], shapes, friction=2.0)
    gyration = model.grains.inertia[0] / model.grains.mass[0]
    # Rolled to this side the touching point is radius * angle along its flat side
    along, out = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    center = (radius + rounding) * out + radius * angle * along
    engine = shaped_engine(model, [[*center, angle]], settings=SHARP)
    crossings, k, before = [], 0, angle
    while len(crossings) < 4:
        engine.step(dt, k * dt)
        k += 1
        now = engine.state.position[0, 2]
        if before > 0.0 >= now or before <= 0.0 < now:
            crossings.append((k - now / (now - before)) * dt)
        before = now
    rate = np.sqrt(G * (radius - rounding) / (gyration + rounding**2))
    return 2.0 * (crossings[3] - crossings[0]) / 3.0, 2.0 * np.pi / rate, engine


def test_a_rod_rocks_on_a_disc():
    """ω² = g (R − b)/(k² + b²), half its thickness b, k² = I/m; the error falls as Δt²."""
    errors = []
    for dt in (2e-2, 1e-2, 5e-3):
        period, exact, engine = rocking_period(dt)
        errors.append(period / exact - 1.0)
        assert abs(book(engine.state, "closure")) < 1e-12
    assert abs(errors[2]) < 2e-4
    assert 3.0 < (errors[1] - errors[0]) / (errors[2] - errors[1]) < 5.5


# ---- Impacts


@pytest.mark.parametrize("friction", [0.0, 10.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_rod_bounces_off_a_plane(restitution, friction):
    """Newton's law at the point that touches: p = W⁻¹ (−(1 + e) u_n, −u_t), or its normal part."""
    angle, dt, rounding = 0.6, 1e-3, 0.1
    model = shaped_model([[(rod(1.0), rounding)]], restitution=restitution, friction=friction,
                         gravity=(0.0, 0.0))  # fmt: skip
    mass, inertia = model.grains.mass[0], model.grains.inertia[0]
    lever = np.array([-0.5 * np.cos(angle), -0.5 * np.sin(angle) - rounding])
    before = np.array([0.3, -1.0, 0.4])
    places = [[0.0, -lever[1] - 0.5 * dt * before[1], angle - 0.5 * dt * before[2]]]
    engine = shaped_engine(model, places, [before], settings=SHARP)
    state = advance(engine, dt, 1)
    # Rows n = (0, 1), t = (1, 0)... of velocities at the point
    rows = np.array([[0.0, 1.0, lever[0]], [1.0, 0.0, -lever[1]]])
    masses = np.diag([1.0 / mass, 1.0 / mass, 1.0 / inertia])
    wanted = -(rows @ before) * (1.0 + restitution, 1.0)
    if friction:
        impulse = np.linalg.solve(rows @ masses @ rows.T, wanted)
        assert abs(impulse[1]) < friction * impulse[0]
    else:
        impulse = np.array([wanted[0] / (rows @ masses @ rows.T)[0, 0], 0.0])
    after = before + masses @ rows.T @ impulse
    assert state.velocity[0] == pytest.approx(after, abs=1e-9)
    assert abs(book(state, "closure")) < 1e-12
    kinetic = 0.5 * np.array([mass, mass, inertia]) @ np.array([before, after]).T ** 2
    lost = book(state, "impact_loss") + book(state, "friction_loss")
    assert kinetic[0] - kinetic[1] == pytest.approx(lost, abs=1e-12)
    if not friction:
        assert lost >= -1e-12


def test_a_dumbbell_is_struck_at_one_end():
    """p = (1 + e) v/(1/m + 1/M + l²/I) of a disc that flies into one of its two discs."""
    restitution, dt, arm = 0.6, 1e-3, 0.8
    dumbbell = [(np.array([[0.0, -arm]]), 0.3), (np.array([[0.0, arm]]), 0.3)]
    model = shaped_model([dumbbell, disc(0.2)], (), (), restitution=restitution, friction=0.0,
                         gravity=(0.0, 0.0))  # fmt: skip
    m, other = model.grains.mass
    assert m == pytest.approx(2.0 * np.pi * 0.09)
    inertia = model.grains.inertia[0]
    assert inertia == pytest.approx(m * (0.5 * 0.09 + arm**2))
    places = [[0.0, 0.0], [-0.5 - 0.5 * dt, arm]]
    state = advance(
        shaped_engine(model, places, [[0.0] * 3, [1.0, 0.0, 0.0]], settings=SHARP), dt, 1
    )
    impulse = (1.0 + restitution) / (1.0 / m + 1.0 / other + arm**2 / inertia)
    assert state.velocity[0] == pytest.approx(
        [impulse / m, 0.0, -impulse * arm / inertia], abs=1e-9
    )
    assert state.velocity[1, 0] == pytest.approx(1.0 - impulse / other, abs=1e-9)


def test_a_clump_turns_freely():
    """It keeps its velocity and its spin, and its corners go around with it."""
    grain = [(np.array([[0.0, 0.0]]), 0.3), (rod(1.0), 0.1), (box(0.3, 0.8), 0.0)]
    model = shaped_model([grain], (), (), gravity=(0.0, 0.0))
    state = advance(shaped_engine(model, [[0.0, 0.0]], [[1.0, -0.5, 3.0]]), 1e-2, 100)
    assert state.position[0] == pytest.approx([1.0, -0.5, 3.0], abs=1e-12)
    assert state.velocity[0].tolist() == [1.0, -0.5, 3.0]


def test_a_disc_laid_on_itself_rolls_as_one():
    """A clump of the same disc twice has two points where one has one: a = g sin θ/(1 + I/(m r²))."""
    gravity = on_slope(0.5)
    model = shaped_model([[(POINT, 0.5), (POINT, 0.5)]], friction=0.8, gravity=gravity)
    assert model.grains.mass[0] == pytest.approx(np.pi * 0.25)
    state = advance(shaped_engine(model, [[0.0, 0.5]], settings=SHARP), 2e-3, 200)
    speed = gravity[0] / 1.5 * 0.4
    assert state.velocity[0] == pytest.approx([speed, 0.0, -speed / 0.5], abs=1e-6)


def test_a_rebound_that_friction_wedges_makes_no_energy():
    """A dumbbell is hit in its notch by an arm of a cross: three points that nearly lock the pair.

    Newton's law would hurl them apart at 300 m/s, with a thousand times the energy that they had.
    """
    dumbbell = [([[-0.2279, -0.039]], 0.2433), ([[0.3561, 0.061]], 0.1946)]
    cross = [(box(0.591, 0.1478), 0.0), (box(0.1478, 0.591), 0.0185)]
    grains = [[(np.array(corners), r) for corners, r in grain] for grain in (dumbbell, cross)]
    model = shaped_model(grains, (), (), friction=0.8, restitution=0.4, gravity=(0.0, 0.0))
    places = [[0.0, 0.0, 2.63324], [-0.295937, -0.273013, 5.577121]]
    velocities = [[-4.047068, -5.949962, -9.042028], [0.0, 0.0, 9.100632]]
    engine = shaped_engine(model, places, velocities, settings=SHARP)
    mass, inertia = model.grains.mass, model.grains.inertia
    weight = np.column_stack([mass, mass, inertia])
    before = (0.5 * weight * engine.state.velocity**2).sum()
    engine.step(2e-3, 0.0)
    assert engine.contacts().i.size == 3
    assert 0.5 * before < (0.5 * weight * engine.state.velocity**2).sum() < before
    momentum = mass @ engine.state.velocity[:, :2]
    assert momentum == pytest.approx(mass @ np.array(velocities)[:, :2], rel=1e-12)


# ---- Discs stay what they are


def test_outlines_that_are_discs_have_the_bits_of_discs():
    """A rounded polygon with one corner: a bed that falls, rolls and bounces, bit by bit."""
    rng = np.random.default_rng(2)
    radius = rng.uniform(0.3, 0.45, 24)
    k = np.arange(24)
    places = np.column_stack([k % 8 + 0.5 + 0.05 * rng.random(24), 0.5 + 0.95 * (k // 8)])
    discs = make_model(radius, FLOOR, period=8.0, friction=0.4)
    outlines, _, _ = outlines_of([disc(r) for r in radius])
    assert outlines.is_disc.all()
    assert (outlines.radius == radius).all()
    shaped = replace(discs, outlines=outlines)
    start = rng.normal(0.0, 1.0, (24, 3))
    one = make_engine(discs, places, start)
    other = make_engine(shaped, places, start)
    for k in range(150):
        one.step(5e-3, k * 5e-3)
        other.step(5e-3, k * 5e-3)
    for name, value in one.state.as_dict().items():
        if name not in ("contact_point", "near_points"):
            assert np.array_equal(value, other.state.as_dict()[name], equal_nan=True), name


def test_a_contact_problem_is_made_of_discs_alone():
    """Its levers are those of discs."""
    engine = shaped_engine(shaped_model([[(box(0.5, 0.5), 0.0)]]), [[0.0, 0.25]])
    with pytest.raises(ValueError, match="no discs"):
        engine.next_start(1e-3, 0.0)

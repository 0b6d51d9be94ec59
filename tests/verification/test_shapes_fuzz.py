"""Bodies of all kinds, thrown together between walls of all kinds: nothing gives way."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from outline_brute import smallest_outline_gap
from scene_parts import book, copy_of, tally
from shapes import (
    box,
    convex,
    disc,
    regular,
    rod,
    scattered,
    shaped_engine,
    shaped_model,
    wall_line,
    wall_shapes,
)
from stuck import least_violation, strut

from multicor_cli.engine import Engine
from multicor_cli.engine.contact import solve
from multicor_cli.engine.motion import layout
from multicor_cli.engine.motion.drives import Constant, DofDrive, Sine, WallDrive
from multicor_cli.model import ShapeKind

PADDLE = regular(3, 1.0)


def any_grain(rng, *, clumps):
    """A disc, a rod, a sharp or rounded polygon, or a clump; about as large as a disc of 0.5."""
    kind, size = rng.integers(6 if clumps else 4), rng.uniform(0.35, 0.6)
    sides = int(rng.integers(3, 9))
    if kind == 0:
        return disc(size)
    if kind == 1:
        rounding = rng.uniform(0.1, 0.3)
        return [(rod(2.0 * (size - rounding) + 0.2), rounding)]
    if kind == 2:
        return [(convex(rng, sides, size), 0.0)]
    if kind == 3:
        return [(convex(rng, sides, 0.8 * size), 0.2 * size)]
    if kind == 4:
        ends = np.array([[-0.6 * size, 0.0]]), np.array([[0.6 * size, 0.1]])
        return [(ends[0], 0.5 * size), (ends[1], 0.4 * size)]
    return [(box(1.6 * size, 0.4 * size), 0.0), (box(0.4 * size, 1.6 * size), 0.05 * size)]


def any_scene(seed, columns=7, rows=7, threads=1, *, clumps=True, spin=0.0):
    """Grains over a funnel, a paddle that may turn and a roller, in a box whose lid presses.

    What is prescribed leaves room for the largest grain: nothing is crushed.
    """
    rng = np.random.default_rng(seed)
    count, pitch = columns * rows, 1.45
    width, height = pitch * columns, pitch * rows
    floor = -5.0
    others = [
        (ShapeKind.PLANE, 0, (0.0, floor, 0.0, 1.0)),
        (ShapeKind.PLANE, 1, (0.0, 0.0, 1.0, 0.0)),
        (ShapeKind.PLANE, 1, (width, 0.0, -1.0, 0.0)),
        (ShapeKind.DISC, 4, (0.0, 0.0, 0.5, 0.0)),
        (ShapeKind.VERTEX, 2, (8.0, -0.5, -1.0, -1.0)),
        (ShapeKind.PLANE, 5, (0.0, 0.0, 0.0, -1.0)),
    ]
    funnel = wall_line([[0.0, -0.5], [1.5, -1.0], [2.2, -1.1]], 2)
    paddle = wall_line(PADDLE, 3, kind=ShapeKind.SIDE, is_closed=True)
    shapes = wall_shapes(others, funnel, paddle)
    walls = ("floor", "sides", "funnel", "paddle", "roller", "lid")
    model = shaped_model(
        [any_grain(rng, clumps=clumps) for _ in range(count)], shapes, walls, mass=5.0, length=width,
        friction=float(rng.choice([0.0, 0.3, 0.8])), restitution=float(rng.choice([0.0, 0.0, 0.4])),
    )  # fmt: skip
    places = scattered(rng, columns, rows, pitch, 0.6)
    drives = [
        WallDrive(x=DofDrive(velocity=Sine(0.0, 1.0, 0.7)), surface=Constant(0.5)),
        WallDrive(),
        WallDrive(),
        WallDrive(spin=DofDrive(velocity=Constant(spin))),
        WallDrive(spin=DofDrive(velocity=Constant(-1.0)), surface=Constant(2.0)),
        WallDrive(y=DofDrive(force=Constant(-30.0 * width))),
    ]
    start = rng.normal(0.0, 1.0, (count, 3))
    engine = shaped_engine(model, places, start, drives=drives, threads=threads)
    engine.state.wall_position[3, :2] = 5.0, -2.2
    engine.state.wall_position[4, :2] = 8.0, -2.7
    engine.state.wall_position[5, 1] = height + 1.0
    engine.begin(engine.orders)
    return engine, (width, floor)


def run(engine, steps, first=0, dt=4e-3):
    """Largest kinetic energy of these steps."""
    most, mass = 0.0, engine.model.grains.mass[:, np.newaxis]
    for k in range(first, first + steps):
        engine.step(dt, k * dt)
        most = max(most, 0.5 * float((mass * engine.state.velocity[:, :2] ** 2).sum()))
    return most


def check(engine, room, energy):
    state, (width, floor) = engine.state, room
    assert np.isfinite(state.position).all()
    assert np.isfinite(state.velocity).all()
    assert tally(state, "max_overlap") <= 1e-3
    assert abs(book(state, "closure")) <= 1e-10 * energy
    x, y = state.position[:, :2].T
    assert ((x > 0.0) & (x < width) & (y > floor) & (y < state.wall_position[5, 1])).all()
    (px, py, angle), (rx, ry, _) = state.wall_position[3:5]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    of_paddle = (state.position[:, :2] - (px, py)) @ turn
    normals = -PADDLE[[2, 0, 1]]  # of an equilateral triangle: away from the corner across
    assert ((of_paddle @ normals.T).max(axis=1) > 0.5).all()
    assert (np.hypot(x - rx, y - ry) > 0.5).all()


def digest(state):
    return {name: np.array(value).tobytes() for name, value in state.as_dict().items()}


@pytest.mark.parametrize("seed", [0, 1, 3, 8])
def test_bodies_of_all_kinds_stay_admissible(seed):
    engine, room = any_scene(seed)
    check(engine, room, run(engine, 300))


@pytest.mark.validation
@pytest.mark.parametrize(("clumps", "dt", "scenes"), [(False, 4e-3, 26), (True, 2e-3, 26)])
def test_a_million_steps_of_grains(clumps, dt, scenes):
    """49 bodies in 26 scenes: half a million convex ones, a million with clumps.

    A step is left unsolved only where it has no solution: the roller draws grains on however wedged
    they are between it and the sides, and no impulse is enough for that.
    """
    jammed, deepest, steps = 0, 0.0, round(1.6 / dt)
    for seed in range(100, 100 + scenes):
        engine, room = any_scene(seed, clumps=clumps)
        energy = 0.0
        for k in range(steps):
            before = copy_of(engine.state)
            energy = max(energy, run(engine, 1, k, dt))
            if tally(engine.state, "unconverged_steps") > tally(before, "unconverged_steps"):
                again = Engine(engine.model, before, threads=1)
                again.resume(engine.orders)
                wedged = strut(again, dt, k * dt)
                assert len(wedged[2]) <= 8  # else it is no strut, and modes are too many to try
                assert least_violation(*wedged) > 0.01
                jammed += 1
        check(engine, room, energy)
        deepest = max(deepest, tally(engine.state, "max_overlap"))
    print(f"{jammed} of {steps * scenes} steps without a solution, overlaps up to {deepest:.1e}")
    assert jammed <= 0.01 * steps * scenes


@pytest.mark.parametrize(
    ("clumps", "dt", "seed"), [(False, 0.015, 1), (False, 0.03, 2), (True, 0.015, 2)]
)
def test_what_turns_far_in_a_step_does_not_overlap_unseen(clumps, dt, seed):
    """Grains turn by up to 0.6 rad in a step; overlaps by comparing all directions."""
    rng = np.random.default_rng(seed)
    ends = np.array([[-0.3, 0.0]]), np.array([[0.3, 0.1]])
    cross = [(box(0.9, 0.3), 0.0), (box(0.3, 0.9), 0.0)]
    kinds = [[(ends[0], 0.25), (ends[1], 0.2)], cross] if clumps else [[(regular(5, 0.5), 0.0)]]
    model = shaped_model([kinds[k % len(kinds)] for k in range(36)], friction=0.0)
    places, spin = scattered(rng, 6, 6, 1.25, 0.7), 0.6 / dt
    inwards = -3.0 * (places[:, :2] - places[:, :2].mean(axis=0))
    velocities = np.column_stack([inwards, rng.uniform(-spin, spin, 36)])
    engine, met = shaped_engine(model, places, velocities), 0
    for k in range(60):
        report = engine.step(dt, dt * k)
        met += report.contacts > 5
        worst = -smallest_outline_gap(model, engine.state, relative=True)
        assert worst <= 5e-4 * (1.0 + 1e-9)
        assert report.overlap >= worst * (1.0 - 1e-9)
    assert met > 20


@pytest.mark.parametrize("at", [1, 90, 220])
def test_a_run_that_goes_on_from_a_copy_has_the_same_bits(at):
    """A checkpoint knows which impulse belongs to which point."""
    engine, _ = any_scene(4)
    run(engine, at)
    other = Engine(engine.model, copy_of(engine.state), threads=1)
    other.resume(engine.orders)
    run(engine, 60, at)
    run(other, 60, at)
    assert engine.state.contact_i.size > 10 or at == 1
    assert digest(engine.state) == digest(other.state)


def test_threads_do_not_matter(monkeypatch):
    """Parallel sweeps and serial ones."""
    monkeypatch.setattr(layout, "PARALLEL_GRAINS", 1)
    monkeypatch.setattr(solve, "PARALLEL_FROM", 1)
    states = []
    for threads in (1, 2):
        engine, _ = any_scene(5, threads=threads)
        assert engine.threads == threads
        run(engine, 250)
        states.append(digest(engine.state))
    assert engine.state.contact_i.size > 15
    assert states[0] == states[1]


INTERPRETED = """
import json
import numpy as np
from shapes import box, disc, rod, shaped_engine, shaped_model
clump = [(rod(0.6), 0.1), (box(0.2, 0.5), 0.0)]
grains = [[(box(1.0, 0.5), 0.0)], [(rod(0.6), 0.1)], clump, disc(0.2)]
places = [[0.0, 0.25, 0.0], [0.1, 0.605, 0.02], [0.9, 0.33, 1.0], [0.35, 0.95, 0.0]]
engine = shaped_engine(shaped_model(grains, friction=0.4), places, [[1.0, 0.0, 0.0]] * 4)
for k in range(12):
    engine.step(4e-3, k * 4e-3)
assert engine.state.contact_i.size > 3
print(json.dumps([engine.state.position.tolist(), engine.state.velocity.tolist()]))
"""


def test_interpreted_kernels_agree_with_compiled_ones():
    """Elementary functions of Python differ in the last bit; it refuses what leaves an array."""
    found = []
    for variables in ({}, {"NUMBA_DISABLE_JIT": "1"}):
        given = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **variables}
        done = subprocess.run([sys.executable, "-c", INTERPRETED], env=given, capture_output=True,
                              check=True)  # fmt: skip
        found.append(np.array(json.loads(done.stdout)))
    assert found[0] == pytest.approx(found[1], abs=1e-9)

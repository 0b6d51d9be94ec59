"""Walls whose surface runs along them: closed forms, and walls that move in earnest beside them."""

from dataclasses import replace

import numpy as np
import pytest
from scene_parts import (
    FLOOR,
    SPEED,
    TIGHT,
    G,
    advance,
    bed,
    begin,
    book,
    make_engine,
    make_model,
    running,
    surface_engine,
)

from multicor_cli.engine import Settings, solve_contacts
from multicor_cli.engine.motion.drives import Constant, DofDrive, Ramp, Sine, WallDrive
from multicor_cli.model import ShapeKind


def started(engine, *speeds):
    """The engine with surfaces that have always run."""
    engine.state.wall_surface = np.array(speeds)
    return engine


@pytest.mark.parametrize("shape", ["disc", "sphere"])
@pytest.mark.parametrize("dt", [1e-2, 3.7e-3, 1e-3])
def test_a_grain_put_on_a_belt_slides_and_then_rolls(shape, dt):
    """v = μ g t until it sticks at V/(1 + m a²/I), V/3 or (sphere) 2V/7; half the work is heat."""
    model = make_model([1.0], FLOOR, friction=0.3, shape=shape)
    engine = started(make_engine(model, [[0.0, 1.0]], settings=TIGHT, drives=[running()]), SPEED)
    early = int(0.5 * SPEED / (0.3 * G * (1.0 + model.shape_factor)) / dt)
    state = advance(engine, dt, early)
    assert state.velocity[0, 0] == pytest.approx(0.3 * G * dt * early, rel=1e-12)
    state = advance(engine, dt, int(0.3 / dt))
    assert state.velocity[0, 0] == pytest.approx(SPEED / (1.0 + model.shape_factor), abs=1e-12)
    assert state.velocity[0, 0] + state.velocity[0, 2] == pytest.approx(SPEED, abs=1e-12)
    assert state.wall_position[0].tolist() == [0.0, 0.0, 0.0]
    assert state.wall_surface.tolist() == [SPEED]
    energy = 0.5 * model.grains.mass[0] * SPEED**2 / (1.0 + model.shape_factor)
    assert book(state, "friction_loss") == pytest.approx(energy, rel=1e-12)
    assert book(state, "kinetic") == pytest.approx(energy, rel=1e-12)
    assert book(state, "wall_work") == pytest.approx(2.0 * energy, rel=1e-12)
    assert book(state, "closure") < 1e-13


def test_a_surface_that_begins_to_run_has_its_speed_at_the_end_of_the_first_step():
    """V⁻ is that of the step before, as of all drives: the mean slip in the first step is −½V."""
    model = make_model([1.0], FLOOR, friction=0.01)
    engine = make_engine(model, [[0.0, 1.0]], settings=TIGHT, drives=[running()])
    engine.step(1e-3, 0.0)
    impulse = engine.contacts().impulse[0, 1]
    assert impulse == pytest.approx(-0.01 * model.grains.mass[0] * G * 1e-3, rel=1e-12)
    assert book(engine.state, "wall_work") == pytest.approx(-impulse * 0.5 * SPEED, rel=1e-12)
    assert engine.contacts().slip[0] == pytest.approx(SPEED, rel=1e-3)


def test_a_belt_carries_up_what_friction_holds_and_both_its_sides_run():
    """On a segment inclined by 20°, solid on both sides: to the right above it, to the left below
    it (μ > tan 20°, no spin: three discs glued by rolling resistance beyond all they can do)."""
    slope = np.radians(20.0)
    segment = [(ShapeKind.SEGMENT, 0, (-50.0, 0.0, 50.0, 0.0))]
    for side in (1.0, -1.0):
        gravity = (-G * np.sin(slope), -side * G * np.cos(slope))
        model = make_model([0.1], segment, friction=0.6, gravity=gravity, rolling=50.0)
        engine = make_engine(model, [[0.0, side * 0.1]], settings=TIGHT, drives=[running()])
        state = advance(engine, 1e-3, 1500)
        assert state.velocity[0, 0] == pytest.approx(side * SPEED, abs=1e-9)
        assert book(state, "closure") < 1e-12


def same_ends(model, positions, moving, run, steps=200, error=1e-7, place=None):
    """States after steps with a last wall that moves, and with one whose surface runs: the same
    motion and books."""
    ends = []
    for drive in (moving, run):
        drives = [WallDrive()] * (model.wall_count - 1) + [drive]
        engine = make_engine(model, positions, settings=TIGHT, drives=drives)
        if place is not None:
            engine.state.wall_position[-1] = place
        ends.append(advance(engine, 2e-3, steps))
        assert book(engine.state, "closure") < 1e-12
    moved, ran = ends
    assert np.allclose(ran.position, moved.position, atol=0.1 * error)
    for name in ("wall_work", "load_work", "friction_loss", "impact_loss", "friction_sliding"):
        assert book(ran, name) == pytest.approx(book(moved, name), rel=error), name
    return ends


LAWS = [
    {"friction": 0.5},
    {"friction": 0.4, "restitution": 0.4, "rolling": 0.1},
    {"friction": 0.6, "adhesion": 0.3, "shape": "sphere"},
    {"table": ([0.0, 0.5, 2.0], [0.6, 0.4, 0.1])},
]


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("signal", [Constant(SPEED), Ramp(0.0, 2.0, 0.2), Sine(0.3, 1.0, 0.15)])
def test_a_plane_whose_surface_runs_is_one_that_moves_along_itself(laws, signal):
    """The same motion, forces, work of the wall and heat up to rounding, whatever the law."""
    model, positions = bed(**laws)
    moved, ran = same_ends(
        model, positions, WallDrive(x=DofDrive(velocity=signal)), running(signal)
    )
    assert np.allclose(ran.velocity, moved.velocity, atol=1e-6)
    assert np.allclose(ran.window_wall_impulse[0, :2], moved.window_wall_impulse[0, :2], rtol=1e-7)
    assert ran.wall_position[0, 0] == 0.0


def in_a_circle(rolling=0.0):
    rng = np.random.default_rng(4)
    radius = rng.uniform(0.15, 0.22, 30)
    k = np.arange(30)
    positions = np.column_stack([(k % 6) * 0.5 - 1.25, (k // 6) * 0.5 - 1.75])
    circle = [(ShapeKind.CIRCLE, 0, (0.0, 0.0, 2.5, 0.0))]
    laws = {"friction": 0.4, "restitution": 0.2, "rolling": rolling}
    return make_model(radius, circle, mass=40.0, inertia=250.0, **laws), positions


@pytest.mark.parametrize("rolling", [0.0, 0.05])
def test_a_circle_whose_surface_runs_is_a_drum_that_turns(rolling):
    """V = Ω R of a drum, counter-clockwise; rolling resistance too, as its material turns."""
    model, positions = in_a_circle(rolling)
    turning = WallDrive(spin=DofDrive(velocity=Constant(0.6)))
    turned, ran = same_ends(model, positions, turning, running(0.6 * 2.5), steps=120)
    assert book(ran, "friction_loss") > 0.0
    assert np.allclose(ran.window_wall_impulse, turned.window_wall_impulse, rtol=1e-6, atol=1e-9)
    assert ran.wall_position[0, 2] == 0.0


@pytest.mark.parametrize("rolling", [0.0, 0.05])
def test_a_roll_that_is_pressed_down_is_one_that_turns_and_feels_the_reaction(rolling):
    """A disc driven by a force in y and held in x: diagonal contacts of the floor, general ones of
    the roll. Its surface runs clockwise, as Ω = −V/R."""
    shapes = [*FLOOR, (ShapeKind.DISC, 1, (0.0, 0.0, 0.8, 0.0))]
    model, positions = bed(friction=0.4)
    model = make_model(
        model.grains.radius, shapes, ("floor", "roll"), friction=0.4, period=model.period, mass=3.0,
        inertia=1.0, wall_gravity=True, rolling=rolling,
    )  # fmt: skip
    press = DofDrive(force=Constant(-20.0), damping=1.0)
    turning = WallDrive(y=press, spin=DofDrive(velocity=Constant(-SPEED / 0.8)))
    drives = turning, running(SPEED, y=press)
    turned, ran = same_ends(model, positions, *drives, 300, 1e-6, (4.0, 3.9, 0.0))
    assert ran.wall_position[1, 1] < 3.88
    assert ran.wall_position[1, :2] == pytest.approx(turned.wall_position[1, :2], abs=1e-8)
    assert abs(ran.window_wall_impulse[1, 2]) > 1e-2  # the torque of friction
    assert np.allclose(ran.window_wall_impulse, turned.window_wall_impulse, rtol=1e-5, atol=1e-7)


def test_a_free_plate_under_a_running_surface_recoils():
    """Without gravity, between two equal grains: momentum is that of the press alone, 0 in x."""
    model = make_model([0.1], FLOOR, friction=0.3, mass=0.2, inertia=1.0)
    drive = running(SPEED, x=DofDrive(force=Constant(0.0)))
    engine = started(make_engine(model, [[0.0, 0.1]], settings=TIGHT, drives=[drive]), SPEED)
    state = advance(engine, 1e-3, 400)
    mass = model.grains.mass[0]
    assert mass * state.velocity[0, 0] == pytest.approx(-0.2 * state.wall_velocity[0, 0], rel=1e-10)
    # Sticking: v + a ω = V_x + V, with a ω = β v.
    stuck = state.velocity[0, 0] * (1.0 + model.shape_factor) - state.wall_velocity[0, 0]
    assert stuck == pytest.approx(SPEED, rel=1e-10)
    assert book(state, "closure") < 1e-13


def test_it_adds_to_the_motion_of_the_wall():
    """A belt that also moves and turns: V at the contact is that of the body and V_s."""
    model = make_model([0.2], FLOOR, friction=5.0, rolling=50.0)  # no spin: it is carried
    drive = running(SPEED, x=DofDrive(velocity=Constant(-0.4)))
    state = advance(make_engine(model, [[0.0, 0.2]], settings=TIGHT, drives=[drive]), 1e-3, 300)
    assert state.velocity[0, 0] == pytest.approx(SPEED - 0.4, abs=1e-9)


@pytest.mark.parametrize(
    "settings",
    [Settings(max_sweeps=15), Settings(method="gauss-seidel"), Settings(local="bipotential")],
)
def test_books_close_whatever_the_solver_does(settings):
    state = advance(surface_engine(settings, restitution=0.3, rolling=0.2), 2e-3, 200)
    assert book(state, "closure") < 1e-12
    assert book(state, "friction_loss") > 0.0


def test_the_problem_of_a_step_knows_it(tmp_path):
    """`solve_contacts` finds the engine's impulses, from the problem and from its file."""
    engine = surface_engine(TIGHT)
    advance(engine, 2e-3, 240)
    problem, start = engine.next_start(2e-3, 0.48)
    assert np.unique(problem.slide).tolist() == [-SPEED, 0.0, 0.5 * SPEED]
    problem.save(tmp_path / "problem.npz")
    solution = solve_contacts(type(problem).load(tmp_path / "problem.npz"), TIGHT, start=start)
    engine.step(2e-3, 0.48)
    impulse, velocity = engine.contacts().carrying().impulse, engine.state.velocity[:, 0]
    found = solution.impulse[solution.impulse[:, 0] > 0.0]
    assert found == pytest.approx(impulse, abs=1e-9 * np.abs(impulse).max())
    assert solution.velocity[: len(velocity), 0] == pytest.approx(velocity, abs=1e-8)


def test_the_light_form_of_a_problem_knows_it():
    """A disc on a fixed body, whose surface runs: the form with anchors, and the general one."""
    model = make_model([0.5], FLOOR, friction=0.3)
    engine = make_engine(model, [[0.0, 0.5]], settings=TIGHT, drives=[running()])
    problem, _ = engine.next_start(1e-2, 0.0)
    light = solve_contacts(problem, TIGHT)
    movable = np.where(problem.inverse_mass > 0.0, problem.inverse_mass, 1e-30)
    heavy = solve_contacts(replace(problem, inverse_mass=movable), TIGHT)
    assert light.impulse[0, 1] == pytest.approx(-0.3 * light.impulse[0, 0], rel=1e-12)
    assert heavy.impulse == pytest.approx(light.impulse, rel=1e-9)


def test_a_drive_that_ends_leaves_the_surface_to_slow_down_within_a_step():
    model = make_model([1.0], FLOOR, friction=0.3)
    engine = make_engine(model, [[0.0, 1.0]], drives=[running()])
    advance(engine, 1e-3, 10)
    begin(engine, drives=[WallDrive()])
    engine.step(1e-3, 0.0)
    assert engine.state.wall_surface.tolist() == [0.0]
    assert book(engine.state, "closure") < 1e-13

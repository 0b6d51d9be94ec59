"""Walls that follow positions, bear stresses and hang on springs, against closed forms."""

import math

import numpy as np
import pytest
from scene_parts import FLOOR, TIGHT, advance, begin, book, make_engine, make_model, tally

from multicor_cli.engine.motion.drives import (
    Constant,
    DofDrive,
    Interpolated,
    Ramp,
    Shifted,
    Sine,
    Spring,
    WallDrive,
)
from multicor_cli.model import ShapeKind

LID = [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, -1.0))]
FAR = [[0.0, -5.0]]
"""A grain that the lid never meets."""


def free_wall(**keys):
    return make_model([0.1], LID, ("lid",), gravity=(0.0, 0.0), **keys)


def positions(signal, dt, steps):
    """Positions and velocities of a wall after each step, and the state at the end."""
    engine = make_engine(free_wall(), FAR, drives=[WallDrive(y=DofDrive(position=signal))])
    engine.state.wall_position[0, 1] = 0.7
    begin(engine, drives=[WallDrive(y=DofDrive(position=signal))])
    found = []
    for k in range(steps):
        engine.step(dt, k * dt)
        found.append((engine.state.wall_position[0, 1] - 0.7, engine.state.wall_velocity[0, 1]))
    return np.array(found), engine.state


def test_a_position_is_met_to_rounding_and_its_velocity_to_second_order():
    """10⁴ steps of a sine: 100 periods, without drift or oscillation."""
    errors = []
    for steps in (5_000, 10_000):
        dt, signal = 10.0 / steps, Sine(0.0, 1e-3, 0.1)
        found, state = positions(signal, dt, steps)
        t = dt * np.arange(1, steps + 1)
        assert np.abs(found[:, 0] - [signal.value(x) for x in t]).max() < 4.0 * np.spacing(0.7)
        exact = 1e-3 * 20.0 * math.pi * np.cos(20.0 * math.pi * t)
        early, late = (
            np.abs(found[part, 1] - exact[part]).max()
            for part in (slice(0, 500), slice(-500, None))
        )
        assert late == pytest.approx(early, rel=1e-3)
        errors.append(late)
        assert book(state, "closure") < 1e-12
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("corner", [0.1, 0.1037])  # at the end of a step, and within one
def test_corners_leave_no_oscillation_behind(corner):
    for signal in (Ramp(0.0, 0.02, corner), Interpolated((0.0, corner, 0.2), (0.0, 0.02, 0.02))):
        found, _ = positions(signal, 0.01, 20)
        assert found[:, 0] == pytest.approx(
            [signal.value(0.01 * k) for k in range(1, 21)], abs=1e-15
        )
        assert np.abs(found[13:, 1]).max() < 1e-12
        assert np.abs(found[:9, 1] - 0.02 / corner).max() < 1e-12 + 0.02 / corner * 0.01


def test_a_kept_position_goes_on_and_one_named_again_starts_where_the_wall_is():
    dt, signal = 1e-3, Ramp(0.0, 0.3, 1.0)
    engine = make_engine(free_wall(), FAR, drives=[WallDrive(spin=DofDrive(position=signal))])
    state = advance(engine, dt, 100)
    assert state.wall_position[0, 2] == pytest.approx(0.03, rel=1e-12)
    begin(engine, drives=[WallDrive(spin=DofDrive(position=Shifted(signal, 0.1), is_kept=True))])
    advance(engine, dt, 100)
    assert state.wall_position[0, 2] == pytest.approx(0.06, rel=1e-12)
    begin(engine, drives=[WallDrive(spin=DofDrive(position=signal))])
    advance(engine, dt, 50)
    assert state.wall_position[0, 2] == pytest.approx(0.075, rel=1e-12)
    begin(engine, drives=[WallDrive()])
    assert state.wall_origin.size == 0


def test_a_grain_rides_on_a_shaking_floor():
    """Below g nothing leaves the floor: the grain goes where the floor goes, and the floor does the
    work."""
    signal, dt = Sine(0.0, 1e-3, 0.1), 1e-4
    model = make_model([1e-2], FLOOR, density=2500.0)
    engine = make_engine(model, [[0.0, 1e-2]], drives=[WallDrive(y=DofDrive(position=signal))])
    state = engine.state
    for k in range(5_000):
        engine.step(dt, k * dt)
        if k > 20:
            assert abs(state.position[0, 1] - 1e-2 - state.wall_position[0, 1]) < 6e-4 * 1e-2
    assert tally(state, "max_overlap") < 1e-3
    assert book(state, "closure") < 1e-12
    gained = book(state, "kinetic") + model.grains.mass[0] * 9.81 * (state.position[0, 1] - 1e-2)
    assert gained == pytest.approx(
        book(state, "wall_work") - book(state, "friction_loss") - book(state, "impact_loss"),
        rel=1e-9,
    )


def test_a_spring_swings_with_its_period_and_keeps_its_energy():
    """M ü = −k (u − u₀): u = u₀ (1 − cos ωt); kinetic and elastic energy add up to ½ k u₀² at any
    step."""
    errors = []
    for dt in (0.02, 0.01, 0.005):
        drive = WallDrive(y=DofDrive(spring=Spring(8.0, Constant(0.3))))
        engine = make_engine(free_wall(mass=2.0), FAR, drives=[drive])
        state = engine.state
        for k in range(round(10.0 / dt)):
            engine.step(dt, k * dt)
            elastic = 0.5 * 8.0 * (state.wall_position[0, 1] - 0.3) ** 2
            assert book(state, "kinetic") + elastic == pytest.approx(0.36, rel=1e-11)
            assert book(state, "load_work") == pytest.approx(0.36 - elastic, rel=1e-11, abs=1e-12)
        assert book(state, "closure") < 1e-12
        errors.append(abs(state.wall_position[0, 1] - 0.3 * (1.0 - math.cos(20.0))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.05)


def test_any_stiffness_is_stable():
    """k Δt²/M = 10⁶: the swing is not resolved, its energy stays."""
    drive = WallDrive(x=DofDrive(spring=Spring(2e8, Constant(0.0)), force=Constant(1.0)))
    engine = make_engine(free_wall(mass=2.0), FAR, drives=[drive])
    engine.state.wall_velocity[0, 0] = 1.0
    state = advance(engine, 0.1, 2_000)
    potential = 1e8 * state.wall_position[0, 0] ** 2 - state.wall_position[0, 0]
    assert book(state, "kinetic") + potential == pytest.approx(1.0, rel=1e-9)


def test_a_damped_spring_comes_to_rest_as_it_should():
    """J θ̈ + c θ̇ + k θ = T: a torsional one, from rest; second order in Δt."""
    k, c, inertia, torque = 3.0, 0.8, 0.5, 0.6
    rate = 0.5 * c / inertia
    swing = math.sqrt(k / inertia - rate * rate)
    exact = (
        torque
        / k
        * (
            1.0
            - math.exp(-2.0 * rate) * (math.cos(2.0 * swing) + rate / swing * math.sin(2.0 * swing))
        )
    )
    errors = []
    for dt in (0.02, 0.01):
        drive = WallDrive(
            spin=DofDrive(spring=Spring(k, Constant(0.0)), force=Constant(torque), damping=c)
        )
        state = advance(
            make_engine(free_wall(inertia=inertia), FAR, drives=[drive]), dt, round(2.0 / dt)
        )
        errors.append(abs(state.wall_position[0, 2] - exact))
        assert book(state, "closure") < 1e-12
        assert book(state, "damping_loss") > 0.0
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_a_slider_that_a_spring_pulls_sticks_and_slips():
    """A lid on a disc that may not roll: it sticks until k v t = μ N, then u̇ = v (1 − cos ωτ),
    with ω² = k/M."""
    shapes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    k, speed, press, friction, mass = 50.0, 0.1, 10.0, 0.3, 2.0
    model = make_model(
        [0.05], shapes, ("floor", "lid"), friction=friction, rolling=10.0, mass=mass,
        gravity=(0.0, 0.0), density=1.0
    )  # fmt: skip
    pull = DofDrive(spring=Spring(k, Ramp(0.0, 100.0 * speed, 100.0)))
    engine = make_engine(
        model,
        [[0.0, 0.05]],
        drives=[WallDrive(), WallDrive(x=pull, y=DofDrive(force=Constant(-press)))],
        settings=TIGHT,
    )
    state = engine.state
    state.wall_position[1, 1] = 0.1
    dt, swing, start = 1e-3, math.sqrt(k / mass), friction * press / (k * speed)
    for step in range(round((start + 4.0 * math.pi / swing) / dt)):
        engine.step(dt, step * dt)
        tau = (step + 1) * dt - start
        exact = speed * (tau - math.sin(swing * tau) / swing) if tau > 0.0 else 0.0
        assert state.wall_position[1, 0] == pytest.approx(exact, abs=2.0 * speed * dt)
    assert book(state, "closure") < 1e-10


def test_work_of_a_spring_on_corrected_positions_is_booked():
    """Overlaps are pushed apart against a spring: what is lifted has its energy."""
    shapes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    model = make_model([0.5], shapes, ("floor", "lid"), mass=1e-3, gravity=(0.0, 0.0))
    engine = make_engine(model, [[0.0, 0.499]])
    state = engine.state
    state.wall_position[1, 1] = 0.998
    begin(engine, drives=[WallDrive(), WallDrive(y=DofDrive(spring=Spring(1e3, Constant(-0.01))))])
    engine.step(1e-4, 0.0)
    assert tally(state, "corrected_steps") == 1.0
    shift = state.wall_position[1, 1] - 0.998
    assert shift > 1e-3
    elastic = 500.0 * ((shift + 0.01) ** 2 - 0.01**2)
    assert book(state, "load_work") == pytest.approx(-elastic, rel=1e-9)
    assert book(state, "closure") < 1e-12


def stressed(drive, lid=0.0):
    """A side wall under a stress between floor and lid, 3 m apart at first, and the lid's
    velocity."""
    shapes = [
        *FLOOR,
        (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0)),
        (ShapeKind.PLANE, 2, (0.0, 0.0, 1.0, 0.0)),
    ]
    model = make_model(
        [0.1], shapes, ("floor", "lid", "side"), gravity=(0.0, 0.0), mass=2.0, length=5.0
    )
    engine = make_engine(model, [[9.0, 1.0]])
    engine.state.wall_position[1, 1] = 3.0
    engine.state.wall_velocity[1, 1] = lid
    begin(
        engine,
        drives=[WallDrive(), WallDrive(y=DofDrive(velocity=Constant(lid))), WallDrive(x=drive)],
    )
    return engine


def test_a_stress_acts_on_the_distance_of_the_neighbors_or_the_length():
    """M V = Σ σ h Δt with the distance h at the start of each step."""
    engine = stressed(DofDrive(stress=Constant(-4.0), between=("lid", "floor")), lid=-0.5)
    state = advance(engine, 0.01, 100)
    heights = 3.0 - 0.5 * 0.01 * np.arange(100)
    assert state.wall_velocity[2, 0] == pytest.approx(-4.0 / 2.0 * 0.01 * heights.sum(), rel=1e-12)
    assert book(state, "load_work") == pytest.approx(state.wall_velocity[2, 0] ** 2, rel=1e-12)
    assert book(state, "closure") < 1e-12
    state = advance(stressed(DofDrive(stress=Ramp(0.0, 2.0, 1.0), damping=0.5)), 0.01, 100)
    other = advance(stressed(DofDrive(force=Ramp(0.0, 10.0, 1.0), damping=0.5)), 0.01, 100)
    assert state.wall_velocity[2, 0] == pytest.approx(other.wall_velocity[2, 0], rel=1e-12)


def test_steepest_slopes_of_signals():
    assert Constant(3.0).steepest() == 0.0
    assert Ramp(1.0, -5.0, 2.0).steepest() == 3.0
    assert Sine(1.0, -2.0, 4.0).steepest() == pytest.approx(math.pi)
    assert Interpolated((0.0, 1.0, 3.0), (0.0, 10.0, -20.0)).steepest() == 15.0
    assert Interpolated((1.0,), (4.0,)).steepest() == 0.0
    assert Shifted(Ramp(0.0, 1.0, 2.0), 1.0).steepest() == 0.5

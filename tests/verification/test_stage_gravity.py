"""Gravity that a stage changes: free flight, a tilted plane, books, resumed and later stages."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from run_fakes import digests, in_pieces
from scene_parts import FLOOR, TIGHT, G, advance, make_engine, make_model, resume
from scenes import SMALL, changed, write_small

from multicor_cli import run as run_scenario
from multicor_cli.engine.motion.drives import Constant, Gravity, Ramp, Sine, TiltedGravity
from multicor_cli.running.from_scenario import stage_gravity
from multicor_cli.scenario import parse_scenario
from multicor_cli.store import run_info

TILT = "gravity = { angle = { ramp = [0.0, 30.0], duration = 0.04 } }"
SHAKE = "gravity = [{ sine = { amplitude = 2.0, period = 0.01 } }, -9.81]"
TILTED = changed(
    SMALL,
    ('name = "shear"\n', f'name = "shear"\n{TILT}\n'),
    ('name = "settle"\n', f'name = "settle"\n{SHAKE}\n'),
    ('[[loading]]\nname = "settle"', 'mass = 1e-3\ngravity = true\n\n[[loading]]\nname = "settle"'),
)
"""Shaken while it settles under a heavy lid, tilted while sheared; the last stage keeps that."""


def flight(dt, duration):
    """Displacement of a free grain from rest under g = (3 sin(4πt), −2 + 3t)."""
    engine = make_engine(make_model([0.1]), [[0.0, 5.0]])
    resume(engine, gravity=Gravity(Sine(0.0, 3.0, 0.5), Ramp(-2.0, 4.0, 2.0)))
    advance(engine, dt, round(duration / dt))
    return engine.state.position[0, :2] - [0.0, 5.0]


def test_free_flight_is_of_second_order():
    """x = A/ω (t − sin(ωt)/ω), y = B t²/2 + C t³/6."""
    t, omega = 0.8, 4.0 * math.pi
    exact = np.array([3.0 / omega * (t - math.sin(omega * t) / omega), -1.0 * t**2 + 0.5 * t**3])
    errors = [np.abs(flight(dt, t) - exact).max() for dt in (0.02, 0.01, 0.005)]
    for coarse, fine in itertools.pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("dt", [1e-2, 3e-3])
def test_a_block_slips_when_the_tangent_of_the_tilt_is_the_friction(dt):
    """Gravity acts at mid-step: the first step that moves the block has tan θ(t + Δt/2) > μ.

    Then v̇ = g (sin θ − μ cos θ), at rate θ̇. A grain with m a²/I → 0 cannot be turned: a block.
    """
    mu, rate = 0.3, math.radians(20.0)
    model = dataclasses.replace(make_model([0.1], FLOOR, friction=mu), shape_factor=1e-12)
    engine = make_engine(model, [[0.0, 0.1]], settings=TIGHT)
    resume(engine, gravity=TiltedGravity(Ramp(0.0, 90.0, 4.5), Constant(G)))
    speeds = []
    for k in range(math.ceil(1.5 / dt)):
        engine.step(dt, k * dt)
        speeds.append(float(engine.state.velocity[0, 0]))
    slip = math.atan(mu) / rate
    first = int(np.flatnonzero(np.array(speeds) > 1e-9)[0])
    assert abs((first + 0.5) * dt - slip) <= dt
    end = rate * len(speeds) * dt
    start = math.atan(mu)
    exact = G / rate * (math.cos(start) - math.cos(end) - mu * (math.sin(end) - math.sin(start)))
    # Midpoint rule, and where in its step the slip begins
    assert speeds[-1] == pytest.approx(exact, abs=G * rate * dt * dt)


def test_tilt_and_components_are_the_same_vector():
    tilted = TiltedGravity(Constant(30.0), Constant(2.0))
    np.testing.assert_allclose(tilted.value(0.0), [1.0, -math.sqrt(3.0)], rtol=1e-14)
    np.testing.assert_allclose(tilted.largest(), [1.0, 2.0, 2.0], rtol=1e-14)
    assert TiltedGravity(Ramp(0.0, -180.0, 1.0), Constant(2.0)).largest() == (2.0, 2.0, 2.0)
    assert Gravity(Sine(1.0, -2.0, 1.0), Constant(-4.0)).largest() == (3.0, 4.0, 5.0)


def test_a_stage_without_gravity_keeps_what_there_was_at_the_end():
    scenario = parse_scenario(TILTED, "tilted.toml")
    settle, shear, on = stage_gravity(scenario)
    starts = [0.0, 0.02, 0.05]
    assert settle.started(starts).value(0.0025) == pytest.approx([2.0, -9.81])
    # The shear stage lasts three quarters of its ramp, which is kept
    for stage, t, angle in ((shear, 0.02, 15.0), (on, 0.0, 22.5), (on, 0.01, 22.5)):
        expected = G * math.sin(math.radians(angle)), -G * math.cos(math.radians(angle))
        assert stage.started(starts).value(t) == pytest.approx(expected, rel=1e-12)
    first, *_ = stage_gravity(parse_scenario(SMALL, "small.toml"))
    assert first.started([0.0]).value(1.0).tolist() == [0.0, -9.81]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = write_small(tmp_path_factory.mktemp("tilted"), TILTED)
    assert run_scenario(path, path.parent / "run").is_finished
    return path.parent / "run"


def test_gravity_that_varies_closes_the_books_and_goes_on(whole, tmp_path):
    """A bed between rough walls, under a heavy lid whose weight turns too, with projections."""
    info = run_info(whole)
    assert info["energy_closure"] < 1e-13
    assert info["books"]["gravity_work"] != 0.0
    # While it is shaken, while it tilts, and in the stage that keeps the tilt
    path, last = write_small(tmp_path, TILTED), run_info(whole)["step"]
    assert in_pieces(path, tmp_path / "run", last - 150, last - 40, last - 3) == digests(whole)
    assert run_info(tmp_path / "run")["stage_ends"] == run_info(whole)["stage_ends"]

"""The time step knows the period of whatever goes up and down: kinds of signals, of what follows
them, and stages."""

import math

import numpy as np
import pytest
from scenarios import plane, scenario
from trials import thinned

from multicor_cli.checks import Verdict, check_run, check_scenario
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.time_step import OSCILLATIONS, PERIOD, review_steps
from multicor_cli.scenario import ScenarioError

SINE = "{ sine = { mean = MEAN, amplitude = 0.01, frequency = 500.0 } }"
WAVES = {
    "frequency": SINE,
    "period": SINE.replace("frequency = 500.0", "period = 2e-3"),
    "phase": SINE.replace("500.0", "500.0, phase = 0.7"),
    "expression": SINE.replace("500.0", '"= f * sqrt(1)"'),
    "table": "{ times = [TIMES], values = [VALUES] }",
    "file": '{ file = "FILE" }',
}
TIMES = [2e-3 / 20.0 * k for k in range(501)]
VALUES = [0.01 * math.sin(2.0 * math.pi * 500.0 * t) for t in TIMES]
KINDS = {
    "velocity": ("drives.lid.y = { velocity = WAVE }", "the velocity of wall 'lid' in y"),
    "velocity in x": ("drives.lid.x = { velocity = WAVE }", "the velocity of wall 'lid' in x"),
    "spin": ("drives.lid.spin = { velocity = WAVE }", "the velocity of wall 'lid' in spin"),
    "position": ("drives.lid.y = { position = WAVE }", "the position of wall 'lid' in y"),
    "force": ("drives.lid.y = { force = WAVE }", "the force of wall 'lid' in y"),
    "torque": ("drives.lid.spin = { force = WAVE }", "the force of wall 'lid' in spin"),
    "stress": ("drives.lid.y = { stress = WAVE }", "the stress of wall 'lid' in y"),
    "anchor": ("drives.lid.y = { spring = { stiffness = 1.0, anchor = WAVE } }",
        "the anchor of wall 'lid' in y"),
    "beside a spring": ("drives.lid.y = { spring = { stiffness = 1.0 }, force = WAVE }",
        "the force of wall 'lid' in y"),
    "surface": ("drives.lid.surface = { velocity = WAVE }", "the surface of wall 'lid'"),
    "gravity": ("gravity = [WAVE, -9.81]", "gravity"),
    "gravity in y": ("gravity = [0.0, WAVE]", "gravity"),
    "angle": ("gravity = { angle = WAVE }", "gravity"),
    "magnitude": ("gravity = { angle = 20.0, magnitude = WAVE }", "gravity"),
    "temperature": ("thermal.floor = { temperature = WAVE }", "the temperature of wall 'floor'"),
}  # fmt: skip
"""What follows a signal, and how it is called; temperatures act on the motion by friction that
depends on them."""


def scene(folder, first="", second="", *overrides, kind="velocity"):
    is_heat = kind == "temperature"
    mean = 350.0 if is_heat else 0.0
    (folder / "wave.csv").write_text(
        "time,value\n" + "".join(f"{t},{mean + v}\n" for t, v in zip(TIMES, VALUES, strict=True))
    )
    text = "".join(f"[[loading]]\nduration = 0.05\n{keys}\n" for keys in (first, second)).replace(
        "MEAN", str(mean)
    )
    text = text.replace("TIMES", str(TIMES)[1:-1]).replace(
        "VALUES", str([mean + v for v in VALUES])[1:-1]
    )
    lid = {
        "geometry": {"kind": "polyline", "points": [[0.1, 0.5], [0.9, 0.5]]},
        "mass": 1.0,
        "inertia": 1.0,
    }
    grain = {
        "sizes": {"kind": "uniform", "min": 0.01, "max": 0.01},
        "count": 1,
        "region": {"min": [0.3, 0.0], "max": [0.7, 0.02]},
    }
    return scenario(
        text.replace("FILE", str(folder / "wave.csv")), variables={"f": 500}, size=[1.0, 1.0],
        frame_interval=0.01,
        friction={"value": 0.3, "softening": 1e-3} if is_heat else 0.3, heat={"temperature": 300.0},
        walls={"floor": plane(), "lid": lid},
        grains=grain, overrides=overrides, dt="auto",
    )  # fmt: skip


def reviewed(given):
    model, _ = build(given)
    plan = make_plan(given, model)
    return plan, review_steps(given, model, plan)


# a position begins with 0
PAIRS = [(kind, wave) for kind in KINDS for wave in WAVES if (kind, wave) != ("position", "phase")]


@pytest.mark.parametrize("pair", thinned(PAIRS, 5))
def test_every_signal_sets_the_step(pair, tmp_path):
    """500 Hz: a fiftieth of 2 ms, in the stage that has it, first or second; the check flags a step
    of a period."""
    kind, wave = pair
    keys, of = KINDS[kind]
    keys = keys.replace("WAVE", WAVES[wave])
    for number, stages in enumerate(((keys, ""), ("", keys))):
        plan, reviews = reviewed(scene(tmp_path, *stages, kind=kind))
        assert plan.stages[number].dt == pytest.approx(PERIOD * 2e-3, rel=0.06)
        assert reviews[number].set_by == f"the period of {of}"
        assert f"of the period of {of}" in reviews[number].text()
        assert number == 0 or reviews[0].of_period is None
        if number:
            continue
        fixed = {
            check.name: check
            for check in check_scenario(scene(tmp_path, *stages, "solver.dt=2e-3", kind=kind))
        }
        assert fixed["time step"].verdict is Verdict.BAD
        assert of in fixed["time step"].text


@pytest.mark.parametrize("kind", KINDS)
def test_a_signal_that_is_kept_sets_the_step_of_the_next_stage(kind, tmp_path):
    """But gravity, of which the last value is kept, and a table that is over."""

    def has_it(review):
        # The lid on its spring takes seconds
        return review.of_period is not None and review.of_period > 1e-3

    is_gravity = "gravity" in kind or kind in ("angle", "magnitude")
    keys = KINDS[kind][0]
    for wave, is_kept in ((SINE, True), (WAVES["table"], False)):
        _, (first, second) = reviewed(scene(tmp_path, keys.replace("WAVE", wave), kind=kind))
        assert has_it(first)
        assert has_it(second) is (is_kept and not is_gravity)
    # Which may end before the table
    held = keys.replace("WAVE", WAVES["table"]) + "\nuntil = { kinetic_energy_ratio = 1e-6 }"
    _, (_, second) = reviewed(scene(tmp_path, held, kind=kind))
    assert has_it(second) is not is_gravity


@pytest.mark.parametrize("signal", [
    "0.01", "{ ramp = [0.0, 0.01], duration = 1e-5 }",
    "{ sine = { amplitude = 0.0, frequency = 500.0 } }",
])  # fmt: skip
@pytest.mark.parametrize("kind", ["velocity", "force", "gravity"])
def test_what_does_not_go_up_and_down_does_not(kind, signal, tmp_path):
    _, (first, _) = reviewed(scene(tmp_path, KINDS[kind][0].replace("WAVE", signal)))
    assert first.of_period is None


def test_a_period_that_no_run_can_follow_is_named(tmp_path):
    fast = KINDS["velocity"][0].replace("WAVE", SINE.replace("500.0", "1e11"))
    with pytest.raises(
        ScenarioError,
        match="which is set by the period of the velocity of wall 'lid' in y; stay below",
    ):
        reviewed(scene(tmp_path, fast))


def test_heat_alone_follows_its_signals_within_a_step(tmp_path):
    """Up to a hundred periods; an automatic step is never longer, a fixed one is refused."""
    keys = KINDS["temperature"][0].replace(
        "WAVE", SINE.replace("MEAN", "350.0").replace("500.0", "2e6")
    )
    plan, (first, _) = reviewed(scene(tmp_path, keys))
    assert plan.stages[0].dt == pytest.approx(OSCILLATIONS * 5e-7, rel=0.05)
    assert first.set_by == "100 periods of the temperature of wall 'floor'"
    with pytest.raises(
        ScenarioError,
        match="the temperature of the wall 'floor' oscillates 200 times within one step",
    ):
        reviewed(scene(tmp_path, keys, "", "solver.dt=1e-4"))
    slow = keys.replace("2e6", "500.0")
    assert reviewed(scene(tmp_path, slow))[0].stages[0].dt > 2e-4


def test_a_lid_that_shakes_moves(run, tmp_path):
    """Velocity A sin ωt: the displacement is A (1 − cos ωt)/ω. A step that is a multiple of the
    period would see none of it."""
    drive = "drives.lid.y = { velocity = { sine = { amplitude = 0.1, frequency = 500.0 } } }"
    still = "drives.lid.y = { fixed = true }"
    found = run(scene(tmp_path, drive, still, "output.frame_interval=1.25e-3"))
    frames = [frame for frame in found.frames if frame.stage == 0]
    time = np.array([frame.time for frame in frames])
    way = np.array([frame.wall_position[1, 1] for frame in frames])
    omega = 2.0 * math.pi * 500.0
    # the error of the trapezoidal rule
    slack = 2.0 * (2.0 * math.pi * PERIOD) ** 2 / 12.0 * 0.1 / omega
    expected = way[0] + 0.1 / omega * (1.0 - np.cos(omega * time))
    assert way == pytest.approx(expected, abs=slack)
    assert np.ptp(way) > 0.9 * 2.0 * 0.1 / omega


def test_gravity_that_shakes_has_no_mean(run, tmp_path):
    """A cos ωt on a grain without friction: v = A sin(ωt)/ω; a step of a period would see the
    constant A."""
    shaken = (
        "gravity = [{ sine = { amplitude = 5.0, frequency = 1000.0, phase = 1.5707963267948966 } "
        "}, -9.81]"
    )
    smooth = ("contacts.0.friction=0.0", "output.frame_interval=1e-2")
    given = scene(tmp_path, shaken, "gravity = [0.0, -9.81]", *smooth)
    fixed = scene(tmp_path, shaken, "", "contacts.0.friction=0.0", "solver.dt=1e-3")
    assert max(abs(frame.velocity[0, 0]) for frame in run(given).frames) < 1e-3 * 5.0 * 0.05
    checks = check_run(run(fixed, "fixed").path)
    (check,) = [check for check in checks if check.name == "time step"]
    assert check.verdict is Verdict.BAD

"""Threads, differences between scenarios, estimates."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from command_line import environment
from run_fakes import FakeDrives, make_plan, strain_reached
from scene_parts import between_planes
from scenes import SMALL, changed, write_small

from multicor_cli.engine.motion.drives import Constant, DofDrive, Ramp, Sine, Spacing, WallDrive
from multicor_cli.engine.orders import Settings
from multicor_cli.model import State
from multicor_cli.running.differences import find_differences, former_defaults
from multicor_cli.running.estimate import estimate
from multicor_cli.running.from_scenario import make_plan as plan_of
from multicor_cli.running.machine import available_cores, reserve_threads
from multicor_cli.running.plan import RunPlan, StagePlan, foresee_steps
from multicor_cli.scenario import load_scenario, parse_scenario
from multicor_cli.scenario.settings import Output


def reserved(code, **extra):
    script = f"from multicor_cli.running.machine import reserve_threads\nimport os\n{code}"
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(**extra), capture_output=True, text=True,
        check=True, timeout=60,
    )  # fmt: skip
    return done.stdout.strip()


def test_more_threads_than_cores_are_reserved_before_numba_comes():
    assert reserved("print(reserve_threads(64), os.environ['NUMBA_NUM_THREADS'])") == "64 64"
    assert reserved("print(reserve_threads(0))") == str(available_cores())
    assert reserved("print(reserve_threads(0), reserve_threads(2))", NUMBA_NUM_THREADS="3") == "3 2"
    assert reserved(
        "reserve_threads(3); import numba; print(numba.config.NUMBA_NUM_THREADS, "
        "reserve_threads(1))"
    ).endswith(" 1")


def test_too_many_threads_are_refused():
    with pytest.raises(ValueError, match="between 1 and"):
        reserve_threads(-1)
    code = "import numba\ntry:\n    reserve_threads(9999)\nexcept ValueError: print('refused')"
    assert reserved(code) == "refused"
    late = "import numba\ntry:\n    reserve_threads(1000)\nexcept ValueError as e: print(e)"
    assert "imported with room for" in reserved(late)


def test_differences_name_every_key():
    before = (
        'a = 1\nb = [1, 2]\n[c]\nd = "x"\ne = 1\n[output]\ncheckpoint_interval = 1.0\n[[f]]\n'
        "g = 1\n[[f]]\ng = 2"
    )
    after = (
        'a = 1.0\nb = [1, 3]\n[c]\nd = "y"\n[output]\ncheckpoint_interval = 2.0\nnew = true\n'
        "[[f]]\ng = 1\n[[f]]\ng = 3"
    )
    found = {
        ".".join(map(str, d.path)): (d.before, d.after) for d in find_differences(before, after)
    }
    assert found == {
        "a": ("1", "1.0"), "b.1": ("2", "3"), "c.d": ('"x"', '"y"'), "c.e": ("1", "not given"),
        "output.new": ("not given", "true"), "f.1.g": ("2", "3"),
    }  # fmt: skip
    assert find_differences(before, before) == []


def test_tables_are_told_by_their_kinds():
    (found,) = find_differences('a = "disc"', 'a = { kind = "rod", aspect = 2.0 }')
    assert (found.before, found.after) == ('"disc"', '{ kind = "rod", … }')


def test_lists_of_another_length_differ_as_a_whole():
    assert [d.path for d in find_differences("b = [1, 2]", "b = [1]")] == [("b",)]


def test_variables_differ_by_the_keys_that_they_change():
    """What refers to a variable says so; a variable without effect may change."""
    text = changed(
        SMALL,
        ("[domain]", "[variables]\nmu = 0.4\n[domain]"),
        ("friction = 0.4", 'friction = "= mu"'),
    )
    before, plain = (
        parse_scenario(content, "small.toml").resolved_toml() for content in (text, SMALL)
    )
    after = parse_scenario(text, "small.toml", ["variables.mu=0.5"]).resolved_toml()
    assert find_differences(before, after) == [(("contacts", 0, "friction"), "0.4", "0.5")]
    assert find_differences(before, plain) == find_differences(plain, before) == []


def test_a_default_that_was_another_one_is_kept_by_runs_that_began_with_it():
    before, after = "[solver]\ntolerance_energy = 0.005", "[solver]\ntolerance_energy = 0.01"
    assert former_defaults(before, after, {"solver": {}}) == ["solver.tolerance_energy=0.005"]
    assert former_defaults(before, after, {}) == ["solver.tolerance_energy=0.005"]
    assert former_defaults("[solver]\nmax_sweeps = 10000", "[solver]\nmax_sweeps = 50000", {}) == [
        "solver.max_sweeps=10000"
    ]
    # The user's own
    assert former_defaults(before, after, {"solver": {"tolerance_energy": 0.005}}) == []
    assert former_defaults("[solver]\ntolerance_energy = 0.02", after, {}) == []  # never a default
    assert (
        former_defaults("[solver]\ntolerance_rms = 0.01", "[solver]\ntolerance_rms = 0.001", {})
        == []
    )


@pytest.mark.parametrize(("signal", "steps"), [
    (Constant(-2.0), 25),  # γ̇ = 2/s: 0.5 after 0.25 s
    (Ramp(0.0, 2.0, 0.1), 30),  # 0.1 on the ramp, 0.4 at 2/s
    (Sine(0.0, np.pi, 0.5), 25),  # ∫|π sin| over a half period of 0.25 s = 0.5
    (Constant(0.0), None),
])  # fmt: skip
def test_steps_to_a_strain_are_foreseen(signal, steps):
    model = between_planes()
    until = strain_reached(Spacing.between(model, "bottom", "top"), 0.5)
    drives = FakeDrives(WallDrive(), WallDrive(x=DofDrive(velocity=signal)))
    stage = StagePlan("shear", 0.01, None, until, 1, 1, Settings(), drives)
    state = State.at_rest(model, np.zeros((2, 2)))
    found = foresee_steps(RunPlan("p", (stage,), Output(frame_interval=1.0)), state)
    assert found == [steps] or (steps is not None and abs(found[0] - steps) <= 1)
    assert foresee_steps(
        RunPlan("p", (replace(stage, step_limit=7),), Output(frame_interval=1.0)), state
    ) == [7]


def test_force_driven_shear_is_not_foreseen():
    model = between_planes()
    until = strain_reached(Spacing.between(model, "bottom", "top"), 0.5)
    drives = FakeDrives(WallDrive(), WallDrive(x=DofDrive(force=Constant(1.0))))
    stage = StagePlan("shear", 0.01, None, until, 1, 1, Settings(), drives)
    plan = RunPlan("p", (stage,), Output(frame_interval=1.0))
    assert foresee_steps(plan, State.at_rest(model, np.zeros((2, 2)))) == [None]


def test_estimate_grows_with_what_it_depends_on(tmp_path):
    from multicor_cli.packing import build

    scenario = load_scenario(write_small(tmp_path))
    model, state = build(scenario)
    plan = plan_of(scenario, model)
    base = estimate(scenario, plan, model, state, 1)
    assert base.steps == 150 + foresee_steps(plan, state)[1] + 20
    assert 0.0 < base.deflection < 1e-2
    single = parse_scenario(SMALL + 'precision = "single"\ncontacts = false\n', tmp_path / "s.toml")
    small = estimate(single, plan_of(single, model), model, state, 1)
    assert small.disk is not None
    assert base.disk is not None
    assert small.frame_bytes < 0.5 * base.frame_bytes
    assert small.disk < base.disk < base.disk_peak


def test_frames_of_the_estimate_are_those_of_the_run():
    model = between_planes()
    plan = make_plan(model)
    steps = foresee_steps(plan, State.at_rest(model, np.zeros((2, 2))))
    assert steps == [20, 20, 7]

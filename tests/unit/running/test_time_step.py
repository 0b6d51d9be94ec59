"""The automatic time step: its scales against hand calculations, and how it meets the output."""

import math

import numpy as np
import pytest
from scenes import SHEAR

from multicor_cli.engine.motion.drives import Constant, DofDrive, Ramp, Sine, WallDrive
from multicor_cli.packing import build
from multicor_cli.running.planning import make_plan
from multicor_cli.running.time_step import (
    HIGH_FRICTION,
    PRESSURE,
    STRAIN,
    TRAVEL,
    Scales,
    automatic_step,
    find_scales,
    review_steps,
)
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.scenario.settings import Output


def planned(*overrides):
    scenario = parse_scenario(SHEAR, "shear.toml", ["solver.dt=auto", "loading.1.dt=auto", *overrides])
    model, _ = build(scenario)
    return scenario, model, make_plan(scenario, model)


def test_weight_and_loads_set_the_pressure():
    scenario, model, _ = planned()
    mass = model.grains.mass.sum()
    weight = mass * math.hypot(*scenario.domain.gravity) / scenario.domain.size[0]
    drives = [WallDrive()] * model.wall_count
    assert find_scales(scenario, model, drives).pressure == pytest.approx(math.sqrt(mass / model.grain_count / weight))
    top = model.walls.names.index("top")
    drives[top] = WallDrive(y=DofDrive(force=Sine(1.0, 10.0 * weight, 1.0)))
    load = (1.0 + 10.0 * weight) / model.walls.length[top]
    expected = math.sqrt(mass / model.grain_count / max(weight, load))
    assert find_scales(scenario, model, drives).pressure == pytest.approx(expected)


def test_moving_walls_set_the_rate():
    scenario, model, _ = planned()
    drives = [WallDrive()] * model.wall_count
    assert find_scales(scenario, model, drives).strain == math.inf
    drives[0] = WallDrive(x=DofDrive(velocity=Constant(-3.0)))
    drives[1] = WallDrive(x=DofDrive(velocity=Ramp(0.0, 2.0, 1.0)))
    assert find_scales(scenario, model, drives).strain == pytest.approx(scenario.domain.size[1] / 5.0)
    drives[0] = WallDrive(spin=DofDrive(velocity=Constant(-1e4)))
    assert find_scales(scenario, model, drives).strain == pytest.approx(1e-4)


def test_an_explicit_time_step_is_kept_and_reviewed():
    scenario = parse_scenario(SHEAR, "shear.toml", ["solver.dt=1e-4"])
    model, _ = build(scenario)
    plan = make_plan(scenario, model)
    assert {stage.dt for stage in plan.stages if not stage.is_frozen} == {1e-4}
    for stage, review in zip(plan.stages, review_steps(scenario, model, plan), strict=True):
        assert not review.is_automatic
        scales = find_scales(scenario, model, stage.drives.started([0.0] * 9))
        assert review.of_pressure == pytest.approx(1e-4 / scales.pressure)
        assert "√(m̄/P)" in review.text()


def test_the_automatic_step_is_within_all_limits_and_frames_come_on_time():
    scenario, model, plan = planned()
    for stage, review in zip(plan.stages, review_steps(scenario, model, plan), strict=True):
        scales = find_scales(scenario, model, stage.drives.started([0.0] * 9))
        assert stage.dt <= scales.limit * (1.0 + 1e-12)
        assert stage.dt >= 0.5 * min(scales.limit, scenario.output.frame_interval)
        assert stage.frame_every * stage.dt == pytest.approx(scenario.output.frame_interval, rel=1e-12)
        assert review.is_automatic
        assert review.automatic == stage.dt


def test_each_scale_can_be_the_one_that_limits():
    output = Output(frame_interval=1.0)
    assert automatic_step(Scales(1e-3, np.inf, np.inf), output) == pytest.approx(1e-3 * PRESSURE, rel=0.1)
    assert automatic_step(Scales(1.0, 1e-2, np.inf), output) == pytest.approx(1e-2 * STRAIN, rel=0.1)
    assert automatic_step(Scales(1.0, np.inf, 1e-3), output) == pytest.approx(1e-3 * TRAVEL, rel=0.1)
    assert automatic_step(Scales(np.inf, np.inf, 1e-3), output) is None


def test_friction_between_grains_shortens_the_step():
    assert Scales(1.0, np.inf, np.inf, 0.3).limit == PRESSURE
    assert Scales(1.0, np.inf, np.inf, 2.0 * HIGH_FRICTION).limit == pytest.approx(PRESSURE / 8.0)
    assert Scales(np.inf, 1.0, np.inf, 2.0 * HIGH_FRICTION).limit == pytest.approx(STRAIN / 2.0)
    assert Scales(np.inf, np.inf, 1.0, 2.0 * HIGH_FRICTION).limit == TRAVEL
    scenario, model, _ = planned("contacts.0.friction=0.7")
    assert find_scales(scenario, model, [WallDrive()] * model.wall_count).friction == 0.7
    table = "contacts.0.friction={ speed = [0.0, 1.0], values = [0.6, 0.2] }"
    scenario, model, _ = planned(table)
    assert find_scales(scenario, model, [WallDrive()] * model.wall_count).friction == 0.6


def test_a_stage_under_way_keeps_its_step():
    scenario, model, plan = planned()
    _, state = build(scenario)
    state.stage, state.stage_step, state.last_dt = 1, 3, 0.5 * plan.stages[1].dt
    later = make_plan(scenario, model, state)
    assert [stage.dt for stage in later.stages] == [plan.stages[0].dt, state.last_dt, *(stage.dt for stage in plan.stages[2:])]
    assert later.stages[1].frame_every == 2 * plan.stages[1].frame_every
    state.stage_step = 0
    assert make_plan(scenario, model, state) == plan


def test_short_intervals_shorten_the_step():
    slow = Scales(100.0, np.inf, np.inf)
    assert automatic_step(slow, Output(frame_interval=0.5)) == 0.5
    assert automatic_step(slow, Output(frame_interval=0.5, series_interval=0.1)) == 0.1
    step = automatic_step(Scales(1.0, np.inf, np.inf), Output(frame_interval=0.5, series_interval=0.3))
    assert step == pytest.approx(0.15)


def test_a_scenario_without_scale_is_refused():
    stages = ["loading=[{duration=1.0}]", "domain.gravity=[0.0,0.0]", "walls.1.gravity=false"]
    scenario = parse_scenario(SHEAR, "shear.toml", ["solver.dt=auto", *stages])
    model, _ = build(scenario)
    with pytest.raises(ScenarioError, match=r"solver\.dt: .*cannot choose a time step for stage 0: .*give the time step"):
        make_plan(scenario, model)


@pytest.mark.parametrize("value", ['"fast"', "-1.0", "true"])
def test_other_words_and_numbers_are_refused(value):
    with pytest.raises(ScenarioError, match=r"solver\.dt"):
        parse_scenario(SHEAR, "shear.toml", [f"solver.dt={value}"])

"""The automatic time step: its scales against hand calculations, and how it meets the output."""

import math

import numpy as np
import pytest
from run_fakes import digests, in_pieces
from scenes import SHEAR

import multicor_cli as multicor
from multicor_cli.checks import Verdict, check_scenario
from multicor_cli.engine.motion.drives import Constant, DofDrive, Ramp, Sine, WallDrive
from multicor_cli.packing import build
from multicor_cli.packing.assembly import start_speed
from multicor_cli.running.planning import make_plan
from multicor_cli.running.time_step import (
    HIGH_FRICTION,
    PRESSURE,
    STRAIN,
    TRAVEL,
    Scales,
    automatic_step,
    fastest,
    find_scales,
    review_steps,
)
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.scenario.settings import Output


def planned(*overrides):
    scenario = parse_scenario(
        SHEAR, "shear.toml", ["solver.dt=auto", "loading.1.dt=auto", *overrides]
    )
    model, _ = build(scenario)
    return scenario, model, make_plan(scenario, model)


def test_weight_and_loads_set_the_pressure():
    scenario, model, _ = planned()
    mass = model.grains.mass.sum()
    weight = mass * math.hypot(*scenario.domain.gravity) / scenario.domain.size[0]
    drives = [WallDrive()] * model.wall_count
    assert find_scales(scenario, model, drives).pressure == pytest.approx(
        math.sqrt(mass / model.grain_count / weight)
    )
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
    assert find_scales(scenario, model, drives).strain == pytest.approx(
        scenario.domain.size[1] / 5.0
    )
    drives[0] = WallDrive(spin=DofDrive(velocity=Constant(-1e4)))
    assert find_scales(scenario, model, drives).strain == pytest.approx(1e-4)


def test_a_surface_that_runs_counts_as_the_motion_that_would_carry_grains_along():
    """A level polyline as if it moved in x, a circle as if it turned, each glued grain as a disc
    that does.
    """
    scenario, model, _ = planned()
    drives = [WallDrive()] * model.wall_count
    paddle, bottom = model.walls.names.index("paddle"), model.walls.names.index("bottom")
    drives[paddle] = WallDrive(surface=Sine(0.0, 3.0, 0.1))
    assert find_scales(scenario, model, drives).strain == pytest.approx(
        scenario.domain.size[1] / 3.0
    )
    drives[bottom] = WallDrive(x=DofDrive(velocity=Constant(1.0)))
    assert find_scales(scenario, model, drives).strain == pytest.approx(
        scenario.domain.size[1] / 4.0
    )
    drives[bottom] = WallDrive(surface=Constant(-1.0))
    smallest = model.shapes.geometry[model.shapes.wall == bottom, 2].min()
    assert find_scales(scenario, model, drives).strain == pytest.approx(smallest)


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
        assert stage.frame_every * stage.dt == pytest.approx(
            scenario.output.frame_interval, rel=1e-12
        )
        assert review.is_automatic
        assert review.automatic == stage.dt


def test_each_scale_can_be_the_one_that_limits():
    output = Output(frame_interval=1.0)
    assert automatic_step(Scales(1e-3, np.inf, np.inf), output) == pytest.approx(
        1e-3 * PRESSURE, rel=0.1
    )
    assert automatic_step(Scales(1.0, 1e-2, np.inf), output) == pytest.approx(
        1e-2 * STRAIN, rel=0.1
    )
    assert automatic_step(Scales(1.0, np.inf, 1e-3), output) == pytest.approx(
        1e-3 * TRAVEL, rel=0.1
    )
    assert automatic_step(Scales(np.inf, np.inf, 1e-3), output) == pytest.approx(
        1e-3 * TRAVEL, rel=0.1
    )
    assert automatic_step(Scales(np.inf, np.inf, np.inf), output) is None


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
    assert [stage.dt for stage in later.stages] == [
        plan.stages[0].dt,
        state.last_dt,
        *(stage.dt for stage in plan.stages[2:]),
    ]
    assert later.stages[1].frame_every == 2 * plan.stages[1].frame_every
    state.stage_step = 0
    assert make_plan(scenario, model, state) == plan


def test_short_intervals_shorten_the_step():
    slow = Scales(100.0, np.inf, np.inf)
    assert automatic_step(slow, Output(frame_interval=0.5)) == 0.5
    assert automatic_step(slow, Output(frame_interval=0.5, series_interval=0.1)) == 0.1
    step = automatic_step(
        Scales(1.0, np.inf, np.inf), Output(frame_interval=0.5, series_interval=0.3)
    )
    assert step == pytest.approx(0.15)


def test_a_scenario_without_scale_is_refused():
    stages = ["loading=[{duration=1.0}]", "domain.gravity=[0.0,0.0]", "walls.1.gravity=false"]
    scenario = parse_scenario(SHEAR, "shear.toml", ["solver.dt=auto", *stages])
    model, _ = build(scenario)
    with pytest.raises(
        ScenarioError,
        match=r"solver\.dt: .*cannot choose a time step for stage 0: .*give the time step",
    ):
        make_plan(scenario, model)


@pytest.mark.parametrize("value", ['"fast"', "-1.0", "true"])
def test_other_words_and_numbers_are_refused(value):
    with pytest.raises(ScenarioError, match=r"solver\.dt"):
        parse_scenario(SHEAR, "shear.toml", [f"solver.dt={value}"])


CHANGEABLE = """\
[scenario]
name = "free"
seed = 1
[domain]
size = [1.0, 1.0]
gravity = [0.0, 0.0]
[materials.m]
density = 2500.0
[[contacts]]
pair = ["*", "*"]
friction = 0.3
[[particles]]
name = "g"
material = "m"
shape = "disc"
thickness = 1e-3
GRAINS
WALLS
[[loading]]
name = "first"
duration = 1.0
DRIVES
[[loading]]
name = "second"
duration = 1.0
LATER
[solver]
[output]
frame_interval = 1.0
"""
AT_REST = (
    'sizes = { kind = "uniform", min = 2e-3, max = 2e-3 }\ncount = 9\n'
    "region = { min = [0.4, 0.4], max = [0.5, 0.5] }\n"
)
LATTICE = AT_REST + 'packing = { kind = "random" }\n'
PADDLE = """\
[[walls]]
name = "paddle"
material = "m"
mass = 1.0
gravity = false
geometry = { kind = "polyline", points = [[0.1, 0.1], [0.3, 0.1]] }
"""
POSITION_TABLE = "{ position = { times = [0.0, 0.4, 0.5], values = [0.0, 0.0, 3.0] } }"
"""The wall stands, then moves with 30 m/s."""
SPEEDS = {
    "group": (LATTICE + "velocity = [24.0, -18.0]", "", "", "", "motion at the start at 30 m/s"),
    "spin of a group": (LATTICE + "spin = 15000.0", "", "", "", "motion at the start at 30 m/s"),
    "shear of a group": (LATTICE + "shear_rate = 700.0", "", "", "", "motion at the start"),
    "release": (
        AT_REST.replace("region = { min = [0.4, 0.4], max = [0.5, 0.5] }\n",
            "velocity = [0.0, -30.0]\n")
        + "release = { rate = 10.0, region = { min = [0.4, 0.4], max = [0.5, 0.5] } }\n",
        "", "", "", "released grains of group 'g' at 30 m/s",
    ),
    "file": ('packing = { kind = "file", path = "g.csv" }', "", "", "",
        "motion at the start at 30 m/s"),
    "run": ('packing = { kind = "run", path = "before" }', "", "", "",
        "motion at the start at 30 m/s"),
    "wall": (LATTICE, PADDLE, "drives.paddle = { x = { velocity = -30.0 } }", "",
        "wall 'paddle' at 30 m/s"),
    "ramp": (
        LATTICE, PADDLE, ("drives.paddle = { y = { velocity = { ramp = [0.0, 30.0], duration = "
            "0.3 } } }"), "",
        "wall 'paddle' at 30 m/s",
    ),
    "sine": (
        LATTICE, PADDLE, ("drives.paddle = { y = { velocity = { sine = { amplitude = 30.0, period "
            "= 0.3 } } } }"), "",
        "wall 'paddle' at 30 m/s",
    ),
    "table": (
        LATTICE, PADDLE, ("drives.paddle = { y = { velocity = { times = [0.0, 0.5, 0.6], values = "
            "[0.0, 30.0, 0.0] } } }"), "",
        "wall 'paddle' at 30 m/s",
    ),
    "expression": (LATTICE, PADDLE, 'drives.paddle = { y = { velocity = "= 3 * 10" } }', "",
        "wall 'paddle' at 30 m/s"),
    "position": (LATTICE, PADDLE, f"drives.paddle = {{ y = {POSITION_TABLE} }}", "",
        "wall 'paddle' at 30 m/s"),
    "anchor": (
        LATTICE, PADDLE,
        ("drives.paddle = { y = { spring = { stiffness = 1e-3, anchor = { ramp = [0.0, 3.0], "
            "duration = 0.1 } } } }"),
        "",
        "wall 'paddle' at 30 m/s",
    ),
    "turn": (LATTICE, PADDLE, "drives.paddle = { spin = { velocity = 300.0 } }", "",
        "wall 'paddle' at"),
    "later": (LATTICE, PADDLE, "", "drives.paddle = { x = { velocity = 30.0 } }",
        "wall 'paddle' at 30 m/s"),
}  # fmt: skip
"""Grains, walls, drives of the first and of the second stage, and what then is the fastest."""


def free(case, folder, *overrides):
    grains, walls, drives, later, _ = SPEEDS[case]
    text = (
        CHANGEABLE.replace("GRAINS", grains)
        .replace("WALLS", walls)
        .replace("DRIVES", drives)
        .replace("LATER", later)
    )
    (folder / "g.csv").write_text(
        "x,y,radius,vx,vy,spin\n0.4,0.4,0.002,0,0,0\n0.5,0.45,0.002,30.0,0,0\n0.6,0.4,0.002,0,1,0\n"
    )
    if case == "run":
        multicor.run(parse_scenario(text.replace("run", "file").replace("before", "g.csv"),
            folder / "b.toml", ["solver.dt=1e-3"]),
                     folder / "before")  # fmt: skip
    return parse_scenario(text, folder / "free.toml", overrides)


@pytest.mark.parametrize("case", SPEEDS)
def test_every_speed_that_is_known_limits_the_step(case, tmp_path):
    """0.3 d̄/v in the stages that have it, in the run, and in checks of one that takes longer
    steps: d̄ = 4 mm, v = 30 m/s.
    """
    scenario = free(case, tmp_path)
    model, _ = build(scenario)
    number, word = 1 if case == "later" else 0, SPEEDS[case][4]
    if case == "later":
        with pytest.raises(
            ScenarioError, match="for stage 0: there is no gravity and no load, and nothing moves"
        ):
            make_plan(scenario, model)
        scenario = free(case, tmp_path, "loading.0.dt=1e-3")
    plan = make_plan(scenario, model)
    review = review_steps(scenario, model, plan)[number]
    assert word in review.fastest
    assert word in review.text()
    assert review.travel <= TRAVEL * (1.0 + 1e-9)
    assert word in review.set_by or case == "turn"  # whose spin is a rate of strain, too
    if "30 m/s" in word:
        assert plan.stages[number].dt == pytest.approx(4e-5, rel=1e-4)
    fixed = check_scenario(
        free(case, tmp_path, "solver.dt=1e-3", "loading.0.dt=1e-3", "loading.1.dt=1e-3")
    )
    (check,) = [check for check in fixed if check.name == "time step"]
    assert check.verdict is Verdict.BAD
    assert review.set_by in check.text


def test_a_wall_turns_about_its_middle_as_fast_as_its_ends(tmp_path):
    scenario = free("turn", tmp_path)
    model, _ = build(scenario)
    drives = make_plan(scenario, model).stages[0].drives.started([0.0])
    assert fastest(scenario, model, drives, (0.0, 0.0, 0.0)) == (
        pytest.approx(300.0 * 0.1),
        "wall 'paddle'",
    )


def test_walls_that_shear_a_periodic_domain_are_not_fast():
    """Their rate of shear limits the step, and grains count relative to the linear profile between
    them.
    """
    overrides = [
        "solver.dt=auto",
        "loading.1.dt=auto",
        "loading.0.drives.top.x={ velocity = 40.0 }",
    ]
    scenario = parse_scenario(SHEAR, "shear.toml", overrides)
    model, state = build(scenario)
    names = model.walls.names
    moving = [
        WallDrive(x=DofDrive(velocity=Constant(40.0))) if name == "top" else WallDrive()
        for name in names
    ]
    assert fastest(scenario, model, moving, (0.0, 0.0, 0.0))[0] < 40.0
    low, high = (state.wall_position[names.index(name), 1] for name in ("bottom", "top"))
    state.velocity[:, 0] = 40.0 * (state.position[:, 1] - low) / (high - low)
    state.velocity[:, 1:] = 0.0
    assert start_speed(scenario, model, state) < 1e-12
    state.velocity[3, 1] = 2.0
    assert start_speed(scenario, model, state) == pytest.approx(2.0)
    still = parse_scenario(SHEAR, "shear.toml", ["solver.dt=auto", "loading.1.dt=auto"])
    assert start_speed(still, model, state) == pytest.approx(np.hypot(*state.velocity.T[:2]).max())


def test_a_run_that_is_taken_up_keeps_the_steps_of_its_later_stages(tmp_path):
    """The speed at the start is kept: it is in no later state, and the second stage has not begun
    when the run stops.
    """
    scenario = free(
        "file",
        tmp_path,
        "loading.0.duration=4e-3",
        "loading.1.duration=4e-3",
        "output.frame_interval=1e-3",
    )
    whole = multicor.run(scenario, tmp_path / "whole", threads=1).directory
    assert in_pieces(scenario, tmp_path / "pieces", 50) == digests(whole)
    with multicor.open_run(whole) as run:
        assert run.model.start_speed == 30.0
        assert set(run.frames.column("steps/dt")[1:].tolist()) == {4e-5}

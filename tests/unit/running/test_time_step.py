"""The automatic time step: its scales against hand calculations, and how it meets the output."""

import math

import numpy as np
import pytest
from places import ROOT
from run_fakes import in_pieces, scales_of_drives
from scenarios import digests, toml
from scenes import SHEAR

import multicor_cli as multicor
from multicor_cli.checks import Verdict, check_scenario
from multicor_cli.engine.motion.drives import Constant, DofDrive, Ramp, Sine, WallDrive
from multicor_cli.packing import build
from multicor_cli.packing.assembly import start_speed
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.time_step import (
    ADHESION,
    HIGH_FRICTION,
    PERIOD,
    PRESSURE,
    STRAIN,
    TRAVEL,
    Scales,
    automatic_step,
    fastest,
    review_steps,
    scales_of_stage,
)
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.scenario.settings import Output

AUTO = ["solver.dt=auto", "loading.1.dt=auto"]


def planned(*overrides):
    scenario = parse_scenario(SHEAR, "shear.toml", [*AUTO, *overrides])
    model, _ = build(scenario)
    return scenario, model, make_plan(scenario, model)


@pytest.fixture
def scales_of():
    """The scales of the scene of shear with these drives of its walls."""
    scenario, model, _ = planned()

    def scales_of(**drives):
        all_drives = [drives.get(name, WallDrive()) for name in model.walls.names]
        return scales_of_drives(scenario, model, all_drives)

    scales_of.scenario, scales_of.model = scenario, model
    return scales_of


def moving(**dofs):
    """A wall with these velocities."""
    return WallDrive(**{name: DofDrive(velocity=signal) for name, signal in dofs.items()})


def test_weight_and_loads_set_the_pressure(scales_of):
    model, domain = scales_of.model, scales_of.scenario.domain
    mass = model.grains.mass.sum()
    weight = mass * math.hypot(*domain.gravity) / domain.size[0]
    mean = mass / model.grain_count
    assert scales_of().pressure == pytest.approx(math.sqrt(mean / weight))
    pushed = WallDrive(y=DofDrive(force=Sine(1.0, 10.0 * weight, 1.0)))
    load = (1.0 + 10.0 * weight) / model.walls.length[model.walls.names.index("top")]
    expected = math.sqrt(mean / max(weight, load))
    assert scales_of(top=pushed).pressure == pytest.approx(expected)


def test_moving_walls_set_the_rate(scales_of):
    """A surface counts as the motion that would carry grains along: a level polyline as if it moved
    in x, a circle as if it turned, each glued grain as a disc that does."""
    model, height = scales_of.model, scales_of.scenario.domain.size[1]
    first, second = model.walls.names[:2]
    back, forth = moving(x=Constant(-3.0)), moving(x=Ramp(0.0, 2.0, 1.0))
    turned, run = moving(spin=Constant(-1e4)), WallDrive(surface=Sine(0.0, 3.0, 0.1))
    smallest = model.shapes.geometry[
        model.shapes.wall == model.walls.names.index("bottom"), 2
    ].min()
    for drives, strain in (
        ({}, math.inf),
        ({first: back, second: forth}, height / 5.0),
        ({first: turned, second: forth}, 1e-4),
        ({"paddle": run}, height / 3.0),
        ({"paddle": run, "bottom": moving(x=Constant(1.0))}, height / 4.0),
        ({"paddle": run, "bottom": WallDrive(surface=Constant(-1.0))}, smallest),
    ):
        assert scales_of(**drives).strain == pytest.approx(strain)


@pytest.mark.parametrize(
    ("slope", "number"),
    [
        (0.0, 0.0), (10.0, 0.0), (14.3, 0.0), (14.5, 4.04e-4), (20.0, 0.0762), (24.0, 0.158),
        (27.0, 0.233), (31.0, 0.3), (90.0, 0.3),
    ],
)  # fmt: skip
@pytest.mark.parametrize("is_periodic", [True, False])
def test_a_layer_on_a_slope_sets_the_rate_at_which_its_friction_is_the_slope(
    slope, number, is_periodic
):
    """μ*(I) = 0.2567 + 0.775 I^0.768 (theory §15.4), measured up to I = 0.3; without a period it
    comes to an end."""
    changes = [f"variables.angle={slope}", f"domain.periodic={str(is_periodic).lower()}"]
    scenario = multicor.load_scenario(ROOT / "configs" / "chute.toml", overrides=changes)
    model, _ = build(scenario)
    scales = scales_of_drives(scenario, model, [WallDrive()] * model.wall_count)
    rate = number / scales.pressure if is_periodic else 0.0
    assert 1.0 / scales.strain == pytest.approx(rate, rel=0.02)
    if rate:
        assert scales.strained_by == "a layer that slides down"


@pytest.mark.parametrize("reach", [None, 2e-6])
def test_adhesion_sets_the_time_in_which_it_crosses_its_range(reach):
    """√(2 m ℓ/F_a) with the mean mass; ℓ is 0.01 mean diameters where none is given."""
    force = 1e-3
    given = f"{{ force = {force}" + (f", range = {reach}" if reach else "") + " }"
    scenario, model, plan = planned(f"contacts.1.adhesion={given}")
    mass = model.grains.mass.mean()
    expected = math.sqrt(2.0 * mass * (reach or 0.01 * model.mean_diameter) / force)
    scales = scales_of_drives(scenario, model, plan.stages[0].drives.started([0.0] * 9))
    assert scales.adhesion == pytest.approx(expected)
    review = review_steps(scenario, model, plan)[0]
    assert review.of_adhesion == pytest.approx(plan.stages[0].dt / expected)
    assert review.set_by == "the range of adhesion"
    assert "adhesion crosses its range" in review.text()


@pytest.mark.parametrize("speed", [0.0, 1e-3, 3.0])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_the_layer_that_flows_down_in_a_drum_sets_its_own_rate(gravity, speed):
    """½ √(g/d̄), however slowly the drum turns."""
    overrides = [f"domain.gravity=[0.0, {-gravity}]"]
    scenario = multicor.load_scenario(ROOT / "configs" / "drum.toml", overrides=overrides)
    model, _ = build(scenario)
    scales = scales_of_drives(scenario, model, [moving(spin=Constant(speed))])
    flows = speed > 0.0 < gravity
    rate = 0.5 * math.sqrt(gravity / model.mean_diameter) if flows else speed
    assert 1.0 / scales.strain == pytest.approx(rate)
    assert (scales.strained_by == "the layer that flows down in a drum") == flows


@pytest.mark.parametrize(("way", "speed"), [
    ({"position": Sine(0.5, 0.2, 2.0)}, 0.2 * math.pi),
    ({"velocity": Sine(0.0, -0.3, 2.0)}, 0.3),
    ({"velocity": Constant(30.0)}, 0.0),
])  # fmt: skip
@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_bed_that_is_shaken_has_a_rate_of_its_own(axis, way, speed):
    """√(g/d̄), where the wall is ever as fast as what falls beside it: 2π v/T > g."""
    for gravity, is_thrown in ((1.01 * math.pi * speed, False), (0.99 * math.pi * speed, True)):
        overrides = [f"domain.gravity=[0.0, {-gravity}]"]
        scenario = multicor.load_scenario(ROOT / "configs" / "hopper.toml", overrides=overrides)
        model, _ = build(scenario)
        drives = [WallDrive(**{axis: DofDrive(**way)}), *[WallDrive()] * (model.wall_count - 1)]
        scales = scales_of_drives(scenario, model, drives)
        shaken = scales.strained_by == "a bed that is shaken"
        assert shaken == (is_thrown and speed > 0.0)
        if shaken:
            assert 1.0 / scales.strain == pytest.approx(math.sqrt(gravity / model.mean_diameter))


def test_an_explicit_time_step_is_kept_and_reviewed():
    scenario = parse_scenario(SHEAR, "shear.toml", ["solver.dt=1e-4"])
    model, _ = build(scenario)
    plan = make_plan(scenario, model)
    assert {stage.dt for stage in plan.stages if not stage.is_frozen} == {1e-4}
    for stage, review in zip(plan.stages, review_steps(scenario, model, plan), strict=True):
        assert not review.is_automatic
        scales = scales_of_drives(scenario, model, stage.drives.started([0.0] * 9))
        assert review.of_pressure == pytest.approx(1e-4 / scales.pressure)
        assert "√(m̄/P)" in review.text()


def test_the_automatic_step_is_within_all_limits_and_frames_come_on_time():
    scenario, model, plan = planned()
    for stage, review in zip(plan.stages, review_steps(scenario, model, plan), strict=True):
        scales = scales_of_drives(scenario, model, stage.drives.started([0.0] * 9))
        assert stage.dt <= scales.limit * (1.0 + 1e-12)
        assert stage.dt >= 0.5 * min(scales.limit, scenario.output.frame_interval)
        assert stage.frame_every * stage.dt == pytest.approx(
            scenario.output.frame_interval, rel=1e-12
        )
        assert review.is_automatic
        assert review.automatic == stage.dt


def test_each_scale_can_be_the_one_that_limits():
    output = Output(frame_interval=1.0)
    for scales, step in (
        (Scales(1e-3, np.inf, np.inf), 1e-3 * PRESSURE),
        (Scales(1.0, 1e-2, np.inf), 1e-2 * STRAIN),
        (Scales(1.0, np.inf, 1e-3), 1e-3 * TRAVEL),
        (Scales(np.inf, np.inf, 1e-3), 1e-3 * TRAVEL),
        (Scales(1.0, np.inf, np.inf, adhesion=1e-2), 1e-2 * ADHESION),
    ):
        assert automatic_step(scales, output) == pytest.approx(step, rel=0.1)
    assert automatic_step(Scales(np.inf, np.inf, np.inf), output) is None


def test_errors_that_are_asked_for_lengthen_the_step_but_no_motion_is_followed_worse():
    for errors in (0.1, 1.0, 3.0):
        at_most = min(1.0, errors)
        assert Scales(1.0, np.inf, np.inf, errors=errors).limit == errors * PRESSURE
        assert Scales(np.inf, 1.0, np.inf, errors=errors).limit == errors * STRAIN
        assert Scales(np.inf, np.inf, 1.0, errors=errors).limit == pytest.approx(at_most * TRAVEL)
        slow = Scales(np.inf, np.inf, np.inf, period=1.0, errors=errors)
        assert slow.limit == pytest.approx(at_most * PERIOD)


@pytest.mark.parametrize(("accuracy", "errors"), [('"draft"', 2), ("0.5", 0.5), ('"fine"', 0.5)])
def test_a_scenario_or_a_stage_asks_for_an_accuracy(accuracy, errors):
    for where, changed in (("solver", [True, True]), ("loading.1.solver", [False, True])):
        scenario, model, plan = planned(f"{where}.accuracy={accuracy}")
        for number, is_changed in enumerate(changed):
            stage, scales = (
                plan.stages[number],
                scales_of_stage(scenario, model, number, plan.stages[number]),
            )
            assert scales.errors == (errors if is_changed else 1.0)
            assert stage.dt == automatic_step(scales, scenario.output)


@pytest.mark.parametrize("where", ["solver", "loading.1.solver"])
def test_an_accuracy_of_fixed_steps_is_refused(where):
    with pytest.raises(ScenarioError, match=rf"{where}.*no time step here is automatic.*auto"):
        parse_scenario(SHEAR, "shear.toml", ["solver.dt=1e-4", f"{where}.accuracy=fine"])


def test_friction_between_grains_shortens_the_step():
    assert Scales(1.0, np.inf, np.inf, 0.3).limit == PRESSURE
    assert Scales(1.0, np.inf, np.inf, 2.0 * HIGH_FRICTION).limit == pytest.approx(
        PRESSURE / 2**2.5
    )
    assert Scales(np.inf, 1.0, np.inf, 2.0 * HIGH_FRICTION).limit == pytest.approx(STRAIN / 4.0)
    assert Scales(np.inf, np.inf, 1.0, 2.0 * HIGH_FRICTION).limit == TRAVEL
    table = "{ speed = [0.0, 1.0], values = [0.6, 0.2] }"
    for friction, largest in (("0.7", 0.7), (table, 0.6)):
        scenario, model, _ = planned(f"contacts.0.friction={friction}")
        still = [WallDrive()] * model.wall_count
        assert scales_of_drives(scenario, model, still).friction == largest


@pytest.mark.parametrize(
    ("restitution", "share"), [(0.0, 1.0), (0.8, 1.0), (0.85, 0.75), (0.9, 0.5), (1.0, 0.25)]
)
def test_grains_that_lose_little_shorten_the_step(restitution, share):
    for scales in ((1.0, np.inf, np.inf), (np.inf, 1.0, np.inf)):
        ratio = Scales(*scales, restitution=restitution).limit / Scales(*scales).limit
        assert ratio == pytest.approx(share)
    assert Scales(np.inf, np.inf, 1.0, restitution=restitution).limit == TRAVEL
    scenario, model, _ = planned(f"contacts.0.restitution={restitution}")
    still = [WallDrive()] * model.wall_count
    assert scales_of_drives(scenario, model, still).restitution == restitution


def test_a_stage_under_way_keeps_its_step():
    scenario, model, plan = planned()
    _, state = build(scenario)
    state.stage, state.stage_step, state.last_dt = 1, 3, 0.5 * plan.stages[1].dt
    later, (first, _, *others) = make_plan(scenario, model, state), plan.stages
    kept = [first.dt, state.last_dt, *(stage.dt for stage in others)]
    assert [stage.dt for stage in later.stages] == kept
    assert later.stages[1].frame_every == 2 * plan.stages[1].frame_every
    state.stage_step = 0
    assert make_plan(scenario, model, state) == plan


def test_short_intervals_shorten_the_step():
    slow, fast = Scales(100.0, np.inf, np.inf), Scales(2.0, np.inf, np.inf)
    frames = {"frame_interval": 0.5}
    assert automatic_step(slow, Output(**frames)) == 0.5
    assert automatic_step(slow, Output(**frames, series_interval=0.1)) == 0.1
    step = automatic_step(fast, Output(**frames, series_interval=0.3))
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


AT_REST = """
sizes = { kind = "uniform", min = 2e-3, max = 2e-3 }
count = 9
region = { min = [0.4, 0.4], max = [0.5, 0.5] }
"""
LATTICE = AT_REST + 'packing = { kind = "random" }\n'
RELEASED = AT_REST.replace("region", "velocity = [0.0, -30.0]\nrelease.region")
SINE = "{ velocity = { sine = { amplitude = 30.0, period = 0.3 } } }"
TABLE = "{ velocity = { times = [0.0, 0.5, 0.6], values = [0.0, 30.0, 0.0] } }"
ANCHOR = "{ stiffness = 1e-3, anchor = { ramp = [0.0, 3.0], duration = 0.1 } }"
POSITION = "{ times = [0.0, 0.4, 0.5], values = [0.0, 0.0, 3.0] }"
"""The wall stands, then moves with 30 m/s."""
AT_START, OF_PADDLE = "motion at the start at 30 m/s", "wall 'paddle' at 30 m/s"
GROUPS = {
    "group": (LATTICE + "velocity = [24.0, -18.0]", AT_START),
    "spin of a group": (LATTICE + "spin = 15000.0", AT_START),
    "shear of a group": (LATTICE + "shear_rate = 700.0", "motion at the start"),
    "release": (RELEASED + "release.rate = 10.0", "released grains of group 'g' at 30 m/s"),
    "file": ('packing = { kind = "file", path = "g.csv" }', AT_START),
    "run": ('packing = { kind = "run", path = "before" }', AT_START),
}
DRIVES = {
    "wall": ("x = { velocity = -30.0 }", OF_PADDLE),
    "ramp": ("y = { velocity = { ramp = [0.0, 30.0], duration = 0.3 } }", OF_PADDLE),
    "sine": (f"y = {SINE}", OF_PADDLE),
    "table": (f"y = {TABLE}", OF_PADDLE),
    "expression": ('y = { velocity = "= 3 * 10" }', OF_PADDLE),
    "position": (f"y = {{ position = {POSITION} }}", OF_PADDLE),
    "anchor": (f"y = {{ spring = {ANCHOR} }}", OF_PADDLE),
    "turn": ("spin = { velocity = 300.0 }", "wall 'paddle' at"),
    "later": ("x = { velocity = 30.0 }", OF_PADDLE),
}
SPEEDS = GROUPS | DRIVES
"""Keys of the grains, or of the drive of a paddle, and what then is the fastest."""


def free(case, folder, *overrides):
    grains = GROUPS[case][0] if case in GROUPS else LATTICE
    drive = f"drives.paddle = {{ {DRIVES[case][0]} }}" if case in DRIVES else ""
    first, second = ("", drive) if case == "later" else (drive, "")
    text = f"""
        [[particles]]
        name = "g"
        {grains}
        [[loading]]
        duration = 1.0
        {first}
        [[loading]]
        duration = 1.0
        {second}
    """
    geometry = {"kind": "polyline", "points": [[0.1, 0.1], [0.3, 0.1]]}
    paddle = {"geometry": geometry, "mass": 1.0, "gravity": False}
    (folder / "g.csv").write_text(
        "x,y,radius,vx,vy,spin\n0.4,0.4,0.002,0,0,0\n0.5,0.45,0.002,30.0,0,0\n0.6,0.4,0.002,0,1,0\n"
    )

    def scene(text, *overrides):
        tables = toml(
            text, size=[1.0, 1.0], gravity=[0.0, 0.0], friction=0.3, frame_interval=1.0, dt="auto",
            walls={"paddle": paddle} if case in DRIVES else {},
        )  # fmt: skip
        return parse_scenario(tables, folder / "free.toml", overrides)

    if case == "run":
        before = text.replace('"run"', '"file"').replace("before", "g.csv")
        multicor.run(scene(before, "solver.dt=1e-3"), folder / "before")
    return scene(text, *overrides)


@pytest.mark.parametrize("case", SPEEDS)
def test_every_speed_that_is_known_limits_the_step(case, tmp_path):
    """0.3 d̄/v in the stages that have it, in the run, and in checks of one that takes longer
    steps: d̄ = 4 mm, v = 30 m/s."""
    scenario = free(case, tmp_path)
    model, _ = build(scenario)
    number, word = 1 if case == "later" else 0, SPEEDS[case][1]
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
    them."""
    driven = [*AUTO, "loading.0.drives.top.x={ velocity = 40.0 }"]
    scenario = parse_scenario(SHEAR, "shear.toml", driven)
    model, state = build(scenario)
    names = model.walls.names
    drives = [moving(x=Constant(40.0)) if name == "top" else WallDrive() for name in names]
    assert fastest(scenario, model, drives, (0.0, 0.0, 0.0))[0] < 40.0
    low, high = (state.wall_position[names.index(name), 1] for name in ("bottom", "top"))
    state.velocity[:, 0] = 40.0 * (state.position[:, 1] - low) / (high - low)
    state.velocity[:, 1:] = 0.0
    assert start_speed(scenario, model, state) < 1e-12
    state.velocity[3, 1] = 2.0
    assert start_speed(scenario, model, state) == pytest.approx(2.0)
    still = parse_scenario(SHEAR, "shear.toml", AUTO)
    assert start_speed(still, model, state) == pytest.approx(np.hypot(*state.velocity.T[:2]).max())


def test_a_run_that_is_taken_up_keeps_the_steps_of_its_later_stages(tmp_path):
    """The speed at the start is kept: it is in no later state, and the second stage has not begun
    when the run stops."""
    short = ("loading.0.duration=4e-3", "loading.1.duration=4e-3", "output.frame_interval=1e-3")
    scenario = free("file", tmp_path, *short)
    whole = multicor.run(scenario, tmp_path / "whole", threads=1).directory
    assert in_pieces(scenario, tmp_path / "pieces", 50) == digests(whole)
    with multicor.open_run(whole) as run:
        assert run.model.start_speed == 30.0
        assert set(run.frames.column("steps/dt")[1:].tolist()) == {4e-5}

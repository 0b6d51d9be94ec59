"""Runs whose walls follow positions, hang on springs or bear stresses, and whose friction changes
from stage to stage."""

import math

import numpy as np
import pytest
from run_fakes import in_pieces, scales_of_drives
from scenarios import digests
from scenes import ONE, WARM, changed

import multicor_cli as multicor
from multicor_cli.engine.motion.drives import (
    Constant,
    DofDrive,
    Ramp,
    Shifted,
    Sine,
    Spring,
    WallDrive,
)
from multicor_cli.export.fclib_file import frame_problem
from multicor_cli.model.state import find_misfit
from multicor_cli.packing import build
from multicor_cli.packing.materials import stage_laws
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import foresee_steps
from multicor_cli.scenario import parse_scenario

MASSES = changed(
    ONE,
    ('name = "lid"\n', 'name = "lid"\nmass = 0.1\n'),
    ('name = "side"\n', 'name = "side"\nmass = 0.2\n'),
)

MOVING = """\
drives.floor = { y = { position = { sine = { amplitude = 1e-3, frequency = 7.0 } } } }
drives.lid = { y = { spring = { stiffness = 40.0, anchor = { ramp = [0.0, -0.02], duration = 0.7 } }, damping = 0.1 } }
drives.side = { x = { stress = { sine = { amplitude = 0.05, period = 0.3 } }, between = ["floor", "lid"] } }
"""
"""Drives that go on in the second stage."""


def moving(text=MASSES):
    return changed(
        text,
        ("duration = 0.5\nSTAGE", f"duration = 0.3\n{MOVING}"),
        ("duration = 0.01\n", "duration = 0.2\n"),
    )


def one(text):
    return parse_scenario(text, "one.toml")


def test_tables_become_drives():
    floor, lid, side = one(moving()).drives()[0].walls
    assert floor.y == DofDrive(position=Sine(0.0, 1e-3, 1.0 / 7.0))
    assert lid.y == DofDrive(spring=Spring(40.0, Ramp(0.0, -0.02, 0.7)), damping=0.1)
    assert side.x == DofDrive(stress=Sine(0.0, 0.05, 0.3), between=("floor", "lid"))


def test_what_is_kept_counts_from_where_it_did():
    floor, lid, side = one(moving()).drives()[1].started([0.0, 0.3])
    assert floor.y == DofDrive(position=Shifted(Sine(0.0, 1e-3, 1.0 / 7.0), 0.3), is_kept=True)
    assert lid.y == DofDrive(
        spring=Spring(40.0, Shifted(Ramp(0.0, -0.02, 0.7), 0.3)), damping=0.1, is_kept=True
    )
    assert side.x == DofDrive(stress=Shifted(Sine(0.0, 0.05, 0.3), 0.3), between=("floor", "lid"))


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    folder = tmp_path_factory.mktemp("moving")
    return multicor.run(one(moving()), folder / "whole", threads=1).directory


def test_positions_go_on_over_stages(reference):
    with multicor.open_run(reference) as run:
        assert run.info["summary"]["energy_closure"] < 1e-12
        assert len(run.frames) == 6
        for frame in run.frames:
            height = 1e-3 * math.sin(14.0 * math.pi * frame.time)
            assert frame.wall_position[0, 1] == pytest.approx(height, abs=1e-16)
        assert run.frames[-1].wall_position[1, 1] < 0.099  # it follows the anchor of its spring


@pytest.mark.parametrize("step", [130, 300, 333])  # 300: between the stages
def test_stopped_runs_go_on_to_the_same_bits(reference, tmp_path, step):
    assert in_pieces(one(moving()), tmp_path / "run", step) == digests(reference)


def test_exported_problems_know_where_displacements_count_from(reference):
    """Frame 4 is in the second stage: the floor goes on with the sine of the first, the lid hangs
    on its spring."""
    mass, stiffness, damping, dt = 0.1, 40.0, 0.1, 1e-3
    with multicor.open_run(reference) as run:
        frame, problem = run.frames[4], frame_problem(run, 4)
        assert (problem.stage, problem.dt) == ("second", dt)
        floor, lid, _ = problem.problem.velocity[run.model.grain_count :, 1]
    t = frame.time
    assert floor == pytest.approx(14e-3 * math.pi * math.cos(14.0 * math.pi * (t + dt)), rel=1e-3)
    half = 0.5 * damping * dt + 0.25 * stiffness * dt * dt
    stretch = frame.wall_position[1, 1] - 0.1 + 0.02 * (t + 0.5 * dt) / 0.7
    free = ((mass - half) * frame.wall_velocity[1, 1] - dt * stiffness * stretch) / (mass + half)
    assert lid == pytest.approx(free, rel=1e-12)


SLIDING = changed(
    ONE,
    ('packing = { kind = "deposited" }', 'packing = { kind = "deposited" }\nvelocity = [0.1, 0.0]'),
    ("duration = 0.5\nSTAGE", 'duration = 0.1\ncontacts = [{ pair = ["*", "*"], friction = 0.0 }]'),
    (
        "duration = 0.01\n",
        (
            'duration = 0.2\ncontacts = [{ pair = ["glass", "*"], friction = 0.2 }]\n[[loading]]\n'
            "duration = 0.1\n"
        ),
    ),
)
"""A disc slides without friction, and then until it rolls: v falls to 2/3 in v/(3 μ g) = 17 ms."""


def test_friction_changes_from_a_stage_on(run, tmp_path):
    found = run(one(SLIDING))
    first, *_, last = found.frames[1:]
    series, mass = found.series, found.model.grains.mass[0]
    assert (first.velocity[0, 0], first.spin[0]) == (0.1, 0.0)
    assert last.velocity[0, 0] == pytest.approx(0.2 / 3.0, rel=1e-6)
    assert last.spin[0] == pytest.approx(-0.2 / 3.0 / 1e-2, rel=1e-6)
    assert found.model.laws.friction[0, 0] == 0.3  # that of [[contacts]]
    loss = series["friction_loss"]
    assert float(loss[-1]) == pytest.approx(0.5 * mass * 0.1**2 / 3.0, rel=1e-6)
    assert loss[series["time"] <= 0.1].max() == 0.0
    # Stopped while it slides
    assert in_pieces(one(SLIDING), tmp_path / "other", 110) == digests(found.path)


LAWS = """\
contacts = [{ pair = ["*", "*"], friction = 0.1 }, { pair = ["wood", "glass"], friction = 0.0 }]
[[loading]]
duration = 1.0
[[loading]]
duration = 1.0
contacts = [{ pair = ["wood", "*"], friction = { speed = [0, 1], values = [0.5, 0.2] } }]
"""


def test_laws_of_stages_differ_from_the_model_in_friction_alone():
    text = changed(
        ONE,
        ("friction = 0.3", "friction = 0.3\nrestitution = 0.4\nadhesion = 1e-3"),
        ("[[contacts]]", "[materials.wood]\ndensity = 700.0\n[[contacts]]"),
        ('name = "floor"\nmaterial = "glass"', 'name = "floor"\nmaterial = "wood"'),
        ("STAGE", ""),
        ("duration = 0.01\n", f"duration = 0.01\n{LAWS}"),
    )
    scenario = one(text)
    model = build(scenario)[0]
    first, second, third, last = stage_laws(scenario, model)
    assert first is None
    assert second is third
    glass, wood = model.materials.index("glass"), model.materials.index("wood")
    assert second.friction[glass, glass] == 0.1
    assert second.friction[glass, wood] == second.friction[wood, glass] == 0.0
    assert (second.restitution[glass, wood], second.adhesion[glass, wood]) == (0.4, 1e-3)
    assert last.table[glass, wood] == last.table[wood, glass] == 0
    assert last.table_friction.tolist() == [0.5, 0.2]
    assert (last.table[glass, glass], last.friction[glass, glass]) == (-1, 0.1)
    plan = make_plan(scenario, model)
    assert [stage.laws is None for stage in plan.stages] == [True, False, False, False]


def test_heat_of_friction_is_that_of_the_stage(run):
    """Softening friction gives way to a number, and back to another softening; what is lost is heat
    all the time."""
    again = "{ value = 0.6, softening = 2e-3, min = 0.2 }"
    text = changed(
        WARM,
        ("duration = 0.01\n",
            'duration = 0.01\ncontacts = [{ pair = ["*", "*"], friction = 0.0 }]\n'),
        ("duration = 0.005\n",
            f'duration = 0.005\ncontacts = [{{ pair = ["steel", "*"], friction = {again} }}]\n'),
        ("\nheat = false", ""),
    )  # fmt: skip
    found = run(parse_scenario(text, "warm.toml"))
    heat, loss, time = (found.series[name] for name in ("heat_friction", "friction_loss", "time"))
    assert abs(loss[time <= 0.01]).max() == 0.0
    assert heat[-1] == pytest.approx(loss[-1], rel=1e-12)
    assert heat[-1] > 0.0
    info = found.info["summary"]
    assert max(info["energy_closure"], info["heat_closure"]) < 1e-12


def test_validate_shows_the_friction_of_stages(typed, tmp_path):
    (tmp_path / "one.toml").write_text(SLIDING)
    said = typed("validate one.toml").stdout
    assert "from stage first on, * – *: 0.0" in said
    assert "from stage second on, glass – *: 0.2" in said


def test_the_time_step_resolves_vibrations_and_springs():
    scenario = one(changed(moving(), ("dt = 1e-3", 'dt = "auto"')))
    model = build(scenario)[0]
    drives = scenario.drives(model.walls.names)[0].started([0.0])
    scales = scales_of_drives(scenario, model, drives)
    assert scales.period == pytest.approx(1.0 / 7.0)
    assert 1.0 / scales.strain == pytest.approx((14.0 * math.pi * 1e-3 + 0.02 / 0.7) / 0.1)
    hung = WallDrive(y=DofDrive(spring=Spring(4e4, Constant(0.0))))
    stiff = scales_of_drives(scenario, model, [drives[0], hung, drives[2]])
    assert stiff.period == pytest.approx(2.0 * math.pi * math.sqrt(0.1 / 4e4))
    assert make_plan(scenario, model).stages[0].dt <= 0.02 / 7.0


def test_the_time_step_knows_the_friction_of_a_stage():
    text = changed(
        SLIDING, ("dt = 1e-3", 'dt = "auto"'), ('"*"], friction = 0.0', '"*"], friction = 1.0')
    )
    scenario = one(text)
    rough, plain, _ = make_plan(scenario, build(scenario)[0]).stages
    assert rough.dt < plain.dt


def test_steps_to_a_strain_of_a_prescribed_position():
    """0.05 m over 0.1 m, by a ramp of 0.1 m/s: 0.5 s."""
    stage = """until = { strain = { walls = ["floor", "lid"], value = 0.5 } }
drives.lid = { x = { position = { ramp = [0.0, 0.1], duration = 1.0 } } }"""
    scenario = one(changed(ONE, ("duration = 0.5\nSTAGE", f"duration = 2.0\n{stage}")))
    model, state = build(scenario)
    assert foresee_steps(make_plan(scenario, model), state)[0] == 500


@pytest.mark.parametrize(
    ("rows", "said"), [(2, "wall_origin has shape"), (3, "wall origin of wall lid is not finite")]
)
def test_origins_that_do_not_fit_are_found(rows, said):
    model, state = build(one(moving()))
    state.wall_origin = np.zeros((rows, 3))
    state.wall_origin[1, 1] = np.nan
    assert said in find_misfit(state, model)

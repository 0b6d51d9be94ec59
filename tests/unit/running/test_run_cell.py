"""Runs of a cell: its time step, what ends its stages, and what its files hold."""

import json
import math

import h5py
import numpy as np
import pytest
from cut_runs import CELL
from run_fakes import in_pieces
from scenarios import digests
from scenes import changed

import multicor_cli as multicor
from multicor_cli.checks import Verdict, check_run, check_scenario
from multicor_cli.model import State
from multicor_cli.model.columns import XX, XY, YY
from multicor_cli.model.state import find_misfit
from multicor_cli.packing import build
from multicor_cli.running.conditions import BLOCKS, Aim, CellSteady, CellStressReached, StepDone
from multicor_cli.running.differences import find_differences
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import foresee_steps
from multicor_cli.running.time_step import scales_of_stage
from multicor_cli.scenario import parse_scenario
from multicor_cli.store import run_info
from multicor_cli.store.vtkhdf import read_lines

FIRST = "cell = { xx = { stress = 50.0 }, yy = { stress = 50.0 }, xy = { rate = 40.0 } }"
SECOND = "cell = { xx = { rate = 0.0 }, yy = { stress = 40.0 }, xy = { rate = -20.0 } }"


def first(text, more=""):
    return FIRST, f"cell = {{ {text} }}\n{more}"


@pytest.mark.parametrize("said", ["", "velocity = [0.0, 0.0]\n", "shear_rate = 0.0\n"])
def test_what_a_run_holds_is_the_scenario_that_it_is_of(said, tmp_path):
    """Grains move with a cell that begins with rates, unless it is said how they do."""
    square = 'periodic = ["x", "y"]'
    text = changed(
        CELL, (square, f"{square}\ncell_rates = {{ xy = 30.0 }}"),
        ("[[particles]]\n", f"[[particles]]\n{said}"),
    )  # fmt: skip
    scenario = parse_scenario(text, "cell.toml")
    state = build(scenario)[1]
    assert state.velocity.any() == bool(said)
    for other in (
        multicor.Scenario.from_dict(scenario.as_dict()),
        parse_scenario(scenario.resolved_toml(), "again.toml"),
    ):
        assert other == scenario
        assert build(other)[1].digest() == state.digest()
    plain = parse_scenario(text.replace(said, ""), "cell.toml")
    assert (plain == scenario) == (not said)
    # Of a run of a version that did not tell
    before = plain.resolved_toml().replace(
        "[[particles]]\n", "[[particles]]\nvelocity = [0.0, 0.0]\n"
    )
    assert before != plain.resolved_toml()
    assert find_differences(before, plain.resolved_toml()) == []


def prepared(*changes):
    scenario = parse_scenario(changed(CELL, *changes), "cell.toml")
    model, state = build(scenario)
    return scenario, model, state, make_plan(scenario, model)


def scales(*changes):
    scenario, model, _, plan = prepared(*changes)
    mass = model.grains.mass.sum() / model.grain_count
    return scales_of_stage(scenario, model, 0, plan.stages[0]), mass


# ---- The automatic time step


@pytest.mark.parametrize(
    ("text", "pressure"),
    [
        ("xx = { stress = 50.0 }, yy = { stress = 80.0 }", 80.0),
        ("xx = { stress = 50.0 }, xy = { stress = -90.0 }", 90.0),
        ("yy = { stress = { ramp = [20.0, 70.0], duration = 0.1 } }", 70.0),
        ("xy = { rate = 1.0 }", 0.0),
    ],
)
def test_the_largest_stress_is_the_pressure(text, pressure):
    found, mass = scales(first(text))
    assert found.pressure == (pytest.approx(math.sqrt(mass / pressure)) if pressure else math.inf)


@pytest.mark.parametrize(("inertia", "factor"), [(100.0, 1.0), (1.0, 1.0), (0.04, 0.2)])
def test_a_cell_lighter_than_its_grains_needs_shorter_steps(inertia, factor):
    found, mass = scales(
        ('periodic = ["x", "y"]', f'periodic = ["x", "y"]\ncell_inertia = {inertia}')
    )
    assert found.pressure == pytest.approx(factor * math.sqrt(mass / 50.0))


def test_the_largest_rate_is_that_of_strain():
    found, _ = scales(first("xx = { rate = -30.0 }, yy = { stress = 1.0 }, xy = { rate = 40.0 }"))
    assert found.strain == pytest.approx(1.0 / 40.0)
    assert "the strain of the cell" in found.limits
    found, _ = scales(first("yy = { stress = 1.0 }, xy = { stress = 2.0 }"))
    assert found.strain == math.inf


@pytest.mark.parametrize(("component", "kind"), [("xy", "rate"), ("yy", "stress")])
def test_periods_of_a_cell_have_names(component, kind):
    sine = "{ sine = { amplitude = 1.0, period = 0.003 } }"
    found, _ = scales(first(f"{component} = {{ {kind} = {sine} }}"))
    assert (found.period, found.cycle) == (0.003, f"the {kind} {component} of the cell")


def test_what_nothing_sets_has_no_automatic_step():
    scenario = parse_scenario(
        changed(CELL, (FIRST, ""), (SECOND, ""), ("dt = 5e-5", "")), "cell.toml"
    )
    model, _ = build(scenario)
    with pytest.raises(multicor.ScenarioError, match="cannot choose a time step"):
        make_plan(scenario, model)


# ---- Ends of stages

ENDS = {
    "constant": ("xy = { rate = -40.0 }", 'cell = "xy", value = 0.2', 100),
    "ramp": ("xx = { rate = { ramp = [0.0, -10.0], duration = 0.01 } }", 'cell = "xx", value = 0.02', 126),
    "to and fro": ("yy = { rate = { times = [0.0, 0.001, 0.001001], values = [20.0, 20.0, -20.0] } }",
        'cell = "yy", value = 0.05', 50),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDS)
def test_a_stage_ends_at_a_strain_which_is_foreseen(name, tmp_path):
    """∫ |L| dt: 10 t²/2·100 = 0.02 at 6.3 ms for the ramp."""
    text, end, steps = ENDS[name]
    text = changed(
        CELL,
        first(text, f"until = {{ strain = {{ {end} }} }}"),
        (SECOND, ""),
        ("duration = 0.01", ""),
    )
    scenario = parse_scenario(text, "cell.toml")
    model, state = build(scenario)
    foreseen = foresee_steps(make_plan(scenario, model), state)
    assert foreseen[0] == pytest.approx(steps, abs=1)
    multicor.run(scenario, tmp_path / "run", threads=1)
    (end, _) = run_info(tmp_path / "run")["stage_ends"]
    assert (end["reason"], end["step"]) == ("condition", pytest.approx(steps, abs=1))


def test_a_strain_under_a_stress_is_not_foreseen():
    _, _, state, plan = prepared(first(
        "yy = { stress = 1.0 }", 'until = { strain = { cell = "yy", value = 0.1 } }'),
        ("duration = 0.01", ""))  # fmt: skip
    assert foresee_steps(plan, state)[0] is None


def notes_of(condition, stresses):
    """The condition, and a state after steps with these stresses (xx, yy, xy) of the grains [N/m]
    in a cell of 2 m × 3 m."""
    state = State(wall_position=np.array([[2.0, 3.0, 0.5]]), wall_velocity=np.zeros((1, 3)))
    state.stage_notes = condition.first_notes(state)
    for step, (xx, yy, xy) in enumerate(stresses, 1):
        state.stage_step = step
        impulse = 0.1 * 6.0 * np.array([[xx, yy, -xy]])  # that in shear is against it
        condition.note(state, StepDone(0.1, state.wall_position.copy(), impulse))
    return state


@pytest.mark.parametrize(("component", "value"), [(XX, 10.0), (YY, 20.0), (XY, 5.0)])
def test_mean_stress_of_a_window(component, value):
    """Per area, with the signs of the stresses that drive a cell."""
    condition = CellStressReached(Aim("it", "N/m", "at least", value), 0, component, 2, 1.0)
    state = notes_of(condition, [(8.0, 18.0, 3.0), (12.0, 22.0, 7.0)])
    assert condition.value(state) == pytest.approx(value)
    assert condition.holds(state)


def test_steady_friction_is_shear_over_the_mean_pressure():
    """The stress drifts with the pressure, its ratio does not."""
    growing = [(1.0 + k, 3.0 + 3.0 * k, 0.5 + 0.5 * k) for k in range(BLOCKS)]
    aim = Aim("the drift", "1", "at most", 0.05)
    ratio, stress = (CellSteady(aim, 0, XY, across, 1, 0) for across in (YY, None))
    assert ratio.holds(notes_of(ratio, growing))
    assert not stress.holds(notes_of(stress, growing))


# ---- Whole runs


def test_the_grains_bear_the_stress(sheared):
    """The series have its stress times its area, which is that of contacts and of velocities."""
    with multicor.open_run(sheared) as run:
        series = {name: np.asarray(run.series[name]) for name in
            ("stage", "window_duration", "wall_force", "wall_position", "virial_rate", "kinetic")}  # fmt: skip
        model = run.model
        assert (model.is_cell, run.wall_names, model.height) == (True, ("cell",), 0.01)
    late = np.flatnonzero(series["stage"] == 0)[-40:]
    weight = series["window_duration"][late]
    area = series["wall_position"][late, 0, 0] * series["wall_position"][late, 0, 1]
    stress = series["wall_force"][late, 0] / area[:, None]
    xx, yy, xy = (weight[:, None] * stress).sum(axis=0) / weight.sum()
    assert (xx, yy) == (pytest.approx(50.0, rel=0.02), pytest.approx(50.0, rel=0.02))
    assert -0.5 * 50.0 < xy < -0.05 * 50.0  # of the order of the friction, against the shear
    virial = series["virial_rate"][late]
    np.testing.assert_allclose(
        virial[:, 0, 0] + virial[:, 1, 1], series["wall_force"][late, 0, :2].sum(axis=1), rtol=0.05
    )


def test_frames_have_real_velocities(sheared):
    """The mean flow is among them, and the state of a checkpoint has them without it."""
    with multicor.open_run(sheared) as run:
        frame, state = run.frames[-1], run.state()
        slope, _ = np.polyfit(frame.position[:, 1], frame.velocity[:, 0], 1)
        rate = frame.wall_velocity[0]
        assert rate[2] == pytest.approx(-20.0)
        assert slope == pytest.approx(-20.0, rel=0.3)
        x, y = frame.position.T
        flow = np.column_stack([rate[0] * x + rate[2] * y, rate[1] * y])
        np.testing.assert_allclose(frame.velocity - flow, state.velocity[:, :2], atol=1e-15)
        assert abs(np.polyfit(y, state.velocity[:, 0], 1)[0]) < 0.3 * 20.0


def test_a_stopped_run_goes_on_to_the_bit(sheared, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    assert in_pieces(tmp_path / "cell.toml", tmp_path / "run", 77, 230) == digests(sheared)


def test_a_program_that_steers_sees_real_velocities(tmp_path):
    (tmp_path / "cell.toml").write_text(changed(CELL, (FIRST, "cell = { xy = { rate = 100.0 } }")))
    seen = []

    def steer(now):
        seen.append((now.velocity[:, 0].copy(), now.position[:, 1].copy(), now.walls["cell"]))
        now.end_run()

    multicor.run(tmp_path / "cell.toml", tmp_path / "run", threads=1, steer=steer, steer_every=20)
    ((velocity, y, wall),) = seen
    assert wall.velocity.tolist() == [0.0, 0.0, pytest.approx(100.0)]
    assert np.polyfit(y, velocity, 1)[0] == pytest.approx(100.0, rel=0.3)


def test_no_check_fails(sheared):
    """The step of 50 µs is 2.7 times the automatic one, and 2.5 times what the flow needs."""
    before = {check.name: check for check in check_scenario(parse_scenario(CELL, "cell.toml"))}
    doubtful = {name for name, check in before.items() if check.verdict is not Verdict.OK}
    assert doubtful == {"time step"}
    assert "load off the grains" not in before  # there is nothing beside the grains
    of_run = {check.name: check for check in check_run(sheared)}
    assert not [check for check in of_run.values() if check.verdict is Verdict.BAD]
    asked, needed = (of_run[name].value for name in ("time step", "time step for the flow"))
    assert needed == pytest.approx(asked, rel=0.15)


def test_validate_tells_of_the_cell(typed, tmp_path):
    (tmp_path / "cell.toml").write_text(changed(CELL, ("dt = 5e-5", "")))
    shown = typed(f"validate {tmp_path}/cell.toml").stdout
    assert "0.012 × 0.01 m, inertia" in shown
    assert "wall" not in shown.replace("wall time", "")
    told = json.loads(typed(f"validate {tmp_path}/cell.toml --json").stdout)
    assert told["cell"].keys() == {"width", "height", "tilt", "inertia"}
    assert told["wall_masses"] == {}


def test_lines_of_contacts_do_not_cross_the_cell(sheared):
    """In ParaView: one across a side ends in a point of its own beside its grain."""
    with multicor.open_run(sheared) as run:
        model, position = run.model, run.frames[5].position
        height = run.frames[5].wall_position[0, 1]
    with h5py.File(sheared / "results.h5") as file:
        offset = file["steps/contact_offset"][()]
        block = read_lines(file, model, 5, 6, offset, np.diff(offset[5:7]))
    points = np.concatenate([position, block.ends[:, :2]])
    one, other = points[block.joined.reshape(-1, 2)].transpose(1, 0, 2)
    assert np.hypot(*(one - other).T).max() < 2.001 * 0.6e-3
    across = block.ends[(block.ends[:, 1] < 0.0) | (block.ends[:, 1] > height)]
    assert len(across)


def test_displacements_that_cannot_be_are_no_state(sheared):
    with multicor.open_run(sheared) as run:
        model, state = run.model, run.state()
    state.nonaffine[3, 1] = np.nan
    said = f"the displacement beside the mean flow of {model.name_of(3)} is not finite"
    assert find_misfit(state, model) == said


def test_a_cell_without_an_area_is_no_state(sheared):
    with multicor.open_run(sheared) as run:
        model, state = run.model, run.state()
    assert find_misfit(state, model) is None
    state.wall_position[0, 1] = 0.0
    assert find_misfit(state, model) == "the cell has no area"

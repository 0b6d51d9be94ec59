"""Benchmarks measure what they say: copies of a scene move like the scene, wrong physics gives no
time, slower is noticed."""

import json
import time
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from scene_parts import advance, shear_engine

from multicor_cli.bench import measuring, scenes, session, yardsticks
from multicor_cli.bench.driving import QUIET, Rest, prepare, repeat_scene
from multicor_cli.bench.measuring import Result, Task, find_faults, measure
from multicor_cli.bench.scenes import SCENES
from multicor_cli.bench.session import (
    HEADINGS,
    MARGINS,
    Benchmark,
    RecordError,
    find_slower,
    notes,
    ratios,
    read_record,
    row,
    slower_twice,
    write_record,
)
from multicor_cli.bench.yardsticks import ReferenceStep, SweepTimes, compile_sweep, time_sweep
from multicor_cli.cli.bench_command import bench
from multicor_cli.engine import Engine, Orders, Settings
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model import BOOK_NAMES, TALLY_NAMES
from multicor_cli.model.state import VARIABLE
from multicor_cli.running.outcome import ExitCode
from multicor_cli.scenario import parse_scenario

LOAD, SPEED, DT = 1.0, 0.3, 0.1


KINETIC, CLOSURE = (BOOK_NAMES.index(name) for name in ("kinetic", "closure"))


@pytest.fixture(scope="module")
def sheared():
    engine = shear_engine(
        Settings(tolerance_rms=1e-3, tolerance_max=5e-2), columns=12, rows=8, load=LOAD, speed=SPEED
    )
    advance(engine, DT, 200)
    assert engine.state.contact_i.size > 100
    return engine


def copied(engine, copies):
    """An engine for copies of a layer side by side."""
    model, state = repeat_scene(engine.model, engine.state, copies)
    load = DofDrive(force=Constant(-LOAD * model.period), damping=0.0)
    lid = WallDrive(x=DofDrive(velocity=Constant(SPEED)), y=load)
    wide = Engine(model, state, threads=1)
    wide.begin(Orders([WallDrive(), lid], engine.orders.settings))
    return wide


def test_the_warm_start_of_copies_is_that_of_the_original(sheared):
    """With all impulses in place the first residual of the copies is that of the original: nothing
    is joined wrongly."""
    wide = copied(sheared, 4)
    pairs = np.column_stack([wide.state.contact_i, wide.state.contact_j]).tolist()
    assert pairs == sorted(pairs)
    narrow_problem, narrow_start = sheared.next_start(DT, 0.0)
    wide_problem, wide_start = wide.next_start(DT, 0.0)
    assert len(wide_problem.pair) == 4 * len(narrow_problem.pair)
    for own, copies in ((narrow_start, wide_start), (narrow_problem.bias, wide_problem.bias)):
        four = np.sort(np.tile(own, (4,) + (1,) * (own.ndim - 1)), axis=0)
        np.testing.assert_allclose(four, np.sort(copies, axis=0), rtol=1e-9, atol=1e-11)


def test_copies_of_a_sheared_layer_move_like_the_original(sheared):
    wide = copied(sheared, 3)
    state, n = wide.state, sheared.model.grain_count
    steps = [(sheared.step(DT, 0.0).contacts, wide.step(DT, 0.0).contacts) for _ in range(3)]
    narrow, broad = np.sum(steps, axis=0)
    assert broad == pytest.approx(3 * narrow, rel=0.03)  # the weakest forces are not unique
    for copy in range(3):
        part = slice(copy * n, (copy + 1) * n)
        moved = (state.position[part, 0] - sheared.state.position[:, 0]) / sheared.model.period
        np.testing.assert_allclose(moved, np.rint(moved), atol=1e-4)
        # to the tolerance of the solver, but for a grain or two that is about to be hit
        off = np.abs(state.velocity[part] - sheared.state.velocity)
        assert np.mean(off > 0.05) < 0.02
        assert np.median(off) < 5e-3
    with pytest.raises(ValueError, match="periodic"):
        repeat_scene(replace(sheared.model, period=0.0), sheared.state, 2)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("copies", [1, 3])
def test_scenes_are_valid_scenarios_of_any_size(name, copies):
    scene = SCENES[name]
    count = scene.tile or 700 * copies
    scenario = parse_scenario(scene.text(count, 5, copies if scene.tile else 1), Path("scene.toml"))
    assert scenario.seed == 5
    assert scenario.particles[0].count == (count * copies if scene.tile else count)


def test_c_sweep_is_ours_and_a_wrong_one_is_refused(monkeypatch):
    c_sweep = compile_sweep()
    if c_sweep is None:
        pytest.skip("needs a C compiler that works")
    engine = shear_engine(columns=8, rows=6)
    advance(engine, 0.02, 60)
    system = engine.next_system(0.02, 0.0).system
    before = system.impulse.copy()
    times = time_sweep(system, (1,))
    assert times.contacts == np.count_nonzero(system.slot >= 0)
    assert times.ratio > 0.0
    assert system.impulse.tolist() == before.tolist()  # the problem itself is left alone
    monkeypatch.setattr(yardsticks, "compile_sweep", lambda: lambda *_: 0.0)
    with pytest.raises(RuntimeError, match="differs"):
        time_sweep(system, (1,))


def test_wrong_physics_is_found():
    prepared = prepare(SCENES["collapse"], 100)
    rounds = [prepared.take(5)]
    assert find_faults(prepared, rounds) == []
    prepared.state.books[CLOSURE] = 1e-3
    prepared.state.tallies[TALLY_NAMES.index("max_overlap")] = 0.1
    # One of five: more than one in a hundred
    rounds[0].reports[2] = replace(rounds[0].reports[2], converged=False)
    prepared.scene = replace(prepared.scene, is_weighed=True)  # half of it is still in the air
    faults = " ".join(find_faults(prepared, rounds))
    words = ("energy books", "overlap", "1 steps did not converge", "of the weight")
    assert all(text in faults for text in words)


def result(**changes):
    sweep = SweepTimes(2000, 10**5, {1: 1.1e-8}, 1e-8, 1.1)
    phases = {"solve": 6e-4, "detect": 3e-4, "prepare": 1e-4}
    found = Result(
        "bed", 1000, 1, 20, 3, candidates=2000.0, sweeps=35.0, median_sweeps=30.0,
        cold_sweeps=300.0, step=1e-3, phases=phases,
        per_contact=1e-8, other_ratio=2.0, sweep=sweep,
    )  # fmt: skip
    return replace(found, **changes)


def test_ratios_and_shares():
    found = result()
    assert found.other == pytest.approx(4e-4)
    assert found.other_share == pytest.approx(4e-4 / (4e-4 + 30 * 2000 * 1e-8))
    other, sweeps = {"other_over_reference": 2.0}, {"sweeps": 30.0}
    over_c = {"sweep_over_c": 1.1, "solve_over_c": 1.0}
    assert ratios(found) == pytest.approx({**other, **sweeps, **over_c, "cold_sweeps": 300.0})
    assert ratios(result(sweep=None, cold_sweeps=None)) == {**sweeps, **other}
    # That would be the time of everything around
    assert "solve_over_c" not in ratios(result(cold_sweeps=None, median_sweeps=2.0))
    assert ratios(result(sweep=None, cold_sweeps=None, per_contact=None)) == other
    assert json.loads(json.dumps(found.as_dict()))["other_share"] == pytest.approx(0.4)


@pytest.fixture
def record(tmp_path):
    return tmp_path / "record.json"


def test_what_is_slower_than_recorded_is_named(record):
    write_record(record, [result(), result(scene="shear", faults=["grains overlap"])])
    known = read_record(record)
    assert list(known) == ["bed-1000-threads-1"]  # nothing is recorded of wrong physics
    assert find_slower([result(), result(scene="new")], known) == []
    assert find_slower([result(per_contact=1.4e-8, median_sweeps=32.0, sweeps=90.0)], known) == []
    (line,) = find_slower([result(per_contact=1.9e-8)], known)
    assert line == "bed-1000-threads-1: solve over c 1.9, recorded 1"
    write_record(record, [result(scene="drum")])
    assert len(read_record(record)) == 2
    record.write_text("[1, 2]")
    with pytest.raises(RecordError, match=r"record\.json"):
        read_record(record)


@pytest.mark.parametrize(("name", "factor"), [
    ("median_sweeps", 2), ("cold_sweeps", 2), ("per_contact", 2), ("other_ratio", 3), ("sweep", 2),
])  # fmt: skip
def test_whatever_takes_that_much_longer_is_slower(name, factor, record):
    write_record(record, [result()])
    before = getattr(result(), name)
    if isinstance(before, SweepTimes):
        after = replace(before, ratio=factor * before.ratio)
    else:
        after = factor * before
    assert len(find_slower([result(**{name: after})], read_record(record))) == 1


def test_two_sweeps_more_are_not_twice_as_many(record):
    """A solve looks at its residual at 2, 5 or 8 sweep-equivalents: a median of 5 beside one of 2
    is one look more."""
    write_record(record, [result(median_sweeps=2.0)])
    assert find_slower([result(median_sweeps=5.0)], read_record(record)) == []
    assert len(find_slower([result(median_sweeps=8.0)], read_record(record))) == 1


def test_medians_of_seeds_are_recorded_and_slower_is_what_is_so_twice(record):
    write_record(record, [result(median_sweeps=sweeps) for sweeps in (20.0, 90.0, 40.0)])
    known = read_record(record)
    assert known["bed-1000-threads-1"]["sweeps"] == 40.0
    first = result(median_sweeps=90.0, other_ratio=9.0)
    other = result(median_sweeps=80.0, cold_sweeps=900.0)
    assert slower_twice([first], [other], known) == ["bed-1000-threads-1: sweeps 80, recorded 40"]
    assert slower_twice([first], [result(median_sweeps=41.0)], known) == []


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_bed_rests_when_it_is_measured(seed, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(seed))
    bed = small_bed(monkeypatch)
    prepared = prepare(bed, 60, seed=seed)
    grains = prepared.model.grains
    energies = []
    for _ in range(20):
        reports = prepared.take(1).reports
        energies.append(prepared.state.books[KINETIC])
        assert reports[0].converged
    allowed = QUIET * float(grains.mass.sum()) * 9.81 * prepared.model.mean_diameter
    assert Rest.of(prepared.model, prepared.stage.dt).allowed == pytest.approx(allowed)
    assert max(energies) <= allowed
    assert prepared.state.stage_step == 20  # the books are those of the measurement
    warm = float(np.median([report.sweeps for report in prepared.take(20).reports]))
    assert warm < 0.5 * prepared.take_cold().reports[0].sweeps


def small_bed(monkeypatch, patience=2.0):
    for name, value in (("_PATIENCE", patience), ("_COLUMNS", 8), ("_ROWS", 8)):
        monkeypatch.setattr(scenes, name, value)
    return replace(SCENES["bed"], tile=60)


def test_a_bed_that_does_not_come_to_rest_is_a_fault_with_a_name(monkeypatch):
    bed = small_bed(monkeypatch, patience=0.002)  # ten steps; it must rest for 286
    monkeypatch.setitem(SCENES, "bed", bed)
    found = measure(Task("bed", 60, 1, 1))
    (fault,) = found.faults
    assert fault.startswith("the bed did not come to rest within 0.002 s: kinetic energy ")
    assert "allowed" in fault
    assert row(found)[5] == "refused"
    assert notes(Benchmark("some", {}, [found], None)) == [f"bed, 60 grains: {fault}"]


def test_the_command_ends_with_the_code_of_physics(monkeypatch):
    found = Benchmark("some", {1: 1e9}, [result(faults=["the bed did not come to rest"])], None)
    asked = []
    monkeypatch.setattr(session, "run_benchmark", lambda tasks, **_: asked.extend(tasks) or found)
    with pytest.raises(typer.Exit) as ended:
        bench(["bed"], [100, 200], 1, 2, seed=7)
    assert ended.value.exit_code == ExitCode.PHYSICS == 4
    assert asked == [Task("bed", 100, 1, 2, 7), Task("bed", 200, 1, 2, 7)]


def test_what_looks_slower_is_measured_again_with_another_seed(monkeypatch, record):
    asked = []
    write_record(record, [result(), result(scene="shear")])

    def run(factor, tasks, **_):
        asked.extend(tasks)
        slower = {task: 3.0 * factor ** (task.seed - 1) for task in tasks if task.scene == "bed"}
        times = [
            result(scene=task.scene, other_ratio=2.0 * slower.get(task, 1.0)) for task in tasks
        ]
        return Benchmark("some", {1: 1e9}, times, None)

    for factor, ends in ((0.1, False), (1.0, True)):
        asked.clear()
        monkeypatch.setattr(session, "run_benchmark", partial(run, factor))
        with pytest.raises(typer.Exit) if ends else nullcontext() as ended:
            bench(["bed", "shear"], [1000], 1, 2, compare=record)
        assert [(task.scene, task.seed) for task in asked] == [("bed", 1), ("shear", 1), ("bed", 2)]
        assert ended is None or ended.value.exit_code == ExitCode.BUG


def test_moving_grains_begin_to_wait_anew():
    rest, reached = Rest(1.0, 3), []
    for energy in (0.5, 1.0, 1.1, 0.0, 0.0, 0.0):
        books = np.zeros(len(BOOK_NAMES))
        books[KINETIC] = energy
        rest.note(SimpleNamespace(books=books))
        reached.append(rest.is_reached)
    assert reached == [False] * 5 + [True]


def test_physics_that_fails_while_a_scene_is_prepared_is_a_fault(monkeypatch):
    def fail(*_, **__):
        raise PhysicsError(7, "no admissible positions")

    monkeypatch.setattr(measuring, "prepare", fail)
    assert measure(Task("shear", 1000, 1, 1)).faults == ["step 7: no admissible positions"]


def test_stages_that_take_longer_show_in_the_ratio():
    """The yardstick does not slow down with the product: where steps take four times as long, the
    ratio exceeds its margin."""
    prepared = prepare(SCENES["collapse"], 100)
    yardstick = ReferenceStep(100)

    def other():
        references = []
        round_ = prepared.take(40, lambda: references.append(yardstick.seconds()))
        return measuring.other_time([round_]) / measuring._quartile(references)

    before = [other() for _ in range(3)]
    whole_step = prepared.engine.step

    def slowed(dt, t):
        started = time.perf_counter()
        report = whole_step(dt, t)
        elapsed = time.perf_counter() - started
        while time.perf_counter() - started < 4.0 * elapsed:
            pass
        return report

    prepared.engine.step = slowed
    after = [other() for _ in range(3)]
    assert max(after) > MARGINS["other_over_reference"] * min(before)


def test_table_gives_no_times_of_wrong_physics():
    right, wrong = row(result()), row(result(faults=["grains overlap"]))
    assert len(right) == len(wrong) == len(HEADINGS)
    assert "1" in right[5]
    assert wrong[5:] == ["refused", *[""] * (len(HEADINGS) - 6)]

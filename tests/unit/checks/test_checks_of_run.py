"""Each check of a run, provoked by a run that deserves it, or by numbers that no run should ever
have."""

import copy
import json
import math
import re
import time
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import call, start
from places import ROOT
from scenes import HEATED, LASTING, PACKED, SMALL, WARM, changed, write_small

import multicor_cli as multicor
from multicor_cli.checks import OF_RUN, Recorded, Verdict, judge_all, resolution, worst_verdict
from multicor_cli.checks.books import _averaged, relative_drift
from multicor_cli.store import open_run, run_info

OK, WARNING, BAD = Verdict.OK, Verdict.WARNING, Verdict.BAD


def by_name(checks):
    return {check.name: check for check in checks}


def ran(directory, scenario, overrides=()):
    """The checks of a run of a scenario, by its text or path."""
    path = write_small(directory, scenario) if isinstance(scenario, str) else scenario
    multicor.run(path, directory / "run", overrides=overrides)
    return by_name(multicor.check_run(directory / "run"))


@pytest.fixture(scope="module")
def ordinary(tmp_path_factory):
    directory = tmp_path_factory.mktemp("ordinary")
    ran(directory, changed(SMALL, ("dt = 2e-4", "dt = 1e-4")))
    return directory / "run"


@pytest.fixture
def recorded(ordinary):
    with open_run(ordinary) as run:
        yield Recorded(run, copy.deepcopy(run_info(ordinary)))


def with_info(recorded, key, value):
    table, *names = recorded.info, *key.split(".")
    for name in names[:-1]:
        table = table[name]
    table[names[-1]] = value
    return by_name(judge_all(OF_RUN, recorded))


def test_an_ordinary_run_has_nothing_bad(ordinary):
    checks = multicor.check_run(ordinary)
    assert worst_verdict(checks) is not BAD, checks
    usual = {"time step", "time step for the flow", "negative losses", "overlap", "lost grains"}
    assert {*usual, "Hertz deflection"} <= by_name(checks).keys()


@pytest.mark.parametrize(("name", "key", "values"), [
    ("energy closure", "energy_closure", {1e-14: OK, 1e-9: BAD}),
    ("overlap", "max_overlap", {5e-4: OK, 2e-3: BAD}),
    ("negative losses", "negative_loss_share", {0.01: OK, 0.07: WARNING, 0.2: BAD}),
    ("Hertz deflection", "hertz_deflection", {6e-6: OK, 5e-3: WARNING, 0.04: BAD}),
    ("work of corrections", "books.correction_work", {0.0: OK}),
])  # fmt: skip
def test_limits_of_the_summary(name, key, values, recorded):
    for value, verdict in values.items():
        assert with_info(recorded, key, value)[name].verdict is verdict


def test_negative_losses_of_a_bed_at_rest_are_left_out(recorded):
    model, steps = recorded.run.model, float(recorded.run.series["window_steps"].sum())
    kick = 9.81 * 1e-4
    limit = steps * 0.5 * float(model.grains.mass.sum()) * kick**2
    recorded.info["books"] |= {"friction_loss": 0.2 * limit, "negative_loss": -0.3 * limit}
    assert "negative losses" in with_info(recorded, "books.impact_loss", 0.6 * limit)
    assert "negative losses" not in with_info(recorded, "books.impact_loss", 0.4 * limit)


@pytest.mark.parametrize(
    ("restitution", "given_back"), [(0.0, 0.0), (0.5, 1.0 / 3.0), (0.9, 0.81 / 0.19)]
)
def test_negative_losses_are_compared_with_what_impacts_take_up(restitution, given_back, recorded):
    """Impacts that lose 1 − e² of what they take up give back e² of it; where they give back all,
    the kinetic energy stands for what they take up."""
    laws = recorded.run.model.laws
    laws.restitution[:] = restitution
    recorded.info["books"] |= {"friction_loss": 3.0, "impact_loss": 2.0, "negative_loss": -0.5}
    expected = 0.5 / (3.0 + 2.0 + 0.5 + 2.0 * given_back)
    check = with_info(recorded, "negative_loss_share", 0.5 / 5.5)["negative losses"]
    assert check.value == pytest.approx(expected)
    laws.restitution[:] = 1.0
    elastic = with_info(recorded, "negative_loss_share", 0.5 / 5.5)["negative losses"]
    largest = float(recorded.run.series["kinetic"].max())
    assert elastic.value == pytest.approx(0.5 / max(5.5, largest))


@pytest.mark.parametrize(("restitution", "dt"), [(0.0, "auto"), (0.9, "auto"), (0.9, 2.5e-3)])
def test_negative_losses_of_shear_do_not_depend_on_restitution(restitution, dt, tmp_path):
    """At the automatic step the check has nothing to say, and a step fifteen times as long is
    found."""
    overrides = (
        f"contacts.0.restitution={restitution}", f"solver.dt={dt}",
        "loading.0.until.strain.value=2.0",
        "particles.0.count=330", "domain.size=[0.02,0.025]", "particles.0.region.max=[0.02,0.0178]",
        "walls.0.geometry.to=[0.02,0.0]", "walls.1.geometry.from=[0.02,0.019]",
        "walls.1.geometry.to=[0.0,0.019]",
        'walls.1.geometry.side="left"', "variables.speed=0.72", "loading.0.drives.top.y.force=-0.2",
        "particles.0.shear_rate=37.9", "output.frame_interval=0.01",
    )  # fmt: skip
    shear = ROOT / "configs" / "shear-gravity-free.toml"
    check = ran(tmp_path, shear, overrides)["negative losses"]
    assert check.value < run_info(tmp_path / "run")["negative_loss_share"] or restitution == 0.0
    assert (check.verdict is OK) == (dt == "auto")


def test_work_of_corrections_is_compared_with_what_was_put_in(recorded):
    given = recorded.book("kinetic_start") + sum(
        abs(recorded.book(f"{name}_work")) for name in ("gravity", "wall", "load")
    )
    for share, verdict in ((0.02, WARNING), (-0.2, BAD)):
        check = with_info(recorded, "books.correction_work", share * given)["work of corrections"]
        assert (check.value, check.verdict) == (pytest.approx(abs(share)), verdict)


def test_heat_of_a_run(recorded):
    heat = {"max_biot": 0.5, "books": {"undelivered": 1.0, "from_walls": 3.0, "closure": 1e-3}}
    heat["books"] |= {"friction": 3.0, "impact": 1.0, "ahead": 0.1}
    recorded.info["heat_closure"] = 1e-3
    checks = with_info(recorded, "heat", heat)
    assert checks["heat closure"].verdict is BAD
    assert checks["largest Biot number"].verdict is WARNING
    delivered = checks["heat not delivered"]
    assert (delivered.value, delivered.verdict) == (0.25, WARNING)
    ahead = checks["heat ahead of losses"]
    assert (ahead.value, ahead.verdict) == (0.025, WARNING)
    heat["max_biot"] = 2.0
    assert with_info(recorded, "heat", heat)["largest Biot number"].verdict is BAD


HOT_FLOOR = re.search(r"thermal = .*", HEATED)[0]
SWINGING = """
[[loading]]
frozen = true
duration = 1000.0
dt = 100.0
thermal.floor = { temperature = { sine = { mean = 400.0, amplitude = 100.0, period = 70.0 } } }
"""


@pytest.mark.parametrize(
    ("flow", "tolerance", "verdicts"),
    [(0.1, 1e-4, (OK, OK)), (1e9, 1e-4, (BAD, OK)), (0.1, 1e-2, (OK, WARNING)), (0.1, 0.1, (OK, BAD))],
)  # fmt: skip
def test_what_heat_did(flow, tolerance, verdicts, tmp_path):
    """Grains hotter than any solid, and a tolerance that lets temperatures be off by percents."""
    text = changed(
        HEATED,
        (HOT_FLOOR, f"thermal = {{ flow = {flow} }}"),
        ("duration = 1.0\nheat", "duration = 0.02\nheat"),
        ("duration = 1.0\nthermal", "duration = 0.01\nthermal"),
        ("[heat]", f"[heat]\ntolerance = {tolerance}"),
    )
    checks = ran(tmp_path, text + SWINGING)
    names = ("highest temperature reached", "error of temperatures")
    assert tuple(checks[name].verdict for name in names) == verdicts


@pytest.mark.parametrize(
    ("key", "verdict"), [("", None), ("ignition = 200.0", WARNING), ("melting = 9e3", OK)]
)
def test_the_hottest_spot_over_what_materials_bear(key, verdict, tmp_path):
    """Where no material says what it bears, there is nothing to compare with."""
    checks = ran(tmp_path, changed(WARM, ("hardness = 2e9", f"hardness = 2e9\n{key}")))
    found = checks.get("hottest spot")
    assert (found and found.verdict) is verdict
    with open_run(tmp_path / "run") as run:
        hottest, stage = run.series["hottest_spot"], run.series["stage"]
    assert not hottest[(stage == 1) | (stage == 3)].any()
    assert hottest[stage == 0].max() > 310.0
    assert found is None or found.value == hottest.max() / float(key.split("=")[1])


LONG = [("dt = 2e-4", "dt = 4e-3"), ("frame_interval = 0.002", "frame_interval = 0.004")]
INEXACT = ("solver.max_sweeps=3", "solver.tolerance_rms=1e-6")
SLOW = ("kinetic_energy_ratio = 1e-2", "kinetic_energy_ratio = 1e-9")


@pytest.mark.parametrize(("changes", "overrides", "found"), [
    (LONG, (), {"time step": (BAD, 5.0, 99.0), "time step for the flow": (BAD, 5.0, 99.0)}),
    ([], INEXACT, {"steps not converged": (BAD, 0.05, 1.0)}),
    ([("young = 70e9", "young = 1e5")], (), {"Hertz deflection": (BAD, 0.01, 99.0)}),
    ([SLOW], (), {"stages timed out": (WARNING, 1.0, 1.0)}),
])  # fmt: skip
def test_what_a_run_deserves(changes, overrides, found, tmp_path):
    checks = ran(tmp_path, changed(SMALL, *changes), overrides)
    for name, (verdict, low, high) in found.items():
        assert checks[name].verdict is verdict
        assert low <= checks[name].value <= high
    if changes == [SLOW]:
        assert "settle: timed out after 0.03 s" in checks["stages timed out"].text


@pytest.mark.parametrize(("pressure", "rate"), [(50.0, 1.0), (1e-3, 100.0)])
def test_step_that_a_known_pressure_and_rate_of_shear_need(pressure, rate, recorded):
    """Limits 0.1 √(m/P) and 0.005/γ̇ of the automatic step (μ = 0.4 is below 0.5), for a stress P V
    and a work of sliding μ P V γ̇."""
    model, dt, rows = recorded.run.model, 1e-4, 11
    volume = math.pi * float((model.grains.radius**2).sum()) / 0.8
    time = 0.01 * np.arange(rows)
    columns = {
        "stage": np.zeros(rows, int),
        "window_duration": np.full(rows, 0.01),
        "virial_rate": np.broadcast_to(pressure * volume * np.eye(2), (rows, 2, 2)),
        "friction_sliding": 0.4 * pressure * volume * rate * time * rows / (rows - 1),
        "contacts_mean": np.full(rows, 0.6 * model.grain_count),
        "kinetic": 0.5 * float(model.grains.mass.sum()) * np.linspace(0.0, 9.0, rows),
    }
    frames = SimpleNamespace(stage=np.zeros(3, int), column=lambda path: np.full(3, dt))
    run = SimpleNamespace(model=model, series=columns, frames=frames, stages=("only",))
    made_up = Recorded(run, {})
    made_up.__dict__["planned"] = None
    (measured,) = resolution._needed(made_up)
    limit = min(0.1 * math.sqrt(float(model.grains.mass.mean()) / pressure), 0.005 / rate)
    assert measured.value == pytest.approx(dt / limit)
    # A rain, at up to 3 m/s: three tenths of a diameter in a step
    columns["contacts_mean"] *= 0.5
    (measured,) = resolution._needed(made_up)
    assert measured.value == pytest.approx(dt * 3.0 / (0.3 * model.mean_diameter))
    columns["kinetic"] *= 0.0
    assert not list(resolution._needed(made_up))


WALL = '\n[[walls]]\nname = "floor"\nmaterial = "glass"\ngeometry = {{ {} }}\n'


@pytest.mark.parametrize(("floor", "verdict"), [([-1.0, 1.0], OK), ([0.0, 0.045], BAD)])
def test_lost_grains(floor, verdict, tmp_path):
    shorter = [("size = [0.06, 0.08]", "size = [0.06, 0.02]"), ("count = 200", "count = 40")]
    text = changed(
        PACKED, ("duration = 1.0", "duration = 0.2"), ("dt = 1e-4", "dt = 1e-3"), *shorter
    )
    points = [[floor[0], -0.002], [floor[1], -0.002]]
    line = WALL.format(f'kind = "polyline", points = {points}')
    found = ran(tmp_path, text + line)["lost grains"]
    with open_run(tmp_path / "run") as run:
        below = int((run.frames[-1].position[:, 1] < -0.005).sum())
    assert found.value == below / 40
    assert found.verdict is verdict


def test_gravity_is_that_of_the_stage(tmp_path):
    """Grains on a floor stay on it until gravity is tilted."""
    text = changed(PACKED, ("duration = 1.0", "duration = 0.01"))
    text += WALL.format('kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]')
    tilt = (
        '\n[[loading]]\nname = "tilt"\nduration = 0.02\n'
        "gravity = { angle = { ramp = [0.0, 90.0], duration = 0.02 } }\n"
    )
    path = write_small(tmp_path, text.replace("\n[solver]", tilt + "\n[solver]"))
    before = by_name(multicor.check_scenario(path))["grains without a floor"]
    assert "(200 of 200, gravity of stage tilt)" in before.text
    ran(tmp_path, path)
    with open_run(tmp_path / "run") as run:
        recorded = Recorded(run, run_info(tmp_path / "run"))
        np.testing.assert_allclose(recorded.gravity, [9.81, 0.0], atol=1e-12)
        assert recorded.largest_gravity == pytest.approx(9.81)


def test_a_cell_is_no_wall_in_what_drifts():
    rows = np.arange(50)
    position = np.tile([2.0, 1.0, 0.0], (50, 1, 1)) * (1.0 + 0.01 * rows)[:, None, None]
    series = {
        "kinetic": np.ones(50), "wall_force": np.ones((50, 1, 3)), "wall_position": position
    }  # fmt: skip
    of_run = SimpleNamespace(wall_names=["cell"], model=SimpleNamespace(is_cell=True))
    book = {"terms": 1.0}.__getitem__
    run = SimpleNamespace(run=of_run, series=series.__getitem__, book=book, lifted_walls=[0])
    names = [name for name, _ in _averaged(run, rows)]
    assert names[0] == "kinetic energy"
    assert names[-1] == "height of the cell"
    assert not any("wall" in name for name in names)


def test_drift_of_a_series():
    rng = np.random.default_rng(1)
    noise = rng.normal(size=4000)
    assert relative_drift(np.ones(39)) is None
    assert relative_drift(np.zeros(100)) == 0.0
    assert relative_drift(10.0 + noise) == 0.0
    assert relative_drift(np.repeat([1.0, 1.0, 2.0, 3.0], 100)) == pytest.approx(1.0 / 3.0)
    assert relative_drift(np.repeat([1.0, 1.0, -2.0, -1.0], 100)) == pytest.approx(0.5)
    late = 5.0 + np.repeat([0.0, 0.0, 0.0, 5.0], 1000)
    assert relative_drift(late + noise) == pytest.approx(0.5, abs=0.05)


def test_a_run_without_steps_has_few_checks(tmp_path):
    multicor.run(write_small(tmp_path), tmp_path / "run", max_hours=0.0)
    names = by_name(multicor.check_run(tmp_path / "run")).keys()
    assert names == {"time step", "lost grains"}


def test_frames_hold_the_contacts_that_carry_something(ordinary):
    with open_run(ordinary) as run:
        for frame in run.frames[1:]:
            assert (frame.contacts.impulse[:, 0] > 0.0).all()
        assert sum(map(len, (frame.contacts for frame in run.frames))) > 0


@pytest.mark.parametrize(
    ("change", "before", "code"), [((), False, 0), (("dt = 2e-4", "dt = 2e-3"), True, 4)]
)
def test_strict(change, before, code, tmp_path):
    """A bad check before a run keeps it from beginning; afterwards `info` says the same; without
    the option nothing changes."""
    write_small(tmp_path, changed(SMALL, *([change] if change else [])))

    def code_of(line):
        return call(*line.split(), cwd=tmp_path).returncode

    assert code_of("validate small.toml --strict") == code
    assert code_of("validate small.toml") == 0
    strict = call("run", "small.toml", "-o", "strict", "--strict", cwd=tmp_path)
    assert strict.returncode == code
    assert (tmp_path / "strict").exists() is not before
    assert ("bad: time step: " in strict.stderr) is before
    assert code_of("run small.toml -o run -q") == 0
    assert code_of("info run --strict") == code
    data = json.loads(call("info", "run", "--json", cwd=tmp_path).stdout)
    worst = "bad" if code else worst_verdict(multicor.check_run(tmp_path / "run")).value
    assert data["verdict"] == worst
    keys = {"name", "value", "text", "limit", "verdict", "meaning", "remedy"}
    assert all(check.keys() == keys for check in data["checks"])
    assert (data["progress"], data["pid"]) == (None, None)


def test_a_run_that_goes_on_tells_where_it_is(tmp_path):
    write_small(tmp_path, LASTING)
    process = start("run", "small.toml", "-o", "run", cwd=tmp_path)
    try:
        deadline = time.monotonic() + 120.0
        while not (tmp_path / "run" / "progress.json").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        shown = call("info", "run", cwd=tmp_path).stdout
        assert f"kill -USR1 {process.pid} " in shown
        assert re.search(r"now +step \d+, t = ", shown)
    finally:
        process.terminate()
        process.communicate()
    assert "kill" not in call("info", "run", cwd=tmp_path).stdout

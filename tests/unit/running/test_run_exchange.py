"""Grains that come and go: closed forms, books of mass, energy and heat, conservation, and bits
that depend on nothing else."""

import shutil

import h5py
import numpy as np
import pytest
import tomli_w
from run_fakes import in_pieces
from scenarios import digests, document, engine, rows_of
from scenarios import scenario as make_scenario

import multicor_cli as multicor
from multicor_cli import post
from multicor_cli.checks import Verdict, check_run
from multicor_cli.engine import Interrupted, PhysicsError
from multicor_cli.engine.inflow import find_room
from multicor_cli.export.csv_files import export_csv
from multicor_cli.model import Presence
from multicor_cli.packing import build, place
from multicor_cli.post import PostError
from multicor_cli.report.pack import view_of
from multicor_cli.running.from_scenario import inflow_rules
from multicor_cli.running.session import Session
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import open_run, run_info, schema, verify

G = 9.81

DROP = """
[[particles]]
name = "drop"
shape = "sphere"
sizes = { kind = "list", radii = [1e-3] }
count = COUNT
velocity = [0.0, -0.1]
spin = 5.0
release = { RATE, start = 0.01, region = { min = [0.049, 0.149], max = [0.051, 0.151] } }
[[outlets]]
name = "floor"
region = { min = [0.0, 0.0], max = [0.1, 0.02] }
"""

OUTLET = """
[[outlets]]
name = "floor"
region = { min = [0.0, 0.03], max = [0.1, 0.04] }
"""

SILO = """
[heat]
temperature = 300.0
[[particles]]
name = "bed"
shape = "sphere"
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 60
packing = { kind = "random" }
region = { min = [0.032, 0.08], max = [0.068, 0.11] }
release = { rate = 500.0, region = { min = [0.03, 0.15], max = [0.07, 0.17] } }
[[particles]]
name = "rain"
shape = "sphere"
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 40
temperature = 350.0
release = { rate = 400.0, start = 0.01, region = { min = [0.03, 0.15], max = [0.07, 0.17] } }
[[walls]]
name = "left"
thermal = { temperature = 400.0 }
geometry = { kind = "polyline", points = [[0.028, 0.2], [0.028, 0.07], [0.045, 0.05]] }
[[walls]]
name = "right"
geometry = { kind = "polyline", points = [[0.072, 0.2], [0.072, 0.07], [0.055, 0.05]] }
[[outlets]]
name = "floor"
then = "THEN"
region = { min = [0.0, 0.0], max = [0.1, 0.02] }
"""


def said(text, duration=0.3, dt=2e-4, **more):
    """What the scenes of this file have in common, without walls unless they name some."""
    walls = {} if "[[walls]]" in text else {"walls": []}
    return {
        "text": text, "size": [0.1, 0.2], "seed": 5, "restitution": 0.2, "dt": dt,
        "duration": duration, "tolerance_rms": 1e-2, "frame_interval": 0.01, **walls, **more,
    }  # fmt: skip


def scenario(text, **more):
    return make_scenario(**said(text, **more))


def dropped(count=1, rate="rate = 100.0"):
    return DROP.replace("COUNT", str(count)).replace("RATE", rate)


SHAPES = (
    '{ kind = "polygon", sides = 5, rounding = 0.05 }',
    '{ kind = "clump", pieces = [{ center = [-1, 0], radius = 1 }, { center = [1, 0], radius = 1 }] }',
)


def silo(then="remove", duration=0.25):
    """Of spheres, or of SHAPES that outlets release once more: "shapes"."""
    if then != "shapes":
        return scenario(SILO.replace("THEN", then), duration=duration)
    text = SILO.replace("THEN", "release")
    for shape in SHAPES:
        text = text.replace('"sphere"', f"{shape}\nthickness = 2e-3", 1)
    return scenario(text, duration=duration)


@pytest.fixture(scope="module")
def silos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("silos")
    for then in ("remove", "release", "shapes"):
        multicor.run(silo(then), folder / then)
    return {then: folder / then for then in ("remove", "release", "shapes")}


def test_a_grain_falls_from_its_release_to_the_outlet(run):
    """From y = 0.15 with −0.1 m/s to 0.02: t = (−v + √(v² + 2 g h))/g; rows are some steps apart."""
    dt = 2e-4
    found = run(scenario(dropped(), dt=dt))
    series, mass, state = found.series, float(found.model.grains.mass[0]), found.state()
    time, row = series["time"], series["time"][1] - series["time"][0]
    flight = (-0.1 + np.sqrt(0.1**2 + 2.0 * G * 0.13)) / G
    assert time[series["present"] > 0][0] == pytest.approx(0.01, abs=row + dt)
    assert time[series["left"] > 0][0] == pytest.approx(0.01 + flight, abs=row + 2.0 * dt)
    last = {name: float(values[-1]) for name, values in series.items() if values.ndim == 1}
    speed, depth = abs(float(state.velocity[0, 1])), float(state.position[0, 1])
    assert 0.02 - 2.0 * speed * dt < depth <= 0.02
    turning = 0.5 * 0.4 * mass * 1e-3**2 * 5.0**2
    potential = last["potential_in"] - last["potential_out"]
    assert last["kinetic_in"] == pytest.approx(0.5 * mass * 0.1**2 + turning, rel=1e-13)
    assert last["kinetic_out"] == pytest.approx(0.5 * mass * speed**2 + turning, rel=1e-13)
    assert last["gravity_work"] == pytest.approx(potential, rel=1e-12)
    assert last["potential_in"] == pytest.approx(mass * G * 0.15, rel=1e-13)
    assert last["kinetic"] == pytest.approx(0.0, abs=1e-15 * mass)
    assert last["closure"] < 1e-12
    assert (last["mass_left"], last["mass_present"], last["mass_waiting"]) == (mass, 0.0, 0.0)
    assert state.presence.tolist() == [Presence.LEFT]


def test_rain_holds_as_many_grains_as_come_in_a_time_of_flight(run):
    rate = 60.0  # released a diameter apart: no two of them touch
    series = run(scenario(dropped(30, f"rate = {rate}"), duration=0.45)).series
    flight = (-0.1 + np.sqrt(0.1**2 + 2.0 * G * 0.13)) / G
    steady = (series["time"] > 0.01 + flight + 0.02) & (series["time"] < 0.4)
    present = series["present"][steady]
    assert abs(present.mean() - rate * flight) < 0.5
    assert set(present.tolist()) <= {int(rate * flight), int(rate * flight) + 1}
    flow = np.polyfit(series["time"][steady], series["outlet_flow"][steady, 0, 0], 1)[0]
    assert flow == pytest.approx(rate, rel=0.1)


def test_a_rate_of_mass_is_kept(run):
    found = run(scenario(dropped(30, "mass_rate = 6e-4"), duration=0.2))
    mass, time = found.model.grains.mass[0], found.series["time"]
    late = (found.series["mass_released"] - 6e-4 * (time - 0.01))[time > 0.02]
    assert (late > -mass).all()
    assert (late <= mass * (1.0 + 1e-9)).all()


def test_releases_wait_for_room_and_the_run_says_so(run):
    found = run(scenario(dropped(30, "rate = 1e4"), duration=0.02))
    behind, y = found.series["behind"], np.sort(found.frames[-1].position[:, 1])
    assert behind[-1] > 0
    assert len(y) >= 1
    assert (np.diff(y) >= 2e-3 * (1.0 - 1e-3)).all()  # one below the other, none overlaps
    (late,) = (check for check in check_run(found.path) if check.name == "late releases")
    assert (late.value, late.verdict) == (behind[-1], Verdict.WARNING)


@pytest.mark.parametrize("then", ["remove", "release", "shapes"])
def test_the_books_of_a_silo_close(silos, then):
    with open_run(silos[then]) as run:
        info, state, first, model = run.info["summary"], run.state(), run.frames[0], run.model
        work, stored = (run.series[name][-1] for name in ("gravity_work", "heat_stored"))
        at_first = G * (first.model.grains.mass * first.position[:, 1]).sum()
    exchange, here = info["exchange"], state.here
    assert exchange["left"] > 20
    assert exchange["mass_closure"] < 1e-13
    assert info["energy_closure"] < 1e-12
    assert info["heat_closure"] < 1e-11
    assert exchange["heat_out"] != 0.0
    known = exchange["present"] + exchange["waiting"] + exchange["left"]
    assert known - exchange["returned"] == 100
    assert exchange["returned"] == (0 if then == "remove" else exchange["left"])
    assert exchange["outlets"]["floor"]["grains"] == exchange["left"]
    potential = G * (model.grains.mass[here] * state.position[here, 1]).sum()
    net = exchange["potential_in"] - exchange["potential_out"]
    slack = 1e-9 * abs(exchange["potential_in"])
    assert work == pytest.approx(at_first - potential + net, abs=slack)
    assert stored == pytest.approx(state.heat[here].sum(), rel=1e-9, abs=1e-12)
    assert not verify(silos[then])
    with h5py.File(silos[then] / "results.h5") as file:
        for spec in schema.select(schema.RESULTS_TABLE, {"heat", "exchange"}):
            assert file[spec.path].attrs["unit"] == spec.unit
        radius, presence = file["VTKHDF/PointData/radius"][:], file["particles/presence"][:]
        assert np.count_nonzero(radius) == np.count_nonzero(presence == Presence.THERE)


@pytest.mark.parametrize("then", ["release", "shapes"])
def test_a_stopped_run_goes_on_to_the_same_bits(silos, tmp_path, then):
    assert in_pieces(silo(then), tmp_path / "run", 37, 400, 801) == digests(silos[then])


def test_bridges_end_with_the_grains_that_go(tmp_path):
    """In a silo of wet grains, whose heat no bridge conducts across a gap."""
    wet = {"force": 5e-5, "range": 1e-4, "kind": "wet"}
    given = scenario(SILO.replace("THEN", "release"), duration=0.25, adhesion=wet)
    whole = multicor.run(given, tmp_path / "whole").directory
    info = run_info(whole)
    assert max(info["energy_closure"], info["heat_closure"]) < 1e-12
    assert info["exchange"]["left"] > 0
    with open_run(whole) as run:
        state, contacts = run.state(), run.frames[-1].contacts
        assert (state.presence[state.bridge_i] == Presence.THERE).all()
        assert state.bridge_i.size > 10
        apart = (contacts.gap > 1e-6) & (contacts.force[:, 0] < 0.0)
        assert apart.any()
        assert not contacts.conductance[apart].any()
    assert in_pieces(given, tmp_path / "cut", 400, 801) == digests(whole)


def test_tables_and_exports_hold_those_alone_that_are_there(silos, tmp_path):
    with open_run(silos["remove"]) as run:
        export_csv(run, tmp_path / "tables", slice(12, 13))
        counts = [len(frame.position) for frame in run.frames]
        for frame, count in zip(run.frames, counts, strict=True):
            here, contacts = frame.presence == Presence.THERE, frame.contacts
            assert count == len(frame.temperature) == frame.model.grain_count == here.sum()
            assert frame.number.tolist() == np.flatnonzero(here).tolist()
            assert frame.presence.size == 100
            assert (contacts.i < count).all()
            pairs = contacts.j < count
            i, j, radius = contacts.i[pairs], contacts.j[pairs], frame.model.grains.radius
            distance = np.hypot(*(frame.position[i] - frame.position[j]).T)
            gap = distance - radius[i] - radius[j]
            # Positions are those at the end of the step
            assert np.abs(gap - contacts.gap[pairs]).max(initial=0.0) < 1e-3
        assert min(counts) < 60 < max(counts)
        assert post.grain_map(run, "temperature", frame=12).value.size == counts[12]
        late, all_of_it = (post.Selection(frames=slice(first, 12)) for first in (8, 1))
        assert post.profile(run, "velocity", selection=late).value.size
        with pytest.raises(PostError, match="come or gone"):
            post.profile(run, "heat", selection=all_of_it)
    rows, series = (
        (tmp_path / "tables" / name).read_text(encoding="utf-8").splitlines()
        for name in ("grains-000012.csv", "series.csv")
    )
    assert len(rows) == 1 + counts[12]
    assert "floor: grains" in series[0]


def test_a_lost_grain_stops_the_run_or_is_removed(run, tmp_path):
    body = dropped(3).split("[[outlets]]")[0]
    with pytest.raises(PhysicsError, match=r"grain 0 at .* is beyond the domain; close the walls"):
        run(scenario(body, domain={"lost": "stop"}), "stop")
    assert run_info(tmp_path / "stop")["exit_code"] == 4
    info = run(scenario(body, domain={"lost": "remove"}), "remove").info["summary"]
    assert (info["exchange"]["lost"], info["exchange"]["present"]) == (3, 0)
    assert info["energy_closure"] < 1e-12


def test_grains_below_all_walls_are_told_of(run):
    body = dropped().split("release =")[0] + 'packing = { kind = "random" }'
    ledge = """
[[walls]]
name = "ledge"
geometry = { kind = "polyline", points = [[0.2, 0.01], [0.3, 0.01]] }
"""
    found = run(scenario(body + ledge))
    (lost,) = (check for check in check_run(found.path) if check.name == "lost grains")
    assert (lost.value, lost.verdict) == (1.0, Verdict.BAD)


REFUSED = {
    "outside": (("max = [0.051, 0.151]", "max = [0.2, 0.151]"), "particles.0.release.region",
        "beyond the domain", "[domain] size"),
    "too small": (("min = [0.049, 0.149]", "min = [0.0499, 0.149]"), "particles.0.release.region",
        "never fit", "enlarge"),
    "rate": (("rate = 100.0", "rate = 0.0"), "particles.0.release.rate", "rate", "0"),
    "no rate": (("rate = 100.0, ", ""), "particles.0.release", "neither rate nor mass_rate",
        "give one"),
    "two rates": (("rate = 100.0", "rate = 100.0, mass_rate = 1.0"), "particles.0.release",
        "both rate and mass_rate", "give one"),
    "no heat": (("spin = 5.0", "temperature = 300.0"), "particles.0.temperature", "no heat",
        "[heat]"),
    "profile": (("spin = 5.0", "shear_rate = 1.0"), "particles.0.shear_rate", "one velocity",
        "remove shear_rate"),
    "no packing": (("release", "# release"), "particles.0.packing", "no packing", "release"),
    "region": (("spin = 5.0", "region = { min = [0, 0], max = [0.1, 0.1] }"), "particles.0.region",
        "no meaning", "release.region"),
    "overlap": (("max = [0.1, 0.02]", "max = [0.1, 0.15]"), "outlets.0.region",
        "leave where they come", "move"),
    "double": (("[[outlets]]", OUTLET + "[[outlets]]"), "outlets.1.name",
        "is also the name of outlets.0", "another name"),
    "nobody": (("release = {", 'packing = { kind = "random" } # {'), "outlets.0.then",
        "no group has a release", "remove"),
    "period": (("max = [0.1, 0.02]", "max = [0.11, 0.02]"), "outlets.0.region", "beyond the period",
        "within the period"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_sense_is_refused_with_place_and_remedy(name):
    (old, new), key, *words = REFUSED[name]
    text = dropped().replace(old, new, 1)
    domain = {"periodic": True} if name == "period" else {}
    if name == "nobody":
        text += 'then = "release"\n'
    assert text != dropped()
    with pytest.raises(ScenarioError) as refused:
        scenario(text, domain=domain)
    found = [problem for problem in refused.value.problems if problem.key == key]
    assert len(found) == 1, refused.value
    said = f"{found[0].message} {found[0].remedy}"
    assert all(word in said for word in words), said


def test_a_gradient_of_temperature_needs_places():
    gradient = "temperature = { value = 300.0, gradient = [1.0, 0.0] }"
    with pytest.raises(ScenarioError, match="grains that wait have none"):
        scenario(SILO.replace("THEN", "remove").replace("temperature = 350.0", gradient))


def test_results_do_not_depend_on_the_number_of_threads(silos, tmp_path):
    Session(silo("release"), tmp_path / "run", threads=2).run()
    assert digests(tmp_path / "run")[0] == digests(silos["release"])[0]


def test_the_grains_of_a_frame_are_those_that_are_there(silos):
    with open_run(silos["remove"]) as run:
        view, frame = view_of(run, len(run.frames) - 1), run.frames[-1]
    assert np.flatnonzero(~np.isnan(view.center[:, 0])).tolist() == frame.number.tolist()
    with open_run(silos["remove"]) as run:
        count = len(run.frames[-1].position)
    packing = {"packing": {"kind": "run", "path": str(silos["remove"])}}
    model, state = build(scenario("", grains={"shape": "sphere", **packing}))
    assert model.grain_count == count == len(state.position)


@pytest.mark.parametrize("path", ["model/outlets", "particles/presence", "series/outlet_flow"])
def test_a_run_that_lacks_a_part_of_it_is_damaged(silos, tmp_path, path):
    file = tmp_path / "results.h5"
    shutil.copy(silos["remove"] / "results.h5", file)
    with h5py.File(file, "r+") as data:
        del data[path]
    assert any(path in finding.message for finding in verify(file))


def test_a_run_goes_on_from_one_whose_grains_come_and_go(run, tmp_path):
    """Who is there stays there, who waits goes on waiting, and who has gone stays away; a frame
    tells the same as the end."""

    def going_on(moment="", outlet=""):
        walls = SILO[SILO.index("[[walls]]") : SILO.index("[[outlets]]")]
        walls = walls.replace("thermal = { temperature = 400.0 }\n", "")
        text = f'[heat]\ntemperature = 300.0\n[start]\nrun = "before"\n{moment}{walls}{outlet}'
        tables = document(**said(text, duration=0.05))
        del tables["particles"]
        return parse_scenario(tomli_w.dumps(tables), tmp_path / "next.toml")

    before = run(silo(duration=0.1), "before")
    last, old, gone = before.frames[-1], before.state(), before.info["summary"]["exchange"]
    assert last.step == old.step
    assert 0 < gone["present"] < 100
    for moment in ("", "frame = -1\n"):
        found = place(going_on(moment))
        state, here = found.state, old.here
        assert np.array_equal(state.presence, old.presence)
        assert np.array_equal(state.position[here], old.position[here])
        assert np.array_equal(state.velocity[here], old.velocity[here])
        assert len(state.contact_i) == len(old.contact_i) > 0
        temperature = state.temperature(found.model.thermal)[here]
        assert temperature == pytest.approx(last.temperature, rel=1e-14)
    for outlet, name in (("", "closed"), (OUTLET, "open")):
        info = run(going_on("", outlet), name).info["summary"]
        exchange = info["exchange"]
        assert exchange["waiting"] == gone["waiting"]
        assert exchange["present"] + exchange["left"] == gone["present"]
        assert max(info["energy_closure"], info["heat_closure"]) < 1e-12
        assert exchange["mass_closure"] < 1e-12
        assert verify(tmp_path / name) == []
        assert outlet or exchange["left"] == 0


BODY = """
[heat]
temperature = 300.0
[[particles]]
name = "rain"
shape = "sphere"
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 8
temperature = 350.0
release = { rate = 500.0, start = 0.02, region = { min = [0.04, 0.1], max = [0.06, 0.12] } }
[[walls]]
name = "plate"
thermal = { capacity = 1e-3, initial = 320.0 }
geometry = { kind = "polyline", points = [[0.03, 0.09], [0.07, 0.09]] }
[[outlets]]
name = "floor"
region = { min = [0.0, 0.0], max = [0.1, 0.02] }
"""


def test_walls_that_wait_for_grains_do_what_others_do(run, tmp_path):
    """A body keeps its temperature, follows its prescribed position, and rubs as stages say, before
    there is a grain and then."""
    drives = {"plate": {"y": {"position": {"sine": {"amplitude": 1e-3, "frequency": 40.0}}}}}
    smooth = {"duration": 0.03, "contacts": [{"pair": ["*", "*"], "friction": 0.0}]}
    loading = [{"duration": 0.05, "drives": drives}, {**smooth, "drives": drives}]
    given = scenario(BODY, duration=0.05, loading=loading)
    found = run(given)
    info, frames, series = found.info["summary"], found.frames, found.series
    assert len(frames[1].position) == 0
    for frame in frames:
        since = frame.time if frame.stage == 0 else frame.time - 0.05
        height = 0.09 + 1e-3 * np.sin(80.0 * np.pi * since)
        assert frame.wall_position[0, 1] == pytest.approx(height, abs=1e-12)
    assert frames[1].wall_temperature[0] == 320.0
    assert frames[-1].wall_temperature[0] > 320.0
    assert max(info["energy_closure"], info["heat_closure"]) < 1e-12
    assert np.ptp(series["friction_loss"][series["time"] > 0.05 + 2e-4]) == 0.0
    assert in_pieces(given, tmp_path / "stopped", 70) == digests(found.path)


SHELF = """
[[particles]]
name = "shot"
shape = "sphere"
sizes = { kind = "list", radii = [1e-3] }
count = 8
velocity = [0.0, -SPEED]
release = { rate = RATE, region = { min = [0.03, 0.102], max = [0.07, 0.106] } }
[[walls]]
name = "shelf"
geometry = { kind = "polyline", points = [[0.0, 0.1], [0.1, 0.1]] }
"""


def shelf(speed, dt, rate=1e5, **laws):
    """Grains are released between 2 and 6 mm above a thin shelf; dt·speed is how far they fly in a
    step."""
    text = SHELF.replace("SPEED", repr(speed)).replace("RATE", repr(rate))
    return scenario(text, dt=dt, duration=0.02, **laws)


@pytest.mark.parametrize(("speed", "dt"), [(10.0, 1e-3), (50.0, 1e-3), (5.0, 1e-2), (100.0, 2e-4)])
@pytest.mark.parametrize("rate", [1e5, 400.0])
def test_released_grains_meet_what_lies_right_below(run, speed, dt, rate):
    found = run(shelf(speed, dt, rate))
    series, mass = found.series, found.model.grains.mass[0]
    assert series["present"][-1] == min(8, 1 + int(0.02 * rate * (1.0 - dt / 0.02)))
    for frame in found.frames:
        assert (frame.position[:, 1] >= 0.1 + 1e-3 * (1.0 - 1e-3)).all()
    assert found.info["summary"]["energy_closure"] < 1e-12
    potential = mass * G * float(found.frames[-1].position[:, 1].sum())
    net = series["potential_in"][-1] - series["potential_out"][-1]
    assert series["gravity_work"][-1] == pytest.approx(net - potential, abs=1e-9 * net)


def test_a_run_that_is_stopped_around_a_release_goes_on_to_the_same_bits(run, tmp_path):
    whole = shelf(50.0, 1e-3, rate=400.0)
    assert in_pieces(whole, tmp_path / "cut", 1, 2, 3, 4, 5, 6) == digests(run(whole).path)


def test_a_step_that_is_interrupted_takes_the_release_before_it_back():
    """Else grains would be new to a step, and known to the same step after a resume."""
    (stopped, _), (other, _) = (engine(shelf(50.0, 1e-3, restitution=0.0)) for _ in range(2))
    ends = []
    for _ in range(2):
        with pytest.raises(Interrupted):
            stopped.step(1e-3, 0.0, lambda: True)
        ends.append(stopped.state.digest())
        stopped.pass_grains()
        assert stopped.state.digest() != ends[0]
    assert ends[0] == ends[1]
    for each in (stopped, other):
        each.step(1e-3, 0.0)
    assert stopped.state.digest() == other.state.digest()


def test_a_step_that_is_interrupted_leaves_the_books_of_who_waits_alone():
    """Nobody comes, for want of room; how many wait for it is in the state, and in its digest."""
    narrow = SHELF.replace("SPEED", "5e-3").replace("RATE", "1e5").replace("[0.07, ", "[0.034, ")
    lying = f"""
[[particles]]
name = "lying"
shape = "sphere"
packing = {{ kind = "file", path = "{rows_of([[0.01, 0.101, 1e-3]])["packing"]["path"]}" }}
"""
    crowded, _ = engine(scenario(narrow + lying, dt=1e-3, duration=0.02))
    for k in range(3):
        crowded.step(1e-3, 1e-3 * k)
    state = crowded.state
    assert state.named("exchange")["behind"] > 0
    state.exchange[list(state.named("exchange")).index("behind")] = 0.0
    before = state.digest()
    with pytest.raises(Interrupted):
        crowded.step(1e-3, 3e-3, lambda: True)
    assert crowded.state.digest() == before


def test_room_is_sought_among_grains_as_large_as_they_have_become():
    """A place beside a grain is free until it has grown."""
    a = 1e-3
    group = {"material": "glass", "shape": "disc", "sizes": {"kind": "list", "radii": [a]}}
    release = {"rate": 1e3, "region": {"min": [0.01, 0.01], "max": [0.01 + 2 * a, 0.01 + 2 * a]}}
    held = [[0.01 + a + 2.01 * a, 0.01 + a, a, 0.0, 0.0, 0.0]]
    glass = {"density": 2500.0, "heat_capacity": 800.0, "conductivity": 1.0, "expansion": 1e-3}
    told = make_scenario(
        particles=[rows_of(held), group | {"name": "more", "count": 1, "release": release}],
        materials={"glass": glass},
        heat={"temperature": 300.0, "conduction": "none"},
    )
    model, state = build(told)
    (rule,) = inflow_rules(told, model).releases
    assert find_room(rule, 0, 1, model, state) == pytest.approx((0.01 + a, 0.01 + a), abs=1e-12)
    state.radius[0] *= 1.02
    assert find_room(rule, 0, 1, model, state) is None


def test_grains_come_again_at_the_angles_at_which_they_came_first(run):
    """Two rods turn as they fall to an outlet that sends them back; each has an angle of its own."""
    region = {"min": [0.02, 0.08], "max": [0.08, 0.09]}
    rods = {
        "name": "rods", "material": "glass", "count": 2, "spin": 20.0, "thickness": 1e-3,
        "shape": {"kind": "rod", "aspect": 3.0}, "sizes": {"kind": "list", "radii": [2e-3, 2e-3]},
        "orientation": {"kind": "list", "angles": [30.0, 75.0]},
        "release": {"rate": 25.0, "region": region},
    }  # fmt: skip
    outlet = {"name": "below", "region": {"min": [-1.0, -1.0], "max": [1.0, 0.01]}}
    made = run(make_scenario(
        particles=[rods], outlets=[outlet | {"then": "release"}], size=[0.1, 0.1], walls=[],
        duration=0.5, dt=1e-3, frame_interval=1e-3,
    ))  # fmt: skip
    came, low = {0: [], 1: []}, {0: 0.0, 1: 0.0}
    for frame in made.frames:
        for grain, at, angle in zip(frame.number, frame.position, frame.angle, strict=True):
            if at[1] > low[grain] + 0.03:
                came[grain].append(np.degrees(angle - 20.0 * 1e-3))
            low[grain] = at[1]
    for grain, angle in ((0, 30.0), (1, 75.0)):
        assert len(came[grain]) >= 3
        assert came[grain] == pytest.approx(np.full(len(came[grain]), angle), abs=1e-6)

"""Grains that come and go: closed forms, books of mass, energy and heat, conservation, and bits
that depend on nothing else.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from run_fakes import digests, in_pieces

from multicor_cli import post
from multicor_cli import run as run_scenario
from multicor_cli.checks import Verdict, check_run
from multicor_cli.engine import Interrupted, PhysicsError
from multicor_cli.export.csv_files import export_csv
from multicor_cli.model import Presence
from multicor_cli.packing import build, place
from multicor_cli.post import PostError
from multicor_cli.report.pack import view_of
from multicor_cli.running.plan import begin_stage
from multicor_cli.running.planning import make_plan
from multicor_cli.running.session import Session, make_engine
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import open_run, run_info, schema, verify

G = 9.81

HEAD = """
[scenario]
name = "flow"
seed = 5
[domain]
size = [0.1, 0.2]
{domain}
[materials.glass]
density = 2500.0
young = 70e9
poisson = 0.22
conductivity = 1.0
heat_capacity = 800.0
[[contacts]]
pair = ["*", "*"]
friction = 0.4
restitution = 0.2
[solver]
dt = {dt}
tolerance_rms = 1e-2
[output]
frame_interval = 0.01
[[loading]]
name = "flow"
duration = {duration}
"""

DROP = """
[[particles]]
name = "drop"
material = "glass"
shape = "sphere"
sizes = {{ kind = "list", radii = [1e-3] }}
count = {count}
velocity = [0.0, -0.1]
spin = 5.0
release = {{ {rate}, start = 0.01, region = {{ min = [0.049, 0.149], max = [0.051, 0.151] }} }}
[[outlets]]
name = "floor"
region = {{ min = [0.0, 0.0], max = [0.1, 0.02] }}
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
material = "glass"
shape = "sphere"
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 60
packing = { kind = "random" }
region = { min = [0.032, 0.08], max = [0.068, 0.11] }
release = { rate = 500.0, region = { min = [0.03, 0.15], max = [0.07, 0.17] } }
[[particles]]
name = "rain"
material = "glass"
shape = "sphere"
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 40
temperature = 350.0
release = { rate = 400.0, start = 0.01, region = { min = [0.03, 0.15], max = [0.07, 0.17] } }
[[walls]]
name = "left"
material = "glass"
thermal = { temperature = 400.0 }
geometry = { kind = "polyline", points = [[0.028, 0.2], [0.028, 0.07], [0.045, 0.05]] }
[[walls]]
name = "right"
material = "glass"
geometry = { kind = "polyline", points = [[0.072, 0.2], [0.072, 0.07], [0.055, 0.05]] }
[[outlets]]
name = "floor"
then = "THEN"
region = { min = [0.0, 0.0], max = [0.1, 0.02] }
"""


def scenario(body: str, domain: str = "", dt: float = 2e-4, duration: float = 0.3):
    return parse_scenario(HEAD.format(domain=domain, dt=dt, duration=duration) + body, "flow.toml")


def drop(count: int = 1, rate: str = "rate = 100.0", **options):
    return scenario(DROP.format(count=count, rate=rate), **options)


def silo(then: str = "remove", duration: float = 0.25, domain: str = ""):
    return scenario(SILO.replace("THEN", then), domain, duration=duration)


@pytest.fixture(scope="module")
def silos(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("silos")
    for then in ("remove", "release"):
        run_scenario(silo(then), folder / then)
    return {then: folder / then for then in ("remove", "release")}


def test_a_grain_falls_from_its_release_to_the_outlet(tmp_path):
    dt = 2e-4
    run_scenario(drop(dt=dt), tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        series = run.series
        mass = float(run.model.grains.mass[0])
        present = series["present"]
        # From y = 0.15 with -0.1 m/s to 0.02: t = (−v + √(v² + 2 g h))/g; rows are some steps
        # apart.
        flight = (-0.1 + np.sqrt(0.1**2 + 2.0 * G * 0.13)) / G
        row = series["time"][1] - series["time"][0]
        assert series["time"][present > 0][0] == pytest.approx(0.01, abs=row + dt)
        assert series["time"][series["left"] > 0][0] == pytest.approx(
            0.01 + flight, abs=row + 2.0 * dt
        )
        last = {name: float(values[-1]) for name, values in series.items() if values.ndim == 1}
        state = run.state()
    speed, depth = abs(float(state.velocity[0, 1])), float(state.position[0, 1])
    assert 0.02 - 2.0 * speed * dt < depth <= 0.02
    inertia = 0.4 * mass * 1e-3**2
    assert last["kinetic_in"] == pytest.approx(
        0.5 * mass * 0.1**2 + 0.5 * inertia * 5.0**2, rel=1e-13
    )
    assert last["kinetic_out"] == pytest.approx(
        0.5 * mass * speed**2 + 0.5 * inertia * 5.0**2, rel=1e-13
    )
    assert last["gravity_work"] == pytest.approx(
        last["potential_in"] - last["potential_out"], rel=1e-12
    )
    assert last["potential_in"] == pytest.approx(mass * G * 0.15, rel=1e-13)
    assert last["kinetic"] == pytest.approx(0.0, abs=1e-15 * mass)
    assert last["closure"] < 1e-12
    assert (last["mass_left"], last["mass_present"], last["mass_waiting"]) == (mass, 0.0, 0.0)
    assert state.presence.tolist() == [Presence.LEFT]


def test_rain_holds_as_many_grains_as_come_in_a_time_of_flight(tmp_path):
    rate = 60.0  # released a diameter apart: no two of them touch
    run_scenario(drop(30, f"rate = {rate}", duration=0.45), tmp_path / "run")
    flight = (-0.1 + np.sqrt(0.1**2 + 2.0 * G * 0.13)) / G
    with open_run(tmp_path / "run") as run:
        time, present = run.series["time"], run.series["present"]
        steady = (time > 0.01 + flight + 0.02) & (time < 0.4)
        assert abs(present[steady].mean() - rate * flight) < 0.5
        assert set(present[steady].tolist()) <= {int(rate * flight), int(rate * flight) + 1}
        flow = np.polyfit(time[steady], run.series["outlet_flow"][steady, 0, 0], 1)[0]
    assert flow == pytest.approx(rate, rel=0.1)


def test_a_rate_of_mass_is_kept(tmp_path):
    run_scenario(drop(30, "mass_rate = 6e-4", duration=0.2), tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        mass, time, released = (
            run.model.grains.mass[0],
            run.series["time"],
            run.series["mass_released"],
        )
    due = 6e-4 * (time - 0.01)
    late = time > 0.02
    assert ((released - due)[late] > -mass).all()
    assert ((released - due)[late] <= mass * (1.0 + 1e-9)).all()


def test_releases_wait_for_room_and_the_run_says_so(tmp_path):
    run_scenario(drop(30, "rate = 1e4", duration=0.02), tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        frame, behind = run.frames[-1], run.series["behind"]
        assert behind[-1] > 0
        y = np.sort(frame.position[:, 1])
        assert len(y) >= 1
        assert (np.diff(y) >= 2e-3 * (1.0 - 1e-3)).all()  # one below the other, none overlaps
    (late,) = (check for check in check_run(tmp_path / "run") if check.name == "late releases")
    assert (late.value, late.verdict) == (behind[-1], Verdict.WARNING)


@pytest.mark.parametrize("then", ["remove", "release"])
def test_the_books_of_a_silo_close(silos, then):
    info = run_info(silos[then])
    exchange = info["exchange"]
    assert exchange["left"] > 20
    assert exchange["mass_closure"] < 1e-13
    assert info["energy_closure"] < 1e-12
    assert info["heat_closure"] < 1e-11
    assert exchange["heat_out"] != 0.0
    assert (
        exchange["present"] + exchange["waiting"] + exchange["left"] - exchange["returned"] == 100
    )
    assert exchange["returned"] == (exchange["left"] if then == "release" else 0)
    assert exchange["outlets"]["floor"]["grains"] == exchange["left"]
    with open_run(silos[then]) as run:
        series, state, model = run.series, run.state(), run.model
        here = state.here
        potential = G * (model.grains.mass[here] * state.position[here, 1]).sum()
        first = run.frames[0]
        at_first = G * (first.model.grains.mass * first.position[:, 1]).sum()
        net = exchange["potential_in"] - exchange["potential_out"]
        assert series["gravity_work"][-1] == pytest.approx(
            at_first - potential + net, abs=1e-9 * abs(exchange["potential_in"])
        )
        held = state.heat[here].sum()
        assert series["heat_stored"][-1] == pytest.approx(held, rel=1e-9, abs=1e-12)
    assert not verify(silos[then])
    with h5py.File(silos[then] / "results.h5") as file:
        for spec in schema.select(schema.RESULTS_TABLE, {"heat", "exchange"}):
            assert file[spec.path].attrs["unit"] == spec.unit
        radius, presence = file["VTKHDF/PointData/radius"][:], file["particles/presence"][:]
        assert np.count_nonzero(radius) == np.count_nonzero(presence == Presence.THERE)


def test_a_stopped_run_goes_on_to_the_same_bits(silos, tmp_path):
    assert in_pieces(silo("release"), tmp_path / "run", 37, 400, 801) == digests(silos["release"])


def test_tables_and_exports_hold_those_alone_that_are_there(silos, tmp_path):
    with open_run(silos["remove"]) as run:
        export_csv(run, tmp_path / "tables", slice(12, 13))
        counts = [len(frame.position) for frame in run.frames]
        for frame in run.frames:
            here = frame.presence == Presence.THERE
            assert (
                len(frame.position)
                == len(frame.temperature)
                == frame.model.grain_count
                == np.count_nonzero(here)
            )
            assert frame.number.tolist() == np.flatnonzero(here).tolist()
            assert frame.presence.size == 100
            assert (frame.contacts.i < len(frame.number)).all()
            pairs = frame.contacts.j < len(frame.number)
            i, j = frame.contacts.i[pairs], frame.contacts.j[pairs]
            gap = (
                np.hypot(*(frame.position[i] - frame.position[j]).T)
                - frame.model.grains.radius[i]
                - frame.model.grains.radius[j]
            )
            # Positions are those at the end of the step
            assert np.abs(gap - frame.contacts.gap[pairs]).max(initial=0.0) < 1e-3
        assert min(counts) < 60 < max(counts)
        assert post.grain_map(run, "temperature", frame=12).value.size == counts[12]
        assert post.profile(
            run, "velocity", selection=post.Selection(frames=slice(8, 12))
        ).value.size
        with pytest.raises(PostError, match="come or gone"):
            post.profile(run, "heat", selection=post.Selection(frames=slice(1, 12)))
        rows = (tmp_path / "tables" / "grains-000012.csv").read_text(encoding="utf-8").splitlines()
        assert len(rows) == 1 + counts[12]
        heading = (tmp_path / "tables" / "series.csv").read_text(encoding="utf-8").splitlines()[0]
        assert "floor: grains" in heading


def test_a_lost_grain_stops_the_run_or_is_removed(tmp_path):
    body = DROP.format(count=3, rate="rate = 100.0").split("[[outlets]]")[0]
    with pytest.raises(PhysicsError, match=r"grain 0 at .* is beyond the domain; close the walls"):
        run_scenario(scenario(body, 'lost = "stop"'), tmp_path / "stop")
    assert run_info(tmp_path / "stop")["exit_code"] == 4
    run_scenario(scenario(body, 'lost = "remove"'), tmp_path / "remove")
    info = run_info(tmp_path / "remove")
    assert (info["exchange"]["lost"], info["exchange"]["present"]) == (3, 0)
    assert info["energy_closure"] < 1e-12


def test_grains_below_all_walls_are_told_of(tmp_path):
    body = DROP.format(count=1, rate="rate = 100.0").split("[[outlets]]")[0]
    body = body.replace(
        body[body.index("release =") : body.index("\n", body.index("release ="))],
        'packing = { kind = "random" }',
    )
    floor = """
[[walls]]
name = "ledge"
material = "glass"
geometry = { kind = "polyline", points = [[0.2, 0.01], [0.3, 0.01]] }
"""
    run_scenario(scenario(body + floor), tmp_path / "run")
    (lost,) = (check for check in check_run(tmp_path / "run") if check.name == "lost grains")
    assert (lost.value, lost.verdict) == (1.0, Verdict.BAD)


REFUSED = {
    "outside": (
        ("max = [0.051, 0.151]", "max = [0.2, 0.151]"),
        "particles.0.release.region",
        "beyond the domain",
        "[domain] size",
    ),
    "too small": (
        ("min = [0.049, 0.149]", "min = [0.0499, 0.149]"),
        "particles.0.release.region",
        "never fit",
        "enlarge",
    ),
    "rate": (("rate = 100.0", "rate = 0.0"), "particles.0.release.rate", "rate", "0"),
    "no rate": (
        ("rate = 100.0, ", ""),
        "particles.0.release",
        "neither rate nor mass_rate",
        "give one",
    ),
    "two rates": (
        ("rate = 100.0", "rate = 100.0, mass_rate = 1.0"),
        "particles.0.release",
        "both rate and mass_rate",
        "give one",
    ),
    "no heat": (
        ("spin = 5.0", "temperature = 300.0"),
        "particles.0.temperature",
        "no heat",
        "[heat]",
    ),
    "profile": (
        ("spin = 5.0", "shear_rate = 1.0"),
        "particles.0.shear_rate",
        "one velocity",
        "remove shear_rate",
    ),
    "no packing": (("release", "# release"), "particles.0.packing", "no packing", "release"),
    "region": (
        ("spin = 5.0", "region = { min = [0, 0], max = [0.1, 0.1] }"),
        "particles.0.region",
        "no meaning",
        "release.region",
    ),
    "overlap": (
        ("max = [0.1, 0.02]", "max = [0.1, 0.15]"),
        "outlets.0.region",
        "leave where they come",
        "move",
    ),
    "double": (
        ("[[outlets]]", OUTLET + "[[outlets]]"),
        "outlets.1.name",
        "is also the name of outlets.0",
        "another name",
    ),
    "nobody": (
        ("release = {", 'packing = { kind = "random" } # {'),
        "outlets.0.then",
        "no group has a release",
        "remove",
    ),
    "period": (
        ("[materials", "periodic = true\n[materials"),
        "outlets.0.region",
        "beyond the period",
        "within the period",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_sense_is_refused_with_place_and_remedy(name):
    (old, new), key, *words = REFUSED[name]
    text = HEAD.format(domain="", dt=2e-4, duration=0.1) + DROP.format(count=1, rate="rate = 100.0")
    if name == "nobody":
        text += 'then = "release"\n'
    if name == "period":
        text = text.replace("max = [0.1, 0.02]", "max = [0.11, 0.02]")
    assert old in text
    with pytest.raises(ScenarioError) as refused:
        parse_scenario(text.replace(old, new, 1), "flow.toml")
    found = [problem for problem in refused.value.problems if problem.key == key]
    assert len(found) == 1, refused.value
    said = f"{found[0].message} {found[0].remedy}"
    assert all(word in said for word in words), said


def test_a_gradient_of_temperature_needs_places():
    text = SILO.replace("THEN", "remove").replace(
        "temperature = 350.0", "temperature = { value = 300.0, gradient = [1.0, 0.0] }"
    )
    with pytest.raises(ScenarioError, match="grains that wait have none"):
        scenario(text)


def test_results_do_not_depend_on_the_number_of_threads(silos, tmp_path):
    Session(silo("release"), tmp_path / "run", threads=2).run()
    assert run_info(tmp_path / "run")["state_digest"] == run_info(silos["release"])["state_digest"]


def test_the_page_and_films_leave_out_who_is_not_there(silos):
    with open_run(silos["remove"]) as run:
        last = len(run.frames) - 1
        view, frame = view_of(run, last), run.frames[last]
    gone = np.isnan(view.center[:, 0])
    assert np.flatnonzero(~gone).tolist() == frame.number.tolist()


def test_grains_of_a_frame_can_begin_another_run(silos, tmp_path):
    with open_run(silos["remove"]) as run:
        count = len(run.frames[-1].position)
    body = f"""
[[particles]]
name = "bed"
material = "glass"
shape = "sphere"
packing = {{ kind = "run", path = "{silos["remove"]}" }}
"""
    model, state = build(scenario(body))
    assert model.grain_count == count == len(state.position)


@pytest.mark.parametrize("path", ["model/outlets", "particles/presence", "series/outlet_flow"])
def test_a_run_that_lacks_a_part_of_it_is_damaged(silos, tmp_path, path):
    file = tmp_path / "results.h5"
    shutil.copy(silos["remove"] / "results.h5", file)
    with h5py.File(file, "r+") as data:
        del data[path]
    assert any(path in finding.message for finding in verify(file))


def test_a_run_goes_on_from_one_whose_grains_come_and_go(tmp_path):
    """Who is there stays there, who waits goes on waiting, and who has gone stays away; a frame
    tells the same as the end.
    """
    head, tail = HEAD.format(domain="", dt=2e-4, duration=0.05).split("[solver]")
    tail = "[solver]" + tail
    walls = SILO[SILO.index("[[walls]]") : SILO.index("[[outlets]]")].replace(
        "thermal = { temperature = 400.0 }\n", ""
    )
    start = '[heat]\ntemperature = 300.0\n[start]\nrun = "before"\n'
    run_scenario(silo(duration=0.1), tmp_path / "before")
    with open_run(tmp_path / "before") as run:
        last, old = run.frames[-1], run.state()
        gone = run.info["summary"]["exchange"]
        assert last.step == old.step
    assert 0 < gone["present"] < 100
    placed = {
        moment: place(parse_scenario(head + start + moment + walls + tail, tmp_path / "next.toml"))
        for moment in ("", "frame = -1\n")
    }
    for found in placed.values():
        state = found.state
        assert np.array_equal(state.presence, old.presence)
        assert np.array_equal(state.position[state.here], old.position[old.here])
        assert np.array_equal(state.velocity[state.here], old.velocity[old.here])
        assert len(state.contact_i) == len(old.contact_i) > 0
        temperature, before = state.temperature(found.model.thermal)[state.here], last.temperature
        assert temperature == pytest.approx(before, rel=1e-14)
    for body, name in ((walls, "closed"), (walls + OUTLET, "open")):
        run_scenario(
            parse_scenario(head + start + body + tail, tmp_path / "next.toml"), tmp_path / name
        )
        info = run_info(tmp_path / name)
        exchange = info["exchange"]
        assert exchange["waiting"] == gone["waiting"]
        assert exchange["present"] + exchange["left"] == gone["present"]
        assert info["energy_closure"] < 1e-12
        assert info["heat_closure"] < 1e-12
        assert exchange["mass_closure"] < 1e-12
        assert verify(tmp_path / name) == []
    assert run_info(tmp_path / "closed")["exchange"]["left"] == 0


BODY = """
[heat]
temperature = 300.0
[[particles]]
name = "rain"
material = "glass"
shape = "sphere"
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 8
temperature = 350.0
release = { rate = 500.0, start = 0.02, region = { min = [0.04, 0.1], max = [0.06, 0.12] } }
[[walls]]
name = "plate"
material = "glass"
thermal = { capacity = 1e-3, initial = 320.0 }
geometry = { kind = "polyline", points = [[0.03, 0.09], [0.07, 0.09]] }
[[outlets]]
name = "floor"
region = { min = [0.0, 0.0], max = [0.1, 0.02] }
"""


def test_walls_that_wait_for_grains_do_what_others_do(tmp_path):
    """A body keeps its temperature, follows its prescribed position, and rubs as stages say, before
    there is a grain and then.
    """
    drives = (
        "drives.plate = { y = { position = { sine = { amplitude = 1e-3, frequency = 40.0 } } } }\n"
    )
    more = (
        '[[loading]]\nname = "smooth"\nduration = 0.03\n'
        'contacts = [{ pair = ["*", "*"], friction = 0.0 }]\n'
    )
    head, tail = HEAD.format(domain="", dt=2e-4, duration=0.05).split("[solver]")
    text = head + BODY + "[solver]" + tail + drives + more + drives
    run_scenario(parse_scenario(text, "flow.toml"), tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        info, frames = run.info["summary"], run.frames
        assert len(frames[1].position) == 0
        for frame in frames:
            since = frame.time if frame.stage == 0 else frame.time - 0.05
            assert frame.wall_position[0, 1] == pytest.approx(
                0.09 + 1e-3 * np.sin(80.0 * np.pi * since), abs=1e-12
            )
        assert frames[1].wall_temperature[0] == 320.0
        assert frames[-1].wall_temperature[0] > 320.0
        last = run.series["friction_loss"]
        assert info["energy_closure"] < 1e-12
        assert info["heat_closure"] < 1e-12
        smooth = run.series["time"] > 0.05 + 2e-4
        assert np.ptp(last[smooth]) == 0.0
    assert in_pieces(parse_scenario(text, "flow.toml"), tmp_path / "stopped", 70) == digests(
        tmp_path / "run"
    )


SHELF = """
[[particles]]
name = "shot"
material = "glass"
shape = "sphere"
sizes = {{ kind = "list", radii = [1e-3] }}
count = 8
velocity = [0.0, -{speed}]
release = {{ rate = {rate}, region = {{ min = [0.03, 0.102], max = [0.07, 0.106] }} }}
[[walls]]
name = "shelf"
material = "glass"
geometry = {{ kind = "polyline", points = [[0.0, 0.1], [0.1, 0.1]] }}
"""


def shelf(speed: float, dt: float, rate: float = 1e5):
    """Grains are released between 2 and 6 mm above a thin shelf; dt·speed is how far they fly in a
    step.
    """
    return scenario(SHELF.format(speed=speed, rate=rate), dt=dt, duration=0.02)


@pytest.mark.parametrize(("speed", "dt"), [(10.0, 1e-3), (50.0, 1e-3), (5.0, 1e-2), (100.0, 2e-4)])
@pytest.mark.parametrize("rate", [1e5, 400.0])
def test_released_grains_meet_what_lies_right_below(tmp_path, speed, dt, rate):
    run_scenario(shelf(speed, dt, rate), tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        assert run.series["present"][-1] == min(8, 1 + int(0.02 * rate * (1.0 - dt / 0.02)))
        for frame in run.frames:
            assert (frame.position[:, 1] >= 0.1 + 1e-3 * (1.0 - 1e-3)).all()
        assert run.info["summary"]["energy_closure"] < 1e-12
        series = run.series
        potential = run.model.grains.mass[0] * G * float(run.frames[-1].position[:, 1].sum())
        net = series["potential_in"][-1] - series["potential_out"][-1]
        assert series["gravity_work"][-1] == pytest.approx(net - potential, abs=1e-9 * net)


def test_a_run_that_is_stopped_around_a_release_goes_on_to_the_same_bits(tmp_path):
    whole = shelf(50.0, 1e-3, rate=400.0)
    run_scenario(whole, tmp_path / "run")
    assert in_pieces(whole, tmp_path / "cut", 1, 2, 3, 4, 5, 6) == digests(tmp_path / "run")


def test_a_step_that_is_interrupted_takes_the_release_before_it_back():
    """Else grains would be new to a step, and known to the same step after a resume."""

    def started():
        whole = shelf(50.0, 1e-3)
        model, state = build(whole)
        engine = make_engine(whole, model, state, 1)
        stage = make_plan(whole, model).stages[0]
        begin_stage(engine, stage, [0.0])
        before = engine.state.digest()
        engine.pass_grains()
        return engine, before

    engine, before = started()
    assert engine.state.digest() != before
    with pytest.raises(Interrupted):
        engine.step(1e-3, 0.0, lambda: True)
    assert engine.state.digest() == before
    engine.pass_grains()
    engine.step(1e-3, 0.0)
    other, _ = started()
    other.step(1e-3, 0.0)
    assert engine.state.digest() == other.state.digest()

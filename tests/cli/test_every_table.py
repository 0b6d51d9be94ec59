"""Every command that reads a run, on runs between walls of every kind and on odd ones: a table of
what is there, or a message."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from command_line import call
from scenarios import plane, toml
from scene_parts import between_planes
from shaped_run import write_shaped_run
from walled import COUNT, FLOOR, FRICTION, LID, PERIOD, RUNS, SMOOTH

from multicor_cli.cli.post_commands import COMMANDS
from multicor_cli.model import State, Thermal
from multicor_cli.post import MAPPED, PROFILED, Selection
from multicor_cli.running.outcome import ExitCode
from multicor_cli.store import RunDirectory, Snapshot, open_run

# --- walls of every kind: what the tables hold


@pytest.fixture(
    scope="module",
    params=[pytest.param(of, marks=[pytest.mark.reliability] * (of.seed > 1)) for of in RUNS],
    ids=lambda of: f"{of.kind} {of.seed}",
)
def walled(request, tmp_path_factory):
    """A short run between walls of some kind."""
    folder = tmp_path_factory.mktemp("walled")
    (folder / "walled.toml").write_text(request.param.text)
    done = call("run", "walled.toml", "-o", "run", cwd=folder)
    assert done.returncode == 0, done.stderr
    with open_run(folder / "run") as run:
        yield request.param, run


def chosen(run):
    """The frames that tables look at unless told otherwise."""
    return [run.frames[int(k)] for k in Selection().indices(run.frames)]


def lines(of, run):
    """Heights of the floor and the lid, averaged over the frames."""
    lid = 0.065 if of.kind == "box of planes" else 0.075 if "under" in of.kind else LID
    first = run.frames[0].wall_position
    way = np.mean([frame.wall_position - first for frame in chosen(run)], axis=0)[:, 1]
    low, high = (way[list(of.walls).index(name)] for name in of.bounds)
    return float(FLOOR + low), float(lid + high)


def wall_forces(run):
    """Shear and normal force on the lid and against it on the floor, half their sum, between the
    first and last frame [N]."""
    time, ends = np.asarray(run.series["time"]), [frame.time for frame in chosen(run)]
    rows = (time > ends[0]) & (time <= ends[-1])
    force = np.asarray(run.series["wall_force"])[rows].mean(axis=0)
    return float(force[0, 0] - force[1, 0]) / 2, float(force[1, 1] - force[0, 1]) / 2


def load_of_frames(run):
    """Mean of what presses floor and lid apart, in the steps of the frames [N]."""
    loads = []
    for frame in chosen(run):
        contacts = frame.contacts
        (nx, _), (p_n, p_t) = contacts.normal.T, contacts.impulse.T
        up = (p_n * contacts.normal[:, 1] + p_t * nx) / frame.dt
        of_walls = contacts.j >= COUNT
        wall = run.model.shapes.wall[contacts.j[of_walls] - COUNT]
        loads.append(0.5 * float((up[of_walls] * np.where(wall == 0, 1.0, -1.0)).sum()))
    return float(np.mean(loads))


def area_of(run):
    return float((np.pi * run.model.grains.radius**2).sum())


def near(value, relative=1e-9):
    return pytest.approx(value, rel=relative)


def bounds_are_right(of, run, table):
    """Heights lie between the walls of the grains, or where the grains are."""
    assert tuple(table["walls"]) == of.bounds
    if all(of.bounds):
        low, high = lines(of, run)
    else:
        y, radius = [frame.position[:, 1] for frame in chosen(run)], run.model.grains.radius
        high = max(float((one + radius).max()) for one in y)
        low = FLOOR if of.bounds[0] else min(float((one - radius).min()) for one in y)
    assert table["height"] == near(high - low)
    assert 0.0 < min(table["y"]) <= max(table["y"]) < table["height"]


def velocity(of, run, table):
    bounds_are_right(of, run, table)
    speeds = np.concatenate([frame.velocity[:, 0] for frame in chosen(run)])
    known = [value for value in table["value"] if value is not None]
    assert speeds.min() - 1e-12 <= min(known) <= max(known) <= speeds.max() + 1e-12


def temperature(of, run, table):
    bounds_are_right(of, run, table)
    known = [value for value in table["value"] if value is not None]
    assert 299.9 < min(known) <= max(known) < 400.1
    assert known[0] > known[-1] or not of.bounds[0]


def solid_fraction(of, run, table):
    """All area is there, but for grains that lie between those of a rough wall, or between a
    polygon and its image."""
    bounds_are_right(of, run, table)
    found, uneven = sum(table["value"]) * table["bin_area"], ("rough", "cluster", "outside")
    assert found <= area_of(run) * (1.0 + 1e-9)
    is_level = not any(kind in shape for shape in of.walls.values() for kind in uneven)
    assert found == near(area_of(run), 1e-6 if is_level else 0.1)


def normal_stress(of, run, table):
    """The load of the lid at all heights of a layer; in a channel the weight above."""
    stress = np.array(table["value"], float)
    if of.is_layer:
        assert np.nanmean(stress) == near(load_of_frames(run) / PERIOD, 0.25)
    elif of.kind == "no walls":
        assert not stress.any()
    else:
        assert stress.min() > -1e-3 * stress.max()
        assert stress[0] > 10.0 * stress[-1]


def heat(of, run, table):
    bounds_are_right(of, run, table)
    # That of a contact may be, not what a grain receives (theory §11.3)
    assert min(table["value"]) >= 0.0
    assert (max(table["value"]) > 0.0) == (of.kind != "no walls")


def theta_eta(of, run, table):
    """Warm at the floor, cold above; each grain is in a bin."""
    y, radius = run.frames[-1].position[:, 1], run.model.grains.radius
    assert (table["wall"], table["wall_temperature"]) == ("floor", 400.0)
    assert sum(table["count"]) == COUNT
    assert table["height"] == near(float((y + radius).max() - (y - radius).min()))
    theta = np.array(table["theta"], float)
    assert -1e-3 < np.nanmin(theta) <= np.nanmax(theta) < 1.001
    half = theta.size // 2
    assert np.nanmean(theta[:half]) > np.nanmean(theta[half:])


def grain_temperatures(of, run, table):
    frame = run.frames[-1]
    assert table["value"] == pytest.approx(frame.temperature.tolist())
    places = np.column_stack([table["x"], table["y"]])
    assert places == pytest.approx(np.asarray(frame.position)[:, :2])


def forces(of, run, table):
    contacts = run.frames[-1].contacts
    normal = contacts.impulse[:, 0] / run.frames[-1].dt
    is_loaded = normal > 0.0
    with_walls = int((contacts.j[is_loaded] >= COUNT).sum())
    assert (table["contacts"], table["wall_contacts"]) == (int(is_loaded.sum()), with_walls)
    assert table["coordination"] == pytest.approx((2 * table["contacts"] - with_walls) / COUNT)
    if is_loaded.any():
        mean = table["normal_force_mean"]
        assert mean == pytest.approx(float(normal[is_loaded].mean()))
        assert table["tangential_force_mean"] <= FRICTION * mean * (1.0 + 1e-9)


def directions(of, run, table):
    assert table["frame_count"] == 5
    assert 0.0 <= table["a_c"] <= 2.0
    assert 0.0 <= table["theta_c"] < 180.0


def rheology(of, run, table):
    """What presses and shears are the walls; the bulk carries the load."""
    low, high = lines(of, run)
    mean, (shear, normal) = table["mean"], wall_forces(run)
    assert (tuple(table["walls"]), table["height"]) == (of.bounds, near(high - low))
    assert mean["pressure"] == near(normal / PERIOD)
    assert mean["friction_walls"] == near(shear / normal)
    if of.is_layer:
        assert 0.5 < mean["solid_fraction"] < 0.95
        assert 1.0 < mean["coordination"] <= mean["coordination_loaded"] < 6.0
        assert mean["bulk_stress_yy"] == near(mean["pressure"], 0.35)
        assert abs(mean["friction_bulk"]) < 1.0
    if of.kind in SMOOTH:
        assert abs(mean["friction_walls"]) <= FRICTION * (1.0 + 1e-6)


def fabric(of, run, table):
    """Numbers of contacts: of the bulk of a layer, elsewhere of all."""
    mean, every = table["mean"], [frame.contacts for frame in chosen(run)]
    numbers = [int(((c.j < COUNT) & (c.impulse[:, 0] != 0.0)).sum()) for c in every]
    if not (of.is_periodic and all(of.bounds)):
        assert table["values"]["contacts"] == numbers
    assert all(a <= b for a, b in zip(table["values"]["contacts"], numbers, strict=True))
    assert 0.0 < mean["mobilization"] <= 1.0
    assert 0.0 < mean["strong_share"] < 1.0
    assert mean["difference"] == near(mean["stress_ratio"] - mean["stress_fabric"], 1e-6)


def lifetimes(of, run, table):
    for name in ("contacts", "strong", "sliding", "again"):
        values = [value for value in table[name] if value is not None]
        assert all(0.0 <= value <= 1.0 for value in values)
    both = zip(table["again"], table["contacts"], strict=True)
    assert all(there >= all_along - 1e-12 for there, all_along in both)
    time = [frame.time for frame in chosen(run)]
    assert table["interval"] == near((time[-1] - time[0]) / (len(time) - 1))


def force_chains(of, run, table):
    mean = table["mean"]
    assert 0.0 <= mean["share"] <= 0.5
    if mean["chains"]:
        assert mean["mean_length"] == near(1e3 * mean["share"] / mean["chains"])
        assert mean["longest"] <= COUNT


def sliding(of, run, table):
    slides, all_of_them = 0, 0
    for frame in chosen(run):
        between = (frame.contacts.j < COUNT) & (frame.contacts.impulse[:, 0] != 0.0)
        slides += int(frame.contacts.sliding[between].sum())
        all_of_them += int(between.sum())
    if all_of_them:
        shares = [value for value in table["values"]["sliding"] if value is not None]
        assert 0.0 <= min(shares) <= slides / all_of_them <= max(shares) <= 1.0


def friction(of, run, table):
    assert sum(table["density"]) / len(table["density"]) == near(1.0)
    assert 0.0 <= table["mean"] <= 1.0


def neighbors(of, run, table):
    """Most of the pairs are where discs touch, none far below; the region is that of the
    centers."""
    d = run.model.mean_diameter
    size = np.mean([np.ptp(frame.position[:, :2], axis=0) for frame in chosen(run)], axis=0)
    if of.is_periodic:
        size[0] = PERIOD
    assert table["region"] == pytest.approx(size)
    assert table["mean_diameter"] == near(d)
    assert table["grain_count"] == COUNT
    g, at = np.array(table["g"]), np.array(table["distance"])
    if of.kind != "no walls":
        assert g[at < 0.7].max() < 0.2
        assert 0.7 < table["first_peak_distance"] < 1.3


def drops(_of, run, table):
    """As many as the energy falls by a standard deviation or more, whatever else is there."""
    is_moving = np.asarray(run.series["window_duration"]) > 0.0
    kinetic = np.asarray(run.series["kinetic"])[is_moving]
    assert table["threshold"] == near(kinetic.std())
    sizes = np.array(table["events"]["size"])
    assert sizes.min() >= table["threshold"] * (1.0 - 1e-9)
    assert sizes.max() <= np.ptp(kinetic)
    assert table["mean"]["size"] == near(sizes.mean())


def cells(of, run, table):
    """Cells are larger than their grains, and of as many as there are; in a layer all fit between
    the walls, but perhaps one at times that has a void beside it."""
    mean = table["mean"]
    assert table["grain_count"] <= COUNT
    assert table["open_share"] == pytest.approx(1.0 - table["grain_count"] / COUNT)
    assert 0.1 < mean["solid_fraction"] < 1.0
    assert 2.0 < mean["neighbors"] < 6.5
    assert 0.0 <= mean["hexatic_global"] <= mean["hexatic"] <= 1.0
    assert sum(table["grains"]) == round(table["grain_count"] * table["frame_count"])
    if of.is_layer:
        low, high = lines(of, run)
        assert table["open_share"] < 1.0 / COUNT
        assert mean["solid_fraction"] > 0.9 * area_of(run) / (PERIOD * (high - low))


def correlated(of, run, table):
    """At touch neighbors share their motion, but no more than all of it."""
    d = run.model.mean_diameter
    assert table["mean_diameter"] == near(d)
    assert table["grain_count"] == COUNT
    assert table["r"] == pytest.approx([d * at for at in table["distance"]])
    speeds = np.concatenate([frame.velocity[:, :2] for frame in chosen(run)])
    assert 0.0 < table["fluctuation"] <= np.sqrt((speeds**2).sum(axis=1).mean()) * (1.0 + 1e-9)


def everywhere(of, run, table):
    """A region that holds all grains."""
    assert set(table["grains"]) == {COUNT}
    assert table["mean"]["solid_fraction"] * table["area"] == near(area_of(run))
    assert (table["mean"]["stress_yy"] > 0.0) == (of.kind != "no walls")
    assert 299.9 < table["mean"]["temperature"] < 400.1


def coarse(of, run, table):
    """The density is that of the grains, but for what is smeared out beyond the ends of a grid."""
    x, y = (np.unique(table[axis]) for axis in "xy")
    cell = (PERIOD / x.size if of.is_periodic else x[1] - x[0]) * (y[1] - y[0])
    found = np.sum(table["values"]["solid-fraction"]) * cell
    assert 0.8 * area_of(run) < found < 1.01 * area_of(run)


def flow(of, run, table):
    """What has crossed a level across the whole domain is above it in the end."""
    first, *_, last = (int((frame.position[:, 1] > 0.02).sum()) for frame in chosen(run))
    assert table["to_the_left"] - table["to_the_right"] == last - first
    assert table["not_counted"] == 0


def series(of, run, table):
    assert table["mean"]["kinetic"] == near(float(np.mean(run.series["kinetic"])), 1e-12)


def books(of, run, table):
    assert max(table["energy_closure"], table["heat_closure"]) < 1e-12
    assert (table["end"]["friction_loss"] > 0.0) == (of.kind != "no walls")


def same(of, run, table):
    assert table["scenario"] == []
    assert {number["difference"] for number in table["numbers"].values()} <= {0.0, None}
    assert table["profiles"]["velocity"]["rms_difference_over_error"] in (0.0, None)
    assert ("pressure" in table["numbers"]) == (of.is_periodic and all(of.bounds))


def strayed(of, run, table):
    """Mean squares of real ways, which are longer than those beside the mean flow."""
    assert len(table["lag"]) == len(table["msd_x"]) == len(table["origins"])
    frames = chosen(run)
    for axis, name in enumerate(("msd_x", "msd_y")):
        first, last = frames[0].unwrapped[:, axis], frames[-1].unwrapped[:, axis]
        assert 0.0 <= min(table[name]) <= 4.0 * ((last - first) ** 2).max() + 1e-9
    assert table["diameter"] == near(run.model.mean_diameter)


def layer_network(of, run, table):
    """Between the walls of a layer, of its contacts alone; other walls are none."""
    low, high = lines(of, run)
    mean = table["mean"]
    assert (tuple(table["walls"]), table["height"]) == (of.bounds, near(high - low))
    assert table["left_out"] == "the gas in the gaps"
    if of.is_periodic:
        assert mean["square"] == near(mean["conductance"] * (high - low) / PERIOD, 0.01)
    assert 0.0 <= mean["joined"] <= 1.0
    assert (mean["conductance"] > 0.0) == of.is_layer


def sizes(of, run, table):
    """Mean diameters by area, at the height of a profile: together all the area of the grains."""
    assert tuple(table["walls"]) == of.bounds
    radius, area, value = run.model.grains.radius, np.array(table["area"]), table["value"]
    known = np.array([v for row in value for v in row if v is not None])
    assert 2.0 * radius.min() <= known.min() * (1.0 + 1e-12)
    assert known.max() <= 2.0 * radius.max() * (1.0 + 1e-12)
    assert area.sum(axis=1).max() <= area_of(run) * (1.0 + 1e-9)


def heat_flows(of, run, table):
    """What the hot wall gives by its contacts, one by one."""
    frame = run.frames[-1]
    contacts, given, number = frame.contacts, 0.0, 0
    for i, j, conductance in zip(contacts.i, contacts.j, contacts.conductance, strict=True):
        is_hot = j >= COUNT and run.model.shapes.wall[j - COUNT] == 0
        number += conductance > 0.0 and (j < COUNT or is_hot)
        given += conductance * (400.0 - frame.temperature[i]) if is_hot else 0.0
    assert (table["contacts"], table["to_walls"]) == (number, 0.0)
    assert table["from_walls"] == pytest.approx(given)


def from_walls(of, run, table):
    """All that the hot wall has given between the frames, over the time."""
    first, *_, last = chosen(run)
    name = next(iter(of.walls))
    given = float(last.wall_heat[0, 0] - first.wall_heat[0, 0])
    assert table["walls"] == [name]
    assert table["mean"][f"{name}: flow"] == near(given / (last.time - first.time))
    warm = table["mean"][f"{name}: bed"]
    assert 299.9 < warm < 400.1
    assert table["mean"][f"{name}: difference"] == near(400.0 - warm)
    assert table["thickness"] == near(run.model.mean_diameter)


def spots(of, run, table):
    """Hotter than the coldest grain; ordered as quantiles are."""
    mean = table["mean"]
    assert 0.0 < mean["rise_50"] <= mean["rise_95"] <= mean["rise_99"] <= mean["rise_max"]
    assert mean["spot_max"] > 300.0 + mean["rise_50"]
    assert 0.0 < mean["sliding"] <= 1.0


TABLES = {
    "profile": velocity,
    "profile --of temperature": temperature,
    "profile --of solid-fraction --exclude-walls 0": solid_fraction,
    "profile --of stress-yy": normal_stress,
    "profile --of heat": heat,
    "theta-eta": theta_eta,
    "map": grain_temperatures,
    "forces": forces,
    "forces --angles --frames -5:": directions,
    "forces --mobilization --frames -5:": friction,
    "rheology": rheology,
    "fabric": fabric,
    "lifetimes": lifetimes,
    "chains": force_chains,
    "clusters": sliding,
    "conductivity": None,
    "conductivity --network": layer_network,
    "heat-network": heat_flows,
    "wall-heat": from_walls,
    "hot-spots": spots,
    "diffusion --margin 1": strayed,
    "structure --margin 0 --reach 1.2": neighbors,
    "mixing": None,
    "mixing --profile size": sizes,
    "residence": None,
    "avalanches --of kinetic": drops,
    "structure --voronoi --margin 0": cells,
    "correlation --margin 0 --reach 1.4": correlated,
    "region --in {min=[0.0,-0.01],max=[0.06,0.09]}": everywhere,
    "fields --spacing 0.25": coarse,
    "flow --line 0.0,0.02:0.06,0.02": flow,
    "series --of kinetic": series,
    "energy": books,
    "compare SELF": same,
}
"""Commands, and what tells whether their table is right."""


ANYWHERE = {
    "mixing": "mixing is one of several groups",
    "residence": "no grain comes or goes in this run",
}
WITHOUT_WALLS = {
    "forces --angles --frames -5:": "no two grains press on each other in these frames",
    "forces --mobilization --frames -5:": "no contact between grains has friction",
    "fabric": "no two grains press on each other in the bulk in these frames",
    "lifetimes": "there is no contact in these frames",
    "correlation --margin 0 --reach 1.4": "nothing moves beside the mean flow in these frames",
    "avalanches --of kinetic": "never drops",
    "wall-heat": "those that have one: none",
    "hot-spots": "no contact slides in these frames",
    "theta-eta": "no wall has a temperature in this frame",
}
"""What commands say of runs of every kind, or of one without walls, in which nothing happens."""


def refusal(of, name):
    """What a command says that has no table of such a run; empty if it has one."""
    if name == "rheology" and not all(of.bounds):
        return "rheology needs a wall below and a wall above the grains that shear them"
    if name == "rheology" and not of.is_periodic:
        return "rheology needs a domain that is periodic in x"
    if name.startswith("diffusion") and not (of.is_periodic and all(of.bounds)):
        return "diffusion needs a mean flow that depends on the height alone"
    if name.startswith("conductivity") and not all(of.bounds):
        return "conductivity needs a wall below and a wall above the grains, walls on their left"
    if name == "conductivity":
        return "have no different temperatures in these frames"
    if of.kind == "no walls" and name in WITHOUT_WALLS:
        return WITHOUT_WALLS[name]
    if name == "theta-eta" and not of.bounds[0]:
        return f"the wall '{next(iter(of.walls))}' is neither below nor above the grains"
    return ANYWHERE.get(name, "")


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", TABLES)
def test_a_table_holds_what_the_run_does(walled, name):
    of, run = walled
    words = [str(run.path) if word == "SELF" else word for word in name.split()]
    done = call("post", words[0], run.path, *words[1:], "--json", cwd=run.path.parent)
    if refused := refusal(of, name):
        assert (done.returncode, done.stdout) == (2, "")
        assert refused in done.stderr
    else:
        assert done.returncode == 0, done.stderr
        TABLES[name](of, run, json.loads(done.stdout))


def test_every_command_is_tried():
    assert {name.split()[0] for name in TABLES} | {"animate"} == set(COMMANDS)


HEAVY = (
    "matplotlib", "multicor_cli.engine.contact", "multicor_cli.packing", "numba",
    "numpy.polynomial", "pandas", "scipy",
    "simpleeval",
)  # fmt: skip
"""What a table without a figure, and an export of frames, do not load: a shell waits for it."""


@pytest.mark.parametrize("words", [
    *(f"post {n} RUN" for n in ["energy", "profile", "rheology", "series", "forces", "structure", "fabric",
        "lifetimes", "correlation"]),
    "export csv RUN -o csv",
])  # fmt: skip
def test_reading_loads_nothing_heavy(finished, tmp_path, words):
    said = f"import sys; sys.argv[1:] = {words.replace('RUN', str(finished)).split()}\n"
    script = said + (
        "from multicor_cli.cli.app import main\ntry: main()\n"
        f"finally: print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stderr.splitlines()[-1] == "[]", done.stderr


# --- runs with hardly anything in them: no crash

GRAINS = {"shape": "sphere", "sizes": {"kind": "list", "radii": [0.01]}}
"""Of them there are a few on a warm floor, below a lid that moves."""


def few(count, warm=400.0, text="", **grains):
    floor = {"geometry": plane(), "thermal": {"temperature": warm}}
    move = {"lid": {"x": {"velocity": 0.1}}}
    group = {**GRAINS, "count": count, **(grains or {"packing": {"kind": "deposited"}})}
    return toml(
        text, size=[1.0, 1.0], periodic=True, friction=0.3, particles=[group],
        walls={"floor": floor, "lid": plane(0.2, -1)}, heat={"temperature": 300.0},
        loading=[{"duration": 4e-3, "drives": move}], dt=1e-3, frame_interval=1e-3,
    )  # fmt: skip


def waiting(start):
    """Grains that are not there at first."""
    region = {"min": [0.4, 0.1], "max": [0.6, 0.15]}
    return few(5, release={"rate": 500.0, "start": start, "region": region})


OUTLET = '[[outlets]]\nname = "out"\nregion = { min = [0.0, -0.1], max = [1.0, 0.19] }'
"""Whoever is there leaves before the first step."""

SCENARIOS = {
    "one grain": few(1), "none yet": waiting(100.0), "none at first": waiting(2e-3),
    "none any more": few(2, text=OUTLET), "two grains, everything cold": few(2, 300.0),
}  # fmt: skip


def write_by_hand(path, places, frames):
    """A run of grains at these places that nothing happens to."""
    model = between_planes([0.1] * len(places))
    n = len(places)
    model = replace(model, thermal=Thermal(np.ones(n), np.full(n, 300.0), np.ones(n)))
    state = State.at_rest(model, np.array(places, float).reshape(-1, 2))
    with RunDirectory.create(path, "", "", {"seed": 1}, stages=("only",)) as run:
        writer = run.writer(model)
        for _ in range(frames):
            writer.frame(Snapshot(state, model, None))
            writer.series_row(Snapshot(state, model))
            state.step, state.time, state.last_dt = state.step + 1, state.time + 0.5, 0.5
        run.checkpoint(state, writer)
        run.finish("finished")


BY_HAND = {
    "no frame": ([(1.0, 0.1), (2.0, 0.1)], 0),
    "one frame": ([(1.0, 0.1), (2.0, 0.1)], 1),
    "all in one place": ([(1.0, 0.5)] * 4, 3),
}


ANY_SHAPE = "grains of any shape"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The odd runs by name."""
    folder = tmp_path_factory.mktemp("odd")
    for name, scenario in SCENARIOS.items():
        file = folder / f"{name.replace(' ', '-')}.toml"
        file.write_text(scenario)
        done = call("run", file.name, "-o", name, cwd=folder)
        assert done.returncode == 0, done.stderr
    for name, (places, frames) in BY_HAND.items():
        write_by_hand(folder / name, places, frames)
    write_shaped_run(folder / ANY_SHAPE, heat=True)
    return {name: folder / name for name in (*SCENARIOS, *BY_HAND, ANY_SHAPE)}


REGION_SEEN = "{ min = [0.3, 0.0], max = [0.7, 0.2] }"
LINE = "0.1,0.01:0.9,0.01"

VARIANTS = {
    "profile": [*(["--of", name] for name in PROFILED), ["--normalized"], ["--bins", "3"],
        ["--frames", ":"]],
    "map": [*(["--of", name] for name in MAPPED), ["--frame", "0"]],
    "theta-eta": [[], ["--wall", "floor"], ["--frame", "0"], ["--frames", ":"]],
    "forces": [[], ["--frame", "0"], ["--mobilization", "--frames", ":"]],
    "rheology": [[], ["--margin", "0", "--frames", ":"]],
    "fabric": [[], ["--margin", "0", "--frames", ":"]],
    "lifetimes": [[], ["--margin", "0", "--frames", ":"]],
    "chains": [[], ["--frames", ":"], ["--lengths", "--angle", "80"], ["--frame", "-1"]],
    "clusters": [[], ["--frames", ":"]],
    "conductivity": [[], ["--network"], ["--network", "--margin", "0", "--frames", ":"]],
    "heat-network": [[], ["--frame", "0"]],
    "wall-heat": [[], ["--near", "2", "--frames", ":"], ["--length", "0.1", "--gas"]],
    "hot-spots": [[], ["--limit", "300", "--frames", ":"]],
    "diffusion": [[], ["--margin", "0", "--frames", ":"]],
    "structure": [
        [], ["--reach", "2", "--margin", "0"], ["--bins", "3", "--frames", ":"], ["--factor"],
        ["--reach", "1e300"], ["--voronoi"], ["--voronoi", "--margin", "0", "--frames", ":"],
    ],
    "mixing": [
        [], ["--cell", "1", "--frames", ":"], ["--group", "grains"], ["--profile", "share"],
        ["--profile", "size"], ["--profile", "size", "--bins", "3", "--times", "1"],
    ],
    "residence": [[], ["--frames", "2:"]],
    "avalanches": [["--of", "kinetic"], ["--of", "kinetic", "--threshold", "1e-30"]],
    "correlation": [[], ["--margin", "0", "--reach", "2"], ["--bins", "3", "--frames", ":"]],
    "region": [["--in", REGION_SEEN],
        ["--in", "{ min = [0.0, 0.15], max = [0.1, 0.2] }", "--frames", ":"]],
    "fields": [
        [], ["--frames", ":"], ["--reach", "1e-9"], ["--reach", "0.01"], ["--reach", "1e-300"],
        ["--spacing", "1e9"],
        ["--line", LINE], ["--center", "0.5,0.1"], ["--center", "0.5,0.1", "--radial"],
        ["--center", "1e300,0"],
    ],
    "energy": [[], ["--from", "1e9"]],
    "compare": [["SELF"]],
    "series": [[], ["--of", "kinetic"]],
    "flow": [["--line", LINE], ["--line", LINE, "--frames", ":"]],
    "animate": [["-o", "film.gif", "--overwrite"]],
}  # fmt: skip
"""Options that change what a command of ``post`` computes."""

OTHERS = [
    ["info"], ["info", "--json"], ["verify"], ["report", "-o", "report.html", "--overwrite"],
    ["export", "gsd", "-o", "run.gsd", "--overwrite"],
    ["export", "vtkhdf", "-o", "run.vtkhdf", "--overwrite"],
    ["export", "csv", "-o", "csv", "--overwrite"],
    ["export", "fclib", "-o", "run.hdf5", "--overwrite"],
]  # fmt: skip


SHOWN = ("one grain", ANY_SHAPE, "none at first", "all in one place")
"""Of these runs every quantity is shown, in every form of output, and of the last two every figure
drawn."""


def commands(run):
    """Every command that reads, in every form of its output, with what changes its numbers."""
    assert VARIANTS.keys() == COMMANDS.keys()
    is_shown = run.name in SHOWN
    forms = [["--json"], ["--csv"], ["--plot", "term"], ["--plot", "figure.png", "--overwrite"]]
    forms = forms[: 4 if run.name in SHOWN[2:] else 3 if is_shown else 1]
    for name, all_variants in VARIANTS.items():
        variants = [k for k in all_variants if is_shown or k is all_variants[0] or "--of" not in k]
        for options in [*variants, *(variants[0] + form for form in forms if name != "animate")]:
            yield ["post", name, str(run), *(word.replace("SELF", str(run)) for word in options)]
    for words in OTHERS:
        place = 2 if words[0] == "export" else 1
        yield [*words[:place], str(run), *words[place:]]


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", [*SCENARIOS, *BY_HAND, ANY_SHAPE])
def test_a_reading_command_gives_a_table_or_a_message(runs, name, tmp_path):
    for words in commands(runs[name]):
        done = call(*words, cwd=tmp_path)
        said = f"{words}: {done.returncode}\n{done.stderr}"
        assert done.returncode != ExitCode.BUG, said
        if done.returncode != ExitCode.DONE:
            assert (done.stdout, bool(done.stderr.strip())) == ("", True), said
        elif "--json" in words:
            json.loads(done.stdout)


@pytest.mark.parametrize(
    "words", [["post", "map"], ["post", "forces"], ["post", "profile"], ["post", "fields"]]
)
def test_where_no_grain_is_a_command_says_so(runs, words, tmp_path):
    done = call(*words, runs["none yet"], cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "no grain is there in frame" in done.stderr


def test_a_film_shows_frames_without_grains(runs, tmp_path):
    done = call("post", "animate", runs["none at first"], "-o", "film.gif", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"{len(open_run(runs['none at first']).frames.time)} frames" in done.stderr
    done = call("post", "animate", runs["none yet"], "-o", "none.gif", cwd=tmp_path)
    assert done.returncode == 2
    assert "no grain is there" in done.stderr

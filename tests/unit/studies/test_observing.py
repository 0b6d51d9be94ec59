"""Numbers taken from runs: those that the commands ``post …`` and ``info`` print, and those that no
run can have."""

import json
import math
import re

import numpy as np
import pytest
from command_line import call
from scenes import CONDUCTING, RAIN, SMALL, WARM, changed

import multicor_cli as multicor
from multicor_cli.post import grain_map
from multicor_cli.post.source import PostError
from multicor_cli.scenario import load_scenario
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import run_info
from multicor_cli.studies.axes import expand
from multicor_cli.studies.observing import SOURCES, Unobservable, missing, take_one, unknown
from multicor_cli.studies.session import check_cases
from multicor_cli.studies.study_file import Observable, load_study

LATE = {"time": 0.02}
BOX = {"min": [0.0, 0.002], "max": [0.02, 0.007]}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return computed(tmp_path_factory.mktemp("cold"), SMALL)


@pytest.fixture(scope="module")
def hot(tmp_path_factory):
    return computed(tmp_path_factory.mktemp("hot"), WARM)


@pytest.fixture(scope="module")
def rain(tmp_path_factory):
    return computed(tmp_path_factory.mktemp("rain"), RAIN)


def computed(folder, text):
    (folder / "a.toml").write_text(text)
    multicor.run(folder / "a.toml", folder / "run", threads=1)
    return folder / "run"


def observable(**keys):
    return Observable.model_validate({"name": "x", **keys})


def taken(run, **keys):
    return tuple(take_one(run, observable(**keys), run_info(run)))


def printed(run, *words):
    """What a command prints; null means that there is no number."""
    done = call("post", words[0], run, *words[1:], "--json", cwd=run.parent)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.replace("null", "NaN"))


@pytest.mark.parametrize(("table", "line", "keys"), [
    ("rheology", "", {}),
    ("fabric", "", {}),
    ("chains", "", {}),
    ("clusters", "", {}),
    ("region", "--in={min=[0.0,0.002],max=[0.02,0.007]}", {"inside": BOX}),
])  # fmt: skip
def test_means_of_tables(table, line, keys, run):
    found = printed(run, table, "--from", "0.02", *line.split())
    for name in (name for name in SOURCES[table].names if name in found["mean"]):
        pair = taken(run, post=table, value=name, after=LATE, **keys)
        expected = (found["mean"][name], found["standard_error"][name])
        assert pair == pytest.approx(expected, nan_ok=True), name
    if table == "region":
        with pytest.raises(Unobservable, match="no temperature"):
            taken(run, post=table, value="temperature", **keys)


def test_columns_of_walls(run):
    """As `post series` names them: the mean of a window-weighted column."""
    with multicor.open_run(run) as opened:
        wall, series = opened.wall_names[-1], opened.series
        rows = (series["time"] >= 0.02) & (series["window_duration"] > 0.0)
        force = series["wall_force"][rows, len(opened.wall_names) - 1, 1]
        mean = np.average(force, weights=series["window_duration"][rows])
    row = observable(series=f"{wall}: force_y", after=LATE)
    assert list(unknown([row])) == []
    assert take_one(run, row, run_info(run)).value == pytest.approx(mean, rel=1e-12)
    with pytest.raises(Unobservable, match="has no nobody: force_y"):
        taken(run, series="nobody: force_y")


@pytest.mark.parametrize("text", [SMALL, RAIN, CONDUCTING], ids=["walls", "outlet", "cell"])
def test_columns_that_a_run_has_are_known_before(text, tmp_path):
    text = text.replace("= 120 * time", "= 5 * time")
    run, scenario = computed(tmp_path, text), load_scenario(tmp_path / "a.toml")
    with multicor.open_run(run) as opened:
        names = [column.name for column in opened.series_columns if ": " in column.name]
    assert len(names) > 5
    rows = [observable(series=name) for name in names]
    assert [finding.what for finding in (*unknown(rows), *missing(rows, scenario))] == []


def test_lifetimes(run):
    found = printed(run, "lifetimes", "--from", "0.02")
    for name in SOURCES["lifetimes"].names:
        pair = taken(run, post="lifetimes", value=name, after=LATE)
        assert pair == pytest.approx((found[name], found[f"{name}_error"]), nan_ok=True)


def test_diffusion(run):
    found = printed(run, "diffusion", "--from", "0.02")
    for axis, name in enumerate(("diffusion_x", "diffusion_y")):
        expected = (found["diffusion"][axis], found["diffusion_error"][axis])
        assert taken(run, post="diffusion", value=name, after=LATE) == pytest.approx(
            expected, nan_ok=True
        )


def test_profile(run):
    found = printed(run, "profile", "--of", "solid-fraction", "--bins", "5", "--from", "0.02")
    keys = {"post": "profile", "value": "solid-fraction"}
    rows = zip(found["y"], found["value"], found["standard_error"], strict=True)
    for y, *pair in rows:
        number = taken(run, at=y + 0.4 * found["bin_width"], bins=5, after=LATE, **keys)
        assert number == pytest.approx(tuple(pair), rel=0.0, abs=0.0, nan_ok=True)
    with pytest.raises(Unobservable, match="outside of the profile"):
        taken(run, at=1.0, **keys)


def test_structure(hot):
    for bins in (None, 30):
        line = () if bins is None else ("--bins", str(bins))
        found = printed(hot, "structure", "--from", "0", *line)
        keys = {"post": "structure", "bins": bins, "after": {"time": 0.0}}
        expected = (found["first_peak"], found["first_peak_error"])
        assert taken(hot, value="first_peak", **keys) == pytest.approx(expected, nan_ok=True)
        assert taken(hot, value="first_peak_distance", **keys)[0] == found["first_peak_distance"]


def test_mixing_and_residence(rain):
    found = printed(rain, "mixing", "--from", "0.05")
    for name in SOURCES["mixing"].names:
        pair = taken(rain, post="mixing", value=name, after={"time": 0.05})
        assert pair == pytest.approx((found["mean"][name], found["standard_error"][name]))
    stays = printed(rain, "residence")
    assert stays["ended"][0] > 50
    pair = taken(rain, post="residence", value="mean")
    assert pair == pytest.approx((stays["mean"][0], stays["standard_error"][0]))
    assert taken(rain, post="residence", value="median")[0] == stays["median"][0]


def test_avalanches(run):
    found = printed(
        run, "avalanches", "--of", "top: force_x", "--from", "0.02", "--threshold", "1e-9"
    )
    assert found["mean"]["count"] > 1
    for name in SOURCES["avalanches"].names:
        pair = taken(
            run, post="avalanches", value=name, column="top: force_x", threshold=1e-9, after=LATE
        )
        expected = (found["mean"][name], found["standard_error"][name])
        assert pair == pytest.approx(expected, nan_ok=True)
    with pytest.raises(ValueError, match="needs column"):
        observable(post="avalanches", value="size")
    with pytest.raises(ValueError, match="threshold belongs to"):
        observable(post="mixing", value="separation", threshold=1.0)


def test_cells_and_correlations(hot):
    found = printed(hot, "structure", "--voronoi", "--from", "0", "--bins", "10")
    keys = {"post": "structure", "bins": 10, "after": {"time": 0.0}}
    for name in ("local_solid_fraction", "share_6", "hexatic_global"):
        expected = (found["mean"][name], found["standard_error"][name])
        assert taken(hot, value=name, **keys) == pytest.approx(expected, nan_ok=True)
    found = printed(hot, "correlation", "--from", "0")
    keys = {"post": "correlation", "after": {"time": 0.0}}
    for name in ("length", "length_across"):
        expected = (found[name], found[f"error_{name}"])
        assert taken(hot, value=name, **keys) == pytest.approx(expected, nan_ok=True)
    assert taken(hot, value="fluctuation", **keys)[0] == found["fluctuation"]


def test_heat(hot):
    """Numbers of networks and of the only warm wall; with the words of the command."""
    network = printed(hot, "heat-network")
    for name in SOURCES["heat-network"].names:
        expected = network[name]
        assert taken(hot, post="heat-network", value=name)[0] == pytest.approx(
            math.nan if expected is None else expected, nan_ok=True
        )
    after = {"time": 0.0}
    found = printed(hot, "wall-heat", "--from", "0")
    (wall,) = found["walls"]
    for name in SOURCES["wall-heat"].names:
        key = f"{wall}: {name}"
        expected = (found["mean"][key], found["standard_error"][key])
        assert taken(hot, post="wall-heat", value=name, after=after) == pytest.approx(
            expected, nan_ok=True
        )
    spots = printed(hot, "hot-spots", "--from", "0")
    for name in ("rise_mean", "spot_max", "peclet_50"):
        expected = (spots["mean"][name], spots["standard_error"][name])
        assert taken(hot, post="hot-spots", value=name, after=after) == pytest.approx(
            expected, nan_ok=True
        )
    with pytest.raises(Unobservable, match="no material has a temperature of ignition"):
        taken(hot, post="hot-spots", value="above", after=after)


def test_maps_and_forces(run):
    keys = {"post": "map", "value": "coordination"}
    with multicor.open_run(run) as opened:
        values = grain_map(opened, "coordination").value
    assert taken(run, **keys)[0] == values.mean()
    assert taken(run, statistic="max", **keys)[0] == values.max()
    assert math.isnan(taken(run, **keys)[1])
    network, angles = printed(run, "forces"), printed(run, "forces", "--angles")
    with pytest.raises(Unobservable, match="all its grains are discs"):
        taken(run, post="forces", value="points")
    with pytest.raises(Unobservable, match="all its grains are discs"):
        taken(run, post="fabric", value="nematic_order")
    for name in (name for name in SOURCES["forces"].names if name != "points"):
        expected = network[name] if name in network else angles[name]
        assert taken(run, post="forces", value=name)[0] == pytest.approx(expected, nan_ok=True), (
            name
        )


def test_energy_heat_and_info(run, hot):
    def value(run, name):
        return taken(run, post="energy", value=name)[0]

    assert value(run, "wall_work") == printed(run, "energy")["end"]["wall_work"]
    found = printed(hot, "energy")
    assert value(hot, "heat_stored") == found["end"]["heat_stored"]
    assert value(hot, "heat_closure") == found["heat_closure"]
    with pytest.raises(Unobservable, match="no heat"):
        value(run, "heat_stored")
    theta = printed(hot, "theta-eta", "--bins", "4")["theta"]
    assert taken(hot, post="theta-eta", value="theta", at=0.3, bins=4)[0] == theta[1]
    mean = run_info(hot)["heat"]["temperature"]["mean"]
    assert taken(hot, info="heat.temperature.mean")[0] == mean


def test_every_number_of_info_is_known(run):
    """What is refused before a run is what no run has."""

    def leaves(prefix, node):
        found = []
        others = ("provenance", "progress", "origin", "worst_step", "exit_code")
        for name, value in node.items():
            if isinstance(value, dict) and name not in others:
                found += leaves(f"{prefix}{name}.", value)
            elif isinstance(value, int | float) and not isinstance(value, bool):
                found.append(prefix + name)
        return [name for name in found if name not in others]

    names = leaves("", run_info(run))
    assert "solver.sweeps_mean" in names
    rows = [observable(info=name) for name in names]
    assert [finding.what for finding in unknown(rows)] == []


KEYS = {
    "profile": {"at": 0.005}, "theta-eta": {"at": 0.5}, "avalanches": {"column": "kinetic"},
    "region": {"inside": BOX},
}  # fmt: skip
NOT_RECORDED = re.compile(r"contacts.* were not recorded|these frames have no contacts")


def test_what_frames_without_contacts_lack_is_known_before(tmp_path):
    """Of every number of every table: refused before the run where it fails after it."""
    text = changed(
        SMALL, ("poisson = 0.22", "poisson = 0.22\nconductivity = 1.0\nheat_capacity = 800.0"),
        ('side = "right" }', 'side = "right" }\nthermal = { temperature = 310.0 }'),
        ("[solver]", "[heat]\n[solver]"), ("[output]", "[output]\ncontacts = false"),
    )  # fmt: skip
    run, scenario = computed(tmp_path, text), load_scenario(tmp_path / "a.toml")
    with multicor.open_run(run) as opened:
        late = {"after": {"time": opened.frames[-5].time}}
    info = run_info(run)
    for table, source in SOURCES.items():
        keys = KEYS.get(table, {}) | ({} if source.is_of_one_frame else late)
        for name in source.names:
            row = observable(post=table, value=name, **keys)
            found = [finding.what for finding in missing([row], scenario)]
            is_refused = any("needs the contacts of frames" in what for what in found)
            try:
                take_one(run, row, info)
                fails = False
            except (PostError, Unobservable) as error:
                fails = NOT_RECORDED.search(str(error)) is not None
            # (other reasons may be told instead of this one, or beside it)
            assert found if fails else not is_refused or len(found) > 1, (table, name)


STUDY = """\
[study]
name = "s"
scenario = "small.toml"

[[observe]]
name = "x"
{}
"""
BOXED = ("periodic = true", "periodic = false")
CONTACTLESS = ("[output]", "[output]\ncontacts = false")
SHORT = ('[[loading]]\nname = "on"\nduration = 0.004\n', "")


def refuse_what_is_wrong(folder):
    study = load_study(folder / "s.toml")
    if findings := list(unknown(study.model.observe)):
        raise study.refuse(*findings)
    check_cases(study, expand(study))


@pytest.mark.parametrize(
    ("keys", "change", "what"),
    [
        ('post = "rheology"\nvalue = "friction_wall"', ("", ""),
            "s.toml:8:1: observe.0.value: rheology has no friction_wall"),
        ('post = "theta-eta"\nvalue = "theta"\nat = 0.5', ("", ""),
            "s.toml:8:1: observe.0.value: theta needs heat"),
        ('series = "heat_stored"', ("", ""),
            "s.toml:7:1: observe.0.series: heat_stored needs heat"),
        ('series = "top: forc_y"', ("", ""), "has no forc_y of top (case only); did you mean 'force_y'"),
        ('post = "avalanches"\nvalue = "size"\ncolumn = "top: nonsense"', ("", ""),
            "s.toml:9:1: observe.0.column: the time series has no nonsense of top"),
        ('post = "avalanches"\nvalue = "size"\ncolumn = "kinetik"', ("", ""),
            "s.toml:9:1: observe.0.column: the time series has no kinetik; did you mean 'kinetic'"),
        ('series = "lid: force_y"', ("", ""),
            "s.toml:7:1: observe.0.series: the time series has no columns of lid"),
        ('info = "heat.temperature.mean"', ("", ""), "heat.temperature.mean needs heat"),
        ('info = "solver.sweeps"', ("", ""), "did you mean 'solver.sweeps_mean'"),
        ('info = "books.wall_wrok"', ("", ""), "did you mean 'books.wall_work'"),
        ('post = "theta-eta"\nvalue = "theta"\nat = 3.0', ("", ""),
            "s.toml:9:1: observe.0.at: η goes from 0 at the lower wall to 1, at is 3"),
        ('post = "fabric"\nvalue = "a_c"', CONTACTLESS,
            "s.toml:8:1: observe.0.value: a_c of fabric needs the contacts of frames"),
        ('post = "profile"\nvalue = "stress-xy"\nat = 0.001', CONTACTLESS,
            "stress-xy of profile needs the contacts of frames"),
        ('post = "rheology"\nvalue = "pressure"', BOXED,
            "rheology needs a domain that is periodic"),
        ('post = "conductivity"\nvalue = "square_xx"', ("", ""), "square_xx needs heat"),
        ('post = "conductivity"\nvalue = "along"', ("", ""), "along needs heat"),
        ('post = "conductivity"\nvalue = "along"', ("", ""),
            "the conductivity of a layer between walls has no along"),
        ('post = "hot-spots"\nvalue = "rise_mean"', ("", ""), "rise_mean needs heat"),
        ('post = "profile"\nvalue = "velocity-x"', ("", ""), 'post = "profile" needs at'),
        ('post = "region"\nvalue = "coordination"', ("", ""), 'post = "region" needs inside'),
        ('post = "rheology"\nvalue = "pressure"\nat = 0.5', ("", ""), "at belongs to"),
        ('post = "energy"\nvalue = "wall_work"\nafter = { time = 0.1 }', ("", ""),
            "energy is about the end of a run"),
        ('series = "kinetic"\nafter = { strain = 3.0 }', SHORT, "ends at a strain of 0.15"),
    ],
)  # fmt: skip
def test_what_no_run_can_have(keys, change, what, tmp_path):
    (tmp_path / "small.toml").write_text(SMALL.replace(*change))
    (tmp_path / "s.toml").write_text(STUDY.format(keys))
    with pytest.raises(ScenarioError) as caught:
        refuse_what_is_wrong(tmp_path)
    assert what in str(caught.value).replace(str(tmp_path) + "/", "")

"""Numbers taken from runs: those that the commands ``post …`` and ``info`` print, and those that no
run can have.
"""

import json
import math

import pytest
from command_line import call
from scenes import SMALL, WARM

import multicor_cli as multicor
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import run_info
from multicor_cli.studies.axes import expand
from multicor_cli.studies.observing import SOURCES, Unobservable, take_one, unknown
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


def computed(folder, text):
    (folder / "a.toml").write_text(text)
    multicor.run(folder / "a.toml", folder / "run", threads=1)
    return folder / "run"


def observable(**keys):
    return Observable.model_validate({"name": "x", **keys})


def taken(run, **keys):
    return tuple(take_one(run, observable(**keys), run_info(run)))


def printed(run, *words):
    done = call("post", words[0], run, *words[1:], "--json", cwd=run.parent)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout, object_hook=_numbers)


def _numbers(found):
    """null means that there is no number."""
    return {
        k: math.nan
        if v is None
        else [math.nan if x is None else x for x in v]
        if isinstance(v, list)
        else v
        for k, v in found.items()
    }


def test_rheology(run):
    found = printed(run, "rheology", "--from", "0.02")
    for name in SOURCES["rheology"].names:
        pair = taken(run, post="rheology", value=name, after=LATE)
        assert pair == pytest.approx(
            (found["mean"][name], found["standard_error"][name]), nan_ok=True
        ), name


def test_region(run):
    found = printed(
        run, "region", "--from", "0.02", "--in", "{ min = [0.0, 0.002], max = [0.02, 0.007] }"
    )
    for name in SOURCES["region"].names:
        if name != "temperature":
            pair = taken(run, post="region", value=name, inside=BOX, after=LATE)
            assert pair == pytest.approx(
                (found["mean"][name], found["standard_error"][name]), nan_ok=True
            ), name
    with pytest.raises(Unobservable, match="no temperature"):
        taken(run, post="region", value="temperature", inside=BOX)


def test_profile(run):
    found = printed(run, "profile", "--of", "solid-fraction", "--bins", "5", "--from", "0.02")
    for k, y in enumerate(found["y"]):
        pair = taken(
            run,
            post="profile",
            value="solid-fraction",
            at=y + 0.4 * found["bin_width"],
            bins=5,
            after=LATE,
        )
        assert pair == pytest.approx(
            (found["value"][k], found["standard_error"][k]), rel=0.0, abs=0.0, nan_ok=True
        )
    with pytest.raises(Unobservable, match="outside of the profile"):
        taken(run, post="profile", value="solid-fraction", at=1.0)


def test_map(run):
    with multicor.open_run(run) as opened:
        from multicor_cli.post import grain_map

        values = grain_map(opened, "coordination").value
    assert taken(run, post="map", value="coordination")[0] == values.mean()
    assert taken(run, post="map", value="coordination", statistic="max")[0] == values.max()
    assert math.isnan(taken(run, post="map", value="coordination")[1])


def test_forces(run):
    network, angles = printed(run, "forces"), printed(run, "forces", "--angles")
    for name in SOURCES["forces"].names:
        expected = network[name] if name in network else angles[name]
        assert taken(run, post="forces", value=name)[0] == pytest.approx(expected, nan_ok=True), (
            name
        )


def test_energy_and_heat(run, hot):
    assert (
        taken(run, post="energy", value="wall_work")[0]
        == printed(run, "energy")["end"]["wall_work"]
    )
    found = printed(hot, "energy")
    assert taken(hot, post="energy", value="heat_stored")[0] == found["end"]["heat_stored"]
    assert taken(hot, post="energy", value="heat_closure")[0] == found["heat_closure"]
    with pytest.raises(Unobservable, match="no heat"):
        taken(run, post="energy", value="heat_stored")


def test_theta_eta(hot):
    found = printed(hot, "theta-eta", "--bins", "4")
    assert taken(hot, post="theta-eta", value="theta", at=0.3, bins=4)[0] == found["theta"][1]


def test_info(hot):
    assert (
        taken(hot, info="heat.temperature.mean")[0] == run_info(hot)["heat"]["temperature"]["mean"]
    )


def test_every_number_of_info_is_known(run):
    """What is refused before a run is what no run has."""

    def leaves(prefix, node):
        found = []
        for name, value in node.items():
            if isinstance(value, dict) and name not in (
                "provenance",
                "progress",
                "origin",
                "worst_step",
            ):
                found += leaves(f"{prefix}{name}.", value)
            elif isinstance(value, int | float) and not isinstance(value, bool):
                found.append(prefix + name)
        return found

    names = leaves("", run_info(run))
    assert "solver.sweeps_mean" in names
    assert [
        finding.message
        for name in names
        if name != "exit_code"
        for finding in unknown([observable(info=name)])
    ] == []


STUDY = """\
[study]
name = "s"
scenario = "small.toml"

[[observe]]
name = "x"
{}
"""
BOXED = ("periodic = true", "periodic = false")
SHORT = ('\n[[loading]]\nname = "on"\nduration = 0.004\n', "")


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
        ('info = "heat.temperature.mean"', ("", ""), "heat.temperature.mean needs heat"),
        ('info = "solver.sweeps"', ("", ""), "did you mean 'solver.sweeps_mean'"),
        ('post = "rheology"\nvalue = "pressure"', BOXED,
            "rheology needs a domain that is periodic"),
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

"""The commands ``study …`` with real worker processes."""

import csv
import io
import json
import os
import re
import shlex
import shutil
import signal
import time
from urllib.parse import quote

import pytest
from command_line import call, call_outside, start
from places import ROOT
from scenes import SMALL, changed
from trials import thinned

import multicor_cli as multicor
from multicor_cli.post import Selection, rheology
from multicor_cli.store import open_run, run_info
from multicor_cli.studies.axes import Case
from multicor_cli.studies.directory import CaseStatus, StudyDirectory

pytest.importorskip("distributed")

STUDY = """\
[study]
name = "s"
scenario = "small.toml"
seeds = 2

[vary]
"contacts.0.friction" = [0.2, 0.4]

[[observe]]
name = "mu"
post = "rheology"
value = "friction_walls"
after = { time = 0.02 }

[[observe]]
name = "kinetic"
series = "kinetic"

[[observe]]
name = "steps"
info = "step"

[compute]
workers = 2
"""
NAMES = [f"friction={friction}_seed={seed}" for friction in (0.2, 0.4) for seed in (3, 4)]


def write(folder, *changes, scenario=("", "")):
    (folder / "s.toml").write_text(changed(STUDY, *changes))
    (folder / "small.toml").write_text(changed(SMALL, scenario))


def ask(folder, line, code=0, call=call):
    """A command about a study: ``call_outside`` where it starts cases."""
    done = call("study", *shlex.split(line), cwd=folder)
    assert done.returncode == code, done.stderr
    return done


def rows(folder, *options):
    return list(
        csv.DictReader(io.StringIO(ask(folder, " ".join(["table s.toml --csv", *options])).stdout))
    )


def states(folder):
    directory = StudyDirectory(folder / "studies" / "s")
    return {case.name: directory.state(case).status for case in directory.cases()}


def digests_of(folder):
    return {row["directory"].rsplit("/", 1)[1]: row["digest"] for row in rows(folder)}


@pytest.fixture(scope="module")
def digests(tmp_path_factory):
    """Of the ends of the cases, each run alone."""
    folder = tmp_path_factory.mktemp("alone")
    write(folder)
    for name in NAMES:
        friction, seed = re.findall(r"[\d.]+", name)
        changes = [f"contacts.0.friction={friction}", f"scenario.seed={seed}"]
        multicor.run(folder / "small.toml", folder / name, overrides=changes)
    return {name: run_info(folder / name)["state_digest"] for name in NAMES}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with a study that is finished."""
    folder = tmp_path_factory.mktemp("finished")
    write(folder)
    done = ask(folder, "run s.toml", call=call_outside)
    assert "4 cases: 4 finished" in done.stderr
    assert "multicor study table s.toml" in done.stderr
    return folder


def test_cases_are_the_runs_that_they_would_be_alone(finished, digests):
    assert digests_of(finished) == digests
    assert all(
        run_info(finished / "studies" / "s" / "cases" / name)["status"] == "finished"
        for name in NAMES
    )


def test_the_same_command_does_nothing_more(finished):
    before = {path: path.stat().st_mtime_ns for path in (finished / "studies").rglob("run.json")}
    ask(finished, "run s.toml")
    assert before == {
        path: path.stat().st_mtime_ns for path in (finished / "studies").rglob("run.json")
    }


def test_table(finished):
    found = rows(finished)
    assert [(row["friction"], row["seed"], row["status"]) for row in found] == [
        (friction, seed, "finished") for friction in ("0.2", "0.4") for seed in ("3", "4")
    ]
    for row in found:
        path = finished / row["directory"]
        with multicor.open_run(path) as run:
            from multicor_cli.post import Selection, rheology

            expected = rheology(run, Selection(start=0.02))
            assert float(row["mu"]) == expected.mean["friction_walls"]
            assert (row["mu_error"] or "nan") == str(expected.error["friction_walls"])
            assert float(row["steps"]) == run.info["summary"]["step"]
        assert float(row["kinetic"]) > 0.0
        assert row["verdict"] in ("ok", "warning", "bad")
    mean = rows(finished, "--mean")
    assert [row["friction"] for row in mean] == ["0.2", "0.4"]
    numbers = [float(row["mu"]) for row in found[:2]]
    assert float(mean[0]["mu"]) == pytest.approx(sum(numbers) / 2.0)
    assert float(mean[0]["mu_between"]) == pytest.approx(abs(numbers[0] - numbers[1]) / 2.0)
    assert mean[0]["mu_seeds"] == "2"


def test_table_as_pandas_and_parquet(finished):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    ask(finished, "table s.toml --parquet t.parquet")
    found = pandas.read_parquet(finished / "t.parquet")
    assert list(found["seed"]) == [3, 4, 3, 4]
    assert found["mu"].notna().all()


def test_figures_of_all_kinds(finished):
    ask(finished, "plot s.toml f.png --of mu --against friction")
    assert (finished / "f.png").read_bytes().startswith(b"\x89PNG")
    said = ask(finished, "plot s.toml term --of steps --against seed", 5).stderr
    assert "varies no seed" in said  # means over seeds have none
    assert "friction" in ask(finished, "plot s.toml term --of mu --against friction").stdout
    line = "plot s.toml g.svg --of mu --against kinetic --curve 'a law: 0.3 + x'"
    ask(finished, line)
    assert "a law" in (finished / "g.svg").read_text()
    assert "--overwrite" in ask(finished, line, 6).stderr
    ask(finished, f"{line} --overwrite")
    ask(finished, "plot s.toml term --of mu --against friction --where friction=0.4")
    ask(finished, "plot s.toml l.svg --of kinetic --against friction --log x --log y")
    ask(finished, "plot s.toml m.svg --of kinetic --against friction --log xy")
    assert (finished / "l.svg").read_bytes() == (finished / "m.svg").read_bytes()
    assert (
        "not x, y or xy"
        in ask(finished, "plot s.toml n.svg --of mu --against friction --log z", 2).stderr
    )


def test_report(finished):
    done = ask(finished, "report s.toml --runs --frames 2")
    assert "wrote 4 pages about runs" in done.stderr
    page = (finished / "studies" / "s" / "s-report.html").read_text()
    for name in NAMES:
        assert f'href="pages/{quote(name)}.html"' in page
        assert f'href="cases/{quote(name)}"' in page
        assert (finished / "studies" / "s" / "pages" / f"{name}.html").is_file()
    assert "4: 4 finished" in page
    ask(finished, "report s.toml", 6)


def test_status(finished):
    found = json.loads(ask(finished, "status s.toml --json").stdout)["cases"]
    assert [case["name"] for case in found] == NAMES
    assert {case["status"] for case in found} == {"finished"}
    states = [StudyDirectory(finished / "studies/s").state(Case(name, {})) for name in NAMES]
    assert all(state.seconds > 0.0 for state in states)
    assert call("study", "cancel", "s.toml", cwd=finished).stderr.startswith("nobody")


def test_more_cases_are_added_and_changed_ones_refused(finished, tmp_path):
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    write(tmp_path, ("seeds = 2", "seeds = [4, 5]"))
    said = ask(tmp_path, "validate s.toml").stdout
    assert "from 2 cases and from what 2 finished runs took" in " ".join(said.split())
    done = ask(tmp_path, "run s.toml", call=call_outside)
    assert "2 cases with" in done.stderr
    new = {"friction=0.2_seed=5", "friction=0.4_seed=5"}
    assert {path.name for path in (tmp_path / "studies/s/cases").iterdir()} == {*NAMES, *new}
    write(tmp_path, scenario=("count = 60", "count = 61"))
    done = ask(tmp_path, "run s.toml", 3)
    assert "it had 60 when the study began" in done.stderr


def test_a_case_that_fails_is_listed_and_tried_again_only_if_asked(tmp_path):
    """Of a stage that has to come further to rest than it can in its time."""
    late = (
        "until = { kinetic_energy_ratio = 1e-2 }",
        'until = { kinetic_energy_ratio = 1e-12 }\non_timeout = "stop"',
    )
    write(tmp_path, ("[0.2, 0.4]", "[0.2]"), ("seeds = 2", "seeds = 1"), scenario=late)
    done = ask(tmp_path, "run s.toml", 4, call=call_outside)
    assert "friction=0.2_seed=3: " in done.stderr
    assert states(tmp_path) == {"friction=0.2_seed=3": CaseStatus.FAILED}
    done = call("study", "status", "s.toml", cwd=tmp_path)
    assert "failed   friction=0.2_seed=3: stage settle" in done.stdout
    again = ask(tmp_path, "run s.toml", 4)
    assert "--retry" in again.stderr
    assert "with 1 worker" not in again.stderr
    assert "with 1 worker" in call_outside("study", "run", "s.toml", "--retry", cwd=tmp_path).stderr


LONG = ("value = 0.15", "value = 2.0")


def wait_until_running(folder, process):
    """Until a case has done a step."""
    directory = StudyDirectory(folder / "studies" / "s")
    for _ in range(1200):
        assert process.poll() is None, process.communicate()
        if directory.exists:
            for case in directory.cases():
                state = directory.state(case)
                if state.status is CaseStatus.RUNNING and state.step > 0:
                    return
        time.sleep(0.05)
    raise AssertionError("no case ran")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Digests of the long cases."""
    folder = tmp_path_factory.mktemp("undisturbed")
    write(folder, ("seeds = 2", "seeds = 1"), scenario=LONG)
    ask(folder, "run s.toml", call=call_outside)
    return digests_of(folder)


ENDS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}


@pytest.mark.parametrize("number", thinned({number.name: number for number in ENDS}, 2))
def test_a_client_that_stops_or_dies_loses_nothing(number, tmp_path, undisturbed):
    write(tmp_path, ("seeds = 2", "seeds = 1"), scenario=LONG)
    process = start("study", "run", "s.toml", cwd=tmp_path)
    wait_until_running(tmp_path, process)
    assert str(process.pid) in ask(tmp_path, "run s.toml", 6).stderr
    os.kill(process.pid, number)
    _, err = process.communicate(timeout=120)
    assert process.returncode == ENDS[number], err
    assert CaseStatus.FAILED not in states(tmp_path).values()
    ask(tmp_path, "run s.toml", call=call_outside)
    assert digests_of(tmp_path) == undisturbed


def test_a_case_whose_process_is_killed_goes_on(tmp_path):
    write(tmp_path, ("[0.2, 0.4]", "[0.2]"), ("seeds = 2", "seeds = 1"), scenario=LONG)
    process = start("study", "run", "s.toml", cwd=tmp_path)
    wait_until_running(tmp_path, process)
    holder = json.loads((tmp_path / "studies/s/cases/friction=0.2_seed=3/lock").read_text())
    os.kill(holder["pid"], signal.SIGKILL)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert list(states(tmp_path).values()) == [CaseStatus.FINISHED]


def test_a_time_limit_stops_with_its_exit_code(tmp_path):
    long = ("value = 0.15", "value = 1000.0")
    write(tmp_path, ("workers = 2", "workers = 1"), scenario=long)
    done = ask(tmp_path, "run s.toml --max-hours 0.003 --json", 75, call=call_outside)
    assert json.loads(done.stdout)["reason"] == "time limit reached"
    assert set(states(tmp_path).values()) <= {CaseStatus.STOPPED, CaseStatus.WAITING}
    assert CaseStatus.STOPPED in states(tmp_path).values()


def test_without_space_nothing_is_started(tmp_path, monkeypatch):
    write(tmp_path)
    monkeypatch.setattr("shutil.disk_usage", lambda _: shutil._ntuple_diskusage(10, 9, 1))
    done = ask(tmp_path, "run s.toml", 3)
    assert "s.toml:3:" in done.stderr
    assert "4 runs will take about" in done.stderr
    assert not (tmp_path / "studies").exists()


@pytest.mark.parametrize(("compute", "what"), [
    ("workers = 2", "of memory, 1 kB are free here"),
    ('slurm = { memory = "1MB" }', ": compute.slurm.memory: a case takes about"),
])  # fmt: skip
def test_without_memory_nothing_is_started(compute, what, tmp_path, monkeypatch):
    write(tmp_path, ("workers = 2", compute))
    monkeypatch.setattr("multicor_cli.studies.clusters.available_memory", lambda: 1000)
    done = ask(tmp_path, "run s.toml", 3)
    assert what in done.stderr
    assert not list((tmp_path / "studies" / "s" / "cases").iterdir())


def test_from_python_with_a_client_of_ones_own(tmp_path, digests):
    distributed = pytest.importorskip("distributed")
    write(tmp_path)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        with pytest.warns(UserWarning, match="asks for no certificate"):
            found = multicor.study(tmp_path / "s.toml", tmp_path / "here", client=client)
        assert client.status == "running"  # it is not ours to close
    pandas = pytest.importorskip("pandas")
    assert isinstance(found, pandas.DataFrame)
    assert (
        dict(zip(found["directory"].str.rsplit("/").str[-1], found["digest"], strict=True))
        == digests
    )
    for case in found.itertuples():
        with open_run(case.directory) as run:
            assert case.mu == rheology(run, Selection(start=0.02)).mean["friction_walls"]


def test_a_directory_with_something_else_is_refused(tmp_path):
    write(tmp_path)
    (tmp_path / "studies" / "s").mkdir(parents=True)
    (tmp_path / "studies" / "s" / "thesis.tex").write_text("")
    done = ask(tmp_path, "run s.toml", 6)
    assert "holds no study" in done.stderr
    assert [path.name for path in (tmp_path / "studies" / "s").iterdir()] == ["thesis.tex"]


def test_shipped_studies_are_valid_and_the_quick_one_runs(tmp_path):
    for path in sorted((ROOT / "configs" / "studies").glob("*.toml")):
        done = call("study", "validate", path, "--json", cwd=ROOT)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["cases"]
    file = ROOT / "configs" / "studies" / "quick.toml"
    done = call_outside("study", "run", file, "-o", tmp_path / "quick", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"multicor study report {file} -o {tmp_path / 'quick'}" in done.stderr
    done = call("study", "table", file, "-o", tmp_path / "quick", "--mean", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)
    friction = [dict(zip(found["headings"], row, strict=True))["mu"] for row in found["rows"]]
    assert 0.25 < friction[0] < friction[1] + 0.05 < friction[2] + 0.1 < 0.6


def test_a_case_in_words():
    assert Case("a", {"x.y": "b c", "z.w": True}).overrides == ['x.y="b c"', "z.w=true"]

"""Studies on a real SLURM, which these tests start on this machine."""

import json
import os
import subprocess
import time

import pytest
from command_line import start
from one_node_slurm import missing, one_node_slurm
from scenes import SMALL

from multicor_cli.studies.directory import CaseStatus, StudyDirectory

pytest.importorskip("dask_jobqueue")
pytestmark = [
    pytest.mark.slurm,
    pytest.mark.skipif(bool(missing()), reason=missing() or "there"),
    pytest.mark.timeout(900),
]

STUDY = """\
[study]
name = "s"
scenario = "small.toml"
seeds = SEEDS

[compute.slurm]
queue = "debug"
cores = 1
memory = "1GB"
jobs = 2
walltime = "WALLTIME"
scheduler_options = { host = "127.0.0.1" }
"""


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    with one_node_slurm(tmp_path_factory.mktemp("slurm")) as found:
        yield found


def begin(folder, slurm, *, seeds=2, walltime="00:10:00", strain=2.0):
    study = STUDY.replace("SEEDS", str(seeds)).replace("WALLTIME", walltime)
    (folder / "s.toml").write_text(study)
    (folder / "small.toml").write_text(SMALL.replace("value = 0.15", f"value = {strain}"))
    return start("study", "run", "s.toml", cwd=folder, **slurm)


def begin_and_wait_until_running(folder, slurm):
    process, directory = begin(folder, slurm), StudyDirectory(folder / "studies" / "s")
    for _ in range(2400):
        assert process.poll() is None, process.communicate()
        if directory.exists and any(
            directory.state(case).status is CaseStatus.RUNNING for case in directory.cases()
        ):
            return process
        time.sleep(0.05)
    raise AssertionError("no case ran")


def ask(slurm, *words, check=True):
    done = subprocess.run(
        words, env={**os.environ, **slurm}, check=check, capture_output=True, text=True
    )
    return done.stdout


def finish(process, folder):
    """Digests of the cases at the end."""
    _, err = process.communicate(timeout=600)
    assert process.returncode == 0, err
    runs = sorted((folder / "studies/s/cases").glob("*/run.json"))
    return [json.loads(run.read_text())["summary"]["state_digest"] for run in runs]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, slurm):
    folder = tmp_path_factory.mktemp("undisturbed")
    digests = finish(begin(folder, slurm), folder)
    assert (folder / "studies/s/logs").is_dir()
    return digests


def cancel_a_job(slurm, process):
    ask(slurm, "scancel", ask(slurm, "squeue", "-h", "-o", "%i", "-t", "R").split()[0])


def kill_the_client(slurm, process):
    process.kill()
    process.communicate()


def take_the_node_down(slurm, process):
    node = f"nodename={ask(slurm, 'sinfo', '-h', '-o', '%n').strip()}"
    ask(slurm, "scontrol", "update", node, "state=down", "reason=test")
    time.sleep(5.0)
    # Refused if it came back by itself
    ask(slurm, "scontrol", "update", node, "state=resume", check=False)


@pytest.mark.parametrize("disturb", [
    cancel_a_job,
    pytest.param(kill_the_client, marks=pytest.mark.reliability),
    pytest.param(take_the_node_down, marks=pytest.mark.reliability),
])  # fmt: skip
def test_a_study_that_is_disturbed_ends_as_it_would_have(tmp_path, slurm, undisturbed, disturb):
    """Another job follows; a client that dies takes its jobs along, and the next one goes on."""
    process = begin_and_wait_until_running(tmp_path, slurm)
    disturb(slurm, process)
    if disturb is kill_the_client:
        process = begin(tmp_path, slurm)
    assert finish(process, tmp_path) == undisturbed


@pytest.mark.reliability
def test_a_walltime_that_is_too_short_is_no_end(tmp_path, slurm):
    """Workers live for half of it, the case for longer: it goes on in the next job."""
    finish(begin(tmp_path, slurm, seeds=1, walltime="00:02:00", strain=200.0), tmp_path)

"""Studies on a real SLURM, which these tests start on this machine."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import command, environment
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
def slurm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    with one_node_slurm(tmp_path_factory.mktemp("slurm")) as found:
        yield found


def begin(
    folder: Path,
    slurm: dict[str, str],
    *,
    seeds: int = 2,
    walltime: str = "00:10:00",
    strain: float = 2.0,
) -> subprocess.Popen[str]:
    if not (folder / "s.toml").exists():
        (folder / "s.toml").write_text(
            STUDY.replace("SEEDS", str(seeds)).replace("WALLTIME", walltime)
        )
        (folder / "small.toml").write_text(SMALL.replace("value = 0.15", f"value = {strain}"))
    return subprocess.Popen(
        command("study", "run", "s.toml"),
        cwd=folder,
        env=environment(**slurm),
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def ask(slurm: dict[str, str], *words: str) -> str:
    return subprocess.run(
        words, env={**os.environ, **slurm}, check=True, capture_output=True, text=True
    ).stdout


def wait_until_running(folder: Path, process: subprocess.Popen[str]) -> None:
    directory = StudyDirectory(folder / "studies" / "s")
    for _ in range(2400):
        assert process.poll() is None, process.communicate()
        if directory.exists and any(
            directory.state(case).status is CaseStatus.RUNNING for case in directory.cases()
        ):
            return
        time.sleep(0.05)
    raise AssertionError("no case ran")


def digests(folder: Path) -> list[str]:
    runs = sorted((folder / "studies/s/cases").glob("*/run.json"))
    return [json.loads(run.read_text())["summary"]["state_digest"] for run in runs]


def finish(process: subprocess.Popen[str]) -> None:
    _, err = process.communicate(timeout=600)
    assert process.returncode == 0, err


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, slurm: dict[str, str]) -> list[str]:
    folder = tmp_path_factory.mktemp("undisturbed")
    finish(begin(folder, slurm))
    assert (folder / "studies/s/logs").is_dir()
    return digests(folder)


def test_a_job_that_is_cancelled_is_followed_by_another(
    tmp_path: Path, slurm: dict[str, str], undisturbed: list[str]
) -> None:
    process = begin(tmp_path, slurm)
    wait_until_running(tmp_path, process)
    job = ask(slurm, "squeue", "-h", "-o", "%i", "-t", "R").split()[0]
    ask(slurm, "scancel", job)
    finish(process)
    assert digests(tmp_path) == undisturbed


def test_a_client_that_dies_takes_its_jobs_along_and_the_next_goes_on(
    tmp_path: Path, slurm: dict[str, str], undisturbed: list[str]
) -> None:
    process = begin(tmp_path, slurm)
    wait_until_running(tmp_path, process)
    process.kill()
    process.communicate()
    finish(begin(tmp_path, slurm))
    assert digests(tmp_path) == undisturbed


def test_a_walltime_that_is_too_short_is_no_end(tmp_path: Path, slurm: dict[str, str]) -> None:
    """Jobs of a minute, cases of more: they go on in the next job."""
    finish(begin(tmp_path, slurm, seeds=1, walltime="00:01:00", strain=100.0))


def test_a_node_that_goes_down(
    tmp_path: Path, slurm: dict[str, str], undisturbed: list[str]
) -> None:
    process = begin(tmp_path, slurm)
    wait_until_running(tmp_path, process)
    node = ask(slurm, "sinfo", "-h", "-o", "%n").strip()
    ask(slurm, "scontrol", "update", f"nodename={node}", "state=down", "reason=test")
    time.sleep(5.0)
    resume = ["scontrol", "update", f"nodename={node}", "state=resume"]
    # Refused if it came back by itself
    subprocess.run(resume, env={**os.environ, **slurm}, check=False, capture_output=True)
    finish(process)
    assert digests(tmp_path) == undisturbed

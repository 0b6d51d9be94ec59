"""Studies lose nothing and do nothing twice, whoever dies: client, worker, case or the scheduler,
at random moments.

A case is done once: after it has been seen finished its files are never touched again. The digests
are those of the cases alone.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from command_line import environment, start
from scenes import SMALL

import multicor_cli as multicor

psutil = pytest.importorskip("psutil")
pytest.importorskip("distributed")
pytestmark = pytest.mark.timeout(3600)

FRICTIONS, SEEDS = (0.2, 0.4, 0.6), (3, 4)
SCENARIO = SMALL.replace("value = 0.15", "value = 2.0") + "checkpoint_interval = 0.5\n"
STUDY = f"""\
[study]
name = "s"
scenario = "small.toml"
seeds = {list(SEEDS)}

[vary]
"contacts.0.friction" = {list(FRICTIONS)}

[compute]
"""
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Digests of the cases, each run alone and undisturbed."""
    folder = tmp_path_factory.mktemp("alone")
    (folder / "small.toml").write_text(SCENARIO)
    found = {}
    for friction in FRICTIONS:
        for seed in SEEDS:
            path = folder / f"{friction}-{seed}"
            overrides = [f"contacts.0.friction={friction}", f"scenario.seed={seed}"]
            multicor.run(folder / "small.toml", path, overrides=overrides, threads=1)
            found[f"friction={friction}_seed={seed}"] = digest(path)
    return found


def digest(run: Path) -> str:
    return str(json.loads((run / "run.json").read_text())["summary"]["state_digest"])


@dataclass
class Finished:
    """Cases that have been seen finished, and what their files were then."""

    folder: Path
    seen: dict[str, dict[str, tuple[int, int]]] = field(default_factory=dict)

    def look(self) -> None:
        """Note new ones; none may have changed."""
        for document in self.folder.glob("studies/s/cases/*/run.json"):
            if json.loads(document.read_text()).get("status") != "finished":
                continue
            now = {
                str(file): (file.stat().st_mtime_ns, file.stat().st_size)
                for file in document.parent.iterdir() if file.name in ("run.json", "results.h5")
            }  # fmt: skip
            assert self.seen.setdefault(document.parent.name, now) == now, (
                f"{document.parent.name} was done twice"
            )


@dataclass
class Cluster:
    """A Dask scheduler with two workers, processes of their own; those that die are started
    again.
    """

    folder: Path
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def address(self) -> str:
        return str(json.loads((self.folder / "scheduler.json").read_text())["address"])

    def mend(self) -> None:
        """Start what is missing; workers end by themselves once their scheduler is gone."""
        if "scheduler" not in self.processes or self.processes["scheduler"].poll() is not None:
            for process in self.processes.values():
                process.kill()
                process.wait()
            self.processes.clear()
            (self.folder / "scheduler.json").unlink(missing_ok=True)
            self._start(
                "scheduler",
                "--host",
                "127.0.0.1",
                "--port",
                "0",
                "--dashboard-address",
                ":0",
                "--scheduler-file",
            )
            while not (self.folder / "scheduler.json").exists():
                time.sleep(0.1)
        for name in ("worker 1", "worker 2"):
            if name not in self.processes or self.processes[name].poll() is not None:
                self._start(
                    name,
                    "--nthreads",
                    "1",
                    "--no-dashboard",
                    "--local-directory",
                    str(self.folder),
                    "--nanny",
                    "--scheduler-file",
                )

    def _start(self, name: str, *options: str) -> None:
        words = [
            sys.executable,
            "-m",
            "distributed.cli.dask_" + name.split()[0],
            *options,
            str(self.folder / "scheduler.json"),
        ]
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                words, cwd=self.folder, env=environment(), stdout=log, stderr=log
            )


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    found = Cluster(folder)
    try:
        yield found
    finally:
        for process in found.processes.values():
            for child in (
                psutil.Process(process.pid).children(recursive=True)
                if process.poll() is None
                else ()
            ):
                child.kill()
            process.kill()
            process.wait()


def victims(client: subprocess.Popen[str], there: Cluster | None) -> dict[str, list[int]]:
    """Processes that may die, by what they are."""
    found: dict[str, list[int]] = {"client": [client.pid]} if client.poll() is None else {}
    roots = {"client": client.pid}
    if there is not None:
        roots = {name: process.pid for name, process in there.processes.items()}
        for name, pid in roots.items():
            found.setdefault(name.split()[0], []).append(pid)
    for root in roots.values():
        try:
            children = psutil.Process(root).children(recursive=True)
            lines = {child.pid: (" ".join(child.cmdline()), child.ppid()) for child in children}
        except psutil.Error:
            continue
        for pid, (line, parent) in lines.items():
            if "studies.forking" in line:  # cases are forked from it
                is_case = "studies.forking" in lines.get(parent, ("", 0))[0]
                found.setdefault("case" if is_case else "fork server", []).append(pid)
            elif "spawn_main" in line:
                found.setdefault("worker", []).append(pid)
    return found


def disturb(
    folder: Path, chance: random.Random, there: Cluster | None, most: int, only: str = ""
) -> Counter[str]:
    """One study from its beginning to its end, with some kills at most, of one kind if that is
    asked; who was killed.
    """
    (folder / "small.toml").write_text(SCENARIO)
    (folder / "s.toml").write_text(STUDY + ("workers = 2\n" if there is None else ""))
    killed: Counter[str] = Counter()
    finished = Finished(folder)
    client: subprocess.Popen[str] | None = None
    while True:
        if client is None or client.poll() is not None:
            if client is not None and client.returncode == 0:
                break
            if client is not None:
                errors = client.communicate()[1]
                assert "Traceback" not in errors, errors
                assert "failed:" not in errors, errors
            if there is not None:
                there.mend()
                (folder / "s.toml").write_text(f'{STUDY}scheduler = "{there.address}"\n')
            client = start("study", "run", "s.toml", cwd=folder)
        deadline = time.monotonic() + chance.uniform(0.0, 8.0)
        while time.monotonic() < deadline and client.poll() is None:
            finished.look()
            time.sleep(0.05)
        if client.poll() is not None or killed.total() >= most:
            continue
        if there is not None:
            there.mend()
        kinds = victims(client, there)
        if only and only not in kinds:
            continue
        kind = only or chance.choice(sorted(kinds))
        number = signal.SIGKILL if kind != "client" else chance.choice(SIGNALS)
        try:
            os.kill(chance.choice(kinds[kind]), number)
        except ProcessLookupError:
            continue
        killed[kind] += 1
        if kind in ("client", "scheduler"):
            client.wait(timeout=120)
    finished.look()
    assert len(finished.seen) == len(FRICTIONS) * len(SEEDS)
    return killed


@pytest.mark.parametrize("only", ["fork server", "worker", "scheduler"])
def test_one_dies(only: str, tmp_path: Path, alone: dict[str, str]) -> None:
    with cluster(tmp_path) as there:
        killed = disturb(
            tmp_path, random.Random(only), None if only == "fork server" else there, 1, only
        )
    assert killed == {only: 1}
    require_undisturbed(tmp_path, alone)


@pytest.mark.reliability
@pytest.mark.parametrize("kind", ["here", "scheduler"])
def test_anybody_dies_at_25_random_moments(
    kind: str, tmp_path: Path, alone: dict[str, str]
) -> None:
    chance, killed = random.Random(kind), Counter[str]()
    for number in range(25):
        folder = tmp_path / str(number)
        folder.mkdir()
        with cluster(folder) as there:
            killed += disturb(
                folder, chance, there if kind == "scheduler" else None, 25 - killed.total()
            )
        require_undisturbed(folder, alone)
        if killed.total() == 25:
            break
    print(f"killed: {dict(killed)}")
    assert killed.total() == 25


def require_undisturbed(folder: Path, alone: dict[str, str]) -> None:
    assert {run.name: digest(run) for run in (folder / "studies/s/cases").iterdir()} == alone
    assert not list((folder / "studies/s/failed").iterdir())

"""Studies lose nothing and do nothing twice, whoever dies: client, worker, case or the scheduler,
at random moments.

A case is done once: after it has been seen finished its files are never touched again. The digests
are those of the cases alone.
"""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict

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
PATIENCE = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "10s"}
"""For a scheduler that does not come back, by default half a minute."""

SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Digests of the cases, each run alone and undisturbed."""
    folder = tmp_path_factory.mktemp("alone")
    (folder / "small.toml").write_text(SCENARIO)
    for friction in FRICTIONS:
        for seed in SEEDS:
            path = folder / "runs" / f"friction={friction}_seed={seed}"
            overrides = [f"contacts.0.friction={friction}", f"scenario.seed={seed}"]
            multicor.run(folder / "small.toml", path, overrides=overrides, threads=1)
    return digests(folder / "runs")


def digests(folder):
    return {
        run.name: json.loads((run / "run.json").read_text())["summary"]["state_digest"]
        for run in folder.iterdir()
    }


def look_at_finished(folder, seen):
    """Note cases that are finished, and what their files are; none may have changed."""
    for document in folder.glob("studies/s/cases/*/run.json"):
        if json.loads(document.read_text()).get("status") == "finished":
            files = (document, document.with_name("results.h5"))
            now = [(file.stat().st_mtime_ns, file.stat().st_size) for file in files]
            name = document.parent.name
            assert seen.setdefault(name, now) == now, f"{name} was done twice"


class Cluster:
    """A Dask scheduler with two workers, processes of their own; those that die are started
    again."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "scheduler.json"
        self.processes = {}

    def is_dead(self, name):
        return name not in self.processes or self.processes[name].poll() is not None

    def mend(self):
        """Start what is missing; workers end by themselves once their scheduler is gone. Gives the
        line of the study that names the scheduler."""
        if self.is_dead("scheduler"):
            for process in self.processes.values():
                process.kill()
                process.wait()
            self.processes.clear()
            self.file.unlink(missing_ok=True)
            self._start("scheduler", "--host 127.0.0.1 --port 0 --dashboard-address :0")
            while not self.file.exists():
                time.sleep(0.1)
        for name in ("worker 1", "worker 2"):
            if self.is_dead(name):
                options = "--nthreads 1 --no-dashboard --nanny --local-directory"
                self._start(name, options, str(self.folder))
        return f'scheduler = "{json.loads(self.file.read_text())["address"]}"\n'

    def _start(self, name, options, *more):
        program = "distributed.cli.dask_" + name.split()[0]
        words = ["-m", program, *options.split(), *more, "--scheduler-file", str(self.file)]
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, *words], cwd=self.folder, env=environment(), stdout=log, stderr=log
            )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for name, process in self.processes.items():
            if not self.is_dead(name):
                for child in psutil.Process(process.pid).children(recursive=True):
                    child.kill()
            process.kill()
            process.wait()


def victims(client, there):
    """Processes that may die, by what they are."""
    found = defaultdict(list)
    if client.poll() is None:
        found["client"].append(client.pid)
    roots = [client.pid]
    if there is not None:
        roots = [process.pid for process in there.processes.values()]
        for name, process in there.processes.items():
            found[name.split()[0]].append(process.pid)
    for root in roots:
        try:
            children = psutil.Process(root).children(recursive=True)
            lines = {child.pid: (" ".join(child.cmdline()), child.ppid()) for child in children}
        except psutil.Error:
            continue
        for pid, (line, parent) in lines.items():
            if "studies.processes" in line:  # cases are forked from it
                is_case = "studies.processes" in lines.get(parent, ("", 0))[0]
                found["case" if is_case else "fork server"].append(pid)
            elif "spawn_main" in line:
                found["worker"].append(pid)
    return found


def disturb(folder, chance, there, most, only=""):
    """One study from its beginning to its end, with some kills at most, of one kind if that is
    asked; who was killed."""
    (folder / "small.toml").write_text(SCENARIO)
    killed, seen, client = Counter(), {}, None
    while client is None or client.poll() != 0:
        if client is None or client.poll() is not None:
            if client is not None:
                errors = client.communicate()[1]
                assert "Traceback" not in errors, errors
                assert "failed:" not in errors, errors
            compute = "workers = 2\n" if there is None else there.mend()
            (folder / "s.toml").write_text(STUDY + compute)
            client = start("study", "run", "s.toml", cwd=folder, **PATIENCE)
        deadline = time.monotonic() + chance.uniform(0.0, 5.0)
        while time.monotonic() < deadline and client.poll() is None:
            look_at_finished(folder, seen)
            time.sleep(0.05)
        if client.poll() is not None or killed.total() >= most:
            continue
        if there is not None:
            there.mend()
        kinds = victims(client, there)
        kind = only or chance.choice(sorted(kinds))
        if kind not in kinds:
            continue
        number = signal.SIGKILL if kind != "client" else chance.choice(SIGNALS)
        with contextlib.suppress(ProcessLookupError):
            os.kill(chance.choice(kinds[kind]), number)
            killed[kind] += 1
            if kind in ("client", "scheduler"):
                client.wait(timeout=120)
    look_at_finished(folder, seen)
    assert len(seen) == len(FRICTIONS) * len(SEEDS)
    return killed


def require_undisturbed(folder, alone):
    assert digests(folder / "studies/s/cases") == alone
    assert not list((folder / "studies/s/failed").iterdir())


@pytest.mark.parametrize("only", [
    "worker",
    pytest.param("fork server", marks=pytest.mark.reliability),
    pytest.param("scheduler", marks=pytest.mark.reliability),
])  # fmt: skip
def test_one_dies(only, tmp_path, alone):
    with Cluster(tmp_path) as there:
        where = None if only == "fork server" else there
        assert disturb(tmp_path, random.Random(only), where, 1, only) == {only: 1}
    require_undisturbed(tmp_path, alone)


@pytest.mark.reliability
@pytest.mark.parametrize("kind", ["here", "scheduler"])
def test_anybody_dies_at_25_random_moments(kind, tmp_path, alone):
    chance, killed = random.Random(kind), Counter()
    for number in range(25):
        folder = tmp_path / str(number)
        folder.mkdir()
        with Cluster(folder) as there:
            where = there if kind == "scheduler" else None
            killed += disturb(folder, chance, where, 25 - killed.total())
        require_undisturbed(folder, alone)
        if killed.total() == 25:
            break
    print(f"killed: {dict(killed)}")
    assert killed.total() == 25

"""Another user of the machine gets nothing run as the owner of a study: here no port is open, and
jobs want a key."""

import contextlib
import json
import os
import signal
import stat
import time

import pytest
from command_line import call_outside, python, start
from pretended_slurm import TAG, pretend_slurm, processes_of
from scenes import SMALL
from trials import thinned

psutil = pytest.importorskip("psutil")
distributed = pytest.importorskip("distributed")

NOBODY = 65534
STUDY = '[study]\nname = "s"\nscenario = "small.toml"\nseeds = 2\n\n[compute]\n'
JOBS = (
    'slurm = { queue = "debug", memory = "1GB", walltime = "00:10:00", jobs = 2, '
    "scheduler_options = { SCHEDULER } }\n"
)
SCHEDULERS = {"everywhere": "", "on loopback": 'host = "127.0.0.1"'}
"""Where the scheduler of jobs listens."""

ATTACK = """\
import asyncio, encodings.idna, json, os, pathlib, sys, urllib.error, urllib.request
from distributed.core import rpc
from distributed.protocol.pickle import dumps
from distributed.security import Security

user, mark, ports, secrets = json.load(sys.stdin)
securities = {"tcp": Security(), "tls": Security.temporary()}
if user is not None:  # the interpreter may be closed to others: what it has loaded is not
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
path = dumps((pathlib.Path(mark),))
touch = {"function": dumps(pathlib.Path.touch), "args": path, "kwargs": dumps({})}
pages = "metrics health status info/main/workers.html json/counts.json json/identity.json api/v1"

async def ask(protocol, port, operation):
    args = securities[protocol].get_connection_args("client")
    async with rpc(f"{protocol}://127.0.0.1:{port}", connection_args=args, timeout=5) as there:
        await asyncio.wait_for(getattr(there, operation)(**touch), 5)

def read(port, page):
    urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=5).close()

async def all_of(attempts):
    return dict(zip(attempts, await asyncio.gather(*attempts.values(), return_exceptions=True)))

async def main():
    attempts = {}
    for port in ports:
        for protocol in securities:
            for operation in ("run", "run_function"):
                attempts[f"{protocol} {port} {operation}"] = ask(protocol, port, operation)
        for page in pages.split():
            attempts[f"http {port} {page}"] = asyncio.to_thread(read, port, page)
    return await all_of(attempts)

answers = {
    what: "answered" if error is None else type(error).__name__
    for what, error in asyncio.run(main()).items()
}
for secret in secrets:
    try:
        pathlib.Path(secret).read_bytes()
        answers[secret] = "answered"
    except OSError as error:
        answers[secret] = type(error).__name__
print(json.dumps(answers))
"""


def attack(mark, ports, secrets=()):
    """What another user, or this one without a key where nobody can become another, is answered who
    tries to have a file made."""
    user = NOBODY if os.getuid() == 0 else None
    read = [str(secret) for secret in secrets if user is not None]
    given = json.dumps([user, str(mark), ports, read])
    done = python("-P", "-c", ATTACK, cwd="/", given=given, timeout=400)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def listening(processes):
    """Ports at which processes listen."""
    found = set()
    for process in processes:
        with contextlib.suppress(psutil.NoSuchProcess):
            connections = process.net_connections(kind="inet")
            found |= {at.laddr.port for at in connections if at.status == psutil.CONN_LISTEN}
    return sorted(found)


def wait_for(is_so, seconds, otherwise):
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end, otherwise()
        time.sleep(0.1)


def write_study(folder, compute, scenario=SMALL):
    (folder / "small.toml").write_text(scenario)
    (folder / "s.toml").write_text(STUDY + compute)


@contextlib.contextmanager
def studying(folder, compute, **variables):
    """All processes of a study of which two cases run."""
    write_study(folder, compute, SMALL.replace("value = 0.15", "value = 1000.0"))
    variables = {TAG: str(folder), **variables}
    tag, client = variables[TAG], start("study", "run", "s.toml", cwd=folder, **variables)

    def two_run():
        assert client.poll() is None, client.stderr.read()
        return len(list(folder.glob("studies/s/cases/*/progress.json"))) >= 2

    try:
        wait_for(two_run, 200.0, lambda: "no case ran")
        yield processes_of(tag)
    finally:
        if client.poll() is None:
            client.send_signal(signal.SIGINT)
        errors = client.communicate(timeout=120)[1]
    assert client.returncode == 130, errors
    assert "Traceback" not in errors, errors
    wait_for(
        lambda: not processes_of(tag), 30.0, lambda: [each.cmdline() for each in processes_of(tag)]
    )


def scheduler_here(**options):
    """A scheduler of Dask with one worker."""
    return distributed.LocalCluster(n_workers=1, host="127.0.0.1", **options)


def test_a_cluster_without_keys_is_open_to_everybody(tmp_path):
    """The attack is one."""
    open_to_all = scheduler_here(
        processes=False, protocol="tcp://", dashboard_address="127.0.0.1:0"
    )
    with open_to_all as there:
        answers = attack(tmp_path / "mark", listening([psutil.Process()]))
        assert (tmp_path / "mark").exists(), answers
        read = [what for what, answer in answers.items() if answer == "answered"]
        assert any(what.startswith("http") for what in read), answers
        assert there.scheduler_address


def test_a_study_here_listens_nowhere(tmp_path):
    with studying(tmp_path, "workers = 2\n") as processes:
        assert len(processes) >= 4  # client, the process that forks, two cases
        assert listening(processes) == []
        sockets = [at for process in processes for at in process.net_connections(kind="unix")]
        assert [at.laddr for at in sockets if at.laddr] == []


@pytest.mark.parametrize("scheduler", thinned(SCHEDULERS, 2))
def test_jobs_work_for_nobody_else(scheduler, tmp_path):
    pytest.importorskip("dask_jobqueue")
    slurm = pretend_slurm(tmp_path / "slurm")
    with studying(tmp_path, JOBS.replace("SCHEDULER", scheduler), **slurm) as processes:
        lines = [" ".join(process.cmdline()) for process in processes]
        assert sum("distributed.cli.dask_worker" in line for line in lines) == 2, lines
        ports = listening(processes)
        assert len(ports) >= 5, ports  # scheduler, two nannies, two workers
        keys = list((tmp_path / "studies/s/logs").glob(".keys-*/*"))
        assert len(keys) == 3
        assert {stat.S_IMODE(path.stat().st_mode) for path in keys} == {0o600}
        assert {stat.S_IMODE(path.parent.stat().st_mode) for path in keys} == {0o700}
        scripts = [path.read_text() for path in (tmp_path / "slurm").glob("job-*.sh")]
        assert not any("PRIVATE KEY" in text for text in [*lines, *scripts])
        answers = attack(tmp_path / "mark", ports, keys)
        assert not (tmp_path / "mark").exists(), answers
        assert "answered" not in answers.values(), answers
    assert not list((tmp_path / "studies/s/logs").glob(".keys-*"))


def test_a_scheduler_without_keys_is_warned_of(tmp_path):
    with scheduler_here(threads_per_worker=1, dashboard_address=None) as there:
        write_study(tmp_path, f'scheduler = "{there.scheduler_address}"\n')
        done = call_outside("study", "run", "s.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"warning: Dask at {there.scheduler_address} asks for no certificate" in done.stderr


def test_a_scheduler_with_keys_of_ones_own(tmp_path):
    keys = distributed.Security.temporary()
    variables = {}
    for name, text in (
        ("CA_FILE", keys.tls_ca_file),
        ("CLIENT__CERT", keys.tls_client_cert),
        ("CLIENT__KEY", keys.tls_client_key),
    ):
        (tmp_path / name).write_text(text)
        variables[f"DASK_DISTRIBUTED__COMM__TLS__{name}"] = str(tmp_path / name)
    own = {"security": keys, "protocol": "tls://"}
    with scheduler_here(threads_per_worker=1, dashboard_address=None, **own) as there:
        write_study(tmp_path, f'scheduler = "{there.scheduler_address}"\n')
        refused = call_outside("study", "run", "s.toml", cwd=tmp_path)
        done = call_outside("study", "run", "s.toml", cwd=tmp_path, **variables)
    assert refused.returncode == 5, refused.stderr
    assert "Traceback" not in refused.stderr
    assert "wants a certificate: set DASK_DISTRIBUTED__COMM__TLS__CA_FILE" in refused.stderr
    assert done.returncode == 0, done.stderr
    assert "warning: Dask" not in done.stderr

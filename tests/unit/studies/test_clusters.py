"""Jobs of batch systems as far as their scripts go, and workers that somebody else has started."""

import contextlib
import shlex
import stat
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from multicor_cli.optional import MissingLibrary
from multicor_cli.scenario import Refused
from multicor_cli.store.errors import StoreError
from multicor_cli.studies.clusters import (
    Needs,
    _cluster,
    _wants_dashboard,
    existing,
    parse_memory,
    require_libraries,
)
from multicor_cli.studies.study_file import Compute, Queue

pytest.importorskip("dask_jobqueue")
pytest.importorskip("cryptography")

LINES = {
    "slurm": ["#SBATCH -p main", "#SBATCH -t 02:00:00", "--cpus-per-task=4", "--mem=8G"],
    "pbs": ["#PBS -q main", "walltime=02:00:00", "ncpus=4"],
    "sge": ["#$ -q main", "h_rt=02:00:00"],
    "lsf": ["#BSUB -q main", "#BSUB -W 02:00", "#BSUB -n 4"],
}


@pytest.fixture
def keys(tmp_path):
    from multicor_cli.studies.clusters import cluster_keys

    with contextlib.ExitStack() as stack:
        yield cluster_keys(stack, tmp_path / "it's a study" / "logs")
    assert not list((tmp_path / "it's a study" / "logs").iterdir())


@pytest.mark.parametrize("name", LINES)
def test_scripts_of_jobs(name, tmp_path, keys):
    more = {"job_extra_directives": ["--account=me"]}
    table = Queue(queue="main", walltime="02:00:00", cores=4, memory="8GB", jobs=3, **more)
    with _cluster(name, table, tmp_path, parse_memory(table.memory), keys) as cluster:
        script = cluster.job_script()
        assert cluster.scheduler_address.startswith("tls://")
    for line in (
        *LINES[name], "--account=me",
        "--lifetime 7155s",  # 45 s before the walltime
        "--resources cores=4,memory=8000000000", "--nthreads 4",
    ):  # fmt: skip
        assert line in script, script
    (line,) = [line for line in script.splitlines() if "dask_worker" in line]
    words = shlex.split(line)
    assert words[:3] == ["cd", "/", "&&"]
    start, worker = words.index("-m"), "distributed.cli.dask_worker"
    assert words[start - 2 : start + 2] == [sys.executable, "-P", "-m", worker]
    assert "PRIVATE KEY" not in script
    for option, key in {"ca-file": "ca_file", "cert": "worker_cert", "key": "worker_key"}.items():
        file = Path(words[words.index(f"--tls-{option}") + 1])
        assert file == Path(getattr(keys, f"tls_{key}"))
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700


def test_the_interpreter_of_jobs_may_be_another(tmp_path, keys):
    with _cluster("slurm", Queue(python="/opt/bin/python -E"), tmp_path, 1e9, keys) as cluster:
        assert (
            " /opt/bin/python -E -P -m distributed.cli.dask_worker tls://" in cluster.job_script()
        )


def test_files_of_keys_that_a_killed_client_has_left_are_removed(tmp_path):
    from multicor_cli.studies.clusters import cluster_keys

    (tmp_path / ".keys-old").mkdir()
    (tmp_path / ".keys-old" / "tls_worker_key.pem").write_text("secret")
    (tmp_path / "dask-worker-1.err").write_text("")
    with contextlib.ExitStack() as stack:
        kept = Path(cluster_keys(stack, tmp_path).tls_worker_key).parent
        assert sorted(tmp_path.iterdir()) == sorted([kept, tmp_path / "dask-worker-1.err"])


def test_an_option_that_the_batch_system_does_not_have(tmp_path, keys):
    with pytest.raises(StoreError, match=r"\[compute\] slurm: .*colour"):
        _cluster("slurm", Queue(colour="red"), tmp_path, 1e9, keys)


@pytest.mark.parametrize("missing", ["distributed", "dask_jobqueue", "cryptography"])
def test_what_is_missing_is_named(missing, monkeypatch):
    monkeypatch.setitem(sys.modules, missing, None)
    require_libraries(Compute(workers=2))  # here nothing is needed
    with pytest.raises(
        MissingLibrary,
        match=f"need {missing.replace('_', '-')}, which is not installed: pip install",
    ):
        require_libraries(Compute(slurm=Queue()))


class _Client:
    def __init__(self, *memories, address="tls://10.0.0.1:8786"):
        self.scheduler = SimpleNamespace(address=address)
        self._workers = {
            str(k): {"nthreads": 2, "resources": {"memory": m} if m else {}}
            for k, m in enumerate(memories)
        }

    def scheduler_info(self, n_workers):
        return {"workers": self._workers}


def test_workers_that_say_how_much_memory_they_have():
    site = existing(_Client(8e9, 4e9), Compute(), Needs(1, 2e9))
    assert site.asked == {"memory": 2e9}
    assert site.slots == 4
    # One says nothing: it could never be asked
    assert existing(_Client(8e9, 0.0), Compute(), Needs(1, 2e9)).asked == {}
    assert existing(_Client(), Compute(), Needs(1, 2e9)).asked == {}
    with pytest.raises(Refused, match="a case takes about 9 GB, workers offer 8 GB at most"):
        existing(_Client(8e9, 4e9), Compute(), Needs(1, 9e9))


@pytest.mark.parametrize(("options", "wanted"), [
    ({}, False), ({"host": "127.0.0.1"}, False), ({"dashboard_address": ":8787"}, True),
    ({"dashboard": True}, True),
])  # fmt: skip
def test_a_dashboard_is_there_only_if_asked_for(options, wanted, tmp_path, keys):
    table = Queue(scheduler_options=options)
    assert _wants_dashboard(table) is wanted
    with _cluster("slurm", table, tmp_path, 1e9, keys) as cluster:
        assert cluster.scheduler_spec["options"]["dashboard"] is wanted
        assert cluster.scheduler_spec["options"]["dashboard_address"] == options.get(
            "dashboard_address", "127.0.0.1:0"
        )


@pytest.mark.parametrize("kind", ["tcp", "ucx", "ws", "tls", "inproc"])
def test_a_scheduler_that_anybody_may_use(kind):
    """Or that nobody else may use."""
    address = f"{kind}://10.0.0.1:8786"
    found = existing(_Client(8e9, address=address), Compute(), Needs(1, 2e9)).doubt
    if kind in ("tls", "inproc"):
        assert not found
    else:
        assert found.startswith(f"Dask at {address} asks for no certificate")
        assert "--tls-ca-file" in found

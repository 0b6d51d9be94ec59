"""Where cases are computed: here, by a Dask scheduler that runs, or in jobs of a batch system."""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
import shlex
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from multicor_cli.optional import library
from multicor_cli.running.machine import available_cores, available_memory, python_child
from multicor_cli.scenario.problems import Refused
from multicor_cli.store.errors import StoreError
from multicor_cli.studies.processes import end_fork_servers, stop_cases
from multicor_cli.studies.study_file import Compute, Queue, parse_memory
from multicor_cli.text import count_noun, format_bytes

if TYPE_CHECKING:
    from distributed import Client, Security

DEATHS = 100
"""Workers that may die under a case before it counts as failed; jobs end with their walltime."""

_FAREWELL = 45
"""Time that a job leaves for a checkpoint before its walltime [s]; half of a shorter one."""

MEMORY, CORES = "memory", "cores"
"""Resources that workers have, and cases take [bytes, 1]."""

_SHARE = 0.9
"""Part of the free memory that cases may take."""

_NO_PAGE = "DASK_DISTRIBUTED__WORKER__HTTP__ROUTES='[]'"
"""Leaves out of a worker the pages that it would show to anybody."""

_CLASSES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "sge": "SGECluster", "lsf": "LSFCluster"}


# ---- Cases on this machine, a thread each. No port is open, so nobody else can get in

_HERE = "here"

Task = dict[str, Any]
Work = Callable[[Task], dict[str, Any]]


class LocalFuture(Future[dict[str, Any]]):
    """The outcome of the case ``key``, with the names that Dask has for it."""

    def __init__(self, key: str) -> None:
        super().__init__()
        self.key = key

    @property
    def status(self) -> str:
        """``pending``, ``finished``, ``cancelled`` or ``error``."""
        if not self.done():
            return "pending"
        if self.cancelled():
            return "cancelled"
        return "finished" if self.exception() is None else "error"


class LocalClient:
    """What `Computation` asks of a `distributed.Client`, with so many cases at a time."""

    status = "running"

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._waiting: SimpleQueue[tuple[LocalFuture, Work, Task]] = SimpleQueue()
        self._running: set[str] = set()
        self._owners: set[str] = set()
        self._is_closed = False
        for _ in range(workers):
            # The second Ctrl-C waits for nobody
            threading.Thread(target=self._work, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop what still runs, with a checkpoint, and wait for nothing."""
        self._is_closed = True
        for owner in self._owners:
            stop_cases(owner)
        for _ in range(self._workers):
            self._waiting.put((LocalFuture(""), dict, {}))  # wakes a thread
        end_fork_servers()

    def submit(self, function: Work, task: Task, *, key: str, **_options: Any) -> LocalFuture:
        """Call a function with a task as soon as there is room for another case."""
        future = LocalFuture(key)
        self._owners.add(task["client"])
        self._waiting.put((future, function, task))
        return future

    def nthreads(self) -> dict[str, int]:
        """How many cases can run at a time."""
        return {_HERE: self._workers}

    def processing(self) -> dict[str, list[str]]:
        """Names of the cases that have begun."""
        return {_HERE: sorted(self._running)}

    def run(self, function: Callable[..., Any], *arguments: Any, **_options: Any) -> dict[str, Any]:
        return {_HERE: function(*arguments)}

    def cancel(self, futures: Iterable[LocalFuture]) -> None:
        for future in futures:
            future.cancel()

    def _work(self) -> None:
        while True:
            future, function, task = self._waiting.get()
            if self._is_closed:
                return
            if not future.set_running_or_notify_cancel():
                continue
            self._running.add(future.key)
            try:
                future.set_result(function(task))
            except Exception as error:
                future.set_exception(error)
            finally:
                self._running.discard(future.key)


# ---- Where cases are computed


class Needs(NamedTuple):
    """What a case takes: threads that it can use, and memory [bytes]."""

    threads: int = 1
    memory: float = 0.0


class Cluster(NamedTuple):
    """Where cases are computed.

    Attributes:
        threads: Of a case.
        slots: Cases that can run at a time, as far as that is known beforehand.
        asked: Resources that a case takes of a worker.
        text: In words.
        doubt: What a person should know about it; may be empty.
    """

    client: Client | LocalClient
    threads: int
    slots: int
    asked: dict[str, float]
    text: str
    doubt: str = ""


def require_libraries(compute: Compute) -> None:
    """Raise `MissingLibrary` if something is not installed that is needed elsewhere than here."""
    names = [] if compute.scheduler is None else ["distributed"]
    if _queue_of(compute) is not None:
        names = ["distributed", "dask_jobqueue", "cryptography"]
    for name in names:
        library(name)


def _queue_of(compute: Compute) -> tuple[str, Queue] | None:
    tables = ((name, getattr(compute, name)) for name in _CLASSES)
    return next(((name, table) for name, table in tables if table is not None), None)


@contextlib.contextmanager
def connected(compute: Compute, logs: Path, needs: Needs, *, most: int) -> Iterator[Cluster]:
    """Workers, started if need be and ended afterwards, ``most`` at most; jobs log to ``logs``.

    Raises:
        Refused: A case needs more memory than the machine, a job or the workers have.
        StoreError: The scheduler cannot be reached.
    """
    queue = _queue_of(compute)
    if compute.scheduler is None and queue is None:
        threads, workers = _fitting(compute, needs, most)
        with LocalClient(workers) as client:
            yield Cluster(client, threads, workers, {}, f"{count_noun(workers, 'worker')} here")
        return
    import dask

    actions = ("target", "spill", "pause", "terminate")
    quiet = {
        **{f"distributed.worker.memory.{action}": False for action in actions},
        "distributed.admin.tick.limit": "1h",
        "distributed.scheduler.allowed-failures": DEATHS,
    }
    with dask.config.set(quiet), contextlib.ExitStack() as stack:
        if queue is None:
            yield _there(stack, str(compute.scheduler), compute.threads or 1, needs)
        else:
            yield _queued(stack, *queue, compute.threads, logs, needs, most)


def existing(client: Any, compute: Compute, needs: Needs) -> Cluster:
    """The workers of somebody's client; raises `Refused` if they tell of too little memory."""
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    offered = [worker.get("resources", {}).get(MEMORY, 0.0) for worker in workers]
    if any(offered) and max(offered) < needs.memory:
        most = f"workers offer {format_bytes(max(offered))} at most"
        message = f"a case takes about {format_bytes(needs.memory)}, {most}"
        raise Refused(("study", "scenario"), message, "use larger workers, or fewer grains")
    asked = {MEMORY: needs.memory} if offered and all(offered) and needs.memory > 0.0 else {}
    slots = sum(int(worker.get("nthreads", 1)) for worker in workers)
    address, doubt = client.scheduler.address, ""
    if not address.startswith(("tls://", "wss://", "inproc://")):
        doubt = (
            f"Dask at {address} asks for no certificate: who can reach it, as every user of the "
            "machine can, can run programs as you. Start scheduler and workers with --tls-ca-file, "
            "--tls-cert and --tls-key"
        )
    return Cluster(client, compute.threads or 1, slots, asked, "a Dask client", doubt)


def _there(stack: contextlib.ExitStack, address: str, threads: int, needs: Needs) -> Cluster:
    from distributed import Client, Security

    if address.startswith("tls://") and not all(
        Security().get_tls_config_for_role("client").get(key) for key in ("ca_file", "cert")
    ):
        raise StoreError(
            f"the Dask scheduler {address} wants a certificate: set "
            "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, …__CLIENT__CERT and …__CLIENT__KEY to their "
            "files"
        )
    try:
        client = stack.enter_context(Client(address, timeout=20, set_as_default=False))
    except (OSError, ValueError) as error:
        raise StoreError(f"the Dask scheduler {address} cannot be reached: {error}") from None
    return existing(client, Compute(threads=threads), needs)._replace(
        text=f"Dask at {address}{_dashboard(client)}"
    )


def _fitting(compute: Compute, needs: Needs, most: int) -> tuple[int, int]:
    """Threads of a case, and cases at a time, that this machine has room for."""
    there, free = available_cores(), available_memory()
    workers = min(compute.workers or max(1, there // (compute.threads or 1)), most)
    if free is not None and needs.memory > 0.0:
        fitting = int(_SHARE * free / needs.memory)
        if fitting < 1:
            sizes = f"{format_bytes(needs.memory)} of memory, {format_bytes(free)} are free here"
            remedy = "use fewer grains, or a machine with more memory"
            raise Refused(("study", "scenario"), f"a case takes about {sizes}", remedy)
        workers = min(workers, fitting)
    return compute.threads or min(needs.threads, max(1, there // workers)), workers


def _dashboard(owner: Any) -> str:
    """Where a cluster or a client says that its dashboard is."""
    has_bokeh = importlib.util.find_spec("bokeh") is not None
    return f", dashboard {owner.dashboard_link}" if has_bokeh and owner.dashboard_link else ""


def _queued(
    stack: contextlib.ExitStack,
    name: str,
    table: Queue,
    threads: int | None,
    logs: Path,
    needs: Needs,
    most: int,
) -> Cluster:
    """Jobs, each a worker for as many cases at a time as its cores and memory allow."""
    import dask
    from distributed import Client

    memory = parse_memory(table.memory)
    if needs.memory > memory:
        sizes = f"{format_bytes(needs.memory)}, a job has {format_bytes(memory)}"
        where = ("compute", name, "memory")
        raise Refused(where, f"a case takes about {sizes}", "give jobs more memory")
    threads = threads or min(needs.threads, table.cores)
    asked = {CORES: float(threads), MEMORY: needs.memory}
    fitting = min(
        table.cores // threads, int(memory / needs.memory) if needs.memory > 0.0 else table.cores
    )
    has_dashboard = _wants_dashboard(table)
    if not has_dashboard:  # what is left of the page then answers nothing
        stack.enter_context(dask.config.set({"distributed.scheduler.http.routes": []}))
    # A worker that hangs up while the client ends is no news, but Dask tells it with a traceback.
    logging.getLogger("distributed.batched").setLevel(logging.WARNING)
    cluster = stack.enter_context(_cluster(name, table, logs, memory, cluster_keys(stack, logs)))
    jobs = min(table.jobs, -(-most // max(1, fitting)))
    # Jobs that end before the study are followed by others
    cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs)
    client = stack.enter_context(Client(cluster, set_as_default=False))
    text = f"{count_noun(jobs, 'job')} of {name}, which leave their messages in {logs}"
    doubt = ""
    if has_dashboard:
        text += _dashboard(cluster)
        doubt = "the dashboard asks for no password: who can reach this machine can look at it"
    return Cluster(client, threads, jobs * max(1, fitting), asked, text, doubt)


def _wants_dashboard(table: Queue) -> bool:
    options = (table.model_extra or {}).get("scheduler_options", {})
    return bool(options.get("dashboard", "dashboard_address" in options))


def _cluster(name: str, table: Queue, logs: Path, memory: float, keys: Security) -> Any:
    import dask
    import dask_jobqueue

    lasts = max(0.5 * table.seconds, table.seconds - _FAREWELL)
    options: dict[str, Any] = {
        "queue": table.queue,
        "walltime": table.walltime,
        "cores": table.cores,
        "memory": table.memory,
        "processes": 1,
        "log_directory": str(logs),
        "local_directory": tempfile.gettempdir(),
        "worker_extra_args": [
            "--lifetime",
            f"{lasts:.0f}s",
            "--resources",
            f"{CORES}={table.cores},{MEMORY}={memory:.0f}",
        ],
        "python": dask.config.get(f"jobqueue.{name}.python") or shlex.quote(sys.executable),
        **(table.model_extra or {}),
        "security": keys,
    }
    options["scheduler_options"] = {
        "dashboard": _wants_dashboard(table), "dashboard_address": "127.0.0.1:0",
        **options.get("scheduler_options", {})
    }  # fmt: skip
    # For a shell. Parts of the job's PYTHONPATH may mean the working directory: let it be root's.
    path = shlex.quote(python_child()[1]["PYTHONPATH"])
    options["python"] = f'cd / && {_NO_PAGE} PYTHONPATH={path}:"$PYTHONPATH" {options["python"]} -P'
    try:
        return getattr(dask_jobqueue, _CLASSES[name])(**options)
    except (RuntimeError, TypeError, ValueError) as error:
        raise StoreError(f"[compute] {name}: {error}") from None


# ---- Keys of scheduler, workers and client of a cluster: who has none is refused

_PREFIX = ".keys-"
_OF_WORKERS = ("tls_ca_file", "tls_worker_cert", "tls_worker_key")


def cluster_keys(stack: contextlib.ExitStack, folder: Path) -> Security:
    """New keys, and files for workers, readable by their owner and removed with ``stack``.

    ``folder`` is of this cluster only, and jobs see it; without ``cryptography`` an `ImportError`.
    """
    from distributed import Security

    class Keys(Security):  # type: ignore[misc]  # mypy does not follow imports of distributed
        def get_tls_config_for_role(self, role: str) -> dict[str, Any]:
            """Workers' files are for a job's script, which dask-jobqueue writes without quotes."""
            config: dict[str, Any] = super().get_tls_config_for_role(role)
            if role != "worker":
                return config
            return {
                key: shlex.quote(value) if isinstance(value, str) else value
                for key, value in config.items()
            }

    folder.mkdir(parents=True, exist_ok=True)
    for left in folder.glob(f"{_PREFIX}*"):  # of a client that was killed
        shutil.rmtree(left, ignore_errors=True)
    keys: Security = Keys.temporary()
    # of mode 0700
    private = Path(
        stack.enter_context(tempfile.TemporaryDirectory(prefix=_PREFIX, dir=folder))
    ).absolute()
    for name in _OF_WORKERS:
        path = private / f"{name}.pem"
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(getattr(keys, name))
        setattr(keys, name, str(path))
    return keys

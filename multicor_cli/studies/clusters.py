"""Where cases are computed: worker processes here, a Dask scheduler that runs, or jobs of a batch system."""

from __future__ import annotations

import contextlib
import importlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from multicor_cli.running.memory import available_memory
from multicor_cli.scenario.problems import Finding
from multicor_cli.store.errors import StoreError
from multicor_cli.studies.forecast import Needs
from multicor_cli.studies.schema import Compute, Queue, parse_memory
from multicor_cli.text import format_bytes

if TYPE_CHECKING:
    from distributed import Client

DEATHS = 100
"""Workers that may die under a case before it counts as failed: jobs of a batch system end with their walltime."""

_FAREWELL = 45
"""How long before its walltime a job stops its case, which then has time for a checkpoint [s]; half of a shorter walltime."""

MEMORY, CORES = "memory", "cores"
"""Resources that workers have, and cases take [bytes, 1]."""

_SHARE = 0.9
"""Part of the free memory that cases may take."""

INSTALL = "pip install 'multicor-cli[study]'"
_CLASSES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "sge": "SGECluster", "lsf": "LSFCluster"}


class MissingDask(StoreError):
    """Dask is not installed, or the batch system is not there."""


class Site(NamedTuple):
    """Where cases are computed.

    Attributes:
        client: Of the Dask scheduler.
        threads: Of a case.
        slots: Cases that can run at a time, as far as that is known beforehand.
        asked: Resources that a case takes of a worker.
        text: In words.
    """

    client: Client
    threads: int
    slots: int
    asked: dict[str, float]
    text: str


class DoesNotFit(Exception):
    """A case needs more memory than there is.

    Attributes:
        finding: What to say about the study file.
    """

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.message)
        self.finding = finding


def require_dask() -> None:
    """Raise `MissingDask` if it is not installed."""
    try:
        importlib.import_module("distributed")
    except ImportError:
        raise MissingDask(f"studies need Dask, which is not installed: {INSTALL}") from None


@contextlib.contextmanager
def connected(compute: Compute, logs: Path, needs: Needs, *, most: int) -> Iterator[Site]:
    """Workers, started if need be and ended afterwards.

    Args:
        compute: Table of the study.
        logs: Directory for the messages of jobs.
        needs: What a case takes.
        most: Number of cases: more workers are not started.

    Raises:
        MissingDask: Dask, or dask-jobqueue, is not installed.
        DoesNotFit: A case needs more memory than the machine, a job or the workers have.
        StoreError: The scheduler cannot be reached.
    """
    require_dask()
    import dask

    quiet = {
        **{f"distributed.worker.memory.{what}": False for what in ("target", "spill", "pause", "terminate")},
        "distributed.admin.tick.limit": "1h",
        "distributed.scheduler.allowed-failures": DEATHS,
    }
    with dask.config.set(quiet), contextlib.ExitStack() as stack:
        queue = next(((name, getattr(compute, name)) for name in _CLASSES if getattr(compute, name) is not None), None)
        if compute.scheduler is not None:
            yield _there(stack, compute.scheduler, compute.threads or 1, needs)
        elif queue is not None:
            yield _queued(stack, *queue, compute.threads, logs, needs, most)
        else:
            yield _here(stack, compute, needs, most)


def existing(client: Any, compute: Compute, needs: Needs) -> Site:
    """The workers of a client that somebody else has made.

    Raises:
        DoesNotFit: They say how much memory they have, and it is not enough.
    """
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    offered = [worker.get("resources", {}).get(MEMORY, 0.0) for worker in workers]
    if any(offered) and max(offered) < needs.memory:
        message = f"a case takes about {format_bytes(needs.memory)}, workers offer {format_bytes(max(offered))} at most"
        raise DoesNotFit(Finding(("study", "scenario"), message, "use larger workers, or fewer grains"))
    asked = {MEMORY: needs.memory} if offered and all(offered) and needs.memory > 0.0 else {}
    slots = sum(int(worker.get("nthreads", 1)) for worker in workers)
    return Site(client, compute.threads or 1, slots, asked, "a Dask client")


def _there(stack: contextlib.ExitStack, address: str, threads: int, needs: Needs) -> Site:
    from distributed import Client

    try:
        client = stack.enter_context(Client(address, timeout=20, set_as_default=False))
    except (OSError, ValueError) as error:
        raise StoreError(f"the Dask scheduler {address} cannot be reached: {error}") from None
    return existing(client, Compute(threads=threads), needs)._replace(text=f"Dask at {address}{_dashboard(client)}")


def _here(stack: contextlib.ExitStack, compute: Compute, needs: Needs, most: int) -> Site:
    from distributed import Client, LocalCluster

    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = min(compute.workers or max(1, there // (compute.threads or 1)), most)
    free = available_memory()
    if free is not None and needs.memory > 0.0:
        fitting = int(_SHARE * free / needs.memory)
        if fitting < 1:
            message = f"a case takes about {format_bytes(needs.memory)} of memory, {format_bytes(free)} are free here"
            raise DoesNotFit(Finding(("study", "scenario"), message, "use fewer grains, or a machine with more memory"))
        workers = min(workers, fitting)
    cluster = LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, memory_limit=None,
        dashboard_address="127.0.0.1:0" if _has_dashboard() else None, silence_logs=50, host="127.0.0.1",
    )  # fmt: skip
    stack.enter_context(cluster)
    client = stack.enter_context(Client(cluster, set_as_default=False))
    threads = compute.threads or min(needs.threads, max(1, there // workers))
    return Site(client, threads, workers, {}, f"{workers} worker{'s' if workers > 1 else ''} here{_dashboard(cluster)}")


def _dashboard(cluster: Any) -> str:
    return f", dashboard {cluster.dashboard_link}" if _has_dashboard() and cluster.dashboard_link else ""


def _has_dashboard() -> bool:
    try:
        importlib.import_module("bokeh")
    except ImportError:
        return False
    return True


def _queued(stack: contextlib.ExitStack, name: str, table: Queue, threads: int | None, logs: Path, needs: Needs, most: int) -> Site:
    """Jobs, each a worker that computes as many cases at a time as its cores and its memory allow."""
    from distributed import Client

    memory = parse_memory(table.memory)
    if needs.memory > memory:
        message = f"a case takes about {format_bytes(needs.memory)}, a job has {format_bytes(memory)}"
        raise DoesNotFit(Finding(("compute", name, "memory"), message, "give jobs more memory"))
    threads = threads or min(needs.threads, table.cores)
    asked = {CORES: float(threads), MEMORY: needs.memory}
    fitting = min(table.cores // threads, int(memory / needs.memory) if needs.memory > 0.0 else table.cores)
    cluster = stack.enter_context(_cluster(name, table, logs, memory))
    jobs = min(table.jobs, -(-most // max(1, fitting)))
    cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs)  # jobs that end before the study are followed by others
    client = stack.enter_context(Client(cluster, set_as_default=False))
    text = f"{jobs} job{'s' if jobs > 1 else ''} of {name}, which leave their messages in {logs}{_dashboard(cluster)}"
    return Site(client, threads, jobs * max(1, fitting), asked, text)


def _cluster(name: str, table: Queue, logs: Path, memory: float) -> Any:
    try:
        jobqueue = importlib.import_module("dask_jobqueue")
    except ImportError:
        raise MissingDask(f"{name} needs dask-jobqueue, which is not installed: {INSTALL}") from None
    lasts = max(0.5 * table.seconds, table.seconds - _FAREWELL)
    options: dict[str, Any] = {
        "queue": table.queue,
        "walltime": table.walltime,
        "cores": table.cores,
        "memory": table.memory,
        "processes": 1,
        "log_directory": str(logs),
        "local_directory": tempfile.gettempdir(),
        "worker_extra_args": ["--lifetime", f"{lasts:.0f}s", "--resources", f"{CORES}={table.cores},{MEMORY}={memory:.0f}"],
        **(table.model_extra or {}),
    }
    options["scheduler_options"] = {"dashboard_address": ":0", **options.get("scheduler_options", {})}
    try:
        return getattr(jobqueue, _CLASSES[name])(**options)
    except (TypeError, ValueError) as error:
        raise StoreError(f"[compute] {name}: {error}") from None

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
from multicor_cli.store.errors import StoreError
from multicor_cli.studies.schema import Compute, Queue, parse_memory

if TYPE_CHECKING:
    from distributed import Client

DEATHS = 100
"""Workers that may die under a case before it counts as failed: jobs of a batch system end with their walltime."""

_FAREWELL = 45
"""How long before its walltime a job stops its case, which then has time for a checkpoint [s]; half of a shorter walltime."""

MEMORY = "memory"
"""Resource that workers have, and cases take [bytes]."""

INSTALL = "pip install 'multicor-cli[study]'"
_CLASSES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "sge": "SGECluster", "lsf": "LSFCluster"}


class MissingDask(StoreError):
    """Dask is not installed, or the batch system is not there."""


class Site(NamedTuple):
    """Where cases are computed.

    Attributes:
        client: Of the Dask scheduler.
        cores: Cores that one worker has.
        text: In words.
    """

    client: Client
    cores: int
    text: str


def require_dask() -> None:
    """Raise `MissingDask` if it is not installed."""
    try:
        importlib.import_module("distributed")
    except ImportError:
        raise MissingDask(f"studies need Dask, which is not installed: {INSTALL}") from None


@contextlib.contextmanager
def connected(compute: Compute, logs: Path, *, most: int) -> Iterator[Site]:
    """Workers, started if need be and ended afterwards.

    Args:
        compute: Table of the study.
        logs: Directory for the messages of jobs.
        most: Number of cases: more workers are not started.

    Raises:
        MissingDask: Dask, or dask-jobqueue, is not installed.
        StorageError: The scheduler cannot be reached.
    """
    require_dask()
    import dask
    from distributed import Client

    quiet = {
        **{f"distributed.worker.memory.{what}": False for what in ("target", "spill", "pause", "terminate")},
        "distributed.admin.tick.limit": "1h",
        "distributed.scheduler.allowed-failures": DEATHS,
    }
    with dask.config.set(quiet), contextlib.ExitStack() as stack:
        queue = next(((name, getattr(compute, name)) for name in _CLASSES if getattr(compute, name) is not None), None)
        if compute.scheduler is not None:
            try:
                client = stack.enter_context(Client(compute.scheduler, timeout=20, set_as_default=False))
            except (OSError, ValueError) as error:
                raise StoreError(f"the Dask scheduler {compute.scheduler} cannot be reached: {error}") from None
            yield Site(client, 1, f"Dask at {compute.scheduler}")
            return
        if queue is not None:
            name, table = queue
            cluster = stack.enter_context(_queued(name, table, logs))
            jobs = min(table.jobs, most)
            cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs)  # jobs that end before the study are followed by others
            client = stack.enter_context(Client(cluster, set_as_default=False))
            text = f"{jobs} job{'s' if jobs > 1 else ''} of {name}, which leave their messages in {logs}"
            yield Site(client, table.cores, text + _dashboard(cluster))
            return
        yield _here(stack, compute.workers, most)


def _here(stack: contextlib.ExitStack, asked: int | None, most: int) -> Site:
    from distributed import Client, LocalCluster

    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = max(1, min(asked or there, most))
    cores = max(1, there // workers)
    free = available_memory()
    resources = {} if free is None else {MEMORY: 0.9 * free / workers}
    cluster = LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, memory_limit=None, resources=resources,
        dashboard_address="127.0.0.1:0" if _has_dashboard() else None, silence_logs=50, host="127.0.0.1",
    )  # fmt: skip
    stack.enter_context(cluster)
    client = stack.enter_context(Client(cluster, set_as_default=False))
    return Site(client, cores, f"{workers} worker{'s' if workers > 1 else ''} here{_dashboard(cluster)}")


def _dashboard(cluster: Any) -> str:
    return f", dashboard {cluster.dashboard_link}" if _has_dashboard() and cluster.dashboard_link else ""


def _has_dashboard() -> bool:
    try:
        importlib.import_module("bokeh")
    except ImportError:
        return False
    return True


def _queued(name: str, table: Queue, logs: Path) -> Any:
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
        "worker_extra_args": ["--lifetime", f"{lasts:.0f}s", "--resources", f"{MEMORY}={parse_memory(table.memory):.0f}"],
        **(table.model_extra or {}),
    }
    options["scheduler_options"] = {"dashboard_address": ":0", **options.get("scheduler_options", {})}
    try:
        return getattr(jobqueue, _CLASSES[name])(**options)
    except (TypeError, ValueError) as error:
        raise StoreError(f"[compute] {name}: {error}") from None

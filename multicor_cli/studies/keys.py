"""Keys with which scheduler, workers and client of a cluster know each other: who has none is refused."""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import tempfile
from pathlib import Path
from typing import Any

from distributed import Security

_PREFIX = ".keys-"
_OF_WORKERS = ("tls_ca_file", "tls_worker_cert", "tls_worker_key")


class ClusterKeys(Security):  # type: ignore[misc]  # mypy does not follow imports of distributed
    """Keys of one cluster, as long as it lives. Those of workers are in files, which their jobs read."""

    def get_tls_config_for_role(self, role: str) -> dict[str, Any]:
        """As of `Security`; names of files of workers are for the script of a job, which dask-jobqueue writes without quotes."""
        found: dict[str, Any] = super().get_tls_config_for_role(role)
        if role != "worker":
            return found
        return {key: shlex.quote(value) if isinstance(value, str) else value for key, value in found.items()}


def cluster_keys(stack: contextlib.ExitStack, folder: Path) -> ClusterKeys:
    """New keys, and the files of workers, which only their owner can read and which are removed when ``stack`` ends.

    Args:
        stack: Ends with the cluster.
        folder: Where the files go: a directory that jobs see, for no other cluster; it is made if need be.

    Raises:
        ImportError: The library ``cryptography`` is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for left in folder.glob(f"{_PREFIX}*"):  # of a client that was killed
        shutil.rmtree(left, ignore_errors=True)
    keys: ClusterKeys = ClusterKeys.temporary()
    private = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix=_PREFIX, dir=folder))).absolute()  # of mode 0700
    for name in _OF_WORKERS:
        path = private / f"{name}.pem"
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(getattr(keys, name))
        setattr(keys, name, str(path))
    return keys

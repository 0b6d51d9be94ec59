"""The lock of a run directory: one live run at a time, taken over from a process that has died."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from multicor_cli.files import json_object, open_regular
from multicor_cli.store.atomic import guards, storage_errors
from multicor_cli.store.errors import DirectoryRefused, RunLocked

_RETRIES, _PAUSE = 5, 0.05
_SIZE = 4096
"""Bytes of a lock that are read at most."""

_held: set[tuple[int, int]] = set()
"""Lock files that this process has held: device and inode."""


def was_taken(path: Path) -> bool:
    """Whether this process holds or has held this very lock file, not only one of the same name."""
    try:
        return _inode(path.stat()) in _held
    except OSError:
        return False


class RunLock:
    """Holds the lock of a run directory until `release`, or until the process dies.

    Until then nothing is changed in the directory by the commit protocol unless the file is still
    there (`atomic.require_own`).

    The file ``lock`` is locked with ``flock`` and names the holder. ``flock`` may not reach across
    hosts, so a file that names another host counts as held. A clean release empties the file.

    Raises `RunLocked` if another process holds it, `DirectoryRefused` if it is a link, which might
    lead to someone else's file, `StorageError` if it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor = _acquire(path)
        try:
            with storage_errors(path):
                holder = json_object(os.pread(self._descriptor, _SIZE, 0))
                if holder and holder.get("host") != socket.gethostname():
                    raise _locked(path, holder, is_elsewhere=True)
                os.ftruncate(self._descriptor, 0)
                identity = {
                    "pid": os.getpid(),
                    "host": socket.gethostname(),
                    "started": datetime.now(UTC).isoformat(timespec="seconds"),
                    "start_ticks": _start_ticks(os.getpid()),
                }
                os.pwrite(self._descriptor, json.dumps(identity).encode(), 0)
                os.fsync(self._descriptor)
        except BaseException:
            os.close(self._descriptor)
            raise
        _held.add(_inode(os.fstat(self._descriptor)))
        guards[path.parent] = self.require

    def require(self) -> None:
        """Raise `RunLocked` if the file is gone or another: this process was taken for dead."""
        if self._descriptor < 0 or not _is_current(self.path, self._descriptor):
            holder = read_holder(self.path)
            pid, host = _process(holder)
            if not self.path.parent.is_dir():
                what = "the directory was moved or removed"
            elif holder:
                what = f"process {pid} on {host} took over this run"
            else:
                what = f"{self.path.name} of this run was removed by somebody"
            raise RunLocked(f"{self.path.parent}: {what}; stopped writing", pid, host)

    def release(self) -> None:
        """Give the lock back, once. A file that cannot be emptied names a holder that has died."""
        if self._descriptor < 0:
            return
        if guards.get(self.path.parent) == self.require:
            del guards[self.path.parent]
        with contextlib.suppress(OSError):
            os.ftruncate(self._descriptor, 0)
        os.close(self._descriptor)
        self._descriptor = -1


def read_holder(path: Path) -> dict[str, Any]:
    """Who holds (or held, if it died) the lock: ``pid, host, started``; empty if no one does."""
    try:
        with open_regular(path) as file:
            return json_object(file.read(_SIZE))
    except OSError:
        return {}


def is_alive(path: Path) -> bool:
    """Whether a run goes on under this lock; one on another host counts. Takes no lock itself."""
    holder = read_holder(path)
    if not holder:
        return False
    if holder.get("host") != socket.gethostname():
        return True
    pid = holder.get("pid")
    ticks = _start_ticks(pid) if isinstance(pid, int) else None
    return ticks is not None and ticks == holder.get("start_ticks")


def _acquire(path: Path) -> int:
    for attempt in range(_RETRIES + 1):
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise DirectoryRefused(
                f"{path}: is not the lock of a run but a link or something else; remove it"
            )
        with storage_errors(path):
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_current(path, descriptor):
                return descriptor
        except BlockingIOError:
            pass
        except OSError as error:
            os.close(descriptor)
            with storage_errors(path):
                raise error
        os.close(descriptor)
        if attempt < _RETRIES:
            time.sleep(_PAUSE)
    raise _locked(path, read_holder(path), is_elsewhere=False)


def _is_current(path: Path, descriptor: int) -> bool:
    """Whether the file that is locked is still the one under this name."""
    try:
        return _inode(path.stat()) == _inode(os.fstat(descriptor))
    except OSError:  # the directory is gone, or cannot be reached any more
        return False


def _inode(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino


def _start_ticks(pid: int) -> int | None:
    """Start of a process in clock ticks since boot; 0 where it is unknown, None if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()
        return None if fields[0] in (b"Z", b"X") else int(fields[19])
    except FileNotFoundError:
        if Path("/proc/self/stat").exists():
            return None
    except (OSError, ValueError, IndexError):
        pass
    try:
        os.kill(pid, 0)
    except OSError as error:
        return None if isinstance(error, ProcessLookupError) else 0
    return 0


def _locked(path: Path, holder: dict[str, Any], *, is_elsewhere: bool) -> RunLocked:
    pid, host = _process(holder)
    who = f"process {pid} on {host or 'an unknown host'}" if holder else "another process"
    remedy = (
        f"; if it is no longer alive, delete {path}"
        if is_elsewhere
        else "; wait for it, or use another directory with -o"
    )
    return RunLocked(f"{path.parent}: in use by {who}{remedy}", pid, host)


def _process(holder: dict[str, Any]) -> tuple[int, str]:
    pid = holder.get("pid")
    return pid if isinstance(pid, int) else -1, str(holder.get("host", ""))

"""The commit protocol: a file appears under its name complete and on disk, or not at all.

Write ``NAME.tmp`` in the same directory, close it, verify it, fsync it, rename it over ``NAME``,
fsync the directory. Tests kill the process at named points of the protocol with the environment
variable ``MULTICOR_KILL_AT=LABEL.POINT`` (or ``LABEL.POINT:N`` for the N-th time that the point is
passed), where POINT is one of ``mid_tmp``, ``after_tmp``, ``before_rename`` and ``after_rename``.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import secrets
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from multicor_cli.files import Unfit, open_regular
from multicor_cli.store.errors import DamagedRun, RunLocked, StorageError, StorageFull

RESERVE = 1 << 20
"""Bytes that large files leave free, so that ``run.json`` can still say why the run stopped."""

_NO_SPACE = {errno.ENOSPC, errno.EDQUOT}
_CANNOT_RESERVE = {errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS}
_BLOCK = 1 << 20
_passed: Counter[str] = Counter()

guards: dict[Path, Callable[[], None]] = {}
"""Called before a change in a directory that this process has locked: raises if it is lost."""


def kill_point(name: str) -> None:
    """Kill this process here if ``MULTICOR_KILL_AT`` names this point (for tests)."""
    wanted = os.environ.get("MULTICOR_KILL_AT")
    if not wanted:
        return
    point, _, count = wanted.partition(":")
    if point == name:
        _passed[name] += 1
        if _passed[name] == int(count or 1):
            os.kill(os.getpid(), signal.SIGKILL)


@contextlib.contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """Turn an `OSError` into `StorageFull` or `StorageError`; an `Unfit` into `DamagedRun`."""
    try:
        yield
    except Unfit as error:
        raise DamagedRun(f"{path}: {error.strerror}") from error
    except OSError as error:
        if error.errno in _NO_SPACE:
            raise StorageFull(path) from error
        if error.errno == errno.EFBIG:
            what = "larger than files may be here (ulimit -f, or the file system)"
            remedy = "raise the limit and give the same command again"
            raise StorageError(f"{path}: {what}; {remedy}") from error
        raise StorageError(f"{path}: {error.strerror or error}") from error


def is_regular(path: Path) -> bool:
    """Whether there is a regular file, or a link to one; `StorageError` if that cannot be seen."""
    with storage_errors(path):
        return path.is_file()


def require_own(path: Path) -> None:
    """Raise `RunLocked` if another has taken the place of the locked directory around a file.

    Somebody may move or remove the directory of a process that is frozen, and put another there.
    """
    for directory in (path.parent, path.parent.parent):
        if (require := guards.get(directory)) is not None:
            require()


def remove_own(path: Path) -> None:
    """Remove a file if it is there; raises `RunLocked` as `require_own`, and `OSError`."""
    require_own(path)
    path.unlink(missing_ok=True)


def require_space(path: Path, size: int) -> None:
    """Raise `StorageFull` if fewer than ``size`` plus `RESERVE` bytes are free at ``path``."""
    with storage_errors(path.parent):
        stats = os.statvfs(path.parent)
    if not stats.f_blocks:
        # The kernel's own file systems have no sizes; they refuse when something is written
        return
    free = stats.f_bavail * stats.f_frsize
    if free < size + RESERVE:
        raise StorageFull(path, size + RESERVE, free)


class GuardedFile:
    """A binary file that never fails while it is written: it keeps the first error.

    The HDF5 library crashes the interpreter at exit when a write fails below it, so it must not see
    one. The caller asks for the error afterwards (`finish`). The space is reserved beforehand,
    hence a full disk is noticed before HDF5 begins.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._position = 0
        self._length = 0
        self.error: OSError | None = None

    def reserve(self, size: int) -> None:
        """Reserve bytes on disk where the file system can; raises `OSError` if there is no room."""
        if not hasattr(os, "posix_fallocate"):
            return
        try:
            os.posix_fallocate(self._descriptor, 0, size)
        except OSError as error:
            if error.errno not in _CANNOT_RESERVE:
                raise

    def write(self, data: bytes | memoryview) -> int:
        """Write at the current position; an error is kept for `finish`."""
        view = memoryview(data).cast("B")
        offset = 0
        try:
            while self.error is None and offset < len(view):
                offset += os.pwrite(self._descriptor, view[offset:], self._position + offset)
        except OSError as error:
            self.error = error
        self._position += len(view)
        self._length = max(self._length, self._position)
        return len(view)

    def readinto(self, buffer: memoryview) -> int:
        """Read back into ``buffer``; bytes that could not be written read as zero."""
        view = memoryview(buffer).cast("B")
        data = os.pread(
            self._descriptor, min(len(view), max(self._length - self._position, 0)), self._position
        )
        view[: len(data)] = data
        view[len(data) :] = bytes(len(view) - len(data))
        self._position += len(view)
        return len(view)

    def read(self, size: int) -> bytes:
        data = bytearray(size)
        self.readinto(memoryview(data))
        return bytes(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a position; the end is the end of what was written, not of what was reserved."""
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._length}[whence]
        self._position = base + offset
        return self._position

    def tell(self) -> int:
        return self._position

    def truncate(self, size: int) -> int:
        """Set the length; the file on disk follows in `finish`."""
        self._length = size
        return size

    def flush(self) -> None:
        """Nothing is buffered here."""

    def finish(self) -> None:
        """Cut the file to what was written; raises the first `OSError` of any write."""
        if self.error is not None:
            raise self.error
        os.ftruncate(self._descriptor, self._length)


def commit_file(
    path: Path,
    label: str,
    write: Callable[[GuardedFile], None],
    *,
    size: int = 0,
    verify: Callable[[Path], None] | None = None,
    read_only: bool = False,
    temporary: Path | None = None,
    is_durable: bool = True,
) -> None:
    """Create or replace ``path`` by the commit protocol.

    ``label`` begins the names of the kill points. ``size`` is an upper bound [bytes], reserved
    beforehand; 0 for small files, which may use the `RESERVE`. ``verify`` raises if the closed
    temporary file is not what was meant. ``read_only``: the file is never changed again.
    ``temporary`` is its name until then; ``NAME.tmp``, which is ours in a run directory, if None.
    ``is_durable``: it must outlive a power cut.

    Raises `StorageFull`, `StorageError`, or `RunLocked` as `require_own`.
    """
    temporary = temporary or path.with_name(path.name + ".tmp")
    require_own(path)
    if size:
        require_space(path, size)
    try:
        with storage_errors(path):
            _write_temporary(temporary, write, size, read_only)
            kill_point(f"{label}.after_tmp")
        if verify is not None:
            verify(temporary)
        with storage_errors(path):
            if is_durable:
                fsync_path(temporary)
            kill_point(f"{label}.before_rename")
            require_own(path)
            temporary.replace(path)
            kill_point(f"{label}.after_rename")
            if is_durable:
                fsync_path(path.parent)
    finally:
        with contextlib.suppress(OSError, RunLocked):
            remove_own(temporary)


def temporary_beside(path: Path) -> Path:
    """A name that nothing else uses: only in run directories is ``NAME.tmp`` ours."""
    return path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}.tmp")


def _write_temporary(
    path: Path, write: Callable[[GuardedFile], None], size: int, read_only: bool
) -> None:
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    try:
        file = GuardedFile(descriptor)
        if size:
            file.reserve(size)
        write(file)
        file.finish()
        if read_only:
            os.fchmod(descriptor, os.fstat(descriptor).st_mode & 0o444)
    finally:
        os.close(descriptor)


def commit_bytes(path: Path, label: str, data: bytes, *, is_durable: bool = True) -> None:
    """Create or replace a small file by the commit protocol; raises as `commit_file` does."""

    def write(file: GuardedFile) -> None:
        file.write(data[: len(data) // 2])
        kill_point(f"{label}.mid_tmp")
        file.write(data[len(data) // 2 :])

    commit_file(path, label, write, is_durable=is_durable)


def commit_result(path: Path, label: str, data: bytes) -> None:
    """Create or replace a file that a user has asked for, whole or not at all; as `commit_file`.

    A link at its place is replaced, not followed; a pipe or a device is refused.
    """
    if path.exists() and not path.is_file():
        raise StorageError(
            f"{path}: is not an ordinary file, and is not replaced; choose another name"
        )

    def write(file: GuardedFile) -> None:
        file.write(data)

    commit_file(path, label, write, size=len(data), temporary=temporary_beside(path))


def append_line(path: Path, label: str, line: bytes) -> None:
    """Append one line with one write, and fsync, or nothing of it; raises as `commit_file`.

    Kill points: ``LABEL.torn`` (half of the line is in the file) and ``LABEL.after_append``.
    """
    require_own(path)
    with storage_errors(path):
        is_new = not path.exists()
        # Without O_NONBLOCK, a pipe would be waited for.
        flags = (
            os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        )
        descriptor = os.open(path, flags, 0o666)
        try:
            _append(descriptor, label, line)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        if is_new:
            fsync_path(path.parent)
        kill_point(f"{label}.after_append")


def _append(descriptor: int, label: str, line: bytes) -> None:
    before = os.fstat(descriptor).st_size
    if os.environ.get("MULTICOR_KILL_AT", "").startswith(f"{label}.torn"):
        os.write(descriptor, line[: len(line) // 2])
        kill_point(f"{label}.torn")
        os.ftruncate(descriptor, before)
    try:
        written = os.write(descriptor, line)
    except OSError:
        os.ftruncate(descriptor, before)
        raise
    if written < len(line):
        os.ftruncate(descriptor, before)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def make_directory(path: Path) -> None:
    """Make a directory and its parents for good; raises `StorageFull` or `StorageError`."""
    with storage_errors(path):
        missing = [path]
        while not missing[-1].is_dir() and missing[-1].parent != missing[-1]:
            missing.append(missing[-1].parent)
        for directory in reversed(missing[:-1]):
            if os.path.lexists(directory) and not directory.is_dir():
                raise StorageError(f"{path}: {directory} is not a directory")
            directory.mkdir(exist_ok=True)
            fsync_path(directory.parent)


def fsync_path(path: Path) -> None:
    """Flush a file or directory to the disk; raises `OSError`."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def described(path: Path) -> dict[str, Any]:
    """Size and digest of a file, as documents have them; raises as `file_digest`."""
    with storage_errors(path):
        size = path.stat().st_size
    return {"size": size, "blake2b": file_digest(path)}


def require_described(path: Path, size: int, digest: str, where: str) -> None:
    """Compare a file with what ``where`` says of it; raises `DamagedRun` or `StorageError`."""
    if not path.is_file():
        raise DamagedRun(f"{path}: missing")
    with storage_errors(path):
        is_whole = path.stat().st_size == size
    if not is_whole or file_digest(path) != digest:
        raise DamagedRun(f"{path}: damaged (it does not match its digest in {where})")


def file_digest(path: Path) -> str:
    """BLAKE2b digest (16 bytes, hexadecimal) of a regular file; `StorageError` or `DamagedRun`."""
    digest = hashlib.blake2b(digest_size=16)
    with storage_errors(path), open_regular(path) as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()

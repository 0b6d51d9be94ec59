"""Reading files that may be anything: only regular ones, never waited for, of bounded size.

What is under a name is looked at on the open descriptor, so that nothing can change in between.
Uses the standard library only.
"""

from __future__ import annotations

import contextlib
import errno
import io
import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from multicor_cli.text import format_bytes

LARGEST_RECORD = 64 << 20
"""Longest scenario of a run that is read [bytes]; none that was accepted is nearly as long."""

_KINDS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


class Unfit(OSError):
    """Something is there and is not read: no regular file, or larger than its kind may be."""


def open_regular(path: Path | str, most: int | None = None) -> io.BufferedReader:
    """Open a regular file, or a link to one, to be read from its beginning; it cannot be rewound.

    Reading fails at more than ``most`` bytes, whatever its size was said to be. Raises `Unfit` if
    it is something else, or larger (``strerror`` says what), and `OSError` if there is none, it may
    not be read, or no file can have this name.
    """
    try:
        # Without O_NONBLOCK, opening a pipe would wait for someone to write into it.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except ValueError:  # a null character, or one that the encoding of the file system lacks
        raise OSError(errno.EINVAL, "no file can have this name", str(path)) from None
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise Unfit(
                errno.ENXIO, "it is a socket or a device, not a regular file", str(path)
            ) from None
        raise
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            what = next(
                (name for is_kind, name in _KINDS if is_kind(status.st_mode)), "something else"
            )
            raise Unfit(
                errno.EISDIR if stat.S_ISDIR(status.st_mode) else 0,
                f"it is {what}, not a regular file",
                str(path),
            )
        if most is not None and status.st_size > most:
            raise _too_large(path, most, status.st_size)
    except BaseException:
        os.close(descriptor)
        raise
    return io.BufferedReader(_Bounded(descriptor, path, most))


def read_regular(path: Path | str, most: int) -> bytes:
    """The content of a regular file of at most ``most`` bytes; raises as `open_regular`."""
    with open_regular(path, most) as file:
        return file.read()


def json_object(data: bytes) -> dict[str, Any]:
    """The JSON object of a file without a digest; empty if there is none, or it is torn."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def read_object(path: Path | str, most: int) -> dict[str, Any]:
    """As `json_object`, of a file of at most ``most`` bytes; empty if it cannot be read."""
    try:
        return json_object(read_regular(path, most))
    except OSError:
        return {}


@contextlib.contextmanager
def regular_path(path: Path | str, most: int | None = None) -> Iterator[str]:
    """The very file looked at, as a name for a library that opens it; raises as `open_regular`."""
    with open_regular(path, most) as file:
        name = f"/proc/self/fd/{file.fileno()}"
        yield name if Path(name).exists() else os.fspath(path)


class _Bounded(io.RawIOBase):
    """An open file, read no further than its limit: some grow, and the kernel's claim no bytes."""

    def __init__(self, descriptor: int, path: Path | str, most: int | None) -> None:
        self._descriptor, self._path, self._most = descriptor, path, most
        self._count = 0

    def readable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        count = os.readv(self._descriptor, [buffer])
        self._count += count
        if self._most is not None and self._count > self._most:
            raise _too_large(self._path, self._most, None)
        return count

    def close(self) -> None:
        if not self.closed:
            os.close(self._descriptor)
        super().close()


def _too_large(path: Path | str, most: int, size: int | None) -> Unfit:
    has = "" if size is None else f" ({format_bytes(size)})"
    return Unfit(
        errno.EFBIG,
        f"it is larger than {format_bytes(most)}{has}, the most that is read of such a file",
        str(path),
    )

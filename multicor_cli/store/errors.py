"""What can go wrong with the files of a run, with the exit codes of the command line."""

from __future__ import annotations

import operator
from pathlib import Path


class StoreError(Exception):
    """Base class: one message for the user, naming the file and the remedy.

    Attributes:
        exit_code: Exit code of the command line for this kind of problem.
    """

    exit_code = 5


class StorageError(StoreError):
    """Something cannot be read or written: permission, I/O error, no directory (exit code 5)."""


class StorageFull(StorageError):
    """There is not enough free space, or a quota or file-size limit is reached (exit code 5).

    Attributes:
        path: The file that could not be written.
        needed: Bytes that were needed, 0 if unknown.
        free: Bytes that were free, 0 if unknown.
    """

    def __init__(self, path: Path, needed: int = 0, free: int = 0) -> None:
        super().__init__(path, needed, free)
        self.path, self.needed, self.free = path, needed, free

    def __str__(self) -> str:
        sizes = f" ({self.needed / 1e6:.1f} MB needed, {self.free / 1e6:.1f} MB free)"
        return (
            f"{self.path}: no space left{sizes if self.needed else ''}; free some space and give "
            "the same command again"
        )


class DirectoryRefused(StoreError):
    """The directory may not be used: no run, a run already, or foreign files (exit code 6)."""

    exit_code = 6


class RunLocked(StoreError):
    """Another process is running in this directory (exit code 6).

    Attributes:
        pid: Process number of the holder, -1 if unknown.
        host: Host of the holder, empty if unknown.
    """

    exit_code = 6

    def __init__(self, message: str, pid: int = -1, host: str = "") -> None:
        self.pid, self.host = pid, host
        super().__init__(message)


class DamagedRun(StoreError):
    """A file is damaged, incomplete, or not what its name says (exit code 7)."""

    exit_code = 7


class NothingStored(DamagedRun):
    """A run was stopped before it had stored anything: undamaged, nothing to read (exit code 6)."""

    exit_code = 6

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.path = path

    def __str__(self) -> str:
        return (
            f"{self.path}: the run has stored nothing yet; if it does not go on, give the command "
            "that began it again"
        )


class UnsupportedVersion(DamagedRun):
    """A file was made by an incompatible version of the program (exit code 7)."""


class NoFrame(IndexError):
    """There is no such frame: the message says which there are."""


def frame_number(count: int, number: int) -> int:
    """A frame's number, from 0; a negative one counts from the end. Raises `NoFrame`.

    As with a list, what is no whole number is a `TypeError`.
    """
    number = operator.index(number)
    if not count or not -count <= number < count:
        raise NoFrame(f"there is no frame {number}: {what_frames(count)}")
    return number % count


def what_frames(count: int) -> str:
    """What frames a run has, in words."""
    return f"the run has {count}, from 0 to {count - 1}" if count else "the run has no frames yet"

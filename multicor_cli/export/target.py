"""Where an export goes, which frames it takes, and what can go wrong with it."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from multicor_cli.optional import MissingLibrary as MissingLibrary
from multicor_cli.store import Frame, Run, layout
from multicor_cli.store.atomic import (
    GuardedFile,
    commit_file,
    fsync_path,
    make_directory,
    storage_errors,
    temporary_beside,
)
from multicor_cli.store.errors import NoFrame, StorageError, StoreError, what_frames

# ---- What goes wrong beside reading the run and writing the file; classes carry exit codes


class ExportError(StoreError):
    """The run does not hold what was asked for (exit code 2)."""

    exit_code = 2


class ExportRefused(StoreError):
    """The target exists, or is not one that an export may replace (exit code 6)."""

    exit_code = 6


# ---- Which frames are exported


def choose_frames(run: Run, frames: slice | None) -> list[Frame]:
    """The frames of a slice, or all, read when they are used; `ExportError` if there is none.

    Anything else than a slice is a `TypeError`.
    """
    if not (frames is None or isinstance(frames, slice)):
        raise TypeError(f"frames is a slice, as slice(-10, None), is {frames!r}")
    chosen = run.frames[slice(None) if frames is None else frames]
    if not chosen:
        raise ExportError(f"{run.path}: there are no such frames: {what_frames(len(run.frames))}")
    return chosen


def choose_frame(run: Run, number: int) -> Frame:
    """One frame; a negative number counts from the end; `ExportError` if there is no such frame."""
    try:
        return run.frames[number]
    except NoFrame as error:
        raise ExportError(f"{run.path}: {error}") from None


# ---- The file or directory appears under its name complete, or not at all

_REMEDY = "choose another name, or give --overwrite"


def refuse_files_of_runs(path: Path) -> None:
    """Refuse the names that the files of a run have or will have, and what lies in its directories.

    `ExportRefused` if it is one, `StorageError` if it cannot be looked at.
    """
    with storage_errors(path):
        # a link at the place itself would be replaced, not followed
        whole = Path(os.path.realpath(path.parent)) / path.name
        for place in (whole, whole.parent):
            is_of_run = layout.is_file_name(place.name.removesuffix(".tmp"))
            if is_of_run and (place.parent / layout.RUN).is_file():
                raise ExportRefused(f"{path}: is the name of a file of the run; choose another")


def check_output(path: Path, *, is_overwriting: bool) -> None:
    """Refuse a name at which no file may be written; changes nothing.

    Raises:
        ExportRefused: If it is a file of a run, a directory, a device or the like, or a file or a
            link and ``is_overwriting`` is False.
        StorageError: If it cannot be looked at.
    """
    refuse_files_of_runs(path)
    with storage_errors(path):
        if path.is_dir():
            raise ExportRefused(f"{path}: is a directory; choose the name of a file")
        if path.exists() and not path.is_file():
            raise ExportRefused(
                f"{path}: is not an ordinary file, and is not replaced; choose another name"
            )
        if os.path.lexists(path) and not is_overwriting:
            raise ExportRefused(f"{path}: exists; {_REMEDY}")


def commit_hdf5(path: Path, kind: str, write: Callable[[GuardedFile], None], size: int) -> None:
    """Write an HDF5 file of about so many bytes, whole or not at all, and its directory.

    Raises `StorageError` if it cannot be written.
    """
    try:
        make_directory(path.parent)
        commit_file(path, kind, write, size=size, temporary=temporary_beside(path))
    except RuntimeError as error:
        raise StorageError(f"{path}: HDF5 cannot write the file ({error})") from error


@contextlib.contextmanager
def new_file(path: Path, *, is_overwriting: bool) -> Iterator[Path]:
    """A name for a file that takes the name ``path`` if the block ends well, and is removed if not.

    The directory of ``path`` is made. `ExportRefused` as `check_output`, `StorageFull` if there is
    not enough space, `StorageError` for any other error of the system.
    """
    check_output(path, is_overwriting=is_overwriting)
    temporary = temporary_beside(path)
    try:
        with storage_errors(path):
            make_directory(path.parent)
            # With the permissions that the user's mask gives; a library may choose others
            temporary.touch(exist_ok=False)
            yield temporary
            fsync_path(temporary)
            temporary.replace(path)
            fsync_path(path.parent)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def new_directory(path: Path, names: re.Pattern[str], *, is_overwriting: bool) -> Iterator[Path]:
    """A directory that takes the name ``path`` if the block ends well, and is removed if not.

    Directories above it are made; one with files of other ``names`` is not replaced.

    Raises:
        ExportRefused: If ``path`` is not a directory, holds other files, has the name of a file of
            a run, or is not empty and ``is_overwriting`` is False.
        StorageFull: If there is not enough space.
        StorageError: For any other error of the system.
    """
    refuse_files_of_runs(path)
    with storage_errors(path):
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            raise ExportRefused(f"{path}: exists and is not a directory; choose another name")
        found = sorted(entry.name for entry in path.iterdir()) if path.exists() else []
        foreign = [name for name in found if not names.fullmatch(name)]
        if foreign:
            raise ExportRefused(
                f"{path}: holds files that no export has made ({foreign[0]} …); choose another name"
            )
        if found and not is_overwriting:
            raise ExportRefused(f"{path}: holds an export; {_REMEDY}")
    temporary = temporary_beside(path)
    try:
        with storage_errors(path):
            make_directory(path.parent)
            temporary.mkdir()
            yield temporary
            for file in (*temporary.iterdir(), temporary):
                fsync_path(file)
            # It cannot be renamed over one with files: those, all made by an export, go first
            if path.exists():
                shutil.rmtree(path)
            temporary.replace(path)
            fsync_path(path.parent)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)

"""Making, checking and cleaning a run directory before anything is computed."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import tempfile
from pathlib import Path

from multicor_cli.files import read_regular
from multicor_cli.scenario.particles import LARGEST_RECORD
from multicor_cli.store import layout
from multicor_cli.store.atomic import commit_bytes, is_regular, make_directory, remove_own, storage_errors
from multicor_cli.store.documents import Document, read_document, write_document
from multicor_cli.store.errors import DamagedRun, DirectoryRefused
from multicor_cli.store.run_document import CREATING

_MOST_BYTES, _MOST_BYTES_OF_PART = 4096, 255
"""Longest path, with the character that ends it, and longest name in it."""

_LONGEST_NAME = "checkpoints/step-00000000000.00.json.tmp"
"""A name in a run directory that is as long as any."""


def is_run(path: Path) -> bool:
    """Whether ``path`` holds a run that can be resumed or is finished; False if there is nothing, or only a beginning."""
    require_room_for_names(path)
    file = path / layout.RUN
    if not is_regular(file):
        return False
    try:
        return bool(read_document(file).get("status") != CREATING)
    except DamagedRun:
        return True


def require_room_for_names(path: Path) -> None:
    """Refuse a directory whose name, or that of a file in it, no system call takes; raises `DirectoryRefused`."""
    parts, whole = path.parts, os.fsencode(path.absolute() / _LONGEST_NAME)
    is_short = len(whole) < _MOST_BYTES and all(len(os.fsencode(part)) <= _MOST_BYTES_OF_PART for part in parts)
    if not is_short or "\0" in str(path):
        limits = f"at most {_MOST_BYTES_OF_PART} bytes between two slashes and {_MOST_BYTES - len(_LONGEST_NAME) - 2} in all"
        raise DirectoryRefused(f"{path}: no run can be in a directory of this name ({limits}); choose another with -o")


def lay_out(path: Path, document: Document, source: bytes, resolved: bytes) -> None:
    """Write what every run has. Status ``creating`` comes first: a crash in between leaves nothing that looks like a run."""
    write_document(path / layout.RUN, "runjson", document)
    with storage_errors(path):
        for entry in layout.known_files(path):
            remove_own(entry)
    for name in (layout.SEGMENTS, layout.CHECKPOINTS):
        make_directory(path / name)
    commit_bytes(path / layout.SOURCE, "scenario", source)
    commit_bytes(path / layout.RESOLVED, "scenario", resolved)
    document["status"] = "running"
    write_document(path / layout.RUN, "runjson", document)


def check_usable(path: Path, *, overwrite: bool) -> None:
    """Refuse a directory in which no run may begin; leaves nothing behind.

    Raises:
        DirectoryRefused: If it is not a directory, holds foreign files, or a run and ``overwrite`` is False.
        StorageError: If it cannot be read or written.
    """
    require_room_for_names(path)
    with storage_errors(path):
        if not path.exists() and not path.is_symlink():
            nearest = next(parent for parent in path.absolute().parents if os.path.lexists(parent))
            if not nearest.is_dir():
                raise DirectoryRefused(f"{path}: {nearest} is not a directory; choose another with -o")
            _require_writable(nearest, path)
            return
        if not path.is_dir():
            raise DirectoryRefused(f"{path}: exists and is not a directory; choose another with -o")
        names = {entry.name for entry in path.iterdir()}
        foreign = layout.foreign_entries(path)
    if layout.RUN not in names:
        if names <= {layout.LOCK, layout.RUN + ".tmp"}:
            return
        raise DirectoryRefused(f"{path}: exists and is not a run directory; choose another with -o, or empty it")
    if is_run(path) and not overwrite:
        raise DirectoryRefused(f"{path}: holds a run; continue it, choose another directory with -o, or give --overwrite")
    if foreign:
        listed = ", ".join(foreign[:5]) + (" …" if len(foreign) > 5 else "")
        raise DirectoryRefused(f"{path}: holds files that no run has made ({listed}); move them away before overwriting")


def _require_writable(directory: Path, path: Path) -> None:
    """Refuse a directory in which no directory can be made now, not when the grains have been placed."""
    if not os.access(directory, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), directory)
    try:
        Path(tempfile.mkdtemp(prefix=".multicor-", dir=directory)).rmdir()
    except FileNotFoundError:  # what the kernel says of its own file systems
        raise DirectoryRefused(f"{path}: no directory can be made in {directory}; choose another place with -o") from None


def read_scenario(path: Path, sha256: str) -> str:
    """Text of a scenario file; raises `DamagedRun` if it was changed, `StorageError` if it cannot be read.

    Where the run was being extended when its process died, it is still the run of a former scenario, kept beside the new one.
    """
    for file in (path, *reversed(layout.former_files(path))):
        with storage_errors(file):
            data = read_regular(file, LARGEST_RECORD)
        if hashlib.sha256(data).hexdigest() == sha256:
            return data.decode()
    raise DamagedRun(f"{path}: was changed after the run had begun; put the original back, or start another run")


def remove_temporaries(path: Path) -> None:
    """Remove what interrupted commits have left; one that cannot be removed does no harm, and what is not ours stays."""
    with contextlib.suppress(OSError):
        for entry in layout.temporaries(path):
            with contextlib.suppress(OSError):
                remove_own(entry)

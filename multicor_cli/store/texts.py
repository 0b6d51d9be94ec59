"""Texts beside the datasets of an HDF5 file: attributes of fixed length, each with a digest.

Strings of variable length, as h5py writes them, lie in a global heap: the only structure of HDF5 without a checksum, and
one in which the library searches forever where an object has no size. Files of format 1.1 and before have such texts; they are read
after a look at their heaps.
"""

from __future__ import annotations

import hashlib
import json
import mmap
from functools import lru_cache
from pathlib import Path

import h5py

from multicor_cli.store.errors import DamagedRun

DIGESTS = "attribute_digests"
"""Root attribute with the digests of all other texts of the root, as JSON; since format 1.2."""

_HEAP = b"GCOL\x01"  # HDF5 does not look at the three bytes behind
_HEAP_HEADER = 16
_OBJECT_HEADER = 16


def write_text(node: h5py.HLObject, name: str, text: str) -> None:
    """Store a text as an attribute."""
    data = text.encode()
    node.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", max(len(data), 1)))


def write_digests(file: h5py.File) -> None:
    """Store the digests of all texts of the root; the last to be written there."""
    file.attrs.pop(DIGESTS, None)
    write_text(file, DIGESTS, json.dumps({name: text_digest(read_text(file, name)) for name in text_names(file)}))


def text_names(node: h5py.HLObject) -> list[str]:
    """Names of the attributes that are texts."""
    return [name for name in node.attrs if h5py.check_string_dtype(node.attrs.get_id(name).dtype) is not None]


def read_text(node: h5py.HLObject, name: str) -> str:
    """An attribute that is a text.

    Raises:
        KeyError: If there is none.
        TypeError: If it is something else.
        UnicodeDecodeError: If it is no text.
        DamagedRun: If HDF5 would not come back from reading it.
    """
    info = h5py.check_string_dtype(node.attrs.get_id(name).dtype)
    if info is None:
        raise TypeError(f"attribute {name!r} is not a string")
    if info.length is None:
        require_finite_heaps(Path(node.file.filename))
    value = node.attrs[name]
    if not isinstance(value, str | bytes):
        raise TypeError(f"attribute {name!r} is not one string")
    return value.decode() if isinstance(value, bytes) else value


def text_digest(text: str) -> str:
    """BLAKE2b digest of a text."""
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=16).hexdigest()


def require_finite_heaps(path: Path) -> None:
    """Refuse a file with a global heap whose objects do not follow each other to its end.

    The layout is that of "Disk Format: Level 1E" in the HDF5 File Format Specification 3.0.

    Raises:
        DamagedRun: If there is such a heap.
        OSError: If the file cannot be read.
    """
    status = path.stat()
    _look_at_heaps(path, status.st_ino, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=64)
def _look_at_heaps(path: Path, *_identity: int) -> None:
    """Once for each file: it is searched from its beginning to its end."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(_HEAP)
        while at >= 0:
            if not _is_finite(data, at):
                raise DamagedRun(f"{path}: damaged (a heap of texts has no end)")
            at = data.find(_HEAP, at + 1)


def _is_finite(data: mmap.mmap, heap: int) -> bool:
    """Whether every object of the heap at ``heap`` ends behind its beginning, and none behind the heap."""
    size = int.from_bytes(data[heap + 8 : heap + _HEAP_HEADER], "little")
    at, end = heap + _HEAP_HEADER, heap + size
    if not _HEAP_HEADER < size <= len(data) - heap:
        return False
    while at + _OBJECT_HEADER <= end:
        index = int.from_bytes(data[at : at + 2], "little")
        length = int.from_bytes(data[at + 8 : at + _OBJECT_HEADER], "little")
        step = _OBJECT_HEADER + (length + 7) // 8 * 8 if index else length  # what is free counts its header
        if not _OBJECT_HEADER <= step <= end - at:
            return False
        at += step
    return True

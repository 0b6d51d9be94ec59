"""Reading HDF5 files that may be damaged or hostile: everything is compared with the schema before memory is taken."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from multicor_cli.files import Unfit, regular_path
from multicor_cli.store.errors import DamagedRun, StorageError, UnsupportedVersion
from multicor_cli.store.schema import FORMAT_VERSION, Dataset
from multicor_cli.store.texts import DIGESTS, read_text, text_digest

_DEFLATE_RATIO = 1100
"""No deflated stream grows by more than 1032 times."""

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_STRING_LIMIT = 64 << 20
_BLOCK_BYTES = 16 << 20
_TYPES: dict[str, tuple[str, ...]] = {"f8": ("<f8",), "float": ("<f8", "<f4"), "i8": ("<i8",), "i4": ("<i4",), "u1": ("|u1",)}
_EDGES = {"frame_edge": "frame", "table_edge": "table"}


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn what h5py raises about a damaged file into `DamagedRun`, and errors of the system into `StorageError`."""
    try:
        yield
    except Unfit as error:
        raise DamagedRun(f"{path}: {error.strerror}") from error
    except FileNotFoundError as error:
        raise DamagedRun(f"{path}: missing") from error
    except OSError as error:
        if error.errno:
            raise StorageError(f"{path}: {error.strerror or error}") from error
        raise DamagedRun(f"{path}: damaged ({_short(error)})") from error
    except (RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError) as error:
        raise DamagedRun(f"{path}: damaged ({_short(error)})") from error


def _short(error: BaseException) -> str:
    return str(error).splitlines()[0][:200] if str(error) else type(error).__name__


class CheckedFile:
    """An open HDF5 file whose datasets are handed out only if they are what the schema says.

    Args:
        path: The file.
        filetype: Expected root attribute ``filetype``.
        run_id: Expected root attribute ``run_id``; any if ``None``.
        dims: Lengths that are already known; others are bound by the first dataset that has them.

    Attributes:
        version: Format version of the file.

    Raises:
        DamagedRun: If it is damaged or not such a file.
        UnsupportedVersion: If it has another major format version.
        StorageError: If it cannot be opened.
    """

    def __init__(self, path: Path, filetype: str, *, run_id: str | None = None, dims: dict[str, int] | None = None) -> None:
        self.path = path
        self.dims: dict[str, int] = {"one": 1, **(dims or {})}
        self._accepted: dict[str, h5py.Dataset] = {}
        with reading(path), regular_path(path) as opened:
            self._size = os.stat(opened).st_size  # noqa: PTH116  (not that of what has this name by now)
            self._file = h5py.File(opened, "r", locking=False)
        try:
            self.version = self._check_header(filetype, run_id)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> CheckedFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._accepted.clear()
        self._file.close()

    @cached_property
    def features(self) -> frozenset[str]:
        """Features of the run that the file belongs to, see ``schema.Feature``; raises `DamagedRun`."""
        found = self.json("features")
        if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
            raise DamagedRun(f"{self.path}: attribute 'features' is damaged")
        return frozenset(found)

    def has(self, spec: Dataset) -> bool:
        """Whether the file has a dataset, going by its version and its features; raises `DamagedRun`."""
        return spec.since <= self.version and (spec.only_with is None or spec.only_with in self.features)

    def text(self, name: str) -> str:
        """A root attribute that is a string, compared with its digest; raises `DamagedRun`."""
        with reading(self.path):
            text = read_text(self._file, name)
        if self._text_digests.get(name) != text_digest(text):
            raise DamagedRun(f"{self.path}: attribute {name!r} does not match its digest")
        return text

    def has_text(self, name: str) -> bool:
        """Whether there is a root attribute of this name that is a string."""
        return name in self._text_digests

    def json(self, name: str) -> Any:
        """A root attribute that holds JSON; raises `DamagedRun`."""
        try:
            return json.loads(self.text(name))
        except (ValueError, RecursionError) as error:
            raise DamagedRun(f"{self.path}: attribute {name!r} is damaged") from error

    def check_texts(self) -> None:
        """Read all root attributes that are texts, and compare them with their digests; raises `DamagedRun`."""
        for name in self._text_digests:
            self.text(name)

    @cached_property
    def _text_digests(self) -> dict[str, Any]:
        with reading(self.path):
            found = json.loads(read_text(self._file, DIGESTS))
        if not isinstance(found, dict):
            raise DamagedRun(f"{self.path}: attribute {DIGESTS!r} is damaged")
        return found

    def dataset(self, spec: Dataset) -> h5py.Dataset:
        """The dataset of a row of the schema, its type, shape and storage checked; raises `DamagedRun`."""
        if spec.path in self._accepted:
            return self._accepted[spec.path]
        with reading(self.path):
            found = self._find(spec.path)
            self._check_type(spec, found)
            self._check_storage(spec, found)
            self._bind(spec, found.shape)
        self._accepted[spec.path] = found
        return found

    def read(self, spec: Dataset, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows ``start:stop`` of a dataset (not of strings); raises `DamagedRun`."""
        found = self.dataset(spec)
        with reading(self.path):
            return np.asarray(found[start : found.shape[0] if stop is None else stop])

    def strings(self, spec: Dataset) -> list[str]:
        """A dataset of strings; raises `DamagedRun`."""
        found = self.dataset(spec)
        with reading(self.path):
            return [bytes(item).rstrip(b"\0").decode() for item in found[...]]

    def blocks(self, spec: Dataset) -> Iterator[NDArray[Any]]:
        """All rows in pieces of bounded size; raises `DamagedRun`."""
        found = self.dataset(spec)
        row_bytes = max(1, math.prod(found.shape[1:]) * found.dtype.itemsize)
        unit = found.chunks[0] if found.chunks else 1
        step = max(unit, _BLOCK_BYTES // row_bytes // unit * unit)
        for start in range(0, found.shape[0], step):
            with reading(self.path):
                yield np.asarray(found[start : start + step])

    def check_digest(self, spec: Dataset, expected: str | None = None) -> str:
        """Read a dataset whole and compare its digest with its attribute (and with ``expected``); raises `DamagedRun`."""
        digest = hashlib.blake2b(digest_size=16)
        for block in self.blocks(spec):
            digest.update(np.ascontiguousarray(block).tobytes())
        with reading(self.path):
            stored = read_text(self._file[spec.path], "blake2b")
        actual = digest.hexdigest()
        if stored != actual or expected not in (None, actual):
            raise DamagedRun(f"{self.path}: the values of {spec.path} do not match their digest")
        return actual

    def check_written(self, specs: Iterable[Dataset], digests: Mapping[str, str]) -> None:
        """Read everything back: the datasets of ``specs`` with their digests by path, and the texts; raises `DamagedRun`."""
        self.check_texts()
        for spec in specs:
            self.check_digest(spec, digests[spec.path])

    def _check_header(self, filetype: str, run_id: str | None) -> tuple[int, int]:
        with reading(self.path):
            version = self._version()
        check_version(self.path, version)
        found = self.text("filetype")
        if found != filetype:
            raise DamagedRun(f"{self.path}: is a {found!r} file, expected {filetype!r}")
        if run_id is not None and self.text("run_id") != run_id:
            raise DamagedRun(f"{self.path}: belongs to another run")
        return version[0], version[1]

    def _version(self) -> list[int]:
        stored = self._file.attrs.get_id("format_version")
        if stored.dtype.kind != "i" or stored.shape != (2,):
            raise TypeError("attribute 'format_version' is not two integers")
        return [int(part) for part in self._file.attrs["format_version"]]

    def _find(self, path: str) -> h5py.Dataset:
        node: Any = self._file
        for part in path.split("/"):
            if not isinstance(node, h5py.Group) or not isinstance(node.get(part, getlink=True), h5py.HardLink):
                raise DamagedRun(f"{self.path}: dataset {path} is missing")
            node = node[part]
        if not isinstance(node, h5py.Dataset):
            raise DamagedRun(f"{self.path}: {path} is not a dataset")
        return node

    def _check_type(self, spec: Dataset, found: h5py.Dataset) -> None:
        if spec.dtype == "str":
            info = h5py.check_string_dtype(found.dtype)
            is_right = info is not None and info.length is not None and found.dtype.itemsize <= _STRING_LIMIT
        else:
            is_right = found.dtype.str in _TYPES[spec.dtype]
        if not is_right:
            raise DamagedRun(f"{self.path}: {spec.path} has type {found.dtype}, expected {spec.dtype}")

    def _check_storage(self, spec: Dataset, found: h5py.Dataset) -> None:
        """No data in other files, known filters only, and no more rows than the file has room for."""
        create = found.id.get_create_plist()
        filters = {create.get_filter(k)[0] for k in range(create.get_nfilters())}
        stored = found.id.get_storage_size()
        declared = math.prod(found.shape) * found.dtype.itemsize
        room = stored * (_DEFLATE_RATIO if h5py.h5z.FILTER_DEFLATE in filters else 1)
        chunk = math.prod(found.chunks or (0,)) * found.dtype.itemsize
        if found.is_virtual or found.external or not filters <= _FILTERS:
            raise DamagedRun(f"{self.path}: {spec.path} is not stored as this program stores it")
        if stored > self._size or declared > room or chunk > max(declared, 1):
            raise DamagedRun(f"{self.path}: {spec.path} claims {declared} bytes, more than the file holds")

    def _bind(self, spec: Dataset, shape: tuple[int, ...]) -> None:
        if len(shape) != len(spec.dims):
            raise DamagedRun(f"{self.path}: {spec.path} has shape {shape}")
        for dim, length in zip(spec.dims, shape, strict=True):
            expected = dim if isinstance(dim, int) else self._expected(dim, length)
            if length != expected:
                raise DamagedRun(f"{self.path}: {spec.path} has shape {shape}, expected {expected} instead of {length}")

    def _expected(self, dim: str, length: int) -> int:
        if dim in _EDGES and length > 0:
            return self.dims.setdefault(_EDGES[dim], length - 1) + 1
        return self.dims.setdefault(dim, length)


def check_version(path: Path, version: Any) -> None:
    """Refuse another major version of the format, or what is not a version; raises `UnsupportedVersion`."""
    is_version = isinstance(version, list) and len(version) == 2 and all(isinstance(part, int) for part in version)
    if not is_version or version[0] != FORMAT_VERSION[0]:
        given = ".".join(map(str, version)) if isinstance(version, list) else str(version)[:40]
        raise UnsupportedVersion(
            f"{path}: has format version {given}, this program reads {FORMAT_VERSION[0]}.x; "
            f"use the version of multicor that made it, or run the scenario again"
        )

"""HDF5 files of a run: datasets of the schema with checksums and digests; read as if hostile.

Files are written with the version 1.10 layout of HDF5, whose structure carries checksums of its
own, through `GuardedFile`, so that HDF5 never sees a failing disk.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Self

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from multicor_cli import __version__
from multicor_cli.files import Unfit, regular_path
from multicor_cli.model.books import Version
from multicor_cli.store.atomic import GuardedFile, commit_file, kill_point
from multicor_cli.store.documents import check_version
from multicor_cli.store.errors import DamagedRun, StorageError
from multicor_cli.store.schema import FORMAT_VERSION, Dataset
from multicor_cli.text import json_value

# ---- Texts beside the datasets of an HDF5 file: attributes of fixed length, each with a digest.
#
# Strings of variable length, as h5py writes them, lie in a global heap: the only structure of HDF5
# without a checksum, and one in which the library searches forever where an object has no size.
# They are refused before they are read.

DIGESTS = "attribute_digests"
"""Root attribute with the digests of all other texts of the root, as JSON."""


def write_text(node: h5py.HLObject, name: str, text: str) -> None:
    """Store a text as an attribute."""
    if h5py.h5a.exists(node.id, name.encode()):
        h5py.h5a.delete(node.id, name.encode())
    _attach(node, name, text, max(len(text.encode()), 1))


def _attach(node: h5py.HLObject, name: str, text: str, length: int | None = None) -> None:
    """A new attribute, of variable length if None; small runs write a thousand.

    As ``node.attrs.create``, in a sixth of its time.
    """
    attribute = h5py.h5a.create(node.id, name.encode(), _text_type(length), _space(()))
    value = text if length is None else text.encode()
    attribute.write(np.array(value, h5py.string_dtype("utf-8", length)))


@functools.cache
def _text_type(length: int | None) -> h5py.h5t.TypeID:
    return h5py.h5t.py_create(h5py.string_dtype("utf-8", length), logical=True)


@functools.lru_cache(256)
def _space(shape: tuple[int, ...]) -> h5py.h5s.SpaceID:
    return h5py.h5s.create_simple(shape) if shape else h5py.h5s.create(h5py.h5s.SCALAR)


def write_digests(file: h5py.File) -> None:
    """Store the digests of all texts of the root; the last to be written there."""
    file.attrs.pop(DIGESTS, None)
    digests = {
        name: text_digest(read_text(file, name))
        for name in file.attrs
        if h5py.check_string_dtype(file.attrs.get_id(name).dtype) is not None
    }
    write_text(file, DIGESTS, json.dumps(digests))


def read_text(node: h5py.HLObject, name: str) -> str:
    """A text of fixed length; raises `KeyError`, `TypeError` or `UnicodeDecodeError` if none."""
    if not h5py.h5a.exists(node.id, name.encode()):
        raise KeyError(f"attribute {name!r} is missing")
    attribute = h5py.h5a.open(node.id, name.encode())
    dtype = attribute.dtype
    info = h5py.check_string_dtype(dtype)
    if info is None or info.length is None or attribute.shape != ():
        raise TypeError(f"attribute {name!r} is not one string of fixed length")
    value = np.zeros((), dtype)
    attribute.read(value)
    return bytes(value[()]).decode()


def text_digest(text: str) -> str:
    """BLAKE2b digest of a text."""
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


# ---- Writing

Precision = Literal["double", "single"]

CHUNK_BYTES = 256 << 10

_DTYPES: dict[str, str] = {"f8": "<f8", "i8": "<i8", "i4": "<i4", "u1": "|u1"}


def dtype_of(spec: Dataset, precision: Precision) -> np.dtype[Any]:
    """Stored type of a dataset that is not a string."""
    if spec.dtype == "float":
        return np.dtype("<f8" if precision == "double" else "<f4")
    return np.dtype(_DTYPES[spec.dtype])


def encode_strings(texts: list[str]) -> NDArray[np.bytes_]:
    """Strings as zero-padded UTF-8 of one length."""
    encoded = [text.encode() for text in texts]
    length = max((len(text) for text in encoded), default=1)
    return np.array(encoded, dtype=f"S{max(length, 1)}")


def estimate_size(specs: tuple[Dataset, ...], data_bytes: int) -> int:
    """Upper bound of the size of a file that holds ``data_bytes`` in the datasets of ``specs``."""
    return data_bytes + data_bytes // 128 + 4096 * len(specs) + (64 << 10)


class Chunked(ABC):
    """Rows on their way into a dataset: every chunk is written once, front to back."""

    def __init__(self, chunk: int) -> None:
        self._chunk = chunk
        self._pending: list[NDArray[Any]] = []
        self._count = 0

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows; those that fill chunks are written."""
        self._pending.append(rows)
        self._count += len(rows)
        if self._count >= self._chunk:
            self._write(self._count // self._chunk * self._chunk)

    def _write(self, count: int) -> None:
        if not count:
            return
        rows = self._pending[0] if len(self._pending) == 1 else np.concatenate(self._pending)
        self._store(rows[:count])
        rest = rows[count:].copy()
        self._pending = [rest] if len(rest) else []
        self._count = len(rest)

    @abstractmethod
    def _store(self, rows: NDArray[Any]) -> None:
        """Write rows behind those that are there."""


class DatasetStream(Chunked):
    """A dataset of a known shape. ``compress``: shuffle and deflate."""

    def __init__(
        self,
        folder: h5py.Group,
        spec: Dataset,
        shape: tuple[int, ...],
        dtype: DTypeLike,
        *,
        compress: bool,
    ) -> None:
        self._spec, self._shape = spec, shape
        self._dtype = np.dtype(dtype)
        self._digest = hashlib.blake2b(digest_size=16)
        self._row = 0
        super().__init__(_chunk_rows(shape, self._dtype.itemsize))
        chunk = (self._chunk, *shape[1:]) if self._chunk else ()
        self._type = _stored_type(self._dtype.str)
        # As ``folder.create_dataset``, in a quarter of its time
        created = h5py.h5d.create(
            folder.id, spec.name.encode(), self._type, _space(shape), _layout(chunk, compress)
        )
        self._dataset = h5py.Dataset(created)

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows; raises `ValueError` if they do not have the shape of the dataset."""
        if rows.shape[1:] != self._shape[1:]:
            raise ValueError(
                f"{self._spec.path}: rows of shape {rows.shape[1:]}, expected {self._shape[1:]}"
            )
        rows = np.ascontiguousarray(rows, dtype=self._dtype)
        if not rows.size:
            self._row += len(rows)
            return
        self._digest.update(rows.data.cast("B") if self._dtype.kind != "S" else rows.tobytes())
        super().append(rows)

    def close(self) -> str:
        """Write the rest; returns the digest. Raises `ValueError` if rows are missing."""
        self._write(self._count)
        if self._row != self._shape[0]:
            raise ValueError(
                f"{self._spec.path}: {self._row} rows written, expected {self._shape[0]}"
            )
        digest = self._digest.hexdigest()
        _attach(self._dataset, "unit", self._spec.unit)
        _attach(self._dataset, "long_name", self._spec.meaning)
        write_text(self._dataset, "blake2b", digest)
        return digest

    def _store(self, rows: NDArray[Any]) -> None:
        end = self._row + len(rows)
        if end > self._shape[0]:
            raise ValueError(f"{self._spec.path}: more than {self._shape[0]} rows")
        if self._dtype.kind == "S":
            rows = rows.astype(h5py.string_dtype("utf-8", self._dtype.itemsize))
        if len(rows) == self._shape[0] and self._dtype.kind != "S":
            # As below, in an eighth of its time
            self._dataset.id.write(h5py.h5s.ALL, h5py.h5s.ALL, rows, self._type)
        else:
            self._dataset[self._row : end] = rows
        self._row = end


@functools.cache
def _stored_type(code: str) -> h5py.h5t.TypeID:
    """Type in a file of arrays of a type, as NumPy names it."""
    dtype = np.dtype(code)
    is_text = dtype.kind == "S"
    return _text_type(dtype.itemsize) if is_text else h5py.h5t.py_create(dtype, logical=True)


@functools.lru_cache(256)
def _layout(chunk: tuple[int, ...], compress: bool) -> h5py.h5p.PropDCID:
    """How a dataset is stored: in chunks, each with its checksum; ``()`` if nothing is in it."""
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_obj_track_times(False)
    if chunk:
        layout.set_chunk(chunk)
        if compress:
            layout.set_shuffle()
            layout.set_deflate(1)
        layout.set_fletcher32()
    return layout


@dataclass
class Hdf5Writer:
    """Creates the datasets of one file; has their digests by path, and its folders."""

    file: h5py.File
    precision: Precision
    compress_integers: bool
    label: str
    digests: dict[str, str] = field(default_factory=dict)
    folders: dict[str, h5py.Group] = field(default_factory=dict)

    def write_table(self, table: Iterable[Dataset], columns: Mapping[str, NDArray[Any]]) -> None:
        """Write those datasets of a table, in its order, that are among ``columns``, by path."""
        for spec in table:
            if spec.path in columns:
                self.write(spec, columns[spec.path])

    def stream(
        self, spec: Dataset, shape: tuple[int, ...], dtype: DTypeLike | None = None
    ) -> DatasetStream:
        """Begin a dataset of a known shape; ``dtype`` only for strings."""
        stored = np.dtype(dtype) if dtype is not None else dtype_of(spec, self.precision)
        compress = self.compress_integers and stored.kind in "iuS"
        folder = spec.path.rpartition("/")[0]
        if folder not in self.folders:
            self.folders[folder] = self.file.require_group(folder or "/")
        return DatasetStream(self.folders[folder], spec, shape, stored, compress=compress)

    def finish(self, spec: Dataset, stream: DatasetStream) -> None:
        self.digests[spec.path] = stream.close()
        if len(self.digests) == 3:
            kill_point(f"{self.label}.mid_tmp")

    def write(self, spec: Dataset, values: NDArray[Any]) -> None:
        stream = self.stream(spec, values.shape, values.dtype if values.dtype.kind == "S" else None)
        stream.append(values)
        self.finish(spec, stream)


def write_hdf5(
    path: Path,
    label: str,
    attributes: Mapping[str, Any],
    fill: Callable[[Hdf5Writer], None],
    *,
    size: int,
    table: tuple[Dataset, ...] = (),
    precision: Precision = "double",
    version: Version = FORMAT_VERSION,
    compress_integers: bool = False,
    verify: Callable[[Path], None] | None = None,
    read_only: bool = True,
) -> dict[str, str]:
    """Commit an HDF5 file, whose datasets ``fill`` writes; returns their digests by path.

    ``label`` begins the names of the kill points. ``attributes`` are those of the root besides the
    versions; dictionaries and lists are stored as JSON. ``size`` is an upper bound [bytes], see
    `estimate_size`. ``precision`` is that of type ``float``, ``version`` that of the datasets.
    ``compress_integers``: strings, too. The closed temporary file is compared with what was written
    of ``table``, and given to ``verify``, which raises if it is not what was meant. ``read_only``:
    the write permission is taken away.

    Raises `StorageFull`, or `StorageError` for any other error of the system or of HDF5; and
    `DamagedRun` if the file does not read back as written.
    """
    digests: dict[str, str] = {}

    def write(guarded: GuardedFile) -> None:
        with h5py.File(guarded, "w", libver=("v110", "v110"), rdcc_nbytes=CHUNK_BYTES) as file:
            file.attrs["format_version"] = np.array(version, np.int64)
            write_text(file, "multicor_version", __version__)
            for name, value in attributes.items():
                is_text = isinstance(value, str)
                text = value if is_text else json.dumps(json_value(value), ensure_ascii=False)
                write_text(file, name, text)
            writer = Hdf5Writer(file, precision, compress_integers, label)
            fill(writer)
            digests.update(writer.digests)
            if "data_digest" in attributes:
                write_text(file, "data_digest", data_digest(digests))
            write_digests(file)

    def check(temporary: Path) -> None:
        with CheckedFile(temporary, attributes["filetype"], run_id=attributes["run_id"]) as file:
            file.check_texts()
            for spec in filter(file.has, table):
                file.check_digest(spec, digests[spec.path])
        if verify is not None:
            verify(temporary)

    try:
        commit_file(path, label, write, size=size, verify=check, read_only=read_only)
    except RuntimeError as error:
        raise StorageError(f"{path}: HDF5 cannot write the file ({error})") from error
    return digests


def data_digest(digests: Mapping[str, str]) -> str:
    """One digest over paths and digests of all datasets but ``scenario/*``, in the order of paths.

    It leaves out texts, provenance and timings: equal for runs with equal numbers.
    """
    total = hashlib.blake2b(digest_size=16)
    for path in sorted(p for p in digests if not p.startswith("scenario/")):
        total.update(f"{path} {digests[path]}\n".encode())
    return total.hexdigest()


def _chunk_rows(shape: tuple[int, ...], itemsize: int) -> int:
    """Rows per chunk: equal chunks near `CHUNK_BYTES`; 0 for a dataset without elements."""
    row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * itemsize
    rows = shape[0]
    if not rows or not row_bytes:
        return 0
    count = -(-rows * row_bytes // CHUNK_BYTES)
    return -(-rows // min(count, rows))


# ---- Reading HDF5 files that may be hostile: the schema is compared before memory is taken

_DEFLATE_RATIO = 1100
"""No deflated stream grows by more than 1032 times."""

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_STRING_LIMIT = 64 << 20
_BLOCK_BYTES = 16 << 20
_EDGES = {"frame_edge": "frame", "table_edge": "table"}


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn errors of h5py about damage into `DamagedRun`, of the system into `StorageError`."""
    try:
        yield
    except Unfit as error:
        raise DamagedRun(f"{path}: {error.strerror}") from error
    except FileNotFoundError as error:
        raise DamagedRun(f"{path}: missing") from error
    except OSError as error:
        if error.errno:
            raise StorageError(f"{path}: {error.strerror or error}") from error
        if "already open for write" in str(error):
            what = "another program has it open for writing, or crashed while it had"
            remedy = "let it close the file, or give h5clear -s FILE"
            raise DamagedRun(f"{path}: {what}: {remedy}") from error
        raise DamagedRun(f"{path}: damaged ({_short(error)})") from error
    except (RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError) as error:
        raise DamagedRun(f"{path}: damaged ({_short(error)})") from error


def _whole(found: h5py.Dataset) -> NDArray[Any]:
    """As ``found[...]``, in a third of its time."""
    values = np.empty(found.shape, found.dtype)
    if values.size:
        found.id.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
    return values


def _short(error: BaseException) -> str:
    return str(error).splitlines()[0][:200] if str(error) else type(error).__name__


class Closing(ABC):
    """What is closed at the end of its context."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Give back what is held."""


class CheckedFile(Closing):
    """An open HDF5 file whose datasets are handed out only if they are what the schema says.

    ``filetype`` and ``run_id`` are expected root attributes, any ``run_id`` if None; ``dims`` are
    lengths that are known: others are bound by the first dataset that has them. Raises `DamagedRun`
    if it is damaged or no such file, `UnsupportedVersion` if it has another major format version,
    `StorageError` if it cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        filetype: str,
        *,
        run_id: str | None = None,
        dims: dict[str, int] | None = None,
    ) -> None:
        self.path = path
        self.dims: dict[str, int] = {"one": 1, **(dims or {})}
        self._accepted: dict[str, h5py.Dataset] = {}
        self._nodes: dict[str, Any] = {}
        with reading(path), regular_path(path) as opened:
            self._size = os.stat(opened).st_size  # noqa: PTH116  (not that of what has this name by now)
            self._file = self._nodes[""] = h5py.File(opened, "r", locking=False)
        try:
            self.version = self._check_header(filetype, run_id)
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        self._accepted.clear()
        self._nodes.clear()
        self._file.close()

    @cached_property
    def features(self) -> frozenset[str]:
        """Features of the run, see ``schema.Feature``; raises `DamagedRun`."""
        found = self.json("features")
        if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
            raise DamagedRun(f"{self.path}: attribute 'features' is damaged")
        return frozenset(found)

    def has(self, spec: Dataset) -> bool:
        """Whether the file has a dataset, by its version and features; raises `DamagedRun`."""
        return spec.since <= self.version and (
            spec.only_with is None or spec.only_with in self.features
        )

    def text(self, name: str) -> str:
        """A root attribute that is a string, compared with its digest; raises `DamagedRun`."""
        with reading(self.path):
            text = read_text(self._file, name)
        if self._text_digests.get(name) != text_digest(text):
            raise DamagedRun(f"{self.path}: attribute {name!r} does not match its digest")
        return text

    def has_text(self, name: str) -> bool:
        return name in self._text_digests

    def json(self, name: str) -> Any:
        """A root attribute that holds JSON; raises `DamagedRun`."""
        try:
            return json.loads(self.text(name))
        except (ValueError, RecursionError) as error:
            raise DamagedRun(f"{self.path}: attribute {name!r} is damaged") from error

    def check_texts(self) -> None:
        """Compare all root attributes that are texts with their digests; raises `DamagedRun`."""
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
        """A dataset of the schema, type, shape and storage checked; raises `DamagedRun`."""
        if spec.path in self._accepted:
            return self._accepted[spec.path]
        with reading(self.path):
            found = self._node(spec.path)
            if not isinstance(found, h5py.Dataset):
                raise DamagedRun(f"{self.path}: {spec.path} is not a dataset")
            self._check_type(spec, found)
            self._check_storage(spec, found)
            self._bind(spec, found.shape)
        self._accepted[spec.path] = found
        return found

    def read(self, spec: Dataset, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows ``start:stop`` of a dataset (not of strings); raises `DamagedRun`."""
        found = self.dataset(spec)
        with reading(self.path):
            if start == 0 and stop is None:
                return _whole(found)
            return np.asarray(found[start : found.shape[0] if stop is None else stop])

    def strings(self, spec: Dataset) -> list[str]:
        """A dataset of strings; raises `DamagedRun`."""
        found = self.dataset(spec)
        with reading(self.path):
            return [bytes(item).rstrip(b"\0").decode() for item in found[...]]

    def blocks(self, spec: Dataset) -> Iterator[NDArray[Any]]:
        """All rows in pieces of bounded size; raises `DamagedRun`."""
        found = self.dataset(spec)
        shape, itemsize = found.shape, found.dtype.itemsize
        if 0 < math.prod(shape) * itemsize <= _BLOCK_BYTES:
            with reading(self.path):
                yield _whole(found)
            return
        unit = (found.chunks or (1,))[0]
        row_bytes = max(1, math.prod(shape[1:]) * itemsize)
        step = max(unit, _BLOCK_BYTES // row_bytes // unit * unit)
        for start in range(0, shape[0], step):
            with reading(self.path):
                yield np.asarray(found[start : start + step])

    def check_digest(self, spec: Dataset, expected: str | None = None) -> str:
        """A dataset's digest, compared with the stored one and ``expected``; or `DamagedRun`."""
        digest = hashlib.blake2b(digest_size=16)
        for block in self.blocks(spec):
            digest.update(np.ascontiguousarray(block).tobytes())
        with reading(self.path):
            stored = read_text(self.dataset(spec), "blake2b")
        actual = digest.hexdigest()
        if stored != actual or expected not in (None, actual):
            raise DamagedRun(f"{self.path}: the values of {spec.path} do not match their digest")
        return actual

    def _check_header(self, filetype: str, run_id: str | None) -> tuple[int, int]:
        with reading(self.path):
            stored = self._file.attrs.get_id("format_version")
            if stored.dtype.kind != "i" or stored.shape != (2,):
                raise TypeError("attribute 'format_version' is not two integers")
            version = [int(part) for part in self._file.attrs["format_version"]]
        check_version(self.path, version)
        found = self.text("filetype")
        if found != filetype:
            raise DamagedRun(f"{self.path}: is a {found!r} file, expected {filetype!r}")
        if run_id is not None and self.text("run_id") != run_id:
            raise DamagedRun(f"{self.path}: belongs to another run")
        return version[0], version[1]

    def _node(self, path: str) -> Any:
        """A folder or a dataset; no link is followed that leads elsewhere."""
        if path not in self._nodes:
            folder, _, name = path.rpartition("/")
            parent, key = self._node(folder), name.encode()
            if (
                not isinstance(parent, h5py.Group)
                or not parent.id.links.exists(key)
                or parent.id.links.get_info(key).type != h5py.h5l.TYPE_HARD
            ):
                raise DamagedRun(f"{self.path}: {path} is missing")
            # ``parent[name]`` would open the file once more to ask whether it may be written
            found = h5py.h5o.open(parent.id, key)
            is_dataset = isinstance(found, h5py.h5d.DatasetID)
            self._nodes[path] = (
                h5py.Dataset(found, readonly=True) if is_dataset else h5py.Group(found)
            )
        return self._nodes[path]

    def _check_type(self, spec: Dataset, found: h5py.Dataset) -> None:
        dtype = found.dtype
        if spec.dtype == "str":
            info = h5py.check_string_dtype(dtype)
            is_right = (
                info is not None and info.length is not None and dtype.itemsize <= _STRING_LIMIT
            )
        else:
            is_right = dtype in (dtype_of(spec, "double"), dtype_of(spec, "single"))
        if not is_right:
            raise DamagedRun(f"{self.path}: {spec.path} has type {dtype}, expected {spec.dtype}")

    def _check_storage(self, spec: Dataset, found: h5py.Dataset) -> None:
        """Refuse data in other files, unknown filters, and more rows than the file has room for."""
        create, itemsize = found.id.get_create_plist(), found.dtype.itemsize
        layout = create.get_layout()
        filters = {create.get_filter(k)[0] for k in range(create.get_nfilters())}
        stored = found.id.get_storage_size()
        declared = math.prod(found.shape) * itemsize
        room = stored * (_DEFLATE_RATIO if h5py.h5z.FILTER_DEFLATE in filters else 1)
        chunks = create.get_chunk() if layout == h5py.h5d.CHUNKED else (0,)
        chunk = math.prod(chunks) * itemsize
        is_elsewhere = layout == h5py.h5d.VIRTUAL or create.get_external_count() > 0
        if is_elsewhere or not filters <= _FILTERS:
            raise DamagedRun(f"{self.path}: {spec.path} is not stored as this program stores it")
        if stored > self._size or declared > room or chunk > max(declared, 1):
            raise DamagedRun(
                f"{self.path}: {spec.path} claims {declared} bytes, more than the file holds"
            )

    def _bind(self, spec: Dataset, shape: tuple[int, ...]) -> None:
        if len(shape) != len(spec.dims):
            raise DamagedRun(f"{self.path}: {spec.path} has shape {shape}")
        for dim, length in zip(spec.dims, shape, strict=True):
            if isinstance(dim, int):
                expected = dim
            elif dim in _EDGES and length > 0:
                expected = self.dims.setdefault(_EDGES[dim], length - 1) + 1
            else:
                expected = self.dims.setdefault(dim, length)
            if length != expected:
                raise DamagedRun(
                    f"{self.path}: {spec.path} has shape {shape}, expected {expected} instead of "
                    f"{length}"
                )

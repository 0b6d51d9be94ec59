"""Writing HDF5 files of a run: datasets of the schema, in streams of rows, with checksums and digests.

Files are written with the version 1.10 layout of HDF5, whose structure carries checksums of its own, through `GuardedFile`,
so that HDF5 never sees a failing disk.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from multicor_cli import __version__
from multicor_cli.model.books import Version
from multicor_cli.store.atomic import GuardedFile, commit_file, kill_point
from multicor_cli.store.documents import plain
from multicor_cli.store.errors import StorageError
from multicor_cli.store.schema import FORMAT_VERSION, Dataset
from multicor_cli.store.texts import write_digests, write_text

Precision = Literal["double", "single"]

CHUNK_BYTES = 256 << 10
"""Target size of a chunk."""

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


class DatasetStream:
    """One dataset, written from front to back in pieces; every chunk is written once.

    Args:
        file: Open HDF5 file.
        spec: What the dataset is.
        shape: Full shape.
        dtype: Stored type.
        compress: Whether to shuffle and deflate.
    """

    def __init__(self, file: h5py.File, spec: Dataset, shape: tuple[int, ...], dtype: DTypeLike, *, compress: bool) -> None:
        self._spec, self._shape = spec, shape
        self._dtype = np.dtype(dtype)
        self._digest = hashlib.blake2b(digest_size=16)
        self._row = 0
        self._chunk = _chunk_rows(shape, self._dtype.itemsize)
        self._pending: list[NDArray[Any]] = []
        self._pending_rows = 0
        options: dict[str, Any] = {}
        if self._chunk:
            options = {"chunks": (self._chunk, *shape[1:]), "fletcher32": True}
            if compress:
                options |= {"shuffle": True, "compression": "gzip", "compression_opts": 1}
        stored = h5py.string_dtype("utf-8", self._dtype.itemsize) if self._dtype.kind == "S" else self._dtype
        self._dataset = file.create_dataset(spec.path, shape=shape, dtype=stored, **options)

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows; raises `ValueError` if they do not have the shape of the dataset."""
        if rows.shape[1:] != self._shape[1:]:
            raise ValueError(f"{self._spec.path}: rows of shape {rows.shape[1:]}, expected {self._shape[1:]}")
        rows = np.ascontiguousarray(rows, dtype=self._dtype)
        if not rows.size:
            self._row += len(rows)
            return
        self._digest.update(rows.data.cast("B") if self._dtype.kind != "S" else rows.tobytes())
        self._pending.append(rows)
        self._pending_rows += len(rows)
        if self._pending_rows >= self._chunk:
            self._write(self._pending_rows // self._chunk * self._chunk)

    def close(self) -> str:
        """Write what is left and the attributes; returns the digest of the values. Raises `ValueError` if rows are missing."""
        self._write(self._pending_rows)
        if self._row != self._shape[0]:
            raise ValueError(f"{self._spec.path}: {self._row} rows written, expected {self._shape[0]}")
        digest = self._digest.hexdigest()
        self._dataset.attrs["unit"] = self._spec.unit
        self._dataset.attrs["long_name"] = self._spec.long_name
        write_text(self._dataset, "blake2b", digest)
        return digest

    def _write(self, count: int) -> None:
        if not count:
            return
        rows = self._pending[0] if len(self._pending) == 1 else np.concatenate(self._pending)
        if self._row + count > self._shape[0]:
            raise ValueError(f"{self._spec.path}: more than {self._shape[0]} rows")
        if self._dtype.kind == "S":
            rows = rows.astype(h5py.string_dtype("utf-8", self._dtype.itemsize))
        self._dataset[self._row : self._row + count] = rows[:count]
        self._row += count
        rest = rows[count:].copy()
        self._pending = [rest] if len(rest) else []
        self._pending_rows = len(rest)


class Hdf5Writer:
    """Creates the datasets of one file.

    Attributes:
        file: The open HDF5 file.
        precision: How datasets of type ``float`` are stored.
        digests: Digest of each dataset written so far, by path.
    """

    def __init__(self, file: h5py.File, precision: Precision, *, compress_integers: bool, label: str) -> None:
        self.file, self.precision = file, precision
        self.digests: dict[str, str] = {}
        self._compress_integers = compress_integers
        self._label = label

    def stream(self, spec: Dataset, shape: tuple[int, ...], dtype: DTypeLike | None = None) -> DatasetStream:
        """Begin a dataset of a known shape; ``dtype`` only for strings."""
        stored = np.dtype(dtype) if dtype is not None else dtype_of(spec, self.precision)
        compress = self._compress_integers and stored.kind in "iuS"
        return DatasetStream(self.file, spec, shape, stored, compress=compress)

    def finish(self, spec: Dataset, stream: DatasetStream) -> None:
        """Close a stream and remember its digest."""
        self.digests[spec.path] = stream.close()
        if len(self.digests) == 3:
            kill_point(f"{self._label}.mid_tmp")

    def write(self, spec: Dataset, values: NDArray[Any]) -> None:
        """Write a whole dataset."""
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
    precision: Precision = "double",
    version: Version = FORMAT_VERSION,
    compress_integers: bool = False,
    verify: Callable[[Path, dict[str, str]], None] | None = None,
    read_only: bool = True,
) -> dict[str, str]:
    """Commit an HDF5 file.

    Args:
        path: Final name.
        label: First part of the names of the kill points.
        attributes: Root attributes besides the versions; dictionaries and lists are stored as JSON.
        fill: Writes the datasets.
        size: Upper bound of the size, see `estimate_size` [bytes].
        precision: How datasets of type ``float`` are stored.
        version: Version of the file format that the datasets are those of.
        compress_integers: Whether to compress integers and strings.
        verify: Called with the closed temporary file and the digests; raises if the file is not what was meant.
        read_only: Whether to take the write permission away.

    Returns:
        Digests of the datasets by path.

    Raises:
        StorageFull: If there is not enough space.
        StorageError: For any other error of the system or of HDF5.
    """
    digests: dict[str, str] = {}

    def write(guarded: GuardedFile) -> None:
        with h5py.File(guarded, "w", libver=("v110", "v110"), rdcc_nbytes=CHUNK_BYTES) as file:
            _write_attributes(file, version, attributes)
            writer = Hdf5Writer(file, precision, compress_integers=compress_integers, label=label)
            fill(writer)
            digests.update(writer.digests)
            if "data_digest" in attributes:
                write_text(file, "data_digest", data_digest(digests))
            write_digests(file)

    check = (lambda temporary: verify(temporary, digests)) if verify is not None else None
    try:
        commit_file(path, label, write, size=size, verify=check, read_only=read_only)
    except RuntimeError as error:
        raise StorageError(f"{path}: HDF5 cannot write the file ({error})") from error
    return digests


def data_digest(digests: Mapping[str, str]) -> str:
    """One digest over the paths and digests of all datasets but ``scenario/*``, in the order of the paths.

    It leaves out texts, provenance and timings: equal for runs with equal numbers.
    """
    total = hashlib.blake2b(digest_size=16)
    for path in sorted(p for p in digests if not p.startswith("scenario/")):
        total.update(f"{path} {digests[path]}\n".encode())
    return total.hexdigest()


def _write_attributes(file: h5py.File, version: Version, attributes: Mapping[str, Any]) -> None:
    file.attrs["format_version"] = np.array(version, np.int64)
    write_text(file, "multicor_version", __version__)
    for name, value in attributes.items():
        write_text(file, name, value if isinstance(value, str) else json.dumps(plain(value), ensure_ascii=False))


def _chunk_rows(shape: tuple[int, ...], itemsize: int) -> int:
    """Rows per chunk: chunks of equal length near `CHUNK_BYTES`; 0 for a dataset without elements."""
    row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * itemsize
    rows = shape[0]
    if not rows or not row_bytes:
        return 0
    count = -(-rows * row_bytes // CHUNK_BYTES)
    return -(-rows // min(count, rows))

"""Grains, and initial temperatures, from files.

The file comes from elsewhere and is not trusted: sizes are checked before memory is taken, values
are plain numbers (no pickled objects, no links to other files), and what is wrong is named with its
row.
"""

from __future__ import annotations

import csv
import difflib
import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.files import regular_path
from multicor_cli.model.model import Floats
from multicor_cli.packing.initial_grains import (
    LINE_LIMIT,
    NAMED,
    InitialGrains,
    describe_faults,
    faulty_rows,
    find_fault,
    reading_input,
    text_lines,
)
from multicor_cli.scenario.checks.grains import MAX_GRAINS
from multicor_cli.scenario.problems import Refused

# ---- Grains from a CSV or HDF5 file: x, y, radius and, if wanted, angle, vx, vy, spin

REQUIRED = ("x", "y", "radius")
OPTIONAL = ("angle", "vx", "vy", "spin")
MAX_BYTES = 2**33

_KEY = ("packing", "path")
_MOST_COMPRESSED = 1100
"""Times by which the compression of HDF5 can shrink data, somewhat more."""
_LARGEST_CHUNK = 2**20  # values
_NUMBERS = "uif"  # kinds of numpy types that are plain numbers


def read_grains(path: Path, shift: tuple[float, float]) -> InitialGrains:
    """Grains from a file whose name ends in .csv, .h5 or .hdf5; ``shift`` is added to x and y [m].

    `Refused` if it is missing, unreadable, too large, or holds something else; rows are named.
    """
    kind = path.suffix.lower()
    if kind == ".csv":
        columns = _read_csv(path)
    elif kind in (".h5", ".hdf5"):
        columns = _read_hdf5(path)
    else:
        raise Refused(
            _KEY,
            f"cannot tell what kind of file '{path.name}' is",
            "its name must end in .csv, .h5 or .hdf5",
        )
    n = columns["x"].size
    values = [columns.get(name, np.zeros(n)) for name in (*REQUIRED, *OPTIONAL)]
    x, y, radius, angle, vx, vy, spin = values
    return InitialGrains(
        radius,
        np.column_stack([x + shift[0], y + shift[1], angle]),
        np.column_stack([vx, vy, spin]),
    )


def _check_names(names: list[str], path: Path, what: str) -> None:
    """All required names once, and no others."""
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        raise Refused(
            _KEY,
            f"'{path}' has no {what} {', '.join(missing)}",
            f"it must have {', '.join(REQUIRED)}",
        )
    for k, name in enumerate(names):
        if name in names[:k]:
            raise Refused(_KEY, f"'{path}' has the {what} '{name}' twice", "remove one")
        if name not in (*REQUIRED, *OPTIONAL):
            near = difflib.get_close_matches(name, OPTIONAL, 1)
            hint = (
                f"did you mean '{near[0]}'?"
                if near
                else f"remove it; known are {', '.join((*REQUIRED, *OPTIONAL))}"
            )
            raise Refused(_KEY, f"'{path}' has an unknown {what} {name[:40]!r}", hint)


def _refuse_count(path: Path, n: int) -> None:
    if n == 0:
        raise Refused(_KEY, f"'{path}' holds no grains", "add one row per grain")
    if n > MAX_GRAINS:
        raise Refused(_KEY, f"'{path}' holds {n} grains", f"the limit is {MAX_GRAINS}")


def _refuse_rows(path: Path, faults: list[str], total: str) -> Refused:
    return Refused(_KEY, f"'{path}': {'; '.join(faults)}{total}", "correct the file")


def _read_csv(path: Path) -> dict[str, Floats]:
    with reading_input(path, "comma-separated text in UTF-8", _KEY):
        names, header_line = _read_header(path)
        _check_names(names, path, "column")
        table = _parse_rows(path, header_line)
        if table is not None:
            _refuse_count(path, len(table) if table.size else 0)
            if table.shape[1] == len(names):
                columns = {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}
                if not faulty_rows(columns).size:
                    return columns
        raise _explain_csv(path, names, header_line)


def _parse_rows(path: Path, header_line: int) -> Floats | None:
    """Rows below the header, `MAX_GRAINS` + 1 at most; None if they are not a table of numbers."""
    try:
        with warnings.catch_warnings(action="ignore"):  # about empty lines and files
            lines = text_lines(path, MAX_BYTES)
            return np.loadtxt(
                lines,
                delimiter=",",
                skiprows=header_line,
                ndmin=2,
                max_rows=MAX_GRAINS + 1,
                dtype=float,
            )
    except ValueError:
        return None


def _read_header(path: Path) -> tuple[list[str], int]:
    """Names of the columns, and number of their line: the first neither empty nor a comment."""
    for number, line in enumerate(text_lines(path, MAX_BYTES), 1):
        if line.strip() and not line.startswith("#"):
            cells = next(csv.reader([line]))
            return [cell.strip() for cell in cells], number
    raise Refused(
        _KEY, f"'{path}' is empty", f"its first line must name the columns, as {','.join(REQUIRED)}"
    )


def _explain_csv(path: Path, names: list[str], header_line: int) -> Refused:
    """Read a faulty file again, slowly, and name the first faulty lines."""
    faults: list[str] = []
    for number, line in enumerate(text_lines(path, MAX_BYTES), 1):
        text = line.split("#", 1)[0]
        if number <= header_line or not text.strip():
            continue
        fault = (
            _line_fault(text, names)
            if len(line) < LINE_LIMIT
            else f"has more than {LINE_LIMIT} characters"
        )
        if fault and len(faults) == NAMED:
            return _refuse_rows(path, faults, "; and more")
        if fault:
            faults.append(f"line {number}: {fault}")
    return _refuse_rows(path, faults or ["the rows cannot be read as numbers"], "")


def _line_fault(text: str, names: list[str]) -> str:
    cells = next(csv.reader([text]))
    if len(cells) != len(names):
        return f"{len(cells)} values for {len(names)} columns"
    for name, cell in zip(names, cells, strict=True):
        try:
            value = float(cell)
        except ValueError:
            return f"{name} = {cell.strip()[:40]!r} is not a number"
        if fault := find_fault(name, value):
            return fault
    return ""


def _read_hdf5(path: Path) -> dict[str, Floats]:
    import h5py

    try:
        with (
            reading_input(path, "an HDF5 file with a dataset for each column", _KEY),
            regular_path(path, MAX_BYTES) as opened,
            h5py.File(opened, "r") as file,
        ):
            names = list(file)
            if "particles" in names and "model" in names:
                raise Refused(
                    _KEY,
                    f"'{path}' is the result of a run",
                    'use packing kind = "run" with the run directory',
                )
            _check_names(names, path, "dataset")
            sizes = {name: _dataset_size(file, name, path) for name in names}
            _refuse_count(path, sizes["x"])
            for name, size in sizes.items():
                if size != sizes["x"]:
                    raise Refused(
                        _KEY,
                        f"'{path}': {name} has {size} values and x has {sizes['x']}",
                        "give one per grain",
                    )
            with np.errstate(over="ignore"):  # long doubles become infinite, which is refused below
                columns = {name: np.asarray(file[name][()], float) for name in names}
    except Refused:
        raise
    # The last two: types that NumPy does not have
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        raise Refused(
            _KEY, f"cannot read '{path}' as HDF5: {error}", "check the file, it may be damaged"
        ) from None
    faults = describe_faults(columns)
    if faults:
        raise _refuse_rows(path, [faults], "")
    return columns


def _dataset_size(file: Any, name: str, path: Path) -> int:
    """Number of values of a dataset, checked to be a plain 1-d array of numbers in this file."""
    import h5py

    link = file.get(name, getlink=True)
    item = file[name] if isinstance(link, h5py.HardLink) else None
    if not isinstance(item, h5py.Dataset) or item.is_virtual or item.external:
        raise Refused(
            _KEY,
            f"'{path}': {name} is not a dataset stored in this file",
            "store the numbers themselves",
        )
    if item.dtype.kind not in _NUMBERS or len(item.shape or ()) != 1:
        raise Refused(
            _KEY,
            f"'{path}': {name} is not a one-dimensional array of numbers",
            "store one number per grain",
        )
    if item.size * item.dtype.itemsize > _MOST_COMPRESSED * max(1, item.id.get_storage_size()):
        raise Refused(
            _KEY,
            f"'{path}': {name} has more values than are stored in the file",
            "store every value",
        )
    # One chunk is unpacked whole
    if math.prod(item.chunks or (0,)) > max(item.size, _LARGEST_CHUNK):
        raise Refused(
            _KEY,
            f"'{path}': {name} is stored in chunks of {item.chunks[0]} values",
            "use smaller chunks",
        )
    return int(item.shape[0])


# ---- Initial temperatures from a text file: one number per line.
#
# The file comes from elsewhere and is not trusted: its size is checked before memory is taken, and
# what is wrong is named with its line. Empty lines and what follows a `#` are left out.

MAX_TEXT_BYTES = 2**31
"""Largest file: more than 40 characters for each of the most grains there can be."""

_TEMPERATURE_KEY = ("temperature", "file")


def read_temperatures(path: Path) -> Floats:
    """The temperatures in a file, text in UTF-8 [K], in the order of its lines.

    `Refused` if it is missing, unreadable, too large, or holds something else; lines are named.
    """
    values: list[float] = []
    faults: list[str] = []
    with reading_input(path, "text in UTF-8, one temperature per line", _TEMPERATURE_KEY):
        for number, text in _lines(path):
            value, fault = _parse(text)
            if fault:
                faults.append(f"line {number}: {fault}")
            values.append(value)
            if len(faults) > NAMED or len(values) > MAX_GRAINS:
                break
    if faults:
        more = "; and more" if len(faults) > NAMED else ""
        raise Refused(
            _TEMPERATURE_KEY,
            f"'{path}': {'; '.join(faults[:NAMED])}{more}",
            "give one temperature in kelvin per line",
        )
    if len(values) > MAX_GRAINS:
        raise Refused(
            _TEMPERATURE_KEY,
            f"'{path}' holds more than {MAX_GRAINS} temperatures",
            "give one per grain",
        )
    return np.array(values, float)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of lines that hold something; one too long for a number is cut, with "…"."""
    number, is_rest = 0, False
    for line in text_lines(path, MAX_TEXT_BYTES):
        is_cut = len(line) == LINE_LIMIT and not line.endswith("\n")
        if not is_rest:
            number += 1
            text = line.split("#", 1)[0].strip()
            if text:
                yield number, f"{text[:40]}…" if is_cut else text
        is_rest = is_cut


def _parse(text: str) -> tuple[float, str]:
    """The temperature [K], and what is wrong with it; empty if nothing is."""
    try:
        value = float(text)
    except ValueError:
        return 0.0, f"{text[:40]!r} is not a number"
    return value, find_fault("temperature", value)

"""Grains, and initial temperatures, from files and from frames of other runs.

The file comes from elsewhere and is not trusted: sizes are checked before memory is taken, values
are plain numbers (no pickled objects, no links to other files), and what is wrong is named with its
row.
"""

from __future__ import annotations

import csv
import difflib
import functools
import io
import math
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.files import open_regular, regular_path
from multicor_cli.model.model import Floats
from multicor_cli.packing.initial_grains import NAMED, Forms, InitialGrains
from multicor_cli.scenario.base import (
    COORDINATE_BOUNDS,
    KELVIN_BOUNDS,
    NUMBER_BOUNDS,
    RADIUS_BOUNDS,
    reading_input,
    refuse_semicolons,
)
from multicor_cli.scenario.checks.grains import MAX_GRAINS
from multicor_cli.scenario.problems import Refused
from multicor_cli.store.errors import NoFrame, StoreError

# ---- Values of grains that come from elsewhere: finite and within bounds, or named with their row

_BOUNDS = {
    "x": COORDINATE_BOUNDS,
    "y": COORDINATE_BOUNDS,
    "radius": RADIUS_BOUNDS,
    "temperature": KELVIN_BOUNDS,
}
"""Bounds of columns, as of keys of a scenario; others are angles [rad], [m/s] and [rad/s]."""

_UNITS = {"x": " m", "y": " m", "radius": " m", "temperature": " K"}


def _find_fault(name: str, value: float) -> str:
    """What is wrong with a value of ``x, y, radius, temperature`` or a motion; empty if nothing."""
    if not math.isfinite(value):
        return f"{name} = {value} is not finite"
    low, high = _BOUNDS.get(name, NUMBER_BOUNDS)
    if low <= value <= high:
        return ""
    is_celsius = name == "temperature" and -273.15 < value <= 0.0
    hint = f" (from degrees Celsius: {value + 273.15:g})" if is_celsius else ""
    unit = _UNITS.get(name, "")
    return f"{name} = {value:g}{unit} is not between {low:g} and {high:g}{unit}{hint}"


def _describe_faults(columns: Mapping[str, Floats]) -> str:
    """Name the first faulty rows, and how many more; empty if none. Columns have shape ``(n,)``."""
    rows = _faulty_rows(columns)
    if not rows.size:
        return ""
    named = []
    for row in rows[:NAMED]:
        faults = (_find_fault(name, float(values[row])) for name, values in columns.items())
        named.append(f"row {row}: {next(filter(None, faults), '')}")
    more = f"; and {rows.size - NAMED} more rows" if rows.size > NAMED else ""
    return "; ".join(named) + more


def _faulty_rows(columns: Mapping[str, Floats]) -> NDArray[np.int64]:
    """Rows with a value that `_find_fault` finds something wrong with."""
    bad = np.zeros(columns["radius"].shape, np.bool_)
    for name, values in columns.items():
        low, high = _BOUNDS.get(name, NUMBER_BOUNDS)
        bad |= ~((values >= low) & (values <= high))
    return np.flatnonzero(bad)


# ---- Lines of text

_LINE_LIMIT = 10_000
"""So much of a line is read at a time [characters]: a file may be one line as long as itself."""


def _text_lines(path: Path, most: int) -> Iterator[str]:
    """Lines of a UTF-8 file of at most ``most`` bytes, in pieces of `_LINE_LIMIT` if longer."""
    with io.TextIOWrapper(open_regular(path, most), encoding="utf-8-sig", newline="") as file:
        yield from iter(lambda: file.readline(_LINE_LIMIT), "")


# ---- Grains from a CSV or HDF5 file: x, y, radius and, if wanted, angle, vx, vy, spin
# (or peculiar_vx, peculiar_vy: velocities beside the mean flow of a cell)

REQUIRED = ("x", "y", "radius")
REAL, PECULIAR = ("vx", "vy"), ("peculiar_vx", "peculiar_vy")
OPTIONAL = ("angle", *REAL, "spin", *PECULIAR)
MAX_BYTES = 2**33

_KEY = ("packing", "path")
_MOST_COMPRESSED = 1100
"""Times by which the compression of HDF5 can shrink data, somewhat more."""
_LARGEST_CHUNK = 2**20  # values
_NUMBERS = "uif"  # kinds of numpy types that are plain numbers

_refused = functools.partial(Refused, _KEY)


def read_grains(
    path: Path, shift: tuple[float, float], *, has_mean_flow: bool = False
) -> InitialGrains:
    """Grains from a file whose name ends in .csv, .h5 or .hdf5; ``shift`` is added to x and y [m].

    Where there is no mean flow, nothing is peculiar. `Refused` if it is missing, unreadable, too
    large, or holds something else; rows are named.
    """
    readers = {".csv": _read_csv, ".h5": _read_hdf5, ".hdf5": _read_hdf5}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        what = f"cannot tell what kind of file '{path.name}' is"
        raise _refused(what, "its name must end in .csv, .h5 or .hdf5")
    columns = reader(path)
    none = np.zeros(columns["x"].size)
    x, y, radius, angle, spin = (columns.get(name, none) for name in (*REQUIRED, "angle", "spin"))
    position = np.column_stack([x + shift[0], y + shift[1], angle])
    is_real, is_peculiar = (any(name in columns for name in kind) for kind in (REAL, PECULIAR))
    what = f"'{path}' has velocities beside the mean flow, "
    if is_peculiar and not has_mean_flow:
        what += "which only a cell has, periodic in both directions"
        raise _refused(what, f"name the columns {', '.join(REAL)}")
    if is_peculiar and is_real:
        raise _refused(what + "and real ones", f"keep {', '.join(REAL)} or {', '.join(PECULIAR)}")
    vx, vy = (columns.get(name, none) for name in (PECULIAR if is_peculiar else REAL))
    velocity = np.column_stack([vx, vy, spin])
    is_told = is_real if is_real or is_peculiar else None
    return InitialGrains(radius, position, velocity, is_velocity_real=is_told)


def _check_names(names: list[str], path: Path, what: str) -> None:
    """All required names once, and no others."""
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        text = f"'{path}' has no {what} {', '.join(missing)}"
        raise _refused(text, f"it must have {', '.join(REQUIRED)}")
    for k, name in enumerate(names):
        if name in names[:k]:
            raise _refused(f"'{path}' has the {what} '{name}' twice", "remove one")
        if name not in REQUIRED + OPTIONAL:
            near = difflib.get_close_matches(name, OPTIONAL, 1)
            known = f"remove it; known are {', '.join(REQUIRED + OPTIONAL)}"
            hint = f"did you mean '{near[0]}'?" if near else known
            raise _refused(f"'{path}' has an unknown {what} {name[:40]!r}", hint)


def _check_count(path: Path, n: int) -> None:
    if n == 0:
        raise _refused(f"'{path}' holds no grains", "add one row per grain")
    if n > MAX_GRAINS:
        raise _refused(f"'{path}' holds {n} grains", f"the limit is {MAX_GRAINS}")


def _read_csv(path: Path) -> dict[str, Floats]:
    with reading_input(path, "comma-separated text in UTF-8", _KEY):
        names, header_line = _read_header(path)
        refuse_semicolons(names, path, _KEY)
        _check_names(names, path, "column")
        table = _parse_rows(path, header_line)
        if table is not None:
            _check_count(path, len(table) if table.size else 0)
            if table.shape[1] == len(names):
                columns = {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}
                if not _faulty_rows(columns).size:
                    return columns
        faults = _csv_faults(path, names, header_line) or ["the rows cannot be read as numbers"]
    raise _refused(f"'{path}': {'; '.join(faults)}", "correct the file")


def _read_header(path: Path) -> tuple[list[str], int]:
    """Names of the columns, and number of their line: the first neither empty nor a comment."""
    for number, line in enumerate(_text_lines(path, MAX_BYTES), 1):
        if line.strip() and not line.startswith("#"):
            return [cell.strip() for cell in next(csv.reader([line]))], number
    names = ",".join(REQUIRED)
    raise _refused(f"'{path}' is empty", f"its first line must name the columns, as {names}")


def _parse_rows(path: Path, header_line: int) -> Floats | None:
    """Rows below the header, `MAX_GRAINS` + 1 at most; None if they are not a table of numbers."""
    lines, most = _text_lines(path, MAX_BYTES), MAX_GRAINS + 1
    try:
        with warnings.catch_warnings(action="ignore"):  # about empty lines and files
            return np.loadtxt(
                lines, float, delimiter=",", skiprows=header_line, ndmin=2, max_rows=most
            )
    except ValueError:
        return None


def _csv_faults(path: Path, names: list[str], header_line: int) -> list[str]:
    """The first faulty lines of a file, which is read again, slowly."""
    faults: list[str] = []
    for number, line in enumerate(_text_lines(path, MAX_BYTES), 1):
        text = line.split("#", 1)[0]
        if number <= header_line or not text.strip():
            continue
        is_long = len(line) >= _LINE_LIMIT
        fault = f"has more than {_LINE_LIMIT} characters" if is_long else _line_fault(text, names)
        if fault and len(faults) == NAMED:
            return [*faults, "and more"]
        if fault:
            faults.append(f"line {number}: {fault}")
    return faults


def _line_fault(text: str, names: list[str]) -> str:
    cells = next(csv.reader([text]))
    if len(cells) != len(names):
        return f"{len(cells)} values for {len(names)} columns"
    for name, cell in zip(names, cells, strict=True):
        try:
            value = float(cell)
        except ValueError:
            return f"{name} = {cell.strip()[:40]!r} is not a number"
        if fault := _find_fault(name, value):
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
                remedy = 'use packing kind = "run" with the run directory'
                raise _refused(f"'{path}' is the result of a run", remedy)
            _check_names(names, path, "dataset")
            sizes = {name: _dataset_size(file, name, path) for name in names}
            _check_count(path, sizes["x"])
            for name, size in sizes.items():
                if size != sizes["x"]:
                    what = f"'{path}': {name} has {size} values and x has {sizes['x']}"
                    raise _refused(what, "give one per grain")
            with np.errstate(over="ignore"):  # long doubles become infinite, which is refused below
                columns = {name: np.asarray(file[name][()], float) for name in names}
    except Refused:
        raise
    # The last two: types that NumPy does not have
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        what = f"cannot read '{path}' as HDF5: {error}"
        raise _refused(what, "check the file, it may be damaged") from None
    faults = _describe_faults(columns)
    if faults:
        raise _refused(f"'{path}': {faults}", "correct the file")
    return columns


def _dataset_size(file: Any, name: str, path: Path) -> int:
    """Number of values of a dataset, checked to be a plain 1-d array of numbers in this file."""
    import h5py

    link = file.get(name, getlink=True)
    item = file[name] if isinstance(link, h5py.HardLink) else None
    fault = None
    if not isinstance(item, h5py.Dataset) or item.is_virtual or item.external:
        fault = "is not a dataset stored in this file", "store the numbers themselves"
    elif item.dtype.kind not in _NUMBERS or len(item.shape or ()) != 1:
        fault = "is not a one-dimensional array of numbers", "store one number per grain"
    elif item.size * item.dtype.itemsize > _MOST_COMPRESSED * max(1, item.id.get_storage_size()):
        fault = "has more values than are stored in the file", "store every value"
    elif math.prod(item.chunks or (0,)) > max(item.size, _LARGEST_CHUNK):
        # One chunk is unpacked whole
        fault = f"is stored in chunks of {item.chunks[0]} values", "use smaller chunks"
    if fault:
        raise _refused(f"'{path}': {name} {fault[0]}", fault[1])
    assert item is not None  # that is a fault
    return int(item.shape[0])


# ---- A group of grains from a frame of another run


def read_frame(path: Path, frame: int) -> InitialGrains:
    """Grains of a frame: radii, wrapped centers, angles, motion and, where known, temperatures.

    Walls and materials are not taken over. ``path`` is a run directory (or a ``results.h5``); a
    negative index of a frame counts from the last one. `Refused` if there is no readable run, or no
    such frame, or it holds what no grain can have.
    """
    from multicor_cli.store import open_run

    try:
        with open_run(path) as run:
            chosen = run.frames[frame]
            position = np.column_stack([chosen.position, chosen.angle]).astype(float)
            velocity = np.column_stack([chosen.velocity, chosen.spin]).astype(float)
            grains, outlines = chosen.model.grains, chosen.model.outlines
            radius = np.array(grains.radius, float)
            forms = None if outlines is None else Forms(outlines, grains.inertia / grains.mass)
            temperature = chosen.temperature
    except NoFrame as error:
        what = f"cannot take grains from the run '{path}': {error}"
        raise Refused(("packing", "frame"), what, "choose another frame") from None
    except StoreError as error:
        what = f"the run '{path}' cannot be read: {error}"
        raise Refused(_KEY, what, "give the directory of a run") from None
    names = ("x", "y", "angle", "vx", "vy", "spin")
    columns = dict(zip(names, [*position.T, *velocity.T], strict=True)) | {"radius": radius}
    if temperature is not None:
        columns["temperature"] = np.array(temperature, float)
    if len({len(values) for values in columns.values()}) > 1:
        what = (
            f"the run '{path}' is damaged: the number of grains in frame {frame} differs from "
            "that of the run"
        )
        raise Refused(_KEY, what, "check it with multicor verify")
    faults = _describe_faults(columns)
    if faults:
        what = f"frame {frame} of the run '{path}': {faults}"
        raise Refused(_KEY, what, "check the run with multicor verify")
    temperatures = columns.get("temperature")
    return InitialGrains(
        radius, position, velocity, temperatures, is_velocity_real=True, forms=forms
    )


# ---- Initial temperatures from a text file: one number per line.
#
# Empty lines and what follows a `#` are left out.

MAX_TEXT_BYTES = 2**31
"""Largest file: more than 40 characters for each of the most grains there can be."""


def read_temperatures(path: Path) -> Floats:
    """The temperatures in a file, text in UTF-8 [K], in the order of its lines.

    `Refused` if it is missing, unreadable, too large, or holds something else; lines are named.
    """
    key, values, faults = ("temperature", "file"), [], []
    with reading_input(path, "text in UTF-8, one temperature per line", key):
        for number, text in _lines(path):
            value = 0.0
            try:
                value = float(text)
                fault = _find_fault("temperature", value)
            except ValueError:
                fault = f"{text[:40]!r} is not a number"
            faults += [f"line {number}: {fault}"] if fault else []
            values.append(value)
            if len(faults) > NAMED or len(values) > MAX_GRAINS:
                break
    if faults:
        what = f"'{path}': {'; '.join(faults[:NAMED])}{'; and more' if faults[NAMED:] else ''}"
        raise Refused(key, what, "give one temperature in kelvin per line")
    if len(values) > MAX_GRAINS:
        what = f"'{path}' holds more than {MAX_GRAINS} temperatures"
        raise Refused(key, what, "give one per grain")
    return np.array(values, float)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of lines that hold something; one too long for a number is cut, with "…"."""
    number, is_rest = 0, False
    for line in _text_lines(path, MAX_TEXT_BYTES):
        is_cut = len(line) == _LINE_LIMIT and not line.endswith("\n")
        if not is_rest:
            number += 1
            text = line.split("#", 1)[0].strip()
            if text:
                yield number, f"{text[:40]}…" if is_cut else text
        is_rest = is_cut

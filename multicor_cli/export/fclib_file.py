"""Contact problems in the HDF5 format of FCLib, the collection of frictional contact problems of the field.

A file holds the local form ``u = W r + q`` with two components (normal, tangential) per contact, W as compressed rows, and, as
a guess, the impulses from which our solver would start. A group ``multicor`` beside it, which FCLib does not look at, holds the
bodies, so that the file can be read back whole.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.problem import ContactProblem, free_velocity
from multicor_cli.export.errors import ExportError
from multicor_cli.export.target import check_output
from multicor_cli.files import regular_path
from multicor_cli.model.columns import NORMAL, TANGENTIAL
from multicor_cli.model.model import Floats, Ints
from multicor_cli.store.atomic import GuardedFile, commit_file, make_directory, temporary_beside
from multicor_cli.store.checked import reading
from multicor_cli.store.errors import StorageError

_LOCAL, _BODIES, _GUESSES = "fclib_local", "multicor", "guesses"
_ROWS = -2
"""``nz`` of a matrix in compressed rows."""

_ENTRY_LIMIT = 200_000_000
"""Largest number of entries of W: 2.4 GB."""

_UNITS = {
    "inverse_mass": "1/kg, 1/kg, 1/(kg m2)",
    "velocity": "m/s, m/s, rad/s",
    "pair": "1",
    "normal": "1",
    "lever": "m",
    "bias": "m/s",
    "friction": "1",
    "slide": "m/s",
}


@dataclass(frozen=True)
class LocalForm:
    """``u = W r + q`` for ``c`` contacts; row ``2k`` is the normal and ``2k + 1`` the tangential component of contact k.

    Attributes:
        start: First entry of every row of W in the two below, shape ``(2c + 1,)``.
        column: Column of every entry, ascending in a row.
        value: The entries [1/kg].
        q: Relative velocities without impulses, the bias in the normal ones [m/s], shape ``(2c,)``.
        friction: Coefficients of friction, shape ``(c,)``.
    """

    start: Ints
    column: Ints
    value: Floats
    q: Floats
    friction: Floats

    def velocity(self, impulse: Floats) -> Floats:
        """``W r + q`` [m/s], shape ``(2c,)``; ``impulse`` has shape ``(c, 2)`` or ``(2c,)``."""
        row = np.repeat(np.arange(len(self.q)), np.diff(self.start))
        products = self.value * impulse.reshape(-1)[self.column]
        return np.asarray(np.bincount(row, products, len(self.q)) + self.q, np.float64)


def local_form(problem: ContactProblem) -> LocalForm:
    """The local form of a problem.

    Raises:
        ExportError: If W is too large: a body that a force moves touches too many others.
    """
    q = free_velocity(problem)
    q[:, 0] += problem.bias
    first, second, block = _blocks(problem)
    count = np.bincount(first, minlength=len(problem.pair))  # blocks in each pair of rows
    begin = np.cumsum(count) - count
    lengths = np.repeat(2 * count, 2)
    row_start = np.concatenate([[0], np.cumsum(lengths)])
    column, value = np.empty(4 * len(first), np.int32), np.empty(4 * len(first))
    within = 2 * (np.arange(len(first)) - begin[first])
    for a in (0, 1):
        for b in (0, 1):
            entry = row_start[2 * first + a] + within + b
            column[entry], value[entry] = 2 * second + b, block[:, a, b]
    return LocalForm(row_start.astype(np.int32), column, value, q.reshape(-1), problem.friction)


def _blocks(problem: ContactProblem) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """The 2×2 blocks of W that are not zero, ordered by their two contacts: these, and the blocks."""
    contact, body, jacobian = _incidences(problem)
    count = np.bincount(body, minlength=len(problem.velocity))
    total = int((count.astype(np.int64) ** 2).sum())
    if 4 * total > _ENTRY_LIMIT:
        message = f"the matrix of the contact problem has {4 * total} entries, more than {_ENTRY_LIMIT}; export a smaller run"
        raise ExportError(message)
    # Every incidence of a body with every other: those of one body lie next to each other.
    repeat = count[body]
    one = np.repeat(np.arange(len(body)), repeat)
    first_of_body = (np.cumsum(count) - count)[body[one]]
    other = first_of_body + np.arange(total) - np.repeat(np.cumsum(repeat) - repeat, repeat)
    key = contact[one] * len(problem.pair) + contact[other]
    order = np.argsort(key, kind="stable")
    one, other, key = one[order], other[order], key[order]
    products = jacobian[one][:, :, None, :] * jacobian[other][:, None, :, :]
    blocks = (products * problem.inverse_mass[body[one]][:, None, None, :]).sum(axis=3)
    edges = np.flatnonzero(np.diff(key, prepend=-1))  # contacts that share both bodies: one block from two
    summed = np.add.reduceat(blocks, edges, axis=0) if len(edges) else blocks
    return contact[one[edges]], contact[other[edges]], summed


def _incidences(problem: ContactProblem) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Contacts with the bodies that can move, ordered by body: contact, body, and what the body adds to u_n and u_t."""
    c = len(problem.pair)
    levers, (nx, ny) = problem.levers(), problem.normal.T
    jacobian = np.empty((2, c, 2, 3))
    for side, sign in ((0, 1.0), (1, -1.0)):
        jacobian[side, :, 0] = sign * np.column_stack([nx, ny, levers[:, side, NORMAL]])
        jacobian[side, :, 1] = sign * np.column_stack([-ny, nx, levers[:, side, TANGENTIAL]])
    body = problem.pair.T.reshape(-1).astype(np.int64)
    contact = np.tile(np.arange(c), 2)
    moves = np.flatnonzero(np.asarray(problem.inverse_mass.any(axis=1))[body])
    moves = moves[np.argsort(body[moves], kind="stable")]
    return contact[moves], body[moves], jacobian.reshape(2 * c, 2, 3)[moves]


def write_fclib(
    problem: ContactProblem,
    path: Path,
    *,
    start: Floats | None = None,
    title: str = "contact problem",
    description: str = "",
    is_overwriting: bool = False,
) -> None:
    """Write a problem in the format of FCLib.

    Args:
        problem: The problem, of at least one contact.
        path: The file.
        start: Impulses to start from [N s], shape ``(c, 2)``; none by default.
        title: What the problem is.
        description: More about it.
        is_overwriting: Whether a file that is there may be replaced.

    Raises:
        ExportError: If there is no contact, or W is too large.
        ExportRefused: If the file may not be written.
        StorageError: If it cannot be written.
    """
    if not len(problem.pair):
        message = "there is no contact, so there is no contact problem to export"
        raise ExportError(message)
    check_output(path, is_overwriting=is_overwriting)
    form = local_form(problem)

    def write(guarded: GuardedFile) -> None:
        with h5py.File(guarded, "w") as file:
            _write_local(file, form)
            _write_texts(file.create_group(f"{_LOCAL}/info"), title, description, len(problem.velocity))
            if start is not None:
                _write_guess(file, form, start)
            for field in fields(problem):
                file[f"{_BODIES}/{field.name}"] = getattr(problem, field.name)
                file[f"{_BODIES}/{field.name}"].attrs["unit"] = _UNITS[field.name]

    arrays = [getattr(part, field.name) for part in (form, problem) for field in fields(part)]
    try:
        make_directory(path.parent)
        size = sum(array.nbytes for array in arrays) + 64 * len(form.q) + (64 << 10)
        commit_file(path, "fclib", write, size=size, temporary=temporary_beside(path))
    except RuntimeError as error:
        raise StorageError(f"{path}: HDF5 cannot write the file ({error})") from error


def _write_local(file: h5py.File, form: LocalForm) -> None:
    local = file.create_group(_LOCAL)
    local["spacedim"] = np.array([2], np.int32)
    for name, number in {"nzmax": len(form.value), "m": len(form.q), "n": len(form.q), "nz": _ROWS}.items():
        local[f"W/{name}"] = np.array([number], np.int32)
    local["W/p"], local["W/i"], local["W/x"] = form.start, form.column, form.value
    local["vectors/q"], local["vectors/mu"] = form.q, form.friction


def _write_texts(info: h5py.Group, title: str, description: str, bodies: int) -> None:
    """Texts end with a zero, as the C library expects them."""
    texts = {
        "title": title,
        "description": description,
        "math_info": "W is symmetric and positive semi-definite; friction is that of Coulomb, so the solution need not be unique",
    }
    for name, text in texts.items():
        data = text.encode() + b"\0"
        info.create_dataset(name, data=np.array(data, dtype=f"S{len(data)}"))
    info.attrs["numberOfDegreeOfFreedom"] = np.array([3 * bodies], np.int32)


def _write_guess(file: h5py.File, form: LocalForm, start: Floats) -> None:
    guesses = file.create_group(_GUESSES)
    guesses["number_of_guesses"] = np.array([1], np.int32)
    guesses["1/r"], guesses["1/u"] = start.reshape(-1), form.velocity(start)


def read_fclib(path: Path) -> tuple[ContactProblem, Floats | None]:
    """The problem of a file that `write_fclib` has made, and the impulses to start from if it has any.

    Raises:
        ExportError: If the file holds the local form alone: it does not say what the bodies are.
        DamagedRun: If it is damaged, or no FCLib file.
        StorageError: If it cannot be read.
    """
    with reading(path), regular_path(path) as opened, h5py.File(opened, "r", locking=False) as file:
        if _BODIES not in file:
            known = "an FCLib file, but one of another program" if _LOCAL in file or "fclib_global" in file else "not an FCLib file"
            raise ExportError(f"{path}: is {known}; only files that multicor has exported can be read back")
        arrays: dict[str, NDArray[Any]] = {
            f.name: file[f"{_BODIES}/{f.name}"][...] for f in fields(ContactProblem) if f.name in file[_BODIES] or f.name != "slide"
        }
        problem = ContactProblem(**arrays)
        start = file[f"{_GUESSES}/1/r"][...].reshape(len(problem.pair), 2) if _GUESSES in file else None
        return problem, start

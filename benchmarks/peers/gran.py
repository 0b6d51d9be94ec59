"""What LAMMPS and LIGGGHTS have in common: files of grains, scripts, and what comes back from
them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from case import Floats, SoftContact
from process import PeerError, find_program, run_program

_LOOP = re.compile(r"^Loop time of (\S+) on (\d+) procs for (\d+) steps", re.MULTILINE)


@dataclass(frozen=True)
class Tuning:
    """Choices that change the speed and not the physics.

    Attributes:
        style: Which of several equivalent pair styles.
        skin: Skin of the neighbor lists over the largest radius.
        grid: Processor grid along x and y.
    """

    style: str
    skin: float
    grid: tuple[int, int]


@dataclass(frozen=True)
class Dialect:
    """How the two programs differ.

    Attributes:
        name: Name of the program.
        package: Debian package that brings it.
        executables: Names to look for, the first that is there is taken.
        styles: Pair styles that give the same contact.
        begin: Lines before the grains are read.
        pair: Lines that define the contacts.
        floor: Arguments of ``fix wall/gran`` for a floor at y = 0.
        dump_format: Arguments of ``dump_modify`` for all digits of some numbers.
    """

    name: str
    package: str
    executables: tuple[str, ...]
    styles: tuple[str, ...]
    begin: tuple[str, ...]
    pair: Callable[[str, SoftContact], list[str]]
    floor: Callable[[SoftContact], str]
    dump_format: Callable[[int], str]


@dataclass(frozen=True)
class Bodies:
    """Grains as the programs read them.

    Attributes:
        position: Centers [m], shape ``(n, 2)``.
        velocity: v_x, v_y [m/s] and spin [rad/s], shape ``(n, 3)``.
        radius: Radii [m], shape ``(n,)``.
        density: Densities [kg/m³], shape ``(n,)``.
        low: Lower corner of the box [m].
        high: Upper corner of the box [m].
    """

    position: Floats
    velocity: Floats
    radius: Floats
    density: Floats
    low: tuple[float, float]
    high: tuple[float, float]


@dataclass(frozen=True)
class Loop:
    """One ``run`` command: its time [s] and its steps."""

    seconds: float
    steps: int


def candidates(dialect: Dialect, cores: int) -> list[Tuning]:
    """Tunings that are worth a try: one choice at a time is varied about the first."""
    grids = [(cores, 1)] if cores == 1 else [(cores, 1), (1, cores)]
    first = Tuning(dialect.styles[0], 0.2, grids[0])
    others = [Tuning(style, 0.2, grids[0]) for style in dialect.styles[1:]]
    others += [Tuning(first.style, skin, grids[0]) for skin in (0.1, 0.4)]
    return [first, *others, *(Tuning(first.style, 0.2, grid) for grid in grids[1:])]


def choose(trials: dict[Tuning, float]) -> Tuning:
    """The best of each choice, given the time of every candidate."""
    first = next(iter(trials))
    best = {"style": first.style, "skin": first.skin, "grid": first.grid}
    for key in best:
        alike = [
            t for t in trials if all(getattr(t, k) == getattr(first, k) for k in best if k != key)
        ]
        best[key] = getattr(min(alike, key=trials.__getitem__), key)
    return Tuning(**best)  # type: ignore[arg-type]


def write_bodies(path: Path, bodies: Bodies, *, is_heated: bool = False) -> None:
    """Write the data file: one type, ids from 1 in the given order.

    Args:
        path: The file.
        bodies: The grains.
        is_heated: Whether each grain has a temperature, at first zero.
    """
    half = 2.0 * float(bodies.radius.max())
    n = len(bodies.radius)
    edges = zip("xyz", (*bodies.low, -half), (*bodies.high, half), strict=True)
    lines = [
        "grains",
        "",
        f"{n} atoms",
        "1 atom types",
        "",
        *(f"{a!r} {b!r} {k}lo {k}hi" for k, a, b in edges),
        "",
        "Atoms",
        "",
    ]
    heat = " 0.0" if is_heated else ""
    rows = zip(
        bodies.radius.tolist(), bodies.density.tolist(), bodies.position.tolist(), strict=True
    )
    lines += [
        f"{k} 1 {2.0 * a!r} {rho!r} {p[0]!r} {p[1]!r} 0.0{heat}"
        for k, (a, rho, p) in enumerate(rows, 1)
    ]
    lines += ["", "Velocities", ""]
    lines += [
        f"{k} {v[0]!r} {v[1]!r} 0.0 0.0 0.0 {v[2]!r}"
        for k, v in enumerate(bodies.velocity.tolist(), 1)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def begin_lines(dialect: Dialect, contact: SoftContact, tuning: Tuning, radius: float) -> list[str]:
    """Lines from the start of a script to its contacts and neighbor lists."""
    x, y = tuning.grid
    return [
        "units si", *dialect.begin, "atom_modify map array sort 1000 0", "boundary p f f",
        "newton off",
        f"processors {x} {y} 1", "read_data grains.data", *dialect.pair(tuning.style, contact),
        f"neighbor {tuning.skin * radius!r} bin", "neigh_modify delay 0 every 1 check yes",
    ]  # fmt: skip


def run_script(
    dialect: Dialect, program: str, lines: list[str], folder: Path, cores: int
) -> list[Loop]:
    """Run a script in a folder that holds its grains; returns its ``run`` commands.

    Raises:
        PeerError: If the program fails, or grains get lost.
    """
    (folder / "in.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    log = folder / "log.txt"
    try:
        run_program(
            [program, "-in", "in.txt", "-log", "log.txt", "-screen", "none"], folder, cores=cores
        )
    except PeerError as error:
        said = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
        message = f"{error}\n{said[-500:]}"
        raise PeerError(message) from error
    loops = parse_loops(log.read_text(encoding="utf-8", errors="replace"))
    if len(loops) != sum(line.startswith("run ") for line in lines):
        message = f"{dialect.name} has not finished its script"
        raise PeerError(message)
    return loops


def parse_loops(log: str) -> list[Loop]:
    """Times and steps of the ``run`` commands of a log."""
    return [Loop(float(seconds), int(steps)) for seconds, _, steps in _LOOP.findall(log)]


def read_dump(path: Path, columns: int) -> Floats:
    """Frames of a text dump sorted by id, shape ``(frames, n, columns)``; the id itself is left
    out.
    """
    frames, lines = [], path.read_text(encoding="utf-8").splitlines()
    at = 0
    while at < len(lines):
        count = int(lines[at + 3])
        start = at + 9
        table = np.array(" ".join(lines[start : start + count]).split(), np.float64).reshape(
            count, -1
        )
        frames.append(table[np.argsort(table[:, 0]), 1 : 1 + columns])
        at = start + count
    return np.array(frames)


def read_averages(path: Path) -> Floats:
    """Rows of a file of ``fix ave/time`` without the step, shape ``(rows, columns)``."""
    return np.loadtxt(path, comments="#", ndmin=2)[:, 1:]


def find_dialect(dialect: Dialect, wanted: str | None) -> str | None:
    """Path of the program, or None; ``wanted`` replaces the usual names."""
    names = dialect.executables if wanted is None else (wanted,)
    return next((path for path in map(find_program, names) if path is not None), None)

"""The falling bed in LAMMPS and LIGGGHTS."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from case import Bed, BedFrames, Floats, SoftContact
from gran import Bodies, Dialect, Tuning, begin_lines, read_dump, run_script, write_bodies


def write_bed(path: Path, bed: Bed) -> None:
    """Write the grains at their start."""
    n = len(bed.radius)
    top = float(bed.position[:, 1].max()) + 4.0 * bed.diameter
    low, high = (0.0, -bed.diameter), (bed.period, top)
    write_bodies(
        path, Bodies(bed.position, np.zeros((n, 3)), bed.radius, np.full(n, bed.density), low, high)
    )


def bed_lines(
    dialect: Dialect, bed: Bed, contact: SoftContact, tuning: Tuning, dt: float
) -> list[str]:
    """The script up to its first ``run``."""
    return [
        *begin_lines(dialect, contact, tuning, float(bed.radius.max())),
        f"timestep {dt!r}",
        "fix move all nve/sphere", f"fix fall all gravity {bed.gravity!r} vector 0.0 -1.0 0.0",
        f"fix floor all wall/gran {dialect.floor(contact)}",
        "thermo 1000000000",
    ]  # fmt: skip


def drop_bed(
    dialect: Dialect, program: str, cores: int, bed: Bed, contact: SoftContact, tuning: Tuning,
    substeps: float, between: float,
    frames: int, folder: Path,
) -> BedFrames:  # fmt: skip
    """Let the grains fall.

    Args:
        dialect: Which program.
        program: Path of it.
        cores: Number of MPI ranks.
        bed: The bed.
        contact: Its contacts.
        tuning: Choices that change the speed only.
        substeps: Time steps in a collision of the two smallest grains.
        between: Time between two frames [s].
        frames: Number of frames.
        folder: Where the program works.
    """
    steps = math.ceil(between * substeps / contact.collision)
    dt = between / steps
    write_bed(folder / "grains.data", bed)
    lines = bed_lines(dialect, bed, contact, tuning, dt)
    lines += [
        f"dump seen all custom {steps} seen.txt id x y vx vy",
        f"dump_modify seen first no {dialect.dump_format(4)}",
    ]
    loops = run_script(dialect, program, [*lines, *[f"run {steps}"] * frames], folder, cores)
    seen = read_dump(folder / "seen.txt", 4)[-frames:]
    seconds = np.array([loop.seconds for loop in loops])
    return BedFrames(
        seconds,
        seen[:, :, :2],
        seen[:, :, 2:],
        _floor_force(bed, seen[:, :, 3], between),
        steps,
        dt,
    )


def _floor_force(bed: Bed, rise: Floats, between: float) -> Floats:
    """Mean force on the floor over the weight, from the change of momentum between frames."""
    momentum = np.concatenate([[0.0], rise @ bed.mass])
    return np.asarray(1.0 + np.diff(momentum) / (between * float(bed.mass.sum()) * bed.gravity))

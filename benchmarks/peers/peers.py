"""The other codes that move grains: which there are, which of them are installed, and what each can
do.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from case import Bed, BedFrames, FlowPlan, Layer, SoftContact
from gran import Dialect, Tuning, find_dialect
from gran_bed import drop_bed
from gran_shear import GranRun, GranShear
from lammps import LAMMPS
from liggghts import LIGGGHTS
from process import find_program, first_line
from yade_shear import YadePeer

DIALECTS = (LIGGGHTS, LAMMPS)
"""Codes with scripts of one family."""


class SoftPeer(Protocol):
    """A code with soft grains."""

    @property
    def name(self) -> str:
        """Its name."""

    def version(self) -> str:
        """What it says about itself."""

    def prepare_shear(
        self, layer: Layer, contact: SoftContact, plan: FlowPlan, folder: Path
    ) -> tuple[Callable[[Layer], GranRun], str]:
        """Tune it; returns what runs it from a start, and a word on how it was tuned."""


@dataclass(frozen=True)
class GranPeer:
    """LAMMPS or LIGGGHTS, installed."""

    dialect: Dialect
    program: str
    cores: int
    substeps: float

    @property
    def name(self) -> str:
        """Its name."""
        return self.dialect.name

    def prepare_shear(
        self, layer: Layer, contact: SoftContact, plan: FlowPlan, folder: Path
    ) -> tuple[Callable[[Layer], GranRun], str]:
        """See `SoftPeer`."""
        study = GranShear(self.dialect, self.program, self.cores, self.substeps)
        tuning = study.tune(layer, contact, folder)
        note = (
            f"{tuning.style}, skin {tuning.skin:g} radii, Δt = 1/{self.substeps:g} of the "
            "shortest collision"
        )
        if self.cores > 1:
            note += f", grid {tuning.grid[0]} × {tuning.grid[1]}"
        return lambda start: study.flow(start, contact, tuning, plan, folder), note

    def prepare_bed(
        self, bed: Bed, contact: SoftContact, between: float, frames: int, folder: Path
    ) -> Callable[[], BedFrames]:
        """What lets the bed fall; arguments as `gran_bed.drop_bed`."""
        tuning = Tuning(self.dialect.styles[0], 0.2, (self.cores, 1))
        d, p, c, s = self.dialect, self.program, self.cores, self.substeps
        return lambda: drop_bed(d, p, c, bed, contact, tuning, s, between, frames, folder)

    def version(self) -> str:
        """First line of what it says about itself."""
        return first_line([self.program, "-help"])


def find_peers(
    names: Sequence[str], lammps: str | None, cores: int, substeps: float
) -> tuple[list[GranPeer], list[tuple[str, str]]]:
    """The codes that are installed, and of those that are not their names and what installs them.

    Args:
        names: Codes that are wanted.
        lammps: Executable of LAMMPS instead of the usual ones.
        cores: Number of MPI ranks.
        substeps: Time steps in the shortest collision.
    """
    there, missing = [], []
    for dialect in DIALECTS:
        if dialect.name in names:
            program = find_dialect(dialect, lammps if dialect.name == "lammps" else None)
            if program is None:
                missing.append((dialect.name, f"apt install {dialect.package}"))
            else:
                there.append(GranPeer(dialect, program, cores, substeps))
    return there, missing


def find_yade(cores: int, substeps: float) -> YadePeer | None:
    """YADE, if it is installed; arguments as `find_peers`."""
    program = find_program("yade")
    return None if program is None else YadePeer(program, cores, substeps)


def find_siconos(python: str) -> str | None:
    """The interpreter, if it is there and has Siconos; else None."""
    interpreter = shutil.which(python)
    if interpreter is None:
        return None
    done = subprocess.run(
        [interpreter, "-c", "import siconos.numerics, scipy"], capture_output=True, check=False
    )
    return interpreter if done.returncode == 0 else None


def siconos_version(python: str) -> str:
    """Version of the Debian package where there is one (the module does not know its own), else the
    interpreter.
    """
    query = shutil.which("dpkg-query")
    known = (
        "" if query is None else first_line([query, "-W", "-f", "${Version}", "python3-siconos"])
    )
    return f"package {known}" if known else f"of {python}"

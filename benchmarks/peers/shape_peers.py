"""Box2D and LMGC90: whether they are installed, and their workers."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from polygons import Bodies, Seen, center_and_gyration
from process import printed_by, run_program

BOX2D, LMGC90 = "box2d", "lmgc90"
PACKAGES = {BOX2D: "pyb2d3", LMGC90: "compas_lmgc90"}
"""Packages of PyPI whose modules the workers import."""


@dataclass(frozen=True)
class ShapePeer:
    """A code for polygons, installed for some interpreter."""

    name: str
    python: str

    def version(self) -> str:
        """Version of the package."""
        package = PACKAGES[self.name]
        said = f"from importlib.metadata import version; print(version({package!r}))"
        return f"{package} {printed_by([self.python, '-c', said]).strip()}"

    def run(
        self, bodies: Bodies, between: float, frames: int, dt: float, tuning: dict[str, float],
        folder: Path,
    ) -> Seen:  # fmt: skip
        """Run it; the first arguments are those of `polygons.Run`.

        Args:
            bodies: What moves.
            between: Time between frames [s].
            frames: Their number.
            dt: Largest time step [s].
            tuning: What its worker asks for besides.
            folder: Where it works.

        Raises:
            PeerError: If it fails.
        """
        every = max(1, round(np.ceil(between / dt * (1.0 - 1e-9))))
        center = np.array([center_and_gyration(corners)[0] for corners in bodies.outlines])
        local = [corners - place for corners, place in zip(bodies.outlines, center, strict=True)]
        source, target = folder / f"{self.name}-in.npz", folder / f"{self.name}-out.npz"
        np.savez(
            source, corner=np.concatenate(local), count=[len(one) for one in local], place=center,
            gravity=bodies.gravity, friction=bodies.friction, width=bodies.width,
            dt=between / every, every=every, frames=frames, **tuning,
        )  # fmt: skip
        worker = Path(__file__).with_name(f"{self.name}_worker.py")
        run_program([self.python, str(worker), str(source), str(target)], folder)
        with np.load(target) as found:
            return Seen(found["position"], found["velocity"], found["seconds"])


def find_shape_peer(name: str, python: str) -> ShapePeer | None:
    """A code, if the interpreter has its package; else None."""
    interpreter = shutil.which(python)
    if interpreter is None:
        return None
    done = subprocess.run(
        [interpreter, "-c", f"import {PACKAGES[name]}"], capture_output=True, check=False
    )
    return ShapePeer(name, interpreter) if done.returncode == 0 else None

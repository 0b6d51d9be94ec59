"""Runs other programs."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

_TAIL = 15  # lines of what a failed program printed


class PeerError(Exception):
    """Another program did not do what it was asked for."""


def find_program(name: str) -> str | None:
    """Path of an executable, given by name or path; None if there is none."""
    return shutil.which(name)


def run_program(
    command: Sequence[str],
    folder: Path,
    *,
    cores: int = 1,
    environment: dict[str, str] | None = None,
) -> str:
    """Run a program in a folder and return what it printed.

    Args:
        command: Program and arguments.
        folder: Where it runs.
        cores: Number of MPI ranks, or 1 for the program alone.
        environment: Variables besides those of this process.

    Raises:
        PeerError: If the program fails.
    """
    launcher: list[str] = []
    if cores > 1:
        mpi = _mpirun(command[0])
        launcher = [mpi, "-n", str(cores)]
        if "Open MPI" in _version(mpi):
            launcher[1:1] = ["--allow-run-as-root", "--bind-to", "core"]
    variables = {**os.environ, "OMP_NUM_THREADS": "1", **(environment or {})}
    done = subprocess.run(
        [*launcher, *command],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        tail = "\n".join((done.stdout + done.stderr).strip().splitlines()[-_TAIL:])
        message = f"{command[0]} failed with exit code {done.returncode}:\n{tail}"
        raise PeerError(message)
    return done.stdout


def printed_by(command: Sequence[str]) -> str:
    """What a command prints, whatever its exit code."""
    with tempfile.TemporaryDirectory() as folder:  # some write a log wherever they are
        return subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False
        ).stdout


def first_line(command: Sequence[str]) -> str:
    """First line that a command prints, whatever its exit code; empty if it prints nothing."""
    return next((line.strip() for line in printed_by(command).splitlines() if line.strip()), "")


def _mpirun(program: str) -> str:
    """The launcher that belongs to a program: the one beside it, else that on the path."""
    beside = Path(program).parent / "mpirun"
    found = str(beside) if beside.exists() else shutil.which("mpirun")
    if found is None:
        message = f"there is no mpirun for {program} (apt install openmpi-bin)"
        raise PeerError(message)
    return found


def _version(mpi: str) -> str:
    return subprocess.run([mpi, "--version"], capture_output=True, text=True, check=False).stdout

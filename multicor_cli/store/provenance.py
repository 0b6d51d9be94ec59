"""Where a run comes from: versions, machine, command, time."""

from __future__ import annotations

import os
import platform
import shlex
import socket
import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from multicor_cli import __version__
from multicor_cli.model.state import nudge_seed

_LIBRARIES = ("numpy", "numba", "llvmlite", "h5py", "pydantic")


def collect_provenance(command: Sequence[str], *, seed: int, threads: int) -> dict[str, Any]:
    """Provenance of a run.

    Args:
        command: Command line.
        seed: Seed of the random numbers, drawn or given.
        threads: Number of threads that the solver may use; with few grains it uses one.

    Returns:
        ``multicor_version, git_sha1, git_dirty, versions, platform, cpu, cores, threads,
        threading_layer, host, command, seed``; the commit is empty where the program was not
        started from its repository. ``nudge`` is there only if the switch for tests of
        `multicor_cli.model.state` was set.
    """
    sha1, is_dirty = _commit(Path(__file__).resolve().parents[2])
    return {
        "multicor_version": __version__,
        "git_sha1": sha1,
        "git_dirty": is_dirty,
        "versions": _versions(),
        "platform": platform.platform(),
        "cpu": processor(),
        "cores": os.cpu_count() or 0,
        "threads": threads,
        "threading_layer": "",  # chosen by the first kernel that has several threads
        "host": socket.gethostname(),
        "command": shlex.join(command),
        "seed": seed,
        **({} if nudge_seed() is None else {"nudge": nudge_seed()}),
    }


def _versions() -> dict[str, str]:
    import h5py

    found = {"python": platform.python_version(), "hdf5": h5py.version.hdf5_version}
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = ""
    return found


def processor() -> str:
    """Name of the processor, as the operating system has it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _commit(root: Path) -> tuple[str, bool]:
    """Commit of a repository and whether files differ from it; empty if it is none."""
    if not (root / ".git").exists():
        return "", False
    sha1 = _git(root, "rev-parse", "HEAD")
    changes = _git(root, "status", "--porcelain", "--untracked-files=no") if sha1 else ""
    return sha1, bool(changes)


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments],
            capture_output=True,
            text=True,
            timeout=5,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def current_command() -> list[str]:
    """The command line of this process; ``python -m multicor_cli`` is named as the command it is.

    Bytes of file names that are not valid UTF-8 are escaped, since texts are stored as UTF-8.
    """
    name = Path(sys.argv[0]).name or "python"
    words = ["multicor" if name == "__main__.py" else name, *sys.argv[1:]]
    return [word.encode(errors="backslashreplace").decode() for word in words]


def new_session() -> dict[str, str]:
    """When and by which command this process began to work on a run."""
    return {"started": now(), "command": shlex.join(current_command())}


def now() -> str:
    """This moment in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")

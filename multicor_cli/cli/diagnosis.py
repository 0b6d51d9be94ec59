"""What a bug report should say about the installation."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from multicor_cli import __version__
from multicor_cli.optional import LIBRARIES
from multicor_cli.text import format_bytes

_LIBRARIES = ("numpy", "numba", "llvmlite", "h5py", "pydantic", "typer", "rich")


def diagnose() -> dict[str, Any]:
    """Versions, processor, memory, threads, kernel cache and free disk."""
    import h5py

    from multicor_cli.engine.jit.cache import configure_cache, is_compiled
    from multicor_cli.running.machine import available_cores

    threading, cache = _threading_layer(), configure_cache()
    kept = f"{cache} ({'compiled' if is_compiled() else 'empty'})"
    try:
        memory = format_bytes(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (ValueError, OSError):
        memory = "unknown"
    return {
        "multicor": __version__,
        "python": f"{platform.python_version()} ({sys.executable})",
        **{name: _version(name) for name in _LIBRARIES},
        "hdf5": str(h5py.version.hdf5_version),
        **{
            each.name: _version(each.name, f"not installed ({each.use} need it: {each.remedy})")
            for each in LIBRARIES.values()
        },
        "ffmpeg": shutil.which("ffmpeg") or "not installed (films become GIF)",
        "platform": platform.platform(),
        "cores": f"{available_cores()} of {os.cpu_count()}",
        "threading layer": threading,
        "memory": memory,
        "kernel cache": "none that outlives a process" if cache is None else kept,
        "free disk": format_bytes(shutil.disk_usage(Path.cwd()).free),
    }


def _version(name: str, missing: str = "not installed") -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return missing


def _threading_layer() -> str:
    """The threading layer of kernels, asked for in another process: a failure stays there."""
    import subprocess

    from multicor_cli.running.machine import python_child, reserve_threads

    reserve_threads()  # as a run does
    command, environment = python_child(
        "-c", "from multicor_cli.engine.jit.cache import describe_layer; print(describe_layer())"
    )
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=False
        )
    except (OSError, subprocess.SubprocessError) as error:
        return f"not known: {type(error).__name__}"
    said = (done.stderr if done.returncode else done.stdout).strip().splitlines()
    if done.returncode:
        return f"none: {said[-1] if said else 'Numba cannot be started'}"
    return said[-1]

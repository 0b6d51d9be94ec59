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
from multicor_cli.text import format_bytes

_LIBRARIES = ("numpy", "numba", "llvmlite", "h5py", "pydantic", "typer", "rich")
_OPTIONAL = {
    "matplotlib": "not installed (figures need it: pip install 'multicor-cli[plots]')",
    "gsd": "not installed (export gsd needs it: pip install 'multicor-cli[gsd]')",
}


def diagnose() -> dict[str, Any]:
    """Versions, processor, memory, threads, kernel cache and free disk."""
    return {
        "multicor": __version__,
        "python": f"{platform.python_version()} ({sys.executable})",
        **{name: _version(name) for name in _LIBRARIES},
        "hdf5": _hdf5_version(),
        **{name: _version(name, missing) for name, missing in _OPTIONAL.items()},
        "ffmpeg": shutil.which("ffmpeg") or "not installed (films become GIF)",
        "platform": platform.platform(),
        "cores": _cores(),
        **_threading(),
        "memory": _memory(),
        "kernel cache": _cache(),
        "free disk": format_bytes(shutil.disk_usage(Path.cwd()).free),
    }


def _version(name: str, missing: str = "not installed") -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return missing


def _hdf5_version() -> str:
    import h5py

    return str(h5py.version.hdf5_version)


def _cores() -> str:
    from multicor_cli.running.threads import available_cores

    return f"{available_cores()} of {os.cpu_count()}"


def _cache() -> str:
    from multicor_cli.engine.jit.cache import configure_cache, is_compiled

    path = configure_cache()
    if path is None:
        return "none that outlives a process"
    return f"{path} ({'compiled' if is_compiled() else 'empty'})"


def _threading() -> dict[str, str]:
    """The threading layer that Numba picks, found by running a tiny parallel loop in another process."""
    import subprocess

    from multicor_cli.running.children import python_child

    code = (
        "import numba\n@numba.njit(parallel=True)\ndef f():\n s=0\n for i in numba.prange(4):\n  s+=i\n return s\n"
        "f(); print(numba.threading_layer(), numba.config.NUMBA_NUM_THREADS)"
    )
    command, environment = python_child("-c", code)
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        return {"threading layer": f"parallel kernels do not work: {error}"}
    layer, _, threads = done.stdout.strip().partition(" ")
    return {"threading layer": f"{layer}, {threads} threads"}


def _memory() -> str:
    try:
        return format_bytes(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (ValueError, OSError):
        return "unknown"

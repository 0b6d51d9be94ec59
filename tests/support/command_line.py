"""The command line in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from places import ROOT


def environment(**extra: str) -> dict[str, str]:
    """The environment of a command: this source tree, and nothing of the terminal."""
    kept = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR", "NUMBA_NUM_THREADS")}
    return {**kept, "PYTHONPATH": str(ROOT), "COLUMNS": "120", **extra}


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "multicor_cli", *map(str, arguments)]


def call(*arguments: object, cwd: Path, **extra: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        command(*arguments), cwd=cwd, env=environment(**extra), capture_output=True, text=True, timeout=300, check=False
    )


def start(*arguments: object, cwd: Path) -> subprocess.Popen[str]:
    """Start a command and leave it running."""
    return subprocess.Popen(
        command(*arguments), cwd=cwd, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def read_info(directory: Path) -> dict[str, Any]:
    """``run_info`` as the command line prints it."""
    done = call("info", directory, "--json", cwd=directory.parent)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)

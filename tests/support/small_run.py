"""A small scenario with three stages, and the command line in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from places import ROOT

SMALL = """\
[scenario]
name = "small"
seed = 3

[domain]
size = [0.02, 0.02]
periodic = true

[materials.glass]
density = 2500.0
young = 70e9
poisson = 0.22

[[contacts]]
pair = ["*", "*"]
friction = 0.4
restitution = 0.3

[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 60
region = { min = [0.0, 0.001], max = [0.02, 0.009] }
packing = { kind = "random" }

[[walls]]
name = "bottom"
material = "glass"
geometry = { kind = "rough", from = [0.0, 0.0], to = [0.02, 0.0], side = "left" }

[[walls]]
name = "top"
material = "glass"
geometry = { kind = "rough", from = [0.0, 0.01], to = [0.02, 0.01], side = "right" }

[[loading]]
name = "settle"
duration = 0.03
until = { kinetic_energy_ratio = 1e-2 }
drives.top = { y = { force = -0.1, damping = 0.1 } }

[[loading]]
name = "shear"
until = { strain = { walls = ["bottom", "top"], value = 0.15 } }
drives.top = { x = { velocity = { ramp = [0.0, 0.1], duration = 0.03 } } }

[[loading]]
name = "on"
duration = 0.004

[solver]
dt = 2e-4
tolerance_rms = 1e-2

[output]
frame_interval = 0.002
"""
"""60 grains between rough walls: settle under a load, shear to a strain, shear on while the ramp of before continues."""


def write_small(directory: Path, text: str = SMALL) -> Path:
    path = directory / "small.toml"
    path.write_text(text)
    return path


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

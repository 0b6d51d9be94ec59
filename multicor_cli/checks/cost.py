"""Whether a run fits on the machine."""

from __future__ import annotations

import shutil
from collections.abc import Iterator

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.prepared import Prepared
from multicor_cli.running.memory import available_memory
from multicor_cli.text import format_bytes


def _disk(run: Prepared) -> Iterator[Measured]:
    place = run.directory.absolute()
    while not place.exists():
        place = place.parent
    free = shutil.disk_usage(place).free
    if run.cost.disk_peak is not None:
        yield Measured(run.cost.disk_peak / max(free, 1), f"{format_bytes(run.cost.disk_peak)} of {format_bytes(free)}")


def _memory(run: Prepared) -> Iterator[Measured]:
    free = available_memory()
    if free is not None:
        yield Measured(run.cost.memory / max(free, 1), f"{format_bytes(run.cost.memory)} of {format_bytes(free)}")


RULES: tuple[Rule[Prepared], ...] = (
    Rule(
        "disk", _disk, unit="of the free space", warning=0.5, bad=1.0,
        meaning="Largest size of the run directory, while results.h5 is made, over the free space where it will lie.",
        remedy='Write fewer frames (output.frame_interval), leave contacts out, use precision = "single", or free some space.',
    ),
    Rule(
        "memory", _memory, unit="of the free memory", warning=0.7, bad=1.0,
        meaning="Memory that the run will use over what is free now.",
        remedy="Use fewer grains, or a machine with more memory.",
    ),
)  # fmt: skip
"""What is checked of the cost of a run."""

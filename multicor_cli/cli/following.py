"""The two commands that are worth giving after a run."""

from __future__ import annotations

import shlex
from pathlib import Path


def following(directory: Path) -> tuple[str, str]:
    """A look at a finished run, and the report of it.

    Args:
        directory: The run directory.
    """
    from multicor_cli.store import open_run

    place = shlex.quote(str(directory))
    with open_run(directory) as run:
        is_heated = run.model.thermal is not None
    look = f"multicor post map {place} --of {'temperature' if is_heated else 'speed'} --plot map.png"
    return look, f"multicor report {place}"

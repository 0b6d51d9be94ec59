"""Which frames are exported."""

from __future__ import annotations

from collections.abc import Callable

from multicor_cli.export.errors import ExportError
from multicor_cli.store import Frame, Run

Progress = Callable[[int, int], None]
"""Is told how many frames are done, and of how many."""


def no_progress(done: int, total: int) -> None:
    """Report nothing."""


def choose_frames(run: Run, frames: slice | None) -> list[Frame]:
    """The frames of a slice, all if there is none; they are read when they are used.

    Raises:
        ExportError: If there is none.
    """
    chosen = run.frames[frames or slice(None)]
    if not chosen:
        raise ExportError(f"{run.path}: the run has no such frames; {_range(run)}")
    return chosen


def choose_frame(run: Run, number: int) -> Frame:
    """One frame; a negative number counts from the end.

    Raises:
        ExportError: If there is no such frame.
    """
    if not -len(run.frames) <= number < len(run.frames):
        raise ExportError(f"{run.path}: the run has no frame {number}; {_range(run)}")
    return run.frames[number]


def _range(run: Run) -> str:
    count = len(run.frames)
    return f"it has {count}, from 0 to {count - 1}" if count else "it has none yet"

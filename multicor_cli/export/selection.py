"""Which frames are exported."""

from __future__ import annotations

from multicor_cli.export.errors import ExportError
from multicor_cli.store import Frame, Run
from multicor_cli.store.errors import NoFrame, what_frames


def choose_frames(run: Run, frames: slice | None) -> list[Frame]:
    """The frames of a slice, all if there is none; they are read when they are used.

    Raises:
        ExportError: If there is none.
    """
    chosen = run.frames[frames or slice(None)]
    if not chosen:
        raise ExportError(f"{run.path}: there are no such frames: {what_frames(len(run.frames))}")
    return chosen


def choose_frame(run: Run, number: int) -> Frame:
    """One frame; a negative number counts from the end.

    Raises:
        ExportError: If there is no such frame.
    """
    try:
        return run.frames[number]
    except NoFrame as error:
        raise ExportError(f"{run.path}: {error}") from None

"""Telling whoever waits how many frames of a run have been read, drawn or written."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Is told how many frames are done, and of how many."""


def no_progress(done: int, total: int) -> None:
    """Report nothing."""

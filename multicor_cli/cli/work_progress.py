"""Progress of a command that takes a while: one line on a terminal that is overwritten, an occasional line in a log."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

LINE_INTERVAL = 10.0
"""Wall-clock time between two lines in a log [s]."""

_TERMINAL_INTERVAL = 0.1


@contextlib.contextmanager
def show_progress(noun: str) -> Iterator[Callable[[int, int], None]]:
    """Give a function that is told how many things are done, and of how many; it writes to stderr.

    Args:
        noun: What is counted, in the singular.
    """
    is_terminal = sys.stderr.isatty()
    interval = _TERMINAL_INTERVAL if is_terminal else LINE_INTERVAL
    following = time.monotonic() + interval
    has_line = False

    def update(done: int, total: int) -> None:
        nonlocal following, has_line
        now = time.monotonic()
        if now < following:
            return
        following, has_line = now + interval, True
        with contextlib.suppress(OSError):
            print(f"\r{noun} {done} of {total} " if is_terminal else f"{noun} {done} of {total}", end="" if is_terminal else "\n",
                  file=sys.stderr, flush=True)  # fmt: skip

    try:
        yield update
    finally:
        if has_line and is_terminal:
            with contextlib.suppress(OSError):
                print("\r\033[K", end="", file=sys.stderr, flush=True)

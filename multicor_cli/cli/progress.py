"""Showing what takes a while: a bar on a terminal, an occasional line in a log, nothing but warnings if asked to be quiet."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from multicor_cli.cli.bar import Bar
from multicor_cli.cli.console import format_seconds, say

if TYPE_CHECKING:
    from multicor_cli.running.observer import Observer, Status

LINE_INTERVAL = 30.0
"""Wall-clock time between two lines of a run in a log [s]."""

WORK_INTERVAL = 10.0
"""The same for shorter work [s]."""


def make_observer(*, is_quiet: bool) -> Observer:
    """The observer that suits the terminal."""
    if is_quiet:
        return QuietObserver()
    return BarObserver() if sys.stderr.isatty() else LogObserver()


class QuietObserver:
    """Shows warnings only; not being able to write them (a closed pipe) must not stop a run."""

    def message(self, text: str) -> None:
        """Ignore it."""

    def warning(self, text: str) -> None:
        """Show it."""
        self._say(f"warning: {text}")

    def stepped(self, status: Status) -> None:
        """Ignore it."""

    def closed(self) -> None:
        """Nothing to do."""

    def _say(self, text: str) -> None:
        with contextlib.suppress(OSError):
            say(text)


class LogObserver(QuietObserver):
    """One line every `LINE_INTERVAL`, the first one after the first steps."""

    def __init__(self) -> None:
        self._next = time.monotonic() + 5.0

    def message(self, text: str) -> None:
        """Show it."""
        self._say(text)

    def stepped(self, status: Status) -> None:
        """Show a line if it is time for one."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + LINE_INTERVAL
            self._say(f"{100.0 * status.progress:5.1f} %  {describe(status)}{_remaining(status)}")


class BarObserver(QuietObserver):
    """A progress bar; messages appear above it."""

    def __init__(self) -> None:
        self._bar = Bar()

    def message(self, text: str) -> None:
        """Show it above the bar."""
        self._bar.message(text)

    def warning(self, text: str) -> None:
        """Show it above the bar."""
        self.message(f"warning: {text}")

    def stepped(self, status: Status) -> None:
        """Update the bar if it is time for that."""
        if self._bar.is_due(status.progress):
            self._bar.update(status.progress, status.stage, describe(status, with_stage=False) + _remaining(status))

    def closed(self) -> None:
        """Give the terminal back."""
        self._bar.close()


@contextlib.contextmanager
def show_progress(noun: str) -> Iterator[Callable[[int, int], None]]:
    """Give a function that is told how many things are done, and of how many; it writes to stderr.

    Args:
        noun: What is counted, in the singular.
    """
    bar = Bar(is_transient=True) if sys.stderr.isatty() else None
    following = time.monotonic() + WORK_INTERVAL

    def update(done: int, total: int) -> None:
        nonlocal following
        text = f"{noun} {done} of {total}"
        if bar is not None and bar.is_due(done / total):
            bar.update(done / total, text, "")
        elif bar is None and time.monotonic() >= following:
            following = time.monotonic() + WORK_INTERVAL
            say(text)

    try:
        yield update
    finally:
        if bar is not None:
            bar.close()


def describe(status: Status, *, with_stage: bool = True) -> str:
    """Where a run is, in one line."""
    state, report = status.state, status.report
    parts = [f"stage {status.stage}"] if with_stage else []
    parts += [f"step {state.step}", f"t = {state.time:.4g} s"]
    if status.speed is not None:
        parts.append(f"{status.speed:.3g} steps/s")
    parts += [f"{report.contacts} contacts", f"{report.sweeps:.0f} sweeps", f"residual {report.rms:.1e}"]
    return "  ".join(parts)


def _remaining(status: Status) -> str:
    return "" if status.remaining is None or status.progress >= 1.0 else f"  {format_seconds(status.remaining)} left"

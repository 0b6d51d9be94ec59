"""Showing a run: a bar on a terminal, a line every half minute in a log, nothing but warnings if asked to be quiet."""

from __future__ import annotations

import contextlib
import sys
import time
from typing import TYPE_CHECKING

from multicor_cli.cli.console import format_seconds, say

if TYPE_CHECKING:
    from multicor_cli.running.observer import Observer, Status

LINE_INTERVAL = 30.0
"""Wall-clock time between two lines in a log [s]."""

BAR_INTERVAL = 0.2
"""Wall-clock time between two updates of the bar [s]."""


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
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        self._console = Console(stderr=True, highlight=False)
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=20),
            TextColumn("{task.percentage:5.1f} %"),
            TextColumn("{task.fields[line]}", markup=False),
            console=self._console,
            auto_refresh=False,
        )
        self._task = self._progress.add_task("", total=1.0, line="")
        self._is_running = False
        self._next = 0.0

    def message(self, text: str) -> None:
        """Show it above the bar."""
        with contextlib.suppress(OSError):
            self._console.print(text, markup=False, soft_wrap=True)

    def warning(self, text: str) -> None:
        """Show it above the bar."""
        self.message(f"warning: {text}")

    def stepped(self, status: Status) -> None:
        """Update the bar if it is time for that."""
        now = time.monotonic()
        if now < self._next and status.progress < 1.0:
            return
        self._next = now + BAR_INTERVAL
        with contextlib.suppress(OSError):
            line = describe(status, with_stage=False) + _remaining(status)
            self._progress.update(self._task, completed=status.progress, description=status.stage, line=line)
            if not self._is_running:
                self._is_running = True
                self._progress.start()
            self._progress.refresh()

    def closed(self) -> None:
        """Give the terminal back."""
        with contextlib.suppress(OSError):
            if self._is_running:
                self._progress.stop()


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

"""The progress bar of everything that takes a while on a terminal."""

from __future__ import annotations

import contextlib
import time

INTERVAL = 0.2
"""Wall-clock time between two updates [s]."""


class Bar:
    """One bar or several on stderr, from the first update on; a terminal that is gone stops nothing.

    Args:
        is_transient: Whether it disappears at the end.
    """

    def __init__(self, *, is_transient: bool = False) -> None:
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
            transient=is_transient,
        )
        self._tasks = [self._progress.add_task("", total=1.0, line="")]
        self._is_running = False
        self._next = 0.0

    def is_due(self, share: float) -> bool:
        """Whether it is time for an update; at the end it always is."""
        return share >= 1.0 or time.monotonic() >= self._next

    def update(self, share: float, description: str, line: str, *more: tuple[float, str, str]) -> None:
        """Show how much is done: a share from 0 to 1, with a text before and one behind the bar.

        Args:
            share: How much is done.
            description: The text before the bar.
            line: The text behind it.
            more: The same for further bars, below the first.
        """
        self._next = time.monotonic() + INTERVAL
        rows = ((share, description, line), *more)
        with contextlib.suppress(OSError):
            while len(self._tasks) < len(rows):
                self._tasks.append(self._progress.add_task("", total=1.0, line=""))
            for task, row in zip(self._tasks, rows, strict=False):
                self._progress.update(task, completed=row[0], description=row[1], line=row[2], visible=True)
            for task in self._tasks[len(rows) :]:
                self._progress.update(task, visible=False)
            if not self._is_running:
                self._is_running = True
                self._progress.start()
            self._progress.refresh()

    def message(self, text: str) -> None:
        """Show a line above the bar."""
        with contextlib.suppress(OSError):
            self._console.print(text, markup=False, soft_wrap=True)

    def close(self) -> None:
        """Give the terminal back."""
        with contextlib.suppress(OSError):
            if self._is_running:
                self._progress.stop()

"""What goes to the terminal: results on stdout; on stderr all for people, such as progress."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

from multicor_cli.cli.options import option
from multicor_cli.text import brief, count_noun, json_value, printable

if TYPE_CHECKING:
    from multicor_cli.checks import Check
    from multicor_cli.running.outcome import Observer, Status


def say(text: str = "") -> None:
    """A line for people, on stderr; nothing happens if no one can read it (a closed pipe)."""
    with contextlib.suppress(OSError):
        print(brief(printable(text)), file=sys.stderr, flush=True)


def complain(text: str) -> None:
    """An error, on stderr: one line, whatever the names in it are."""
    say(f"multicor: {text}".replace("\n", "\\n"))


def emit(text: str) -> None:
    """A line of the result, on stdout."""
    print(text)


def emit_json(data: Any) -> None:
    """The result as JSON, on stdout; numbers that are not finite become null."""
    print(json.dumps(json_value(data), indent=2, ensure_ascii=False, allow_nan=False))


_WIDEST = 100_000
"""Columns of letters of the widest table."""


def emit_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout; numbers belong into right-aligned columns, so all but the first are."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for number, name in enumerate(columns):
        table.add_column(Text(name), justify="left" if number == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*(Text(brief(printable(cell))) for cell in row))
    console = Console(file=sys.stdout, highlight=False)
    # As wide as it is: a terminal wraps what rich would leave out
    options = console.options.update(max_width=_WIDEST)
    console.width = max(console.width, console.measure(table, options=options).maximum)
    console.print(table)


def emit_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Names and values on stdout, aligned."""
    pairs = list(pairs)
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        emit(brief(printable(f"{name:<{width}}  {value}")))


def format_seconds(seconds: float) -> str:
    """A span of time for people, as ``42 s``, ``3 min 05 s``, ``2 h 10 min``."""
    if seconds < 99.5:
        return f"{seconds:.0f} s" if seconds >= 9.95 else f"{seconds:.2g} s"
    minutes = round(seconds) // 60
    if minutes < 60:
        return f"{minutes} min {round(seconds) % 60:02d} s"
    if minutes < 48 * 60:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{minutes / 1440:.1f} days"


# ---- The progress bar of everything that takes a while on a terminal

INTERVAL = 0.2
"""Wall-clock time between two updates [s]."""


class Bar:
    """Bars on stderr, from the first update on; a terminal that is gone stops nothing."""

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

    def update(
        self, share: float, description: str, line: str, *more: tuple[float, str, str]
    ) -> None:
        """Show the share done, from 0 to 1, with texts before and behind; ``more`` bars follow."""
        self._next = time.monotonic() + INTERVAL
        rows = ((share, description, line), *more)
        with contextlib.suppress(OSError):
            while len(self._tasks) < len(rows):
                self._tasks.append(self._progress.add_task("", total=1.0, line=""))
            for task, row in zip(self._tasks, rows, strict=False):
                self._progress.update(
                    task, completed=row[0], description=row[1], line=row[2], visible=True
                )
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
        with contextlib.suppress(OSError):
            if self._is_running:
                self._progress.stop()


# ---- Showing what takes a while: a bar on a terminal, a line at times in a log, or warnings only

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
    """Shows warnings only."""

    def message(self, text: str) -> None: ...

    def warning(self, text: str) -> None:
        say(f"warning: {text}")

    def stepped(self, status: Status) -> None: ...

    def closed(self) -> None: ...


class LogObserver(QuietObserver):
    """One line every `LINE_INTERVAL`, the first one after the first steps."""

    def __init__(self) -> None:
        self._next = time.monotonic() + 5.0

    def message(self, text: str) -> None:
        say(text)

    def stepped(self, status: Status) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + LINE_INTERVAL
            say(f"{100.0 * status.progress:5.1f} %  {describe(status)}{_remaining(status)}")


class BarObserver(QuietObserver):
    """A progress bar; messages appear above it."""

    def __init__(self) -> None:
        self._bar = Bar()

    def message(self, text: str) -> None:
        self._bar.message(text)

    def warning(self, text: str) -> None:
        self.message(f"warning: {text}")

    def stepped(self, status: Status) -> None:
        if self._bar.is_due(status.progress):
            line = describe(status, with_stage=False) + _remaining(status)
            self._bar.update(status.progress, status.stage, line)

    def closed(self) -> None:
        self._bar.close()


@contextlib.contextmanager
def show_progress(noun: str) -> Iterator[Callable[[int, int], None]]:
    """Give a function that is told how many of how many ``noun`` are done, for stderr."""
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
    solved = f"{report.contacts} contacts  {report.sweeps:.0f} sweeps  residual {report.rms:.1e}"
    return "  ".join([*parts, solved])


def _remaining(status: Status) -> str:
    if status.remaining is None or status.progress >= 1.0:
        return ""
    return f"  {format_seconds(status.remaining)} left"


# ---- Checks on the terminal and in JSON, and what `--strict` makes of them

Strict = Annotated[bool, option("--strict", "Exit with code 4 if a check is bad.")]


_WIDTH = 120
_INDENT = " " * 11


def show_all(checks: Sequence[Check], write: Callable[[str], None]) -> None:
    """Every check in a line; what those that are not ok mean, and what to do, below theirs."""
    width = max((len(check.name) for check in checks), default=0)
    for check in checks:
        write(f"{check.verdict.value:<7}  {check.name:<{width}}  {check.text} [{check.limit}]")
        if check.verdict.value != "ok":
            for text, start in ((check.meaning, _INDENT), (check.remedy, _INDENT[:-2] + "→ ")):
                write(fill(text, _WIDTH, initial_indent=start, subsequent_indent=_INDENT))


def show_doubtful(checks: Sequence[Check], say: Callable[[str], None], of: str = "") -> None:
    """The checks that are not ok, each in a line."""
    for check in checks:
        if check.verdict.value != "ok":
            found = f"{check.verdict.value}: {check.name}: {check.text} [{check.limit}]"
            say(f"{found}{of}. {check.remedy}")


def count_verdicts(checks: Sequence[Check]) -> str:
    """How many checks came out how, in words."""
    count = Counter(check.verdict.value for check in checks)
    warnings = count_noun(count["warning"], "warning")
    return f"{count_noun(len(checks), 'check')}: {count['ok']} ok, {warnings}, {count['bad']} bad"


def checks_as_json(checks: Sequence[Check]) -> dict[str, Any]:
    """The worst verdict, and all checks."""
    from multicor_cli.checks import worst_verdict

    return {"verdict": worst_verdict(checks).value, "checks": [check.as_dict() for check in checks]}


def refuse_bad(checks: Sequence[Check], *, is_strict: bool) -> None:
    """Raise `ChecksFailed`, hence exit code 4, if a check is bad and the user asked for that."""
    from multicor_cli.checks import ChecksFailed, Verdict

    if is_strict and any(check.verdict is Verdict.BAD for check in checks):
        raise ChecksFailed(list(checks))

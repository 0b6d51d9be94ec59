"""The commands ``study …``: many runs of one scenario from one file."""

from __future__ import annotations

import os
import shlex
import signal
import socket
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from multicor_cli.cli import console, options
from multicor_cli.cli.options import AsJson, Quiet, option, output_option
from multicor_cli.text import count_noun, format_bytes

if TYPE_CHECKING:
    from multicor_cli.studies.axes import Case
    from multicor_cli.studies.directory import StudyDirectory
    from multicor_cli.studies.session import Forecast, StudySession
    from multicor_cli.studies.table import StudyTable

group = typer.Typer(
    no_args_is_help=True,
    help="Compute many runs of one scenario, and make their table and figures.",
)

StudyFile = Annotated[
    Path, typer.Argument(metavar="STUDY.toml", help="Study file.", show_default=False)
]
Output = Annotated[
    Path | None,
    output_option(metavar="DIR", help="Directory of the study.", show_default="studies/NAME"),
]
_LINES = 60.0  # seconds between two lines in a log
_SHOWN = 8  # running cases that are listed


def _open(file: Path, output: Path | None) -> StudySession:
    from multicor_cli.studies.session import StudySession

    return StudySession.open(file, output)


def run(
    file: StudyFile,
    output: Output = None,
    retry: Annotated[bool, option("--retry", "Try cases that failed once more.")] = False,
    max_hours: Annotated[
        float | None,
        option(
            "--max-hours H", "Stop after this time, with checkpoints and exit code 75.", min=0.0
        ),
    ] = None,
    is_quiet: Quiet = False,
    is_json: AsJson = False,
) -> None:
    """Compute the cases of a study that are not done yet: the same command begins a study and
    continues it.

    Ctrl-C, SIGTERM and SIGHUP stop running cases after a checkpoint.
    """
    from multicor_cli.running.outcome import ExitCode
    from multicor_cli.studies.directory import CaseStatus

    session = _open(file, output)
    predicted = None
    if any(state.status is CaseStatus.WAITING for state in session.states()):
        if not is_quiet:
            console.say(f"checking {count_noun(len(session.cases), 'case')}")
        predicted = session.check()
        _show_doubtful(predicted)
    watcher = StudyProgress(session.directory, is_quiet=is_quiet)
    try:
        tally = session.compute(
            retry=retry, max_hours=max_hours, watcher=watcher, predicted=predicted
        )
    finally:
        watcher.closed()
    counts = Counter(state.status for state in session.states())
    for name, reason in tally.failed.items():
        console.complain(f"case {name}: {reason}")
    if is_json:
        console.emit_json({
            "directory": str(session.directory.path),
            "cases": {state.value: counts[state] for state in CaseStatus},
            "failed": tally.failed, "stopped": tally.stopped,
            "reason": "" if tally.reason is None else tally.reason.value,
        })  # fmt: skip
    if not is_quiet:
        console.say(f"{_summary(counts)}, in {session.directory.path}")
        if counts[CaseStatus.FINISHED] == len(session.cases):
            again = shlex.join([str(file), *([] if output is None else ["-o", str(output)])])
            console.say(
                f"next:  multicor study table {again}\n       multicor study report {again}"
            )
    if tally.stopped:
        raise typer.Exit(ExitCode.STOPPED if tally.reason is None else tally.reason.exit_code)
    if counts[CaseStatus.FAILED]:
        if not tally.failed:
            failed = f"{count_noun(counts[CaseStatus.FAILED], 'case')} failed before"
            console.say(f"{failed}; --retry tries again:  multicor study status {file}")
        raise typer.Exit(ExitCode.PHYSICS)


def validate(file: StudyFile, output: Output = None, is_json: AsJson = False) -> None:
    """Check a study and every case of it, and estimate what it will cost. Nothing is written."""
    session = _open(file, output)
    found = session.check()
    if is_json:
        console.emit_json({
            "valid": True, "study": str(file), "name": session.study.name,
            "cases": [case.name for case in session.cases],
            "estimate": {
                "core_hours": found.hours, "disk_bytes": found.disk,
                "memory_bytes_per_case": found.memory, "placed": found.placed,
                "cases_left": found.cases, "runs_measured": found.measured,
            },
            "doubtful": [{"case": name, **check.as_dict()} for name, check in found.doubtful],
        })  # fmt: skip
        return
    hours, disk = "unknown: a stage has no known end", "unknown"
    if not found.cases:
        hours = "none"
    elif found.hours is not None:
        hours = f"about {console.format_seconds(3600.0 * found.hours)} on one core, estimated from "
        hours += count_noun(found.placed, "case")
        if found.measured:
            hours += f" and from what {count_noun(found.measured, 'finished run')} took"
        elif found.cases > 1:
            hours += " before any has run; runs beside each other take longer"
    if found.disk is not None:
        disk = f"about {format_bytes(found.disk)}"
    first, last = session.cases[0].name, session.cases[-1].name
    console.emit_pairs([
        ("study", session.study.name),
        ("scenario", str(session.study.scenario)),
        ("cases", f"{len(session.cases)}, from {first} to {last}"),
        ("grains", f"{found.grains} at most"),
        ("left", count_noun(found.cases, "case")),
        ("time", hours),
        ("disk", disk),
        ("memory", f"{format_bytes(found.memory)} for each case at a time"),
    ])  # fmt: skip
    _show_doubtful(found)


def status(file: StudyFile, output: Output = None, is_json: AsJson = False) -> None:
    """Show how far the cases of a study are."""
    from multicor_cli.studies.directory import CaseStatus

    session = _open(file, output)
    states = session.states()
    if is_json:
        console.emit_json({
            "directory": str(session.directory.path),
            "cases": [
                {
                    "name": case.name, "values": dict(case.values), "status": state.status.value,
                    "reason": state.reason,
                    "step": state.step, "share": state.share, "remaining_seconds": state.remaining,
                }
                for case, state in zip(session.cases, states, strict=True)
            ],
        })  # fmt: skip
        return
    console.emit(_summary(Counter(state.status for state in states)))
    for case, state in zip(session.cases, states, strict=True):
        if state.status is CaseStatus.RUNNING:
            console.emit(f"running  {case.name}{_how_far(state.share, state.remaining)}")
        elif state.status is CaseStatus.FAILED:
            console.emit(f"failed   {case.name}: {state.reason}")
        elif state.status is CaseStatus.STOPPED:
            console.emit(f"stopped  {case.name} at step {state.step}: {state.reason}")


def table(
    file: StudyFile,
    output: Output = None,
    is_mean: Annotated[
        bool, option("--mean", "Means over the seeds, with the error between them.")
    ] = False,
    is_csv: Annotated[bool, option("--csv", "Print CSV.")] = False,
    is_json: AsJson = False,
    parquet: Annotated[
        Path | None,
        option("--parquet FILE", "Write a Parquet file; needs pandas and pyarrow.", False),
    ] = None,
    is_overwriting: Annotated[
        bool, option("--overwrite", "Replace the file of --parquet if it is there.")
    ] = False,
) -> None:
    """Print the table of a study: values, observables with their errors, verdict, digest and run
    directory of each case.
    """
    from multicor_cli.export.target import check_output
    from multicor_cli.optional import library

    if is_csv and is_json:
        raise typer.BadParameter("--json and --csv exclude each other")
    session = _open(file, output)
    found = _table(session, is_mean=is_mean)
    if parquet is not None:
        library("pyarrow")
        check_output(parquet, is_overwriting=is_overwriting)
        found.frame().to_parquet(parquet)
        console.say(f"wrote {parquet}")
    if is_json:
        console.emit_json({"headings": found.headings, "rows": found.records})
    elif is_csv:
        sys.stdout.write(found.csv())
    elif parquet is None:
        headings, lines = found.lines
        console.emit_table(headings, lines)
    for row in found.rows:
        for name, why in (row.problems or {}).items():
            if name:
                console.say(f"warning: case {row.case}: {name}: {why}")


def plot(
    file: StudyFile,
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FIGURE", help="File (.png, .svg, .pdf), or term.", show_default=False
        ),
    ],
    of: Annotated[
        str, option("--of NAME", "Observable.", False, autocompletion=options.observables)
    ],
    against: Annotated[str, option("--against NAME", "Key or observable across.", False)],
    by: Annotated[
        str | None,
        option("--by KEY", "A series for each of its values; default: for all other keys."),
    ] = None,
    facet: Annotated[
        str | None, option("--facet KEY", "A panel for each of its values.", False)
    ] = None,
    where: Annotated[
        list[str] | None,
        option("--where KEY=VALUE", "Cases with this value only; may be repeated.", False),
    ] = None,
    kind: Annotated[
        str | None, option("--fit KIND", "{fits}.", False, autocompletion=options.listed("fits"))
    ] = None,
    curves: Annotated[
        list[str] | None,
        option(
            "--curve 'NAME: FORMULA'", "A formula in x beside the points; may be repeated.", False
        ),
    ] = None,
    axes: Annotated[
        list[str] | None,
        option("--log AXES", "Logarithmic axes: x, y or xy; may be repeated.", False),
    ] = None,
    output: Output = None,
    is_overwriting: Annotated[
        bool, option("--overwrite", "Replace the file if it is there.")
    ] = False,
) -> None:
    """Draw an observable of a study against a value or another observable, means over seeds with
    their errors.

    The name of a curve stands in the legend: --curve 'da Cruz 2005: 0.25 + 1.1*x'.
    """
    from multicor_cli.export.target import check_output
    from multicor_cli.studies import figure
    from multicor_cli.studies.table import PlotRequest, make_panels

    for asked in axes or ():
        if asked not in ("x", "y", "xy"):
            raise typer.BadParameter(f"'{asked}' is not x, y or xy", param_hint="--log")
    is_file = target != Path("term")
    if is_file:
        check_output(target, is_overwriting=is_overwriting)
    question = PlotRequest(of, against, by, facet, tuple(_pair(text) for text in where or ()))
    formulas = [figure.formula(text) for text in curves or ()]
    session = _open(file, output)
    found = _table(session, is_mean=True)
    panels = make_panels(found, question)
    fits = [] if kind is None else [[figure.fit(kind, it) for it in each.series] for each in panels]
    for panel, own in zip(panels, fits, strict=bool(fits)):
        for line, curve in zip(panel.series, own, strict=True):
            console.say(": ".join(text for text in (panel.title, line.label, curve.text) if text))
    if not is_file:
        console.emit(figure.draw_letters(found, panels, question))
        return
    figure.draw(target, found, panels, question, fits, formulas, log="".join(axes or ()))
    console.say(f"wrote {target}")


def _pair(text: str) -> tuple[str, str]:
    key, sign, value = text.partition("=")
    if not sign:
        raise typer.BadParameter(f"'{text}' is not KEY=VALUE", param_hint="--where")
    return key, value


def report(
    file: StudyFile,
    output: Output = None,
    page: Annotated[
        Path | None,
        option("--page FILE.html", "File to write.", "NAME-report.html in the study's directory"),
    ] = None,
    has_runs: Annotated[
        bool, option("--runs", "Write a page about each finished run that has none as well.")
    ] = False,
    frames: Annotated[
        int, option("--frames N", "Largest number of frames in the page of a run.", min=1)
    ] = 20,
    is_overwriting: Annotated[
        bool, option("--overwrite", "Replace the file if it is a report.")
    ] = False,
) -> None:
    """Write one HTML page about a study: how far it is, figures, means over seeds, and all cases
    with links to their runs.
    """
    from multicor_cli.studies.report import report_path, write_study_report

    session = _open(file, output)
    target = page if page is not None else report_path(session)
    if target.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"'{target}' does not end in .html", param_hint="--page")
    with console.show_progress("run") as progress:
        of_runs = frames if has_runs else None
        written = write_study_report(
            session, target, is_overwriting=is_overwriting, run_frames=of_runs, progress=progress
        )
    if written:
        console.say(f"wrote {count_noun(written, 'page')} about runs")
    console.say(f"wrote {target}")


def cancel(file: StudyFile, output: Output = None) -> None:
    """Ask the program that computes a study on this machine to stop, with checkpoints."""
    from multicor_cli.store.errors import DirectoryRefused
    from multicor_cli.store.lock import is_alive, read_holder
    from multicor_cli.studies.directory import LOCK

    lock = _open(file, output).directory.path / LOCK
    holder = read_holder(lock)
    if not is_alive(lock):
        console.say("nobody is at work on this study")
        return
    if holder.get("host") != socket.gethostname():
        by = f"process {holder.get('pid')} on {holder.get('host')}"
        raise DirectoryRefused(f"{lock.parent}: the study is computed by {by}; cancel it there")
    os.kill(int(holder["pid"]), signal.SIGTERM)
    console.say(f"asked process {holder['pid']} to stop")


class StudyProgress:
    """Shows how a study goes: a bar on a terminal, a line a minute in a log, or nothing."""

    def __init__(self, directory: StudyDirectory, *, is_quiet: bool) -> None:
        self._directory, self._is_quiet = directory, is_quiet
        self._bar = console.Bar(is_transient=True) if sys.stderr.isatty() and not is_quiet else None
        self._total = self._ended = 0
        self._following = time.monotonic()
        self._first: tuple[float, float] | None = None

    def began(self, text: str, cases: int) -> None:
        self._total = cases
        self._say(f"{count_noun(cases, 'case')} with {text}")

    def warning(self, text: str) -> None:
        console.say(f"warning: {text}")

    def ended(self, case: Case, outcome: dict[str, Any]) -> None:
        self._ended += 1
        if outcome["status"] != "finished" and outcome["reason"] != "not begun":
            self._say(f"{outcome['status']}: {case.name}: {outcome['reason']}")

    def looked(self, running: Callable[[], Sequence[Case]]) -> None:
        """One line for all, and one for each that runs."""
        now = time.monotonic()
        if self._is_quiet or now < self._following:
            return
        self._following = now + (2.0 if self._bar is not None else _LINES)
        states = [(case, self._directory.state(case)) for case in running()]
        states = [(case, state) for case, state in states if state.status.value == "running"]
        done = (self._ended + sum(state.share or 0.0 for _, state in states)) / max(self._total, 1)
        all_cases, left = f"{self._ended} of {self._total} cases", self._time_left(now, done)
        if self._bar is not None:
            rows = [(each.share or 0.0, case.name, _left(each.remaining)) for case, each in states]
            self._bar.update(done, all_cases, left, *rows[:_SHOWN])
            return
        console.say(f"{all_cases}, {left}" if left else all_cases)
        for case, state in states[:_SHOWN]:
            console.say(f"  {case.name}{_how_far(state.share, state.remaining)}")

    def _time_left(self, now: float, done: float) -> str:
        """Time left at the speed measured in this session, as an estimate."""
        if self._first is None:
            self._first = now, done
        since, before = now - self._first[0], done - self._first[1]
        return f"about {_left(since * (1.0 - done) / before)}" if before > 0.01 else ""

    def stopping(self) -> None:
        self._say("stopping: running cases write their checkpoints")

    def closed(self) -> None:
        if self._bar is not None:
            self._bar.close()

    def _say(self, text: str) -> None:
        if not self._is_quiet:
            console.say(text)


def _table(session: StudySession, *, is_mean: bool) -> StudyTable:
    from multicor_cli.studies.table import over_seeds

    session.directory.document()  # refuses a directory without a study
    found = session.table()
    return over_seeds(found) if is_mean else found


def _show_doubtful(found: Forecast) -> None:
    for name, check in found.doubtful:
        console.show_doubtful([check], console.say, f" (case {name})")


def _summary(counts: Counter[Any]) -> str:
    states = sorted(counts, key=lambda state: state.value)
    parts = ", ".join(f"{counts[state]} {state.value}" for state in states)
    return f"{count_noun(sum(counts.values()), 'case')}: {parts}"


def _how_far(share: float | None, remaining: float | None) -> str:
    text = "" if share is None else f"  {100.0 * share:.0f} %"
    return f"{text}  {_left(remaining)}".rstrip()


def _left(seconds: float | None) -> str:
    return "" if seconds is None else f"{console.format_seconds(seconds)} left"


COMMANDS = {
    command.__name__: command for command in (run, validate, status, table, plot, report, cancel)
}
"""Commands by name."""

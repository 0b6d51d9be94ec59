"""One page about a study: how far it is, figures, means over seeds, and links to its runs."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from urllib.parse import quote

import numpy as np

from multicor_cli import __version__
from multicor_cli.optional import MissingLibrary
from multicor_cli.plots.style import PlotError
from multicor_cli.post.source import PostError
from multicor_cli.report import check_target, write_report
from multicor_cli.report.figures import Figure, make_figure
from multicor_cli.report.page import ReportRow, details, figure_cards, header, html_of, table_cards
from multicor_cli.store.atomic import commit_result, make_directory
from multicor_cli.store.layout import Progress, no_progress
from multicor_cli.studies.axes import SEED, short_names, shown
from multicor_cli.studies.directory import PAGES, CaseStatus
from multicor_cli.studies.figure import draw_into
from multicor_cli.studies.session import StudySession
from multicor_cli.studies.table import PlotRequest, StudyTable, make_panels, over_seeds, values_of

_FIGURES = 12
"""Most figures of a page."""

_SIZE = (3.7, 2.8)
_LOGARITHMIC = 20.0
"""Values whose largest is this many times the smallest are shown on a logarithmic axis."""


def report_path(session: StudySession) -> Path:
    """Where the page is unless told: in the study's directory, so that links lead to the runs."""
    return session.directory.path / f"{session.study.name}-report.html"


def write_study_report(
    session: StudySession,
    path: Path,
    *,
    is_overwriting: bool = False,
    run_frames: int | None = None,
    progress: Progress = no_progress,
) -> int:
    """Write the page of a study, finished or not; returns the number of new pages of runs.

    With ``run_frames`` each finished run that has no page gets one, with so many frames at most;
    ``progress`` is told how many of them are done.

    Raises:
        ExportRefused: If the file exists and may not be replaced, or is no report.
        StoreError: If there is no study, or a file cannot be written.
    """
    check_target(path, is_overwriting=is_overwriting)
    session.directory.document()  # refuses a directory without a study
    table = session.table()
    written = 0 if run_frames is None else _write_pages(session, run_frames, progress)
    made = f"Made by multicor {__version__} from {session.directory.path.resolve().name}."
    means = over_seeds(table).lines
    headings, lines = table.lines
    links = [_links(table, row.case, path.parent) for row in table.rows]
    done = sum(row.status == CaseStatus.FINISHED.value for row in table.rows)
    status = "finished" if done == len(table.rows) else f"{done} of {len(table.rows)} finished"
    body = [
        header(session.study.name, session.study.model.study.description, status),
        _cards(session, table),
        figure_cards(_figures(table)),
        "" if SEED not in table.keys else _wide("Means over seeds", *means),
        _wide("Cases", [*headings, "run"], lines, links),
        details("Study file", f'<pre tabindex="0">{escape(session.study.sources.text)}</pre>'),
        f"<footer><p>{escape(made)}</p></footer>",
    ]
    commit_result(path, "report", html_of(session.study.name, body))
    return written


def _write_pages(session: StudySession, frames: int, progress: Progress) -> int:
    """Pages of finished runs that have none; those whose run cannot be shown are left out."""
    directory = session.directory
    finished = [
        case.name for case in session.cases if directory.state(case).status is CaseStatus.FINISHED
    ]
    missing = [name for name in finished if not directory.page(name).exists()]
    make_directory(directory.path / PAGES)
    written = 0
    for number, name in enumerate(missing):
        progress(number, len(missing))
        with contextlib.suppress(PostError):
            write_report(directory.case(name), directory.page(name), frames=frames)
            written += 1
    return written


def _cards(session: StudySession, table: StudyTable) -> str:
    counts = Counter(row.status for row in table.rows)
    hours = float(np.nansum([row.hours for row in table.rows])) if table.rows else 0.0
    names = short_names(table.keys)
    verdicts = Counter(row.verdict for row in table.rows if row.verdict)
    bad = "bad" if verdicts["bad"] else "warning" if verdicts["warning"] else "ok"
    statuses = ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))
    checks = ", ".join(f"{verdicts[name]} {name}" for name in ("ok", "warning", "bad"))
    rows = [
        ReportRow("scenario", session.study.model.study.scenario),
        ReportRow("cases", f"{len(table.rows)}: {statuses}"),
        ReportRow("time of the runs", f"{hours:.3g} h"),
        ReportRow("checks of the runs", checks, "worst", bad),
    ]
    ranges = {}
    for key in table.keys:
        texts = [shown(value) for value in values_of(table.rows, key)]
        long = f"{', '.join(texts[:6])} … {texts[-1]} ({len(texts)} values)" if texts else ""
        ranges[key] = ", ".join(texts) if len(texts) <= 12 else long
    lost = [row for row in table.rows if row.status == CaseStatus.FAILED.value]
    cards = {
        "Study": rows,
        "Varied": [ReportRow(names[key], ranges[key]) for key in table.keys],
        "Set for all cases": [
            ReportRow(key, shown(value)) for key, value in session.study.model.set.items()
        ],
        "Failed": [ReportRow(row.case, (row.problems or {}).get("", "")) for row in lost],
    }
    return table_cards(cards)


def _figures(table: StudyTable) -> list[Figure] | None:
    """Observables against the key with the most values, if these are at least two numbers.

    None without matplotlib.
    """
    mean = over_seeds(table)
    lengths = {}
    for key in mean.keys:
        values = {row.values.get(key) for row in mean.rows}
        if not any(isinstance(value, str | bool) or value is None for value in values):
            lengths[key] = len(values)
    across = max(lengths, key=lambda key: lengths[key], default="")
    if lengths.get(across, 0) < 2:
        return []
    found = []
    for name in table.observables[:_FIGURES]:
        request = PlotRequest(name, across)
        try:
            panels = make_panels(mean, request)
        except PlotError:  # none has finished
            continue
        x = np.concatenate([line.x for panel in panels for line in panel.series])
        log = "x" if x.min() > 0.0 and x.max() > _LOGARITHMIC * x.min() else ""
        fill = partial(draw_into, table=mean, panels=panels, request=request, fits=[], log=log)
        title = f"{name} against {short_names(mean.keys)[across]}"
        try:
            found.append(make_figure(title, _SIZE, fill))
        except MissingLibrary:  # there is no matplotlib
            return None
    return found


def _links(table: StudyTable, name: str, base: Path) -> str:
    """Links to the page of a run, if there is one, and to its directory."""
    run = table.directory.case(name)
    page = table.directory.page(name)
    found = [(page, "report")] if page.exists() else []
    if run.exists():
        found.append((run, "files"))
    links = []
    for path, text in found:
        try:
            address = path.resolve().relative_to(base.resolve()).as_posix()
        except ValueError:  # the page lies elsewhere
            address = path.resolve().as_posix()
        links.append(f'<a href="{quote(address)}">{text}</a>')
    return " ".join(links)


def _wide(
    title: str,
    headings: Sequence[str],
    lines: Sequence[Sequence[str]],
    links: Sequence[str] | None = None,
) -> str:
    """A table, with links as a last column; verdicts, the last but one, in their colors."""
    rows = []
    for number, line in enumerate(lines):
        row = [escape(cell) for cell in line]
        if line[-2] in ("ok", "warning", "bad"):
            row[-2] = f'<span class="{line[-2]}">{line[-2]}</span>'
        rows.append(row if links is None else [*row, links[number]])
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in headings)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return details(title, f'<div class="wide" tabindex="0">{table}</div>', is_open=True)

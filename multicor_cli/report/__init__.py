"""One HTML page about a run, to be mailed and opened in any browser without a network.

``pack`` reads the grains of some frames and makes them small, ``figures`` shows how the run went,
``page`` joins them and tables with the hand-written scripts beside it into one file.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from multicor_cli.checks import check_run
from multicor_cli.export.target import ExportRefused, check_output
from multicor_cli.files import open_regular
from multicor_cli.post.energy import energy
from multicor_cli.post.source import PostError
from multicor_cli.report.figures import make_figures
from multicor_cli.report.pack import pack_frames
from multicor_cli.report.page import MARK, make_page
from multicor_cli.store import open_run, run_info
from multicor_cli.store.atomic import commit_result, storage_errors
from multicor_cli.store.layout import Progress, no_progress

SIZE_LIMIT = 30_000_000
"""Largest size of a page [bytes]: what most mail servers still take."""

_ROOM = 2_000_000  # for figures, scripts and the scenario [bytes]
_BASE64 = 4.0 / 3.0


@dataclass(frozen=True)
class ReportSummary:
    """What a page holds.

    Attributes:
        path: The file.
        size: Its size [bytes].
        frames: Frames in it.
        frame_count: Frames of the run.
        contact_limit: Most contacts per frame in it; None: all.
        has_figures: Whether it has figures; they need matplotlib.
    """

    path: Path
    size: int
    frames: int
    frame_count: int
    contact_limit: int | None
    has_figures: bool


def default_path(directory: Path) -> Path:
    """Where the page goes unless told: beside the run directory, as ``NAME-report.html``."""
    # Unlike resolve, it takes links that lead in a circle
    whole = Path(os.path.realpath(directory))
    whole = whole.parent if whole.is_file() else whole
    return whole.with_name(f"{whole.name}-report.html")


def write_report(
    directory: Path | str,
    path: Path | str | None = None,
    *,
    frames: int | None = None,
    is_overwriting: bool = False,
    progress: Progress = no_progress,
) -> ReportSummary:
    """Write one self-contained HTML page about a run, finished or not.

    Args:
        directory: Run directory, or a ``results.h5`` on its own.
        path: File to write; default: `default_path`.
        frames: Most frames in the interactive view; default: as many as fit into `SIZE_LIMIT`.
        is_overwriting: Whether an existing file may be replaced.
        progress: Is told how many frames have been read, and of how many.

    Raises:
        ExportRefused: If the file exists and may not be replaced, or is named as one of a run.
        PostError: If the run has no frames yet.
        StoreError: If the run cannot be read, or the file cannot be written.
    """
    target = default_path(Path(directory)) if path is None else Path(path)
    check_target(target, is_overwriting=is_overwriting)
    # What a damaged file holds may be absurd: it is left out of scales, without warnings.
    with open_run(directory) as run, np.errstate(all="ignore"):
        info = run_info(directory)
        if not len(run.frames):
            raise PostError(
                f"{directory}: the run has no frames yet; try again when it has written one"
            )
        packing = pack_frames(run, int((SIZE_LIMIT - _ROOM) / _BASE64), frames, progress)
        books = energy(run) if run.series.row_count else None
        figures = make_figures(run, books)
        page = make_page(run, info, check_run(directory, info), books, packing, figures)
    commit_result(target, "report", page)
    shown, count, limit = len(packing.chunks), packing.frame_count, packing.contact_limit
    return ReportSummary(target, len(page), shown, count, limit, figures is not None)


def check_target(path: Path, *, is_overwriting: bool) -> None:
    """Refuse a file as `check_output` does, and always one that is not a page of ours."""
    check_output(path, is_overwriting=is_overwriting)
    is_ours = not os.path.lexists(path)
    if path.is_file():
        with storage_errors(path), open_regular(path) as file:
            head = file.read(400).decode("utf-8", "replace")
        is_ours = not head or MARK in head
    if not is_ours:
        raise ExportRefused(
            f"{path}: is not a report of multicor and is not replaced; choose another file with -o"
        )


__all__ = ["ReportSummary", "write_report"]

"""Command ``report``: one HTML page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from multicor_cli.cli.console import say
from multicor_cli.cli.options import RunPath, output_option
from multicor_cli.cli.progress import show_progress
from multicor_cli.optional import LIBRARIES
from multicor_cli.text import format_bytes

PageFile = Annotated[
    Optional[Path],  # noqa: UP045  (evaluated by typer)
    output_option(metavar="FILE.html", help="File to write.", show_default="DIR-report.html beside DIR"),
]
FrameLimit = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--frames", metavar="N", min=1, help="Largest number of frames in it.", show_default="as many as fit in 30 MB"),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file if it is a report.")]


def report(directory: RunPath, output: PageFile = None, frames: FrameLimit = None, is_overwriting: Overwrite = False) -> None:
    """Write one HTML page about a run, to mail or to keep: how it went, figures, and an interactive view of the grains.

    The page needs no network and opens in any current browser. It works on a run that is still going on. Frames are left
    out, evenly, if the page would become larger than 30 MB, and it says so.
    """
    if output is not None and output.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"'{output}' does not end in .html", param_hint="-o")
    from multicor_cli.report import write_report

    with show_progress("frame") as progress:
        done = write_report(directory, output, frames=frames, is_overwriting=is_overwriting, progress=progress)
    if not done.has_figures:
        say(f"without figures: they need matplotlib: {LIBRARIES['matplotlib'].remedy}")
    contacts = "" if done.contact_limit is None else f", with the {done.contact_limit} strongest contacts of each"
    say(f"wrote {done.path}: {format_bytes(done.size)}, {done.frames} of {done.frame_count} frames{contacts}")


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the command."""
    app.command("report")(wrap(report))

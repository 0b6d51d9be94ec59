"""Commands ``export …``: frames of a run in the formats of other programs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from multicor_cli.cli.console import complain, say
from multicor_cli.cli.options import RunPath, output_option
from multicor_cli.cli.post_options import Frames, OneFrame, parse_frames
from multicor_cli.cli.progress import show_progress
from multicor_cli.text import count_noun, format_bytes

export = typer.Typer(
    no_args_is_help=True,
    help="A run in the formats of other programs. ParaView opens results.vtkhdf in the run directory as it is.",
)

GsdFile = Annotated[Path, output_option(metavar="FILE.gsd", help="File to write.")]
CsvDirectory = Annotated[Path, output_option(metavar="DIR", help="Directory to write.")]
FclibFile = Annotated[Path, output_option(metavar="FILE.hdf5", help="File to write.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what an export has written there before.")]


def to_gsd(directory: RunPath, output: GsdFile, frames: Frames = None, is_overwriting: Overwrite = False) -> None:
    """Write a GSD file for OVITO: grains as particles, contacts that carry a force as bonds.

    Temperatures, angular velocities and forces are logged quantities, which OVITO shows as properties. Needs the library gsd.
    """
    chosen = parse_frames(frames, None, None)
    from multicor_cli.export import export_gsd
    from multicor_cli.store import open_run

    with open_run(directory) as run, show_progress("frame") as progress:
        count = export_gsd(run, output, chosen, is_overwriting=is_overwriting, progress=progress)
    say(f"wrote {output}: {count_noun(count, 'frame')}, {format_bytes(output.stat().st_size)}")


def to_csv(directory: RunPath, output: CsvDirectory, frames: Frames = None, is_overwriting: Overwrite = False) -> None:
    """Write CSV files into a directory: grains, contacts and walls of every frame, the list of frames, and the time series.

    Headings carry the units; numbers are written so that reading them gives the same bits.
    """
    chosen = parse_frames(frames, None, None)
    from multicor_cli.export import export_csv
    from multicor_cli.store import open_run

    with open_run(directory) as run, show_progress("frame") as progress:
        count = export_csv(run, output, chosen, is_overwriting=is_overwriting, progress=progress)
    size = sum(file.stat().st_size for file in output.iterdir())
    say(f"wrote {output}: {count_noun(count, 'frame')}, {format_bytes(size)}")


def to_fclib(directory: RunPath, output: FclibFile, frame: OneFrame = -1, is_overwriting: Overwrite = False) -> None:
    """Write the contact problem of the step after a frame in the HDF5 format of FCLib, for other solvers.

    After the last frame of a finished run, the step is the one that its last stage would take next.
    """
    from multicor_cli.export import export_fclib
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        found = export_fclib(run, output, frame, is_overwriting=is_overwriting, computing=_may_be_left())
    contacts = count_noun(len(found.problem.pair), "contact")
    where = "beyond the end of the run" if found.is_beyond else f"in stage '{found.stage}'"
    say(f"wrote {output}: {contacts} of the step after frame {found.frame} (t = {found.time:g} s), {where}")


@contextlib.contextmanager
def _may_be_left() -> Iterator[None]:
    """Leave at once when a signal says so: an exception would have to find its way through the machine code of a compiler."""
    from multicor_cli.running.signals import Switchboard

    switchboard = Switchboard(may_exit=True)
    switchboard.farewell = lambda number: complain("interrupted")
    with switchboard.installed(), switchboard.impatient():
        yield


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    for name, command in {"gsd": to_gsd, "csv": to_csv, "fclib": to_fclib}.items():
        export.command(name)(wrap(command))
    app.add_typer(export, name="export")

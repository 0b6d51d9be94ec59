"""Command ``post animate``: a film of a map."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from multicor_cli.cli.completion import listed
from multicor_cli.cli.console import say
from multicor_cli.cli.options import RunPath, output_option
from multicor_cli.cli.post_options import Frames, parse_frames
from multicor_cli.cli.progress import show_progress

if TYPE_CHECKING:
    from multicor_cli.post import GrainMap
    from multicor_cli.store import Run

FilmOf = Annotated[str, typer.Option("--of", metavar="FIELD", help="What to show: {mapped}.", autocompletion=listed("mapped"))]
FilmFile = Annotated[Path, output_option(metavar="FILE", help="File to write: FILE.mp4 or .gif.")]
Rate = Annotated[float, typer.Option("--fps", metavar="N", min=0.1, max=120.0, help="Pictures per second.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")]


def animate(
    directory: RunPath,
    output: FilmFile,
    of: FilmOf = "velocity",
    frames: Frames = None,
    rate: Rate = 20.0,
    is_overwriting: Overwrite = False,
) -> None:
    """Draw a map of every frame into a film, with one color scale for all.

    An .mp4 needs ffmpeg; where it is missing a .gif is written instead.
    """
    from multicor_cli.export.target import check_output
    from multicor_cli.plots.animate import SUFFIXES, film_path, write_film

    if output.suffix.lower() not in SUFFIXES:
        raise typer.BadParameter(f"'{output}' does not end in .mp4 or .gif", param_hint="-o")
    target = film_path(output)
    if target != output:
        say(f"ffmpeg is not installed: writing {target} instead of {output}")
    check_output(target, is_overwriting=is_overwriting)
    from multicor_cli.post import Selection
    from multicor_cli.store import open_run

    with open_run(directory) as run, show_progress("frame") as progress:
        chosen = Selection(frames=parse_frames(frames, None, None) or slice(None)).indices(run.frames).tolist()
        film = write_film(lambda: _maps(run, of, chosen), len(chosen), output, rate=rate, progress=progress)
    skipped = f", without {film.skipped} that lack this quantity" if film.skipped else ""
    say(f"wrote {film.path}: {film.frames} frames{skipped}")


def _maps(run: Run, of: str, chosen: list[int]) -> Iterator[GrainMap | None]:
    """Maps of frames; None for those that lack the quantity. Not all may lack it, and there must be a grain in some."""
    from multicor_cli.post import PostError, grain_map

    found, trouble = False, None
    for frame in chosen:
        try:
            table = grain_map(run, of, frame, may_be_empty=True)
        except PostError as error:
            trouble = error
            yield None
            continue
        found |= bool(table.value.size)
        yield table
    if not found:
        raise trouble or PostError("no grain is there in any of the frames")


COMMANDS = {"animate": animate}
"""Commands by name."""

"""Command ``post region``: what is inside a part of the plane."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Annotated

import typer

from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_options import AsCsv, AsJson, End, FigureFile, Frames, Overwrite, Start, parse_frames
from multicor_cli.cli.post_output import TableOutput
from multicor_cli.text import count_noun

if TYPE_CHECKING:
    from multicor_cli.model.areas import Area

EXAMPLE = '{ kind = "circle", center = [0.02, 0.01], radius = 0.005 }'
Place = Annotated[
    str,
    typer.Option(
        "--in",
        metavar="REGION",
        help=f"The region, as in a scenario: {EXAMPLE}, an annulus, a polygon, or a rectangle {{ min, max }}.",
        show_default=False,
    ),
]


def region(
    directory: RunPath,
    place: Place,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: Overwrite = False,
) -> None:
    """Measure what is inside a region: solid fraction, coordination, velocity, temperature, stress of contacts and of fluctuations.

    The table holds means over the frames and their standard errors, CSV one row per frame, JSON and figure both. Grains count with
    the part of their area that lies inside, contacts with that of their branch.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting)
    area = _parse(place)
    from multicor_cli.post import Selection, in_region
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = in_region(run, area, Selection(start, end, parse_frames(frames, start, end)))
    output.draw(table)
    about = f"{count_noun(len(table.time), 'frame')} from t = {table.time[0]:g} s to {table.time[-1]:g} s"
    output.deliver(table, about, run=directory, is_detailed=True)


def _parse(text: str) -> Area:
    from pydantic import TypeAdapter, ValidationError

    from multicor_cli.scenario.region import AnyRegion, Region

    try:
        found: Region = TypeAdapter(AnyRegion).validate_python(tomllib.loads(f"region = {text}")["region"])
    except tomllib.TOMLDecodeError:
        raise typer.BadParameter(f"'{text}' is not a region; write it as {EXAMPLE}", param_hint="--in") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(key) for key in first["loc"] if not str(key).startswith("<"))
        raise typer.BadParameter(f"{where or 'region'}: {first['msg']}; write it as {EXAMPLE}", param_hint="--in") from None
    return found.area()


COMMANDS = {"region": region}
"""Commands by name."""

"""Initial temperatures of a group of grains."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Strict, Tag

from multicor_cli.scenario.base import Kelvin, Number, Point, Table, one_of
from multicor_cli.scenario.packings import FilePath
from multicor_cli.scenario.region import AnnulusRegion, CircleRegion, PolygonRegion, RectangleRegion, tag_kind

MAX_VALUES = 100_000
"""Most temperatures in the scenario file itself; more go into a file of their own."""


class GradientTemperature(Table):
    """A temperature that varies linearly from place to place."""

    value: Kelvin = Field(description="temperature [K] at the point at")
    gradient: Annotated[tuple[Number, Number], Strict(False)] = Field(description="change in x and in y [K/m]")
    at: Point = Field((0.0, 0.0), description="point at which the temperature is value [m]")


class _Warm(Table):
    value: Kelvin = Field(description="temperature of the grains with their center in it [K]")


class TemperatureRectangle(RectangleRegion, _Warm):
    """A rectangle with a temperature."""


class TemperatureCircle(CircleRegion, _Warm):
    """The inside of a circle with a temperature."""


class TemperatureAnnulus(AnnulusRegion, _Warm):
    """An annulus with a temperature."""


class TemperaturePolygon(PolygonRegion, _Warm):
    """A polygon with a temperature."""


TemperatureRegion = Annotated[
    Annotated[TemperatureRectangle, Tag("rectangle")]
    | Annotated[TemperatureCircle, Tag("circle")]
    | Annotated[TemperatureAnnulus, Tag("annulus")]
    | Annotated[TemperaturePolygon, Tag("polygon")],
    Discriminator(tag_kind),
]


class RegionsTemperature(Table):
    """One temperature, and others in regions; where they overlap, the later one holds."""

    value: Kelvin = Field(description="temperature outside all regions [K]")
    regions: Annotated[tuple[TemperatureRegion, ...], Strict(False)] = Field(
        min_length=1,
        max_length=1000,
        description="rectangles, circles, annuli or polygons, as [{ min = [0, 0], max = [1, 1], value = 400.0 }, "
        '{ kind = "circle", center = [0, 0], radius = 1, value = 350.0 }]; later ones win',
    )


class ValuesTemperature(Table):
    """One temperature for each grain of the group."""

    values: Annotated[tuple[Kelvin, ...], Strict(False)] = Field(
        min_length=1, max_length=MAX_VALUES, description="temperature of each grain of the group [K], in their order"
    )


class FileTemperature(Table):
    """One temperature for each grain of the group, from a file."""

    file: FilePath = Field(description="text file with one temperature [K] per line, relative to the scenario file")


Temperature = Annotated[
    Annotated[Kelvin, Tag("<plain>")]
    | Annotated[GradientTemperature, Tag("<gradient>")]
    | Annotated[RegionsTemperature, Tag("<regions>")]
    | Annotated[ValuesTemperature, Tag("<values>")]
    | Annotated[FileTemperature, Tag("<file>")],
    one_of("a temperature is a number or a table with", "gradient", "regions", "values", "file"),
]
AnyTemperature = float | GradientTemperature | RegionsTemperature | ValuesTemperature | FileTemperature

"""Groups of free grains: placing, temperatures, coming and going, and from other runs."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from multicor_cli.files import LARGEST_RECORD, read_regular
from multicor_cli.scenario.base import (
    Array,
    Friction,
    GrainCount,
    Kelvin,
    Length,
    LengthPair,
    Name,
    Number,
    Pair,
    Point,
    Ratio,
    Table,
    Vector,
    exactly_one,
    one_of,
    optional,
    required,
)
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.region import (
    AnnulusRegion,
    AnyRegion,
    CircleRegion,
    PolygonRegion,
    RectangleRegion,
    Region,
    tag_kind,
)
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.shapes import DiscShape, FileShape, GrainShape, Orientation, Shape
from multicor_cli.scenario.sizes import Sizes

# ---- How the grains of a group are placed at the start

MAX_FILL = 0.9069
FilePath = Annotated[str, Field(min_length=1, max_length=4096, pattern=r"^[^\x00]+$")]
AreaFraction = Annotated[float, Field(gt=0.0, le=MAX_FILL)]


class LatticePacking(Table):
    """Grains on the sites of a lattice, row by row from the lower left corner of the region."""

    kind: Literal["lattice"]
    lattice: Literal["triangular", "square"] = required('"triangular" (closest) or "square"')
    spacing: Length | None = optional(
        "distance between the centers of neighboring sites [m]; default: the largest diameter"
    )
    jitter: float = optional(
        "each grain is put at random within this share of the spacing around its site",
        0.0,
        ge=0.0,
        le=0.5,
    )


class RandomPacking(Table):
    """Grains at random places without overlap, the largest first; turned at random too, if they
    are no discs.
    """

    kind: Literal["random"]
    separation: float = optional(
        "smallest gap between grains, over the mean diameter", 0.0, ge=0.0, le=10.0
    )
    attempts: int = optional(
        "places tried for one grain before giving up", 1000, ge=1, le=1_000_000
    )


class DepositedPacking(Table):
    """Grains dropped one after the other; each rolls down until it rests on two others, a wall or
    the floor of the region. Grains that are no discs sink from a random packing all together.
    """

    kind: Literal["deposited"]


class CompactedPacking(Table):
    """A random packing that the engine compacts between a floor and a loaded lid inside the
    region.
    """

    kind: Literal["compacted"]
    pressure: float = required(
        "load on the lid: force per length of wall, for the whole thickness of the grains [N/m]",
        ge=1e-12,
        le=1e12,
    )
    friction: Friction | None = optional(
        "coefficient of friction during the compaction (0: densest); default: that of [[contacts]]"
    )
    kinetic_energy_ratio: Ratio = optional(
        "compacted when the kinetic energy has fallen to this share of its largest value", 1e-6
    )


SourcePacking = Annotated[
    LatticePacking | RandomPacking | DepositedPacking | CompactedPacking,
    Field(discriminator="kind"),
]


class TilePacking(Table):
    """A small packing, periodic in x, repeated in x and y from the lower left corner of the
    region.
    """

    kind: Literal["tile"]
    source: SourcePacking = required(
        "packing of one tile: a lattice, random, deposited or compacted packing"
    )
    tile: LengthPair = required("width and height of one tile [m]")
    tile_count: GrainCount | None = optional("number of grains of one tile (or give tile_fill)")
    tile_fill: AreaFraction | None = optional("area fraction of one tile (or give tile_count)")
    repeat: Pair[Annotated[int, Field(ge=1, le=100_000)]] = required(
        "number of tiles in x and in y"
    )

    def faults(self) -> Iterator[Refused]:
        if self.tile_count is not None and self.tile_fill is not None:
            what = "both tile_count and tile_fill are given"
            yield Refused(("tile_fill",), what, "give one of them")
        is_bounded = self.tile_count is not None or self.tile_fill is not None
        if not (is_bounded or isinstance(self.source, LatticePacking)):
            yield Refused((), "neither tile_count nor tile_fill is given", "give one of them")


class FilePacking(Table):
    """Grains from a CSV or HDF5 file with columns (datasets) x, y, radius and, if wanted, angle,
    vx, vy, spin; in a cell peculiar_vx, peculiar_vy, beside its mean flow, in place of vx, vy.
    """

    kind: Literal["file"]
    path: FilePath = required("file (.csv, .h5), relative to the scenario file")
    shift: Point = optional("added to all x and y [m]", (0.0, 0.0))


class OutlinesPacking(Table):
    """Grains where the file of their outlines draws them, each once and in its size."""

    kind: Literal["outlines"]
    scale: Length = optional("length of a unit of the file [m]", 1.0)
    shift: Point = optional("added to all x and y [m]", (0.0, 0.0))


class RunPacking(Table):
    """Grains from a frame of another run, with their velocities."""

    kind: Literal["run"]
    path: FilePath = required("run directory, relative to the scenario file")
    frame: int = optional("index of the frame; -1 is the last one", -1, ge=-(10**9), le=10**9)


class StartPacking(Table):
    """The grains that the group of this name has in the run of ``[start]``."""

    kind: Literal["start"]


Packing = Annotated[
    LatticePacking
    | RandomPacking
    | DepositedPacking
    | CompactedPacking
    | TilePacking
    | FilePacking
    | OutlinesPacking
    | RunPacking
    | StartPacking,
    Field(discriminator="kind"),
]


# ---- Initial temperatures of a group of grains

MAX_VALUES = 100_000
"""Most temperatures in the scenario file itself; more go into a file of their own."""


class GradientTemperature(Table):
    """A temperature that varies linearly from place to place."""

    value: Kelvin = required("temperature [K] at the point at")
    gradient: Pair[Number] = required("change in x and in y [K/m]")
    at: Point = optional("point at which the temperature is value [m]", (0.0, 0.0))


class _Warm(Table):
    value: Kelvin = required("temperature of the grains with their center in it [K]")


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

    value: Kelvin = required("temperature outside all regions [K]")
    regions: Array[TemperatureRegion] = required(
        "rectangles, circles, annuli or polygons, as [{ min = [0, 0], max = [1, 1], value = 400.0 "
        '}, { kind = "circle", center = [0, 0], radius = 1, value = 350.0 }]; later ones win',
        min_length=1,
        max_length=1000,
    )


class ValuesTemperature(Table):
    """One temperature for each grain of the group."""

    values: Array[Kelvin] = required(
        "temperature of each grain of the group [K], in their order",
        min_length=1,
        max_length=MAX_VALUES,
    )


class FileTemperature(Table):
    """One temperature for each grain of the group, from a file."""

    file: FilePath = required(
        "text file with one temperature [K] per line, relative to the scenario file"
    )


Temperature = Annotated[
    Annotated[Kelvin, Tag("<plain>")]
    | Annotated[GradientTemperature, Tag("<gradient>")]
    | Annotated[RegionsTemperature, Tag("<regions>")]
    | Annotated[ValuesTemperature, Tag("<values>")]
    | Annotated[FileTemperature, Tag("<file>")],
    one_of("a temperature is a number or a table with", "gradient, regions, values, file"),
]


# ---- How grains come and go: releases of groups, and outlets

Rate = Annotated[float, Field(gt=0.0, le=1e12)]


class Release(Table):
    """``release`` of a group: its grains come one after the other, in the order of their
    numbers.
    """

    rate: Rate | None = optional("grains per second [1/s] (or give mass_rate)")
    mass_rate: Rate | None = optional("mass per second [kg/s] (or give rate)")
    region: RectangleRegion = required(
        "where: grains come at random places wholly inside it that are free; if none is, they wait"
    )
    start: float = optional("time of the first release [s]", 0.0, ge=0.0, le=1e12)

    def faults(self) -> Iterator[Refused]:
        remedy = "give one of them: grains per second, or kilograms per second"
        yield from exactly_one(self, "rate", "mass_rate", remedy)


class Outlet(Table):
    """One entry of ``[[outlets]]``: grains whose centers are inside leave before the next step."""

    name: Name = required("name of the outlet")
    region: RectangleRegion = required("where: deeper than the fastest grain moves in a step")
    then: Literal["remove", "release"] = optional(
        '"remove": grains leave for good; "release": those of groups with a release go back '
        "to wait for it, to come again as they came first",
        "remove",
    )


# ---- Going on from another run: where grains start, and what groups they belong to

RECORD = "scenario.resolved.toml"
"""The scenario of a run in its directory, with all defaults."""

_KEPT = ("name", "material", "shape", "thickness", "sizes")
"""What a group is; the other keys said how its grains were placed."""


class Start(Table):
    """``[start]``: the run from which this one goes on."""

    run: FilePath = required("directory of the run to go on from, relative to the scenario file")
    at: Literal["end"] | None = optional(
        '"end" (default): where the run stands, its last checkpoint, exactly; or give frame'
    )
    frame: int | None = optional(
        "index of a frame of the run to go on from; -1 is the last one", ge=-(10**9), le=10**9
    )

    def faults(self) -> Iterator[Refused]:
        if self.at is not None and self.frame is not None:
            yield Refused(("frame",), 'both at = "end" and frame are given', "give one of them")


def take_groups(document: dict[str, Any], directory: Path) -> bool:
    """Give a document with ``[start]`` but no ``[[particles]]`` its run's groups; whether it did.

    What is wrong with the run is told where its grains are read: a run that goes on needs neither
    any more. Until then a document whose run cannot be read has no groups.
    """
    start = document.get("start")
    if not isinstance(start, dict) or "particles" in document:
        return False
    document["particles"] = []
    if isinstance(path := start.get("run"), str):
        try:
            text = read_regular(directory / path / RECORD, LARGEST_RECORD).decode()
            document["particles"] = [
                {key: group[key] for key in _KEPT if key in group} | {"packing": {"kind": "start"}}
                for group in tomllib.loads(text)["particles"]
            ]
        except (OSError, ValueError, RecursionError, LookupError, TypeError):
            pass
    return True


# ---- Groups

MOTION = ("velocity", "shear_rate")
"""Keys of a group without which its grains move with the mean flow of a cell that begins with one.
"""


class ParticleGroup(Table):
    """One entry of ``[[particles]]``.

    Exactly one of ``count`` and ``fill`` is given, except for packings that bring their own number
    of grains (file, outlines, run, start, tile: neither) and for a lattice, which without them
    fills the whole region. Grains from a file or a run bring their radii too, so that ``sizes`` and
    ``region`` are refused there; of a group that goes on, ``sizes`` are those that walls may
    borrow.
    """

    name: Name = required("name of the group")
    material: Name = required("name of a [materials.NAME] table")
    shape: Shape = required(
        '"disc" (needs thickness) or "sphere", or a table of an outline with a thickness, as '
        '{ kind = "polygon", sides = 5 }; all groups are spheres, or none is'
    )
    thickness: Length | None = optional("thickness of the discs [m]; required but for spheres")
    sizes: Sizes | None = optional(
        'distribution of the radii, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }'
    )
    orientation: Orientation | None = optional(
        'how grains that are no discs are turned, as { kind = "fixed", angle = 0.0 }; default: '
        '"uniform", at random'
    )
    count: GrainCount | None = optional("number of grains (or give fill)")
    fill: AreaFraction | None = optional(
        "area of the grains over the area of the region (or give count)"
    )
    region: AnyRegion | None = optional(
        "where the grains are placed: a rectangle { min, max }, or with a kind a circle { "
        "center, radius }, an annulus { center, inner, outer } or a polygon { points }; "
        "default: the whole domain"
    )
    packing: Packing | None = optional(
        'how the grains are placed at the start, as { kind = "random" }; without it they wait '
        "for their release"
    )
    release: Release | None = optional(
        "how the grains come: { rate = 100.0, region = { min = [...], max = [...] } }, with "
        "velocity, spin and temperature of the group; with a packing, how they come again "
        "after an outlet"
    )
    velocity: Vector = optional(
        "initial velocity [m/s], added to any velocity that comes with the packing", (0.0, 0.0)
    )
    spin: Number = optional(
        "initial spin [rad/s], added to any spin that comes with the packing", 0.0
    )
    shear_rate: Number = optional(
        "initial shear rate [1/s]: adds shear_rate (y - y of the region's middle) to vx, "
        "-shear_rate/2 to spin",
        0.0,
    )

    temperature: Temperature | None = optional(
        "initial temperature [K]: a number, or a table with gradient, regions, values or file; "
        "default: that of the frame for a packing from a run with heat, else that of [heat]"
    )

    def placed_in(self, domain: Domain) -> Region:
        """Where it is placed: its region, or the whole domain."""
        return self.region or RectangleRegion(min=(0.0, 0.0), max=domain.size)

    @property
    def brings_grains(self) -> bool:
        """Whether the packing tells the number of grains and their radii (from a file or a run)."""
        return isinstance(self.packing, FilePacking | OutlinesPacking | RunPacking | StartPacking)

    @property
    def body(self) -> Literal["disc", "sphere"]:
        """Whether grains are spheres, or as thick everywhere as discs are."""
        return "sphere" if self.shape == "sphere" else "disc"

    @property
    def outline(self) -> GrainShape | None:
        """What outline grains have; None if they are discs or spheres."""
        if isinstance(self.shape, str | DiscShape) or self.shape.is_disc:
            return None
        return self.shape

    @property
    def solid(self) -> float:
        """Mass of a grain over that of its true area and the density of its material."""
        return self.shape.solid if isinstance(self.shape, GrainShape) else 1.0

    def faults(self) -> Iterator[Refused]:
        yield from self._faults_of_coming()
        yield from self._faults_of_outlines()
        if self.body == "disc" and self.thickness is None:
            grains = "discs" if self.outline is None else "grains that are no spheres"
            yield Refused((), f"{grains} need a thickness", "add thickness [m]")
        if self.body == "sphere" and self.thickness is not None:
            remedy = 'remove it, or use shape = "disc"'
            yield Refused(("thickness",), "spheres have no thickness", remedy)
        if not self.brings_grains and self.sizes is None:
            remedy = 'add sizes, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }'
            yield Refused((), "the sizes of the grains are missing", remedy)
        for key in ("region",) if isinstance(self.packing, StartPacking) else ("sizes", "region"):
            if self.brings_grains and getattr(self, key) is not None:
                yield Refused((key,), f"{key} {self._is_unused}", f"remove {key}")
        yield from self._faults_of_number()

    def _faults_of_outlines(self) -> Iterator[Refused]:
        if isinstance(self.packing, OutlinesPacking) and not isinstance(self.shape, FileShape):
            remedy = 'use shape = { kind = "file", file = "..." }, or another packing'
            yield Refused(("shape",), "there is no file of outlines to place", remedy)
        if self.outline is None and getattr(self.shape, "gyration", None) is not None:
            what = "grains that are discs have the moment of inertia ½ m r²"
            yield Refused(("shape", "gyration"), what, "remove gyration")
        if self.orientation is None:
            return
        if self.outline is None:
            yield Refused(("orientation",), "discs and spheres have no orientation", "remove it")
        if self.brings_grains:
            yield Refused(("orientation",), f"orientation {self._is_unused}", "remove it")

    @property
    def _is_unused(self) -> str:
        return f'has no meaning for packing kind = "{getattr(self.packing, "kind", "")}"'

    def _faults_of_coming(self) -> Iterator[Refused]:
        if self.packing is None and self.release is None:
            remedy = 'add packing = { kind = "random" }, or a release'
            yield Refused(("packing",), "the group has no packing", remedy)
        if self.release is not None and self.shear_rate:
            what = "grains are released with one velocity, but shear_rate gives each height its own"
            yield Refused(("shear_rate",), what, "remove shear_rate, or release")
        for key, remedy in (("region", "give release.region"), ("fill", "give count")):
            if self.packing is None and getattr(self, key) is not None:
                what = f"{key} has no meaning for grains that wait for their release"
                yield Refused((key,), what, remedy)

    def _faults_of_number(self) -> Iterator[Refused]:
        given = [key for key in ("count", "fill") if getattr(self, key) is not None]
        if len(given) == 2:
            yield Refused(("fill",), "both count and fill are given", "give one of them")
        is_tile = isinstance(self.packing, TilePacking)
        if given and (self.brings_grains or is_tile):
            remedy = "use tile_count or tile_fill of the packing" if is_tile else "remove it"
            yield Refused((given[0],), f"{given[0]} {self._is_unused}", remedy)
        fills = self.brings_grains or isinstance(self.packing, TilePacking | LatticePacking)
        if not given and not fills:
            remedy = "give the number of grains or the area fraction of the region"
            yield Refused((), "neither count nor fill is given", remedy)

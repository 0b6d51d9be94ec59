"""How the grains of a group are placed at the start."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Strict, model_validator

from multicor_cli.scenario.base import Friction, GrainCount, Length, LengthPair, Point, Ratio, Table, refuse

MAX_FILL = 0.9069
FilePath = Annotated[str, Field(min_length=1, max_length=4096, pattern=r"^[^\x00]+$")]
AreaFraction = Annotated[float, Field(gt=0.0, le=MAX_FILL)]


class LatticePacking(Table):
    """Grains on the sites of a lattice, row by row from the lower left corner of the region."""

    kind: Literal["lattice"]
    lattice: Literal["triangular", "square"] = Field(description='"triangular" (closest) or "square"')
    spacing: Length | None = Field(
        None, description="distance between the centers of neighboring sites [m]; default: the largest diameter"
    )
    jitter: float = Field(
        0.0, ge=0.0, le=0.5, description="each grain is put at random within this share of the spacing around its site"
    )


class RandomPacking(Table):
    """Grains at random places without overlap, the largest first."""

    kind: Literal["random"]
    separation: float = Field(0.0, ge=0.0, le=10.0, description="smallest gap between grains, over the mean diameter")
    attempts: int = Field(1000, ge=1, le=1_000_000, description="places tried for one grain before giving up")


class DepositedPacking(Table):
    """Grains dropped one after the other; each rolls down until it rests on two others, a wall or the floor of the region."""

    kind: Literal["deposited"]


class CompactedPacking(Table):
    """A random packing that the engine compacts between a floor and a loaded lid inside the region."""

    kind: Literal["compacted"]
    pressure: float = Field(
        ge=1e-12, le=1e12, description="load on the lid: force per length of wall, for the whole thickness of the grains [N/m]"
    )
    friction: Friction | None = Field(
        None, description="coefficient of friction during the compaction (0: densest); default: that of [[contacts]]"
    )
    kinetic_energy_ratio: Ratio = Field(
        1e-6, description="compacted when the kinetic energy has fallen to this share of its largest value"
    )


SourcePacking = Annotated[
    LatticePacking | RandomPacking | DepositedPacking | CompactedPacking,
    Field(discriminator="kind"),
]


class TilePacking(Table):
    """A small packing, periodic in x, repeated in x and y from the lower left corner of the region."""

    kind: Literal["tile"]
    source: SourcePacking = Field(description="packing of one tile: a lattice, random, deposited or compacted packing")
    tile: LengthPair = Field(description="width and height of one tile [m]")
    tile_count: GrainCount | None = Field(None, description="number of grains of one tile (or give tile_fill)")
    tile_fill: AreaFraction | None = Field(None, description="area fraction of one tile (or give tile_count)")
    repeat: Annotated[tuple[Annotated[int, Field(ge=1, le=100_000)], Annotated[int, Field(ge=1, le=100_000)]], Strict(False)] = (
        Field(description="number of tiles in x and in y")
    )

    @model_validator(mode="after")
    def _one_count(self) -> Self:
        given = (self.tile_count is not None) + (self.tile_fill is not None)
        if given == 2:
            raise refuse("both tile_count and tile_fill are given", "give one of them", "tile_fill")
        if given == 0 and not isinstance(self.source, LatticePacking):
            raise refuse("neither tile_count nor tile_fill is given", "give one of them")
        return self


class FilePacking(Table):
    """Grains from a CSV or HDF5 file with columns (datasets) x, y, radius and, if wanted, angle, vx, vy, spin."""

    kind: Literal["file"]
    path: FilePath = Field(description="file (.csv, .h5), relative to the scenario file")
    shift: Point = Field((0.0, 0.0), description="added to all x and y [m]")


class RunPacking(Table):
    """Grains from a frame of another run, with their velocities."""

    kind: Literal["run"]
    path: FilePath = Field(description="run directory, relative to the scenario file")
    frame: int = Field(-1, ge=-(10**9), le=10**9, description="index of the frame; -1 is the last one")


class StartPacking(Table):
    """The grains that the group of this name has in the run of ``[start]``."""

    kind: Literal["start"]


Packing = Annotated[
    LatticePacking | RandomPacking | DepositedPacking | CompactedPacking | TilePacking | FilePacking | RunPacking | StartPacking,
    Field(discriminator="kind"),
]

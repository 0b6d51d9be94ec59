"""Groups of free grains."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from multicor_cli.scenario.base import GrainCount, Length, Name, Number, Table, Vector, refuse
from multicor_cli.scenario.exchange import Release
from multicor_cli.scenario.packings import (
    AreaFraction,
    FilePacking,
    LatticePacking,
    Packing,
    RunPacking,
    StartPacking,
    TilePacking,
)
from multicor_cli.scenario.region import AnyRegion
from multicor_cli.scenario.sizes import Sizes
from multicor_cli.scenario.temperatures import Temperature


class ParticleGroup(Table):
    """One entry of ``[[particles]]``.

    Exactly one of ``count`` and ``fill`` is given, except for packings that bring their own number of grains (file, run, start,
    tile: neither) and for a lattice, which without them fills the whole region. Grains from a file or a run bring their radii
    too, so that ``sizes`` and ``region`` are refused there; of a group that goes on, ``sizes`` are those that walls may borrow.
    """

    name: Name = Field(description="name of the group")
    material: Name = Field(description="name of a [materials.NAME] table")
    shape: Literal["disc", "sphere"] = Field(description='"disc" (needs thickness) or "sphere"; the same for all groups')
    thickness: Length | None = Field(None, description="thickness of the discs [m]; required for discs")
    sizes: Sizes | None = Field(None, description='distribution of the radii, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }')
    count: GrainCount | None = Field(None, description="number of grains (or give fill)")
    fill: AreaFraction | None = Field(None, description="area of the grains over the area of the region (or give count)")
    region: AnyRegion | None = Field(
        None,
        description="where the grains are placed: a rectangle { min, max }, or with a kind a circle { center, radius }, an annulus "
        "{ center, inner, outer } or a polygon { points }; default: the whole domain",
    )
    packing: Packing | None = Field(
        None, description='how the grains are placed at the start, as { kind = "random" }; without it they wait for their release'
    )
    release: Release | None = Field(
        None,
        description="how the grains come: { rate = 100.0, region = { min = [...], max = [...] } }, with velocity, spin and "
        "temperature of the group; with a packing, how they come again after an outlet",
    )
    velocity: Vector = Field((0.0, 0.0), description="initial velocity [m/s], added to any velocity that comes with the packing")
    spin: Number = Field(0.0, description="initial spin [rad/s], added to any spin that comes with the packing")
    shear_rate: Number = Field(
        0.0,
        description="initial shear rate [1/s]: adds shear_rate (y - y of the region's middle) to vx, -shear_rate/2 to spin",
    )

    temperature: Temperature | None = Field(
        None,
        description="initial temperature [K]: a number, or a table with gradient, regions, values or file; default: that of the "
        "frame for a packing from a run with heat, else that of [heat]",
    )

    @property
    def brings_grains(self) -> bool:
        """Whether the packing tells the number of grains and their radii (from a file or a run)."""
        return isinstance(self.packing, FilePacking | RunPacking | StartPacking)

    @model_validator(mode="after")
    def _check_release(self) -> Self:
        if self.packing is None and self.release is None:
            raise refuse("the group has no packing", 'add packing = { kind = "random" }, or a release', "packing")
        if self.release is not None and self.shear_rate:
            what = "grains are released with one velocity, but shear_rate gives each height its own"
            raise refuse(what, "remove shear_rate, or release", "shear_rate")
        for key in ("region", "fill"):
            if self.packing is None and getattr(self, key) is not None:
                remedy = "give release.region" if key == "region" else "give count"
                raise refuse(f"{key} has no meaning for grains that wait for their release", remedy, key)
        return self

    @model_validator(mode="after")
    def _check_thickness(self) -> Self:
        if self.shape == "disc" and self.thickness is None:
            raise refuse("discs need a thickness", "add thickness [m]")
        if self.shape == "sphere" and self.thickness is not None:
            raise refuse("spheres have no thickness", 'remove it, or use shape = "disc"', "thickness")
        return self

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        if not self.brings_grains and self.sizes is None:
            raise refuse("the sizes of the grains are missing", 'add sizes, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }')
        for key in ("region",) if isinstance(self.packing, StartPacking) else ("sizes", "region"):
            if self.packing is not None and self.brings_grains and getattr(self, key) is not None:
                raise refuse(f'{key} has no meaning for packing kind = "{self.packing.kind}"', f"remove {key}", key)
        return self

    @model_validator(mode="after")
    def _check_count(self) -> Self:
        given = [key for key in ("count", "fill") if getattr(self, key) is not None]
        if len(given) == 2:
            raise refuse("both count and fill are given", "give one of them", "fill")
        if given and self.packing is not None and (self.brings_grains or isinstance(self.packing, TilePacking)):
            remedy = "use tile_count or tile_fill of the packing" if isinstance(self.packing, TilePacking) else "remove it"
            raise refuse(f'{given[0]} has no meaning for packing kind = "{self.packing.kind}"', remedy, given[0])
        if not given and not (self.brings_grains or isinstance(self.packing, TilePacking | LatticePacking)):
            raise refuse("neither count nor fill is given", "give the number of grains or the area fraction of the region")
        return self

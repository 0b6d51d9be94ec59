"""What is written once: the model and the scenario of a run."""

from __future__ import annotations

from dataclasses import replace

from multicor_cli.model.books import DType, Feature, Shape
from multicor_cli.model.shapes import SHAPES
from multicor_cli.store.schema.rows import Dataset


def _thermal(name: str, unit: str, long_name: str) -> Dataset:
    return Dataset(f"model/thermal/{name}", "f8", ("grain",), unit, long_name, lambda m: getattr(m.thermal, name), only_with="heat")


def _law(name: str, dtype: DType, dims: Shape, unit: str, long_name: str) -> Dataset:
    return Dataset(f"model/laws/{name}", dtype, dims, unit, long_name, lambda m: getattr(m.model.laws, name))


def _softening(name: str, unit: str, long_name: str) -> Dataset:
    return replace(_law(f"softening_{name}", "f8", ("material", "material"), unit, long_name), only_with="softening")


def _pair(name: str, unit: str, long_name: str, feature: Feature) -> Dataset:
    return replace(_law(name, "f8", ("material", "material"), unit, long_name), only_with=feature, since=(1, 1))


MODEL: tuple[Dataset, ...] = (
    Dataset("model/radius", "f8", ("grain",), "m", "radius of each grain", lambda m: m.model.grains.radius),
    Dataset("model/mass", "f8", ("grain",), "kg", "mass of each grain", lambda m: m.model.grains.mass),
    Dataset(
        "model/inertia", "f8", ("grain",), "kg m2", "moment of inertia of each grain about its center",
        lambda m: m.model.grains.inertia,
    ),
    Dataset(
        "model/material", "i4", ("grain",), "1", "material of each grain, a row of model/material_names",
        lambda m: m.model.grains.material,
    ),
    Dataset(
        "model/group", "i4", ("grain",), "1", "particle group of each grain, a row of model/group_names",
        lambda m: m.model.grains.group,
    ),
    Dataset("model/material_names", "str", ("material",), "1", "names of the materials", lambda m: m.model.materials),
    Dataset("model/group_names", "str", ("group",), "1", "names of the particle groups", lambda m: m.model.groups),
    Dataset("model/walls/names", "str", ("wall",), "1", "names of the walls", lambda m: m.model.walls.names),
    Dataset(
        "model/walls/mass", "f8", ("wall",), "kg", "mass that a load moves; nan if none was given",
        lambda m: m.model.walls.mass, finite=False,
    ),
    Dataset(
        "model/walls/inertia", "f8", ("wall",), "kg m2", "moment of inertia of a wall; nan if none",
        lambda m: m.model.walls.inertia, finite=False,
    ),
    Dataset(
        "model/walls/has_gravity", "u1", ("wall",), "1", "whether gravity acts on the wall: 0 or 1",
        lambda m: m.model.walls.has_gravity,
    ),
    Dataset(
        "model/walls/length", "f8", ("wall",), "m", "length over which a load on the wall spreads", lambda m: m.model.walls.length,
    ),
    Dataset(
        "model/walls/runs", "u1", ("wall",), "1", "whether a drive lets the surface of the wall run along it: 0 or 1",
        lambda m: m.model.walls.runs, only_with="surface", since=(1, 3),
    ),
    Dataset(
        "model/walls/meets", "u1", ("wall", "group"), "1", "whether grains of the group meet the wall: 0 (they pass through) or 1",
        lambda m: m.model.walls.meets, only_with="groups", since=(1, 3),
    ),
    Dataset(
        "model/shapes/kind", "i4", ("shape",), "1", ", ".join(f"{kind:d} {shape.name}" for kind, shape in SHAPES.items()),
        lambda m: m.model.shapes.kind,
    ),
    Dataset(
        "model/shapes/wall", "i4", ("shape",), "1", "wall that carries the shape, a row of model/walls/names",
        lambda m: m.model.shapes.wall,
    ),
    Dataset(
        "model/shapes/geometry", "f8", ("shape", 4), "m", "four numbers in the frame of the wall; see the table of kinds",
        lambda m: m.model.shapes.geometry,
    ),
    Dataset(
        "model/shapes/material", "i4", ("shape",), "1", "material of the shape, a row of model/material_names",
        lambda m: m.model.shapes.material,
    ),
    _law("friction", "f8", ("material", "material"), "1", "coefficient of friction where laws/table is -1"),
    _law("restitution", "f8", ("material", "material"), "1", "coefficient of normal restitution"),
    _law("table", "i4", ("material", "material"), "1", "table of friction against sliding speed, or -1"),
    _law("table_start", "i4", ("table_edge",), "1", "first row of each table in the two below"),
    _law("table_speed", "f8", ("table_row",), "m/s", "sliding speeds, ascending within a table"),
    _law("table_friction", "f8", ("table_row",), "1", "coefficient of friction at these speeds"),
    _softening("rate", "1/K", "c of mu = mu0 (1 - c (T - T_r)); 0 for pairs without it"),
    _softening("start", "K", "temperature T_r at which mu = mu0"),
    _softening("lowest", "1", "smallest coefficient of friction"),
    _softening("highest", "1", "largest coefficient of friction"),
    _pair("adhesion", "N", "tension that a contact bears", "adhesion"),
    _pair("rolling", "1", "coefficient of rolling resistance", "rolling"),
    _thermal("capacity", "J/K", "heat capacity of each grain"),
    _thermal("start", "K", "temperature of each grain at the start of the run"),
    _thermal("surface", "m2", "area through which each grain meets fluid and surroundings"),
    Dataset(
        "model/outlets", "str", ("outlet",), "1", "names of the outlets",
        lambda m: m.model.outlets, only_with="exchange", since=(1, 2),
    ),
    Dataset(
        "model/start_speed", "f8", ("one",), "m/s",
        "speed of the fastest grain, surface of a grain or wall at the start, but for the shear that walls impose",
        lambda m: m.model.start_speed, only_with="motion", since=(1, 3),
    ),
    Dataset("model/period", "f8", ("one",), "m", "period in x; 0 if the domain is not periodic", lambda m: m.model.period),
    Dataset("model/gravity", "f8", (2,), "m/s2", "acceleration of gravity (x, y)", lambda m: m.model.gravity),
    Dataset(
        "model/shape_factor", "f8", ("one",), "1", "m a2/I of every grain: 2 for discs, 5/2 for spheres",
        lambda m: m.model.shape_factor,
    ),
)  # fmt: skip
"""Written once (`model.Model`)."""

SCENARIO: tuple[Dataset, ...] = (
    Dataset("scenario/source", "str", ("one",), "1", "the scenario file as given"),
    Dataset("scenario/resolved", "str", ("one",), "1", "the scenario with all defaults and overrides"),
    Dataset("scenario/stages", "str", ("stage",), "1", "names of the loading stages"),
)
"""Only in ``results.h5``; a running run has the same texts as files beside it."""

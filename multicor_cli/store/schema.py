"""The table of every dataset in the files of a run: one row each, the same for segments, `model.h5` and `results.h5`.

A new quantity is one more row here, with where its value comes from; writers and readers follow the table. Rows that only some
runs have name the feature of the run that they belong to; a run with that feature has all of them, a run without it none
(`select`).
"""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass
from typing import Any, Literal

from multicor_cli.model import BOOK_NAMES, TALLY_NAMES, WINDOW_NAMES, Model
from multicor_cli.model.columns import ANGLE, SPIN
from multicor_cli.model.shapes import SHAPES
from multicor_cli.store.moment import Moment, in_plane, mean_temperature

FORMAT_VERSION = (1, 0)
"""Major and minor version of the file format. A reader refuses another major version and ignores unknown datasets."""

Dim = Literal[
    "one",
    "frame",
    "frame_edge",
    "particle_row",
    "contact_row",
    "series_row",
    "grain",
    "shape",
    "wall",
    "material",
    "group",
    "stage",
    "table_edge",
    "table_row",
    "heat_grain",
    "heat_wall",
    "heat_book",
    "mean_row",
]
"""Named lengths. ``frame_edge`` is ``frame + 1``: row ``offset[k]:offset[k+1]`` belongs to frame ``k``. Those that begin with
``heat`` are 0 in checkpoints of runs without heat."""

Feature = Literal["heat", "softening"]
"""What only some runs have: temperatures, or friction that depends on them."""

Value = Callable[[Moment], Any]
"""Where a value comes from: an array, or what belongs to one row."""

DType = Literal["f8", "float", "i8", "i4", "u1", "str"]
"""Stored types. ``float`` is f8 or f4 after ``output.precision``; ``str`` is UTF-8 of fixed length."""


@dataclass(frozen=True)
class Dataset:
    """One row of the table.

    Attributes:
        path: Name inside the file, without the leading slash.
        dtype: Stored type.
        dims: Shape: named lengths and numbers.
        unit: SI unit, one per column (separated by commas) where they differ; ``1`` if dimensionless.
        long_name: What it is, in a sentence.
        value: What is stored of a moment; None where the writer knows by itself, or a getter of its own does.
        finite: Whether every value must be finite.
        since: Format version in which the dataset appeared.
        only_with: Feature of the runs that have it, or None if all have it.
    """

    path: str
    dtype: DType
    dims: tuple[Dim | int, ...]
    unit: str
    long_name: str
    value: Value | None = None
    finite: bool = True
    since: tuple[int, int] = (1, 0)
    only_with: Feature | None = None

    @property
    def name(self) -> str:
        """Last part of the path."""
        return self.path.rsplit("/", 1)[-1]

    @property
    def group(self) -> str:
        """Path without its last part."""
        return self.path.rsplit("/", 1)[0]

    @property
    def row(self) -> Dim | int:
        """What one row of the dataset stands for."""
        return self.dims[0]


def _heat(
    path: str, dtype: DType, dims: tuple[Dim | int, ...], unit: str, long_name: str, value: Value, *, finite: bool = True
) -> Dataset:
    return Dataset(path, dtype, dims, unit, long_name, value, finite, only_with="heat")


def _law(name: str, dtype: DType, dims: tuple[Dim | int, ...], unit: str, long_name: str) -> Dataset:
    return Dataset(f"model/laws/{name}", dtype, dims, unit, long_name, lambda m: getattr(m.model.laws, name))


def _softening(name: str, unit: str, long_name: str) -> Dataset:
    path, dims = f"model/laws/softening_{name}", ("material", "material")
    return Dataset(path, "f8", dims, unit, long_name, lambda m: getattr(m.model.laws, f"softening_{name}"), only_with="softening")  # type: ignore[arg-type]


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
    _heat("model/thermal/capacity", "f8", ("grain",), "J/K", "heat capacity of each grain", lambda m: m.thermal.capacity),
    _heat(
        "model/thermal/start", "f8", ("grain",), "K", "temperature of each grain at the start of the run",
        lambda m: m.thermal.start,
    ),
    _heat(
        "model/thermal/surface", "f8", ("grain",), "m2", "area through which each grain meets fluid and surroundings",
        lambda m: m.thermal.surface,
    ),
    Dataset("model/period", "f8", ("one",), "m", "period in x; 0 if the domain is not periodic", lambda m: m.model.period),
    Dataset("model/gravity", "f8", (2,), "m/s2", "acceleration of gravity (x, y)", lambda m: m.model.gravity),
    Dataset(
        "model/shape_factor", "f8", ("one",), "1", "m a2/I of every grain: 2 for discs, 5/2 for spheres",
        lambda m: m.model.shape_factor,
    ),
)  # fmt: skip
"""Written once (`state.Model`)."""

STEPS: tuple[Dataset, ...] = (
    Dataset("steps/step", "i8", ("frame",), "1", "steps done since the start of the run", lambda m: m.state.step),
    Dataset("steps/time", "f8", ("frame",), "s", "time since the start of the run", lambda m: m.state.time),
    Dataset(
        "steps/dt", "f8", ("frame",), "s", "length of the last step; impulse/dt is its mean contact force; 0 before it",
        lambda m: m.state.last_dt,
    ),
    Dataset("steps/stage", "i4", ("frame",), "1", "loading stage, a row of scenario/stages", lambda m: m.state.stage),
    Dataset(
        "steps/contacts_recorded", "u1", ("frame",), "1", "1 if the contacts of the frame are in the file, 0 if not",
        lambda m: m.contacts is not None,
    ),
)  # fmt: skip
"""One row per frame."""

OFFSETS: tuple[Dataset, ...] = (
    Dataset("steps/particle_offset", "i8", ("frame_edge",), "1", "rows offset[k]:offset[k+1] of particles/* are frame k"),
    Dataset("steps/contact_offset", "i8", ("frame_edge",), "1", "rows offset[k]:offset[k+1] of contacts/* are frame k"),
)
"""Where the rows of each frame lie."""

PARTICLES: tuple[Dataset, ...] = (
    Dataset(
        "particles/position", "float", ("particle_row", 3), "m", "centers x, y, z; x wrapped into the period, z = 0",
        lambda m: in_plane(m.state.position),
    ),
    Dataset(
        "particles/angle", "float", ("particle_row",), "rad", "rotation since the start of the run",
        lambda m: m.state.position[:, ANGLE],
    ),
    Dataset(
        "particles/image", "i8", ("particle_row",), "1", "periods by which x was wrapped: x + image*period is unwrapped",
        lambda m: m.state.image,
    ),
    Dataset(
        "particles/velocity", "float", ("particle_row", 3), "m/s", "velocities x, y, z of the centers; z = 0",
        lambda m: in_plane(m.state.velocity),
    ),
    Dataset(
        "particles/spin", "float", ("particle_row",), "rad/s", "angular velocity, counter-clockwise positive",
        lambda m: m.state.velocity[:, SPIN],
    ),
    _heat("particles/temperature", "f8", ("particle_row",), "K", "temperature", lambda m: m.temperature),
    _heat(
        "particles/generated", "f8", ("particle_row",), "J", "heat of friction and impacts received since the start",
        lambda m: m.state.generated,
    ),
    _heat("particles/wear", "f8", ("particle_row",), "m3", "volume worn off since the start", lambda m: m.state.wear),
)  # fmt: skip
"""One row per grain and frame, in the order of the grains."""

CONTACTS: tuple[Dataset, ...] = (
    Dataset("contacts/i", "i4", ("contact_row",), "1", "first shape of the contact: a grain", lambda m: m.table.i),
    Dataset("contacts/j", "i4", ("contact_row",), "1", "second shape: a grain if < n, else wall shape j - n", lambda m: m.table.j),
    Dataset(
        "contacts/kind", "u1", ("contact_row",), "1", "0 grain-grain, 1 grain-wall", lambda m: m.table.j >= m.model.grain_count,
    ),
    Dataset(
        "contacts/normal", "float", ("contact_row", 2), "1", "unit normal n from j to i; the tangent is n turned by +90 deg",
        lambda m: m.table.normal,
    ),
    Dataset("contacts/gap", "float", ("contact_row",), "m", "gap, negative where shapes overlap", lambda m: m.table.gap),
    Dataset(
        "contacts/impulse", "float", ("contact_row", 2), "N s", "normal and tangential impulse on i in the last step",
        lambda m: m.table.impulse,
    ),
    Dataset(
        "contacts/slip", "float", ("contact_row",), "m/s", "tangential velocity of i relative to j after the step",
        lambda m: m.table.slip,
    ),
    Dataset(
        "contacts/sliding", "u1", ("contact_row",), "1", "1 if the contact slides, 0 if it sticks or carries nothing",
        lambda m: m.table.sliding,
    ),
    _heat(
        "contacts/heat", "float", ("contact_row",), "J", "heat generated in the contact in the last step",
        lambda m: m.of_contacts(m.table.heat),
    ),
    _heat(
        "contacts/conductance", "float", ("contact_row",), "W/K", "conductance of the contact in the last step",
        lambda m: m.of_contacts(m.table.conductance),
    ),
)  # fmt: skip
"""One row per contact of the last step and frame, ordered by (i, j)."""

WALLS: tuple[Dataset, ...] = (
    Dataset(
        "walls/position", "f8", ("frame", "wall", 3), "m, m, rad", "reference point and angle of the wall",
        lambda m: m.state.wall_position,
    ),
    Dataset(
        "walls/velocity", "f8", ("frame", "wall", 3), "m/s, m/s, rad/s", "velocity and spin of the wall",
        lambda m: m.state.wall_velocity,
    ),
    _heat(
        "walls/temperature", "f8", ("frame", "wall"), "K", "temperature of the wall; nan where none is prescribed",
        lambda m: m.state.wall_temperature, finite=False,
    ),
    _heat(
        "walls/heat", "f8", ("frame", "wall", 2), "J", "heat given to the grains; heat of friction and impacts received",
        lambda m: m.state.wall_heat,
    ),
    _heat("walls/wear", "f8", ("frame", "wall"), "m3", "volume worn off since the start", lambda m: m.state.wall_wear),
)  # fmt: skip
"""One row per frame and wall."""


def _scalar(name: str, unit: str, long_name: str, value: Value, dtype: DType = "f8") -> Dataset:
    return Dataset(f"series/{name}", dtype, ("series_row",), unit, long_name, value)


def _book(name: str, long_name: str, unit: str = "J") -> Dataset:
    return _scalar(name, unit, long_name, lambda m: m.books[name])


def _tally(name: str, unit: str, long_name: str, dtype: DType = "f8") -> Dataset:
    return _scalar(name, unit, long_name, lambda m: m.tallies[name], dtype)


def _window(name: str, unit: str, long_name: str, of: str, dtype: DType = "f8") -> Dataset:
    return _scalar(name, unit, long_name, lambda m: m.window[of], dtype)


def _heat_scalar(name: str, unit: str, long_name: str, value: Value) -> Dataset:
    return _heat(f"series/{name}", "f8", ("series_row",), unit, long_name, value)


def _heat_book(name: str, unit: str, long_name: str, dtype: DType = "f8") -> Dataset:
    return _heat(f"series/{series_name(name)}", dtype, ("series_row",), unit, long_name, lambda m: m.heat_books[name])


def series_name(book: str) -> str:
    """Name in the time series of a heat book, one of `multicor_cli.model.HEAT_BOOK_NAMES`."""
    return book if book.startswith(("max_", "solid_gas_")) else f"heat_{book}"


SERIES: tuple[Dataset, ...] = (
    _scalar("step", "1", "steps done since the start of the run", lambda m: m.state.step, "i8"),
    _scalar("time", "s", "time since the start of the run, the end of the window", lambda m: m.state.time, "f8"),
    _scalar("stage", "1", "loading stage, a row of scenario/stages", lambda m: m.state.stage, "i4"),
    _scalar("strain", "1", "shear strain accumulated in this stage", lambda m: m.state.stage_strain),
    _book("kinetic", "kinetic energy of the free degrees of freedom"),
    _book("kinetic_start", "kinetic energy at the start of the run"),
    _book("gravity_work", "work of gravity since the start, position correction included"),
    _book("wall_work", "work done on the grains by prescribed wall velocities since the start"),
    _book("load_work", "work of the loads on driven walls since the start, position correction included"),
    _book("friction_loss", "energy lost to friction since the start, signed"),
    _book("impact_loss", "energy lost to impacts since the start, signed"),
    _book("damping_loss", "energy lost in the damping of loads since the start"),
    _book("correction_work", "energy moved by the projection of positions since the start"),
    _book("friction_sliding", "mu |u_t+| p_n summed since the start: the end-of-step rule"),
    _book("negative_loss", "negative part of friction_loss + impact_loss since the start"),
    _book("terms", "sum of the absolute terms of the energy balance since the start"),
    _book("imbalance", "kinetic - kinetic_start - works + losses now"),
    _book("closure", "largest |imbalance|/terms so far", "1"),
    _tally("max_overlap", "1", "largest overlap over the smaller radius so far"),
    _tally("max_impulse_rate", "N", "largest normal impulse over dt so far"),
    _tally("corrected_steps", "1", "steps so far after which positions were projected", "i8"),
    _window("window_duration", "s", "length of the window since the row before; 0 in a row without steps", "duration"),
    _window("window_steps", "1", "steps in the window", "steps", "i8"),
    _scalar(
        "sweeps_mean", "1", "sweep-equivalents per step of the window; 0 in a row without steps", lambda m: m.per_step("sweeps")
    ),
    _window("unconverged", "1", "steps of the window that hit the cap on sweeps", "unconverged", "i8"),
    _window("residual_rms", "1", "largest rms velocity correction over u_ref in the window", "residual_rms"),
    _window("residual_max", "1", "largest velocity correction over u_ref in the window", "residual_max"),
    _window("residual_energy", "1", "largest energy residual G in the window", "residual_energy"),
    _scalar("contacts_mean", "1", "loaded contacts per step of the window", lambda m: m.per_step("contacts")),
    Dataset(
        "series/virial_rate", "f8", ("series_row", 2, 2), "N m",
        "window mean of sum f_a l_b over grain-grain contacts, l from j to i; over an area: mean stress, compression positive",
        lambda m: m.rate(m.virial),
    ),
    Dataset(
        "series/wall_force", "f8", ("series_row", "wall", 3), "N, N, N m",
        "window mean of the force and torque exerted by the grains on each wall",
        lambda m: m.rate(m.state.window_wall_impulse),
    ),
    Dataset(
        "series/wall_position", "f8", ("series_row", "wall", 3), "m, m, rad", "reference point and angle of the wall",
        lambda m: m.state.wall_position,
    ),
    Dataset(
        "series/wall_velocity", "f8", ("series_row", "wall", 3), "m/s, m/s, rad/s", "velocity and spin of the wall",
        lambda m: m.state.wall_velocity,
    ),
    _heat_book("stored", "J", "heat content of the grains since the start"),
    _heat_book("friction", "J", "heat of friction since the start"),
    _heat_book("impact", "J", "heat of impacts since the start"),
    _heat_book("to_walls", "J", "share of the heat of friction and impacts that went into the walls"),
    _heat_book("from_walls", "J", "heat that the walls gave to the grains since the start, signed"),
    _heat_book("from_ambient", "J", "heat from the ambient fluid by convection since the start, signed"),
    _heat_book("from_surroundings", "J", "heat from the surroundings by radiation since the start, signed"),
    _heat_book("exchanged", "J", "sum of the absolute exchanges with the outside since the start"),
    _heat_book("undelivered", "J", "heat that walls of prescribed flow could not pass on: nothing touched them"),
    _heat_book("imbalance", "J", "heat_stored - (friction + impact - to_walls + from_walls + ambient + surroundings) now"),
    _heat_book("closure", "1", "largest |heat_imbalance| / (heat_exchanged + sum of C |T - T_0|) so far"),
    _heat_book("sub_steps", "1", "sub-steps of the heat integrator so far", "i8"),
    _heat_book("max_biot", "1", "largest Biot number of a contact so far"),
    _heat_book("solid_gas_min", "1", "smallest k_s s/(k_f a) of a contact in the last step; 0 without gas"),
    _heat_book("solid_gas_max", "1", "largest k_s s/(k_f a) of a contact in the last step; 0 without gas"),
    _heat_scalar(
        "temperature_mean",
        "K",
        "mean temperature of the grains, weighted by heat capacity",
        lambda m: mean_temperature(m.temperature, m.thermal),
    ),
    _heat_scalar("temperature_min", "K", "lowest temperature of a grain", lambda m: m.temperature.min()),
    _heat_scalar("temperature_max", "K", "highest temperature of a grain", lambda m: m.temperature.max()),
    _heat(
        "series/wall_heat", "f8", ("series_row", "wall", 2), "J", "heat given to the grains; heat of friction and impacts received",
        lambda m: m.state.wall_heat,
    ),
)  # fmt: skip
"""One row per point of the time series, which has its own, denser cadence than the frames."""

SCENARIO: tuple[Dataset, ...] = (
    Dataset("scenario/source", "str", ("one",), "1", "the scenario file as given"),
    Dataset("scenario/resolved", "str", ("one",), "1", "the scenario with all defaults and overrides"),
    Dataset("scenario/stages", "str", ("stage",), "1", "names of the loading stages"),
)
"""Only in ``results.h5``; a running run has the same texts as files beside it."""

FRAME_TABLE = STEPS + OFFSETS + PARTICLES + CONTACTS + WALLS
"""Everything that a frame consists of."""

SEGMENT_TABLE = FRAME_TABLE + SERIES
"""Everything in a segment."""

RESULTS_TABLE = SCENARIO + MODEL + FRAME_TABLE + SERIES
"""Everything in ``results.h5``."""


def _state(name: str, dtype: DType, dims: tuple[Dim | int, ...], unit: str, long_name: str) -> Dataset:
    """A part of the state that belongs to heat; it is there, but empty, in runs without."""
    return Dataset(f"state/{name}", dtype, dims, unit, long_name, finite=False)


CHECKPOINT: tuple[Dataset, ...] = (
    Dataset("state/position", "f8", ("grain", 3), "m, m, rad", "centers (x wrapped into the period) and angles of the grains"),
    Dataset("state/image", "i8", ("grain",), "1", "periods by which x was wrapped"),
    Dataset("state/velocity", "f8", ("grain", 3), "m/s, m/s, rad/s", "velocities and spins of the grains"),
    Dataset("state/wall_position", "f8", ("wall", 3), "m, m, rad", "reference points and angles of the walls"),
    Dataset("state/wall_velocity", "f8", ("wall", 3), "m/s, m/s, rad/s", "velocities and spins of the walls"),
    Dataset("state/contact_i", "i4", ("contact_row",), "1", "first shape of each contact that carried an impulse"),
    Dataset("state/contact_j", "i4", ("contact_row",), "1", "second shape of each of these contacts"),
    Dataset("state/contact_impulse", "f8", ("contact_row", 2), "N s", "normal and tangential impulse of the last step"),
    Dataset("state/books", "f8", (len(BOOK_NAMES),), "J", "energy books, in the order of state.BOOK_NAMES"),
    Dataset("state/tallies", "f8", (len(TALLY_NAMES),), "mixed", "counters, in the order of state.TALLY_NAMES"),
    Dataset("state/window", "f8", (len(WINDOW_NAMES),), "mixed", "sums, in the order of state.WINDOW_NAMES"),
    Dataset("state/window_wall_impulse", "f8", ("wall", 3), "N s, N s, N m s", "impulse on each wall since the last series row"),
    Dataset("state/step", "i8", ("one",), "1", "steps done since the start of the run"),
    Dataset("state/frozen_steps", "i8", ("one",), "1", "how many of the steps were of frozen stages"),
    Dataset("state/stage", "i8", ("one",), "1", "current loading stage"),
    Dataset("state/stage_step", "i8", ("one",), "1", "steps done in this stage"),
    Dataset("state/stage_start", "f8", ("one",), "s", "time at which this stage began"),
    Dataset("state/stage_peak", "f8", ("one",), "J", "largest kinetic energy in this stage"),
    Dataset("state/stage_strain", "f8", ("one",), "1", "shear strain accumulated in this stage"),
    Dataset("state/time", "f8", ("one",), "s", "time since the start of the run"),
    Dataset("state/last_dt", "f8", ("one",), "s", "length of the last step"),
    _state("heat", "f8", ("heat_grain",), "J", "heat content of the grains since the start"),
    _state("generated", "f8", ("heat_grain",), "J", "heat of friction and impacts received since the start"),
    _state("wear", "f8", ("heat_grain",), "m3", "volume worn off the grains since the start"),
    _state("wall_heat", "f8", ("heat_wall", 2), "J", "heat given to the grains; heat of friction and impacts received"),
    _state("wall_wear", "f8", ("heat_wall",), "m3", "volume worn off the walls since the start"),
    _state("wall_temperature", "f8", ("heat_wall",), "K", "temperature of the walls; nan where none is prescribed"),
    _state("heat_books", "f8", ("heat_book",), "mixed", "heat books, in the order of state.HEAT_BOOK_NAMES"),
    _state("mean_i", "i4", ("mean_row",), "1", "first shape of each contact with an averaged force"),
    _state("mean_j", "i4", ("mean_row",), "1", "second shape of each of these contacts"),
    _state("mean_force", "f8", ("mean_row",), "N", "running average of the normal force"),
    _state("mean_age", "f8", ("one",), "s", "time since the start of the running averages"),
    _state("heat_dt", "f8", ("one",), "s", "sub-step that the heat integrator tries first; 0: the whole step"),
)
"""A checkpoint: every field of `state.State` (a test compares the two)."""


def features_of(model: Model) -> frozenset[Feature]:
    """What a run of this model has beyond what every run has."""
    found: dict[Feature, object] = {"heat": model.thermal, "softening": model.laws.depends_on_temperature or None}
    return frozenset(feature for feature, value in found.items() if value is not None)


def select(table: tuple[Dataset, ...], features: Set[str]) -> tuple[Dataset, ...]:
    """The rows of a table that a run with these features has, in order."""
    return tuple(row for row in table if row.only_with is None or row.only_with in features)


def names(table: tuple[Dataset, ...]) -> tuple[str, ...]:
    """Last parts of the paths of a table, in order."""
    return tuple(row.name for row in table)


def markdown(table: tuple[Dataset, ...]) -> str:
    """A table of the format documents: path, type, shape, unit, meaning, and since which version (in runs with which feature)."""
    lines = ["| path | type | shape | unit | meaning | since |", "|---|---|---|---|---|---|"]
    for row in table:
        shape = ", ".join(_DIM_SYMBOL[d] if isinstance(d, str) else str(d) for d in row.dims)
        since = ".".join(map(str, row.since)) + (f", {row.only_with}" if row.only_with else "")
        meaning = row.long_name.replace("|", "\\|")
        lines.append(f"| `{row.path}` | {row.dtype} | ({shape}) | {row.unit} | {meaning} | {since} |")
    return "\n".join(lines)


_DIM_SYMBOL: dict[str, str] = {
    "one": "1",
    "frame": "K",
    "frame_edge": "K+1",
    "particle_row": "P",
    "contact_row": "C",
    "series_row": "S",
    "grain": "n",
    "shape": "m",
    "wall": "w",
    "material": "k",
    "group": "g",
    "stage": "L",
    "table_edge": "T+1",
    "table_row": "R",
    "heat_grain": "n*",
    "heat_wall": "w*",
    "heat_book": "b*",
    "mean_row": "A",
}

"""What files say of a run's arrays, and its numbers: books, counters, sums between series rows.

A number is one entry here, and a line of the engine that keeps it (`engine.energy.account`,
`engine.heat.books`); checkpoints, the time series and the summary follow. New entries go to the end
of their table: their places in a state count.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Literal

# ---- What files say of arrays: type, shape, unit and meaning, beside the field that holds each

Dim = Literal[
    "one", "frame", "frame_edge", "particle_row", "contact_row", "rolling_row", "near_row",
    "series_row",
    "grain", "shape", "wall", "material", "group", "stage", "table_edge", "table_row",
    "heat_grain", "heat_wall", "heat_book", "mean_row", "stage_note", "origin_row", "surface_row",
    "ahead_row", "before_row", "outlet", "exchange_grain", "exchange_group", "exchange_outlet",
    "exchange_book", "bridge_row", "adhesion_book", "cell_grain", "gradient_book", "flux_book",
    "expansion_grain", "expansion_book", "point_row", "near_point_row", "late_row", "grain_edge",
    "piece", "piece_edge", "corner", "book", "tally", "window",
]  # fmt: skip
"""Named lengths. ``frame_edge`` is ``frame + 1``: row ``offset[k]:offset[k+1]`` belongs to frame
``k``. Those that begin with ``heat`` are 0 in states of runs without heat, those that begin with
``exchange`` where no grain comes or goes, with ``cell`` where there are walls, with ``gradient``
without a mean gradient of temperature, with ``flux`` in cells and without heat, and with
``expansion`` where no grain expands."""

Shape = tuple[Dim | int, ...]
"""Named lengths and numbers."""

Version = tuple[int, int]
"""Major and minor version of the file format."""

DType = Literal["f8", "float", "i8", "i4", "u1", "str"]
"""Stored types: ``float`` is f8 or f4 after ``output.precision``, ``str`` UTF-8 of fixed length."""

Feature = Literal[
    "heat", "softening", "adhesion", "rolling", "exchange", "surface", "groups", "motion", "range",
    "cell", "gradient", "flux", "flash", "expansion", "outlines",
]  # fmt: skip
"""What only some runs have: temperatures, friction that depends on them, adhesion, rolling
resistance, grains that come and go, walls whose surface runs, walls that only some groups meet,
motion at the start, adhesion with a range, a cell that is periodic in both directions, a mean
gradient of temperature in it, heat that flows between walls, friction that weakens by flash
heating, grains that expand, or shrink as they wear, and grains that are no discs."""

Export = Literal["vtk", "gsd"]
"""What shows a dataset of the frames besides CSV, which shows all: ParaView's view, GSD files."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """What files say of a quantity: a field of a dataclass, a number, or a dataset.

    Attributes:
        dtype: Stored type.
        dims: Shape; ``("one",)`` is a number.
        unit: SI unit, one per column (separated by commas) where they differ; ``1`` if
            dimensionless.
        meaning: What it is, in a sentence.
        columns: Names of its columns in tables, if it has several; others are not shown.
        exports: What shows it, besides CSV.
        only_with: Feature of the runs that have it, or None if all have it.
        since: Version of the file format in which it appeared.
    """

    dtype: DType
    dims: Shape
    unit: str
    meaning: str
    columns: tuple[str, ...] = ()
    exports: tuple[Export, ...] = ()
    only_with: Feature | None = None
    since: Version = (1, 0)


def stored(default: Any = MISSING, default_factory: Any = MISSING, **about: Any) -> Any:
    """A field of a dataclass with what files say of it."""
    metadata = {"stored": Stored(**about)}
    return field(default=default, default_factory=default_factory, metadata=metadata)


def stored_fields(cls: type) -> dict[str, Stored]:
    """What files say of the fields of a dataclass, by name, in the order of the fields."""
    return {f.name: f.metadata["stored"] for f in fields(cls)}


# ---- The numbers that a run keeps


@dataclass(frozen=True, kw_only=True)
class Entry(Stored):
    """A number that a run keeps, a row of the time series.

    Attributes:
        name: Its name in the program.
        series: Its name in the time series; None if it is not there.
        per_step: Whether the time series holds its mean over the steps of the window.
        summary: Its own key in the summary of a run, if any; see `multicor_cli.store.summarize`.
        label: What ``multicor info`` calls it, and adds to the number; None: it does not show it.
    """

    name: str
    series: str | None = None
    per_step: bool = False
    summary: str | None = None
    label: tuple[str, str] | None = None


def _entry(
    name: str, meaning: str, unit: str = "1", series: str | None = None, **more: Any
) -> Entry:
    said = {"dtype": "f8", "dims": ("series_row",), **more}
    return Entry(name=name, meaning=meaning, unit=unit, series=series, **said)


def _book(name: str, meaning: str, unit: str = "J") -> Entry:
    return _entry(name, meaning, unit, name)


def _heat(name: str, meaning: str, unit: str = "J", **more: Any) -> Entry:
    return _entry(name, meaning, unit, f"heat_{name}", **more)


BOOKS = (
    _book("kinetic", "kinetic energy of the free degrees of freedom"),
    _book("kinetic_start", "kinetic energy at the start of the run"),
    # on unwrapped displacements
    _book("gravity_work", "work of gravity since the start, position correction included"),
    _book("wall_work", "work done on the grains by prescribed wall velocities since the start"),
    # ΣF·Δq
    _book("load_work",
        "work of the loads on driven walls since the start, position correction included"),
    # −Σ p_t ½(u_t⁻+u_t⁺)
    _book("friction_loss", "energy lost to friction since the start, signed"),
    # −Σ p_n ½(u_n⁻+u_n⁺)
    _book("impact_loss", "energy lost to impacts since the start, signed"),
    # Σ c v̄² Δt
    _book("damping_loss", "energy lost in the damping of loads since the start"),
    # ΣF·δq of gravity and loads
    _book("correction_work", "energy moved by the projection of positions since the start"),
    # The rule of the paper
    _book("friction_sliding", "mu |u_t+| q_n summed since the start: the end-of-step rule"),
    # Contacts that gained energy
    _book("negative_loss", "negative part of friction_loss + impact_loss since the start"),
    _book("terms", "sum of the absolute terms of the energy balance since the start"),
    # The correction is among the losses
    _book("imbalance", "kinetic - kinetic_start - works + losses now"),
    _book("closure",
        "largest |imbalance| so far over terms, or over a small share of the kinetic energy where "
        "that is more", "1"),
)  # fmt: skip
"""The energy books, in the order of `State.books`."""

TALLIES = (
    _entry("sweeps", "sweep-equivalents of the contact solver, summed over steps"),
    _entry("unconverged_steps", "steps that hit the cap on sweeps"),
    _entry("residual_rms_max", "largest rms velocity correction of a step over u_ref"),
    _entry("residual_max_max", "largest velocity correction of a step over u_ref"),
    # at the end of a step
    _entry("max_overlap", "largest overlap over the smaller radius so far", series="max_overlap",
        summary="max_overlap", label=("largest overlap", " of the smaller radius")),
    _entry("corrected_steps", "steps so far after which positions were projected",
        series="corrected_steps", dtype="i8", summary="corrected_steps"),
    # the largest mean contact force of a step
    _entry("max_impulse_rate", "largest normal impulse over dt so far", "N",
        series="max_impulse_rate", summary="max_contact_force"),
)  # fmt: skip
"""Counters of a run, in the order of `State.tallies`."""

WINDOW = (
    _entry("duration", "length of the window since the row before; 0 in a row without steps", "s",
        series="window_duration"),
    _entry("steps", "steps in the window", series="window_steps", dtype="i8"),
    _entry("sweeps", "sweep-equivalents per step of the window; 0 in a row without steps",
        series="sweeps_mean", per_step=True),
    _entry("unconverged", "steps of the window that hit the cap on sweeps", series="unconverged",
        dtype="i8"),
    _entry("residual_rms", "largest rms velocity correction over u_ref in the window",
        series="residual_rms"),
    _entry("residual_max", "largest velocity correction over u_ref in the window",
        series="residual_max"),
    _entry("residual_energy", "largest energy residual G in the window", series="residual_energy"),
    _entry("contacts", "loaded contacts per step of the window", series="contacts_mean",
        per_step=True),
    # Σ p_a ℓ_b over grain–grain contacts, ℓ from j to i; the time series has its rate.
    *(_entry(f"virial_{a}{b}", f"sum of p_{a} l_{b} in the window", "J s")
        for a in "xy" for b in "xy"),
)  # fmt: skip
"""Sums kept between two rows of the time series, in the order of `State.window`."""

HEAT_BOOKS = (
    _heat("stored", "heat content of the grains since the start"),
    # by the rule in use
    _heat("friction", "heat of friction since the start"),
    _heat("impact", "heat of impacts since the start"),
    _heat("to_walls", "share of the heat of friction and impacts that went into the walls"),
    # conduction, gas, radiation
    _heat("from_walls", "heat that the walls gave to the grains since the start, signed"),
    _heat("from_ambient", "heat from the ambient fluid by convection since the start, signed"),
    _heat("from_surroundings", "heat from the surroundings by radiation since the start, signed"),
    # Step by step
    _heat("exchanged", "sum of the absolute exchanges with the outside since the start"),
    _heat("undelivered",
        "heat that walls of prescribed flow could not pass on: nothing touched them"),
    _heat("imbalance",
        "heat_stored - (friction + impact - to_walls + ahead + from_walls + ambient + "
        "surroundings + along_gradient) now"),
    _heat("closure", "largest |heat_imbalance| / (heat_exchanged + sum of C |T - T_0|) so far",
        "1"),
    _heat("sub_steps", "sub-steps of the heat integrator so far", "1", dtype="i8"),
    _entry("max_biot", "largest Biot number of a contact so far", series="max_biot"),
    _entry("solid_gas_min", "smallest k_s s/(k_f a) of a contact in the last step; 0 without gas",
        series="solid_gas_min"),
    _entry("solid_gas_max", "largest k_s s/(k_f a) of a contact in the last step; 0 without gas",
        series="solid_gas_max"),
    # or ½ Δt ΣH/C of a step of Euler's rule
    _entry("integration_error",
        "largest estimated error of temperatures in a sub-step so far, over their spread",
        series="heat_integration_error", since=(1, 4)),
    _heat("ahead",
        "heat that grains and walls have received beyond what their contacts have lost, now",
        since=(1, 6)),
    _entry("hottest_spot",
        "temperature of the hottest contact spot in the window, with the flash of its friction; 0 "
        "if none slides, or if the properties that it takes are not given", "K",
        series="hottest_spot", since=(1, 10)),
)  # fmt: skip
"""Heat books, in the order of `State.heat_books`; empty in runs without heat."""


def _exchange(name: str, meaning: str, unit: str = "1", **more: Any) -> Entry:
    return _entry(name, meaning, unit, name, since=(1, 2), **more)


def _grains(name: str, meaning: str) -> Entry:
    return _exchange(name, meaning, dtype="i8")


EXCHANGE_BOOKS = (
    _grains("waiting", "grains that wait for their release"),
    _grains("present", "grains that are there"),
    _grains("released", "releases since the start"),
    _grains("left", "grains that left through an outlet since the start, each time counted"),
    _grains("returned", "grains of these that went back to wait"),
    _grains("lost", "grains removed beyond the domain since the start"),
    _grains("behind", "releases that are due and found no room"),
    _exchange("mass_waiting", "mass of the grains that wait", "kg"),
    _exchange("mass_present", "mass of the grains that are there", "kg"),
    _exchange("mass_released", "mass released since the start", "kg"),
    _exchange("mass_left", "mass that left through outlets since the start", "kg"),
    _exchange("mass_returned", "mass of this that went back to wait", "kg"),
    _exchange("mass_lost", "mass removed beyond the domain since the start", "kg"),
    _exchange("mass_closure",
        "largest |waiting + present + left - returned + lost - all mass| over all mass so far"),
    _exchange("kinetic_in", "kinetic energy of the grains released since the start", "J"),
    _exchange("kinetic_out", "kinetic energy of the grains gone since the start", "J"),
    _exchange("potential_in",
        "their energy in the gravity of the domain, zero at the origin, where they were released",
        "J"),
    _exchange("potential_out",
        "their energy in the gravity of the domain, zero at the origin, where they went", "J"),
    _exchange("heat_out", "heat content that the grains gone have taken along since the start",
        "J"),
)  # fmt: skip
"""Books of grains that come and go, in the order of `State.exchange`; empty where none does."""


ADHESION_BOOKS = (
    # −Σ F Δt ½(u_n⁻+u_n⁺)
    _entry("adhesion_work",
        "work of adhesion on the motion since the start: less than 0 for what has been parted",
        "J", "adhesion_work", since=(1, 7)),
)  # fmt: skip
"""Books of adhesion, in the order of `State.adhesion_books`; empty where no pair has it."""


GROWTH_BOOKS = (
    # Σ p_n g, and what spins gain
    _entry("expansion_work",
        "work of the expansion of the grains against what presses on them, since the start", "J",
        "expansion_work", since=(1, 10)),
    _entry("worn_energy", "kinetic energy that what is worn off has taken along, since the start",
        "J", "worn_energy", since=(1, 10)),
)  # fmt: skip
"""Books of grains that expand or shrink, in the order of `State.growth_books`; else empty."""


_WAYS = {
    "contacts": "conducted by contacts",
    "gas": "conducted by the gas in the gaps",
    "radiation": "radiated between neighbors",
}


def _heat_along(axis: str) -> tuple[Entry, ...]:
    """Heat that has passed along an axis, per length of the plane across it, by what carried it."""
    return tuple(
        _entry(
            f"{name}_{axis}", f"heat {what} along {axis} since the start, per length of the plane",
            "J/m", f"heat_by_{name}_{axis}", since=(1, 9),
        )
        for name, what in {**_WAYS, "motion": "carried by grains beside the mean flow"}.items()
    )  # fmt: skip


def _heat_way(axis: str) -> tuple[Entry, ...]:
    """Heat times how far it has gone along an axis, by what carried it."""
    return tuple(
        _entry(
            f"{name}_{axis}", f"heat {what} since the start, times its way along {axis}",
            "J m", f"heat_way_by_{name}_{axis}", since=(1, 11),
        )
        for name, what in {**_WAYS, "motion": "carried by grains that move"}.items()
    )  # fmt: skip


GRADIENT_BOOKS = (
    # −Σ C G·Δs
    _heat("along_gradient",
        "heat that motion along the mean gradient has given to the grains since the start",
        since=(1, 9)),
    *_heat_along("x"),
    *_heat_along("y"),
)  # fmt: skip
"""Books of a cell with a mean gradient of temperature, in the order of `State.gradient_books`."""

FLUX_BOOKS = (*_heat_way("x"), *_heat_way("y"))
"""What has carried heat between walls, in the order of `State.flux_books`; empty in cells."""


NUMBERS = {
    "books": BOOKS,
    "tallies": TALLIES,
    "window": WINDOW,
    "heat_books": HEAT_BOOKS,
    "exchange": EXCHANGE_BOOKS,
    "adhesion_books": ADHESION_BOOKS,
    "gradient_books": GRADIENT_BOOKS,
    "flux_books": FLUX_BOOKS,
    "growth_books": GROWTH_BOOKS,
}
"""The tables of the numbers, by the array of `State` that holds them."""

NAMES = {field: tuple(entry.name for entry in table) for field, table in NUMBERS.items()}
"""Names of the entries of each array, in its order."""

BOOK_NAMES, TALLY_NAMES, WINDOW_NAMES, HEAT_BOOK_NAMES, EXCHANGE_NAMES, *_ = NAMES.values()


def entry_counts(version: Version | None = None) -> dict[str, int]:
    """Lengths of a state's ``books``, ``tallies`` and ``window`` by dims, in files of a version."""
    tables = {"book": BOOKS, "tally": TALLIES, "window": WINDOW}
    return {
        dim: len([e for e in table if version is None or e.since <= version])
        for dim, table in tables.items()
    }


COUNTS_LAST = tuple(sorted(TALLIES, key=lambda entry: entry.dtype == "i8"))
"""The tallies as files of format 1.0 have the counters of a run."""

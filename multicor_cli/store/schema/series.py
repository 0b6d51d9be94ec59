"""The time series: a row for every dataset.

A value of the moment is one more row here. The numbers that the engine keeps say themselves what they are (`model.books`).
"""

from __future__ import annotations

from collections.abc import Callable

from multicor_cli.model.books import (
    BOOKS,
    EXCHANGE_BOOKS,
    HEAT_BOOKS,
    TALLIES,
    WINDOW,
    DType,
    Entry,
    Feature,
    Shape,
    Version,
    measures_first,
)
from multicor_cli.store.moment import Moment
from multicor_cli.store.schema.rows import Dataset, Value


def _scalar(
    name: str,
    unit: str,
    long_name: str,
    value: Value,
    dtype: DType = "f8",
    *,
    only_with: Feature | None = None,
    since: Version = (1, 0),
) -> Dataset:
    return Dataset(f"series/{name}", dtype, ("series_row",), unit, long_name, value, only_with=only_with, since=since)


def _array(
    name: str,
    dims: Shape,
    unit: str,
    long_name: str,
    value: Value,
    columns: tuple[str, ...],
    *,
    only_with: Feature | None = None,
    since: Version = (1, 0),
) -> Dataset:
    path, shape = f"series/{name}", ("series_row", *dims)
    return Dataset(path, "f8", shape, unit, long_name, value, only_with=only_with, since=since, columns=columns)


def _kept(
    entries: tuple[Entry, ...], values: Callable[[Moment], dict[str, float]], only_with: Feature | None = None
) -> tuple[Dataset, ...]:
    """Rows of the numbers that the engine keeps, as far as they are in the time series."""

    def row(entry: Entry, series: str) -> Dataset:
        def value(moment: Moment) -> float:
            return moment.per_step(entry.name) if entry.per_step else values(moment)[entry.name]

        return _scalar(series, entry.unit, entry.meaning, value, entry.dtype, only_with=only_with, since=entry.since)

    return tuple(row(entry, entry.series) for entry in entries if entry.series is not None)


SERIES: tuple[Dataset, ...] = (
    _scalar("step", "1", "steps done since the start of the run", lambda m: m.state.step, "i8"),
    _scalar("time", "s", "time since the start of the run, the end of the window", lambda m: m.state.time),
    _scalar("stage", "1", "loading stage, a row of scenario/stages", lambda m: m.state.stage, "i4"),
    _scalar("strain", "1", "shear strain accumulated in this stage", lambda m: m.state.stage_strain),
    *_kept(BOOKS, lambda m: m.books),
    *_kept(measures_first(TALLIES), lambda m: m.tallies),
    *_kept(WINDOW, lambda m: m.window),
    _array(
        "virial_rate", (2, 2), "N m",
        "window mean of sum f_a l_b over grain-grain contacts, l from j to i; over an area: mean stress, compression positive",
        lambda m: m.rate(m.virial), ("virial_xx", "virial_xy", "virial_yx", "virial_yy"),
    ),
    _array(
        "wall_force", ("wall", 3), "N, N, N m", "window mean of the force and torque exerted by the grains on each wall",
        lambda m: m.rate(m.state.window_wall_impulse), ("force_x", "force_y", "torque"),
    ),
    _array(
        "wall_position", ("wall", 3), "m, m, rad", "reference point and angle of the wall",
        lambda m: m.state.wall_position, ("x", "y", "angle"),
    ),
    _array(
        "wall_velocity", ("wall", 3), "m/s, m/s, rad/s", "velocity and spin of the wall",
        lambda m: m.state.wall_velocity, ("velocity_x", "velocity_y", "spin"),
    ),
    _array(
        "wall_surface", ("wall",), "m/s", "velocity of the surface of the wall along it",
        lambda m: m.wall_surface, (), only_with="surface", since=(1, 3),
    ),
    *_kept(HEAT_BOOKS, lambda m: m.heat_books, "heat"),
    _scalar(
        "temperature_mean", "K", "mean temperature of the grains, weighted by heat capacity",
        lambda m: m.temperatures_here[0], only_with="heat",
    ),
    _scalar("temperature_min", "K", "lowest temperature of a grain", lambda m: m.temperatures_here[1], only_with="heat"),
    _scalar("temperature_max", "K", "highest temperature of a grain", lambda m: m.temperatures_here[2], only_with="heat"),
    _array(
        "wall_heat", ("wall", 2), "J", "heat given to the grains; heat of friction and impacts received",
        lambda m: m.state.wall_heat, ("heat_given", "heat_received"), only_with="heat",
    ),
    *_kept(EXCHANGE_BOOKS, lambda m: m.exchange, "exchange"),
    _array(
        "outlet_flow", ("outlet", 2), "1, kg", "grains and mass that left through each outlet since the start",
        lambda m: m.state.outlet_flow, ("grains", "mass"), only_with="exchange", since=(1, 2),
    ),
)  # fmt: skip
"""One row per point of the time series, which has its own, denser cadence than the frames."""

"""Which tables of `multicor post` give a number of a run, and how."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from multicor_cli.post import forces
from multicor_cli.post.energy import HEAT, MECHANICAL, energy
from multicor_cli.post.grain_map import grain_map
from multicor_cli.post.profile import profile
from multicor_cli.post.quantities import MAPPED, PROFILED, QUANTITIES
from multicor_cli.post.region import QUANTITIES as IN_REGION
from multicor_cli.post.region import in_region
from multicor_cli.post.rheology import QUANTITIES as OF_RHEOLOGY
from multicor_cli.post.rheology import rheology
from multicor_cli.post.source import Selection
from multicor_cli.post.theta_eta import theta_eta

if TYPE_CHECKING:
    from multicor_cli.store.reader import Run
    from multicor_cli.studies.schema import Observable


class Number(NamedTuple):
    """A number with its standard error; nan where it is not known."""

    value: float
    error: float = math.nan


class Unobservable(Exception):
    """An observable that a run does not have."""


@dataclass(frozen=True)
class Source:
    """A table that gives numbers.

    Attributes:
        names: Quantities that it has.
        take: The number of a quantity, from the frames after a time.
        of_heat: Those of them that only runs with heat have.
        is_of_one_frame: Whether it is about the last frame.
        needs_shear: Whether two walls have to shear the grains.
    """

    names: tuple[str, ...]
    take: Callable[[Run, Observable, Selection], Number]
    of_heat: frozenset[str] = frozenset()
    is_of_one_frame: bool = False
    needs_shear: bool = False


def _value(row: Observable) -> str:
    assert row.value is not None
    return row.value


def _rheology(run: Run, row: Observable, selection: Selection) -> Number:
    found = rheology(run, selection)
    return Number(found.mean[_value(row)], found.error[_value(row)])


def _region(run: Run, row: Observable, selection: Selection) -> Number:
    assert row.inside is not None
    found = in_region(run, row.inside.area(), selection)
    if row.value not in found.mean:
        raise Unobservable(f"the run has no {row.value}")
    return Number(found.mean[_value(row)], found.error[_value(row)])


def _profile(run: Run, row: Observable, selection: Selection) -> Number:
    found = profile(run, _value(row), selection, row.bins)
    k = _bin(found.y, found.width, row)
    return Number(float(found.value[k]), float(found.error[k]))


def _theta(run: Run, row: Observable, _selection: Selection) -> Number:
    found = theta_eta(run, bins=row.bins)
    k = _bin(found.center, 1.0 / found.center.size, row)
    return Number(
        float({"theta": found.mean, "standard_deviation": found.spread, "min": found.lowest, "max": found.highest}[_value(row)][k])
    )


def _bin(centers: np.ndarray[tuple[int], np.dtype[np.float64]], width: float, row: Observable) -> int:
    """The bin that holds the place of an observable."""
    assert row.at is not None
    k = int(np.abs(centers - row.at).argmin())
    if abs(float(centers[k]) - row.at) > 0.5001 * width:
        low, high = float(centers[0]) - 0.5 * width, float(centers[-1]) + 0.5 * width
        raise Unobservable(f"{row.at:g} lies outside of the profile, which goes from {low:.4g} to {high:.4g}")
    return k


def _map(run: Run, row: Observable, _selection: Selection) -> Number:
    values = grain_map(run, _value(row)).value
    values = values[np.isfinite(values)]
    if not values.size:
        raise Unobservable(f"no grain has a {row.value}")
    return Number(float(getattr(np, row.statistic or "mean")(values)))


_OF_NETWORK = forces.SUMMARY
_OF_DIRECTIONS = forces.MOMENTS


def _forces(run: Run, row: Observable, selection: Selection) -> Number:
    if row.value in _OF_NETWORK:
        return Number(float(forces.force_network(run).summary[_value(row)]))
    return Number(forces.angular_distribution(run, selection).moments[_value(row)])


_CLOSURES = ("energy_closure", "heat_closure")


def _energy(run: Run, row: Observable, _selection: Selection) -> Number:
    found = energy(run).as_dict()
    value = found[_value(row)] if row.value in _CLOSURES else found["end"].get(row.value)
    if value is None:
        raise Unobservable("the run has no heat")
    return Number(float(value))


_AMOUNTS = tuple(name for name, quantity in MAPPED.items() if quantity.names_of is None)
_HEAT_FIELDS = frozenset(name for name, quantity in QUANTITIES.items() if quantity.needs_heat)

SOURCES: dict[str, Source] = {
    "rheology": Source(tuple(row.name for row in OF_RHEOLOGY), _rheology, needs_shear=True),
    "region": Source(IN_REGION, _region, frozenset({"temperature"})),
    "profile": Source(tuple(PROFILED), _profile, _HEAT_FIELDS),
    "theta-eta": Source(
        ("theta", "standard_deviation", "min", "max"), _theta,
        frozenset({"theta", "standard_deviation", "min", "max"}), is_of_one_frame=True,
    ),
    "map": Source(_AMOUNTS, _map, _HEAT_FIELDS, is_of_one_frame=True),
    "forces": Source((*_OF_NETWORK, *_OF_DIRECTIONS), _forces),
    "energy": Source(
        (*(line.name for line in (*MECHANICAL, *HEAT)), *_CLOSURES), _energy,
        frozenset({*(line.name for line in HEAT), "heat_closure"}), is_of_one_frame=True,
    ),
}  # fmt: skip
"""By name of the command."""

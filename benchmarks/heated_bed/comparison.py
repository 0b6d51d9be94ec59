"""θ against η of the deposited bed and of the lattice, in vacuum and in air."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from deposited import AIR_CONDUCTIVITY, Bed
from lattice_bed import Floats, Profile, heat_lattice
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.post import ThetaTable, theta_eta

ETA = (0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2)


@dataclass(frozen=True)
class Beds:
    """Both beds at the end, in vacuum and in air.

    Attributes:
        vacuum: Deposited.
        air: Deposited.
        lattice_vacuum: Perfect lattice.
        lattice_air: Perfect lattice.
    """

    vacuum: ThetaTable
    air: ThetaTable
    lattice_vacuum: Profile
    lattice_air: Profile


@dataclass(frozen=True)
class ProfileRow:
    """θ at one η; spreads are standard deviations among the grains of a bin one diameter wide."""

    eta: float
    lattice_vacuum: float
    vacuum: float
    vacuum_spread: float
    lattice_air: float
    air: float
    air_spread: float


class _Frame(NamedTuple):
    position: Floats
    temperature: Floats
    wall_temperature: Floats
    wall_position: Floats


@dataclass(frozen=True)
class _Frames:
    cold: _Frame
    hot: _Frame
    time: Floats
    stage: NDArray[np.int64]

    def __getitem__(self, index: int) -> _Frame:
        return (self.cold, self.hot)[index]


def compare_beds(bed: Bed, vacuum: Floats, air: Floats) -> Beds:
    """The four profiles; ``vacuum`` and ``air`` are temperatures of the grains [K], shape
    ``(n,)``.
    """
    return Beds(
        profile_of(bed, vacuum),
        profile_of(bed, air),
        heat_lattice(bed.sphere, bed.duration),
        heat_lattice(bed.sphere, bed.duration, AIR_CONDUCTIVITY),
    )


def profile_of(bed: Bed, temperature: Floats) -> ThetaTable:
    """What ``multicor post theta-eta`` makes of these temperatures of the frozen bed [K]."""
    model: Model = bed.model
    walls = np.where(np.array(model.walls.names) == "floor", bed.hot, np.nan)
    frames = [
        _Frame(bed.state.position[:, :2], values, walls, bed.state.wall_position)
        for values in (np.full(temperature.size, bed.reference), temperature)
    ]
    source: Any = SimpleNamespace(
        model=model, frames=_Frames(*frames, np.array([0.0, bed.duration]), np.zeros(2, np.int64))
    )
    return theta_eta(source)


def tabulate(beds: Beds) -> list[ProfileRow]:
    """θ at the η of `ETA`: of the lattice between rows, of the deposited bed between bins,
    linear.
    """
    eta = np.array(ETA)
    columns = [
        eta,
        beds.lattice_vacuum.at(eta),
        *_between_bins(beds.vacuum, eta),
        beds.lattice_air.at(eta),
        *_between_bins(beds.air, eta),
    ]
    return [ProfileRow(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _between_bins(table: ThetaTable, eta: Floats) -> tuple[Floats, Floats]:
    known = np.isfinite(table.mean)
    center = table.center[known]
    return np.interp(eta, center, table.mean[known]), np.interp(eta, center, table.spread[known])

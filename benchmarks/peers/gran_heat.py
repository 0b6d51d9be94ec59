"""Conduction through a frozen bed in LAMMPS and LIGGGHTS: no integrator moves the grains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from case import Floats
from gran import Bodies, Dialect, read_dump, run_script, write_bodies
from process import printed_by

_SPRING = 1.0  # N/m: any; nothing moves
_LIGGGHTS_FACTOR = math.sqrt(2.0 * math.pi)


@dataclass(frozen=True)
class FrozenBed:
    """Grains that overlap by the overlaps of Hertz' law, on a hot floor at y = 0.

    Attributes:
        position: Centers [m], shape ``(n, 2)``.
        radius: Radii [m], shape ``(n,)``.
        capacity: Heat capacities [J/K], shape ``(n,)``.
        specific: Specific heat capacity [J/(kg K)].
        conductivity: λ [W/(m K)].
        period: Period in x [m].
        cold: Temperature of the grains at the start [K].
        hot: Temperature of the floor [K].
        duration: Time of heating [s].
        stable: Smallest C/ΣH of a grain [s]; explicit steps are stable up to it, whatever the
            packing.
    """

    position: Floats
    radius: Floats
    capacity: Floats
    specific: float
    conductivity: float
    period: float
    cold: float
    hot: float
    duration: float
    stable: float


@dataclass(frozen=True)
class PeerHeat:
    """Time of the steps [s], their number, and the temperatures at the end [K], shape ``(n,)``."""

    seconds: float
    steps: int
    temperature: Floats


def law_of(dialect: Dialect) -> str:
    """What the program takes for a contact, and how it is made to take 2 λ a."""
    if dialect.name == "lammps":
        return "H = 2 λ a with a = √(δ R*), `heat radius`"
    return (
        f"H = 2 λ √A with A = 2 π δ R*, which is {_LIGGGHTS_FACTOR:.3f} × 2 λ a: λ is given "
        "smaller by that factor"
    )


def can_heat(dialect: Dialect, program: str) -> bool:
    """Whether the program knows conduction; LAMMPS does since 2022."""
    wanted = "heat/flow" if dialect.name == "lammps" else "heat/gran/conduction"
    return wanted in printed_by([program, "-help"])


def heat_peer(dialect: Dialect, program: str, cores: int, bed: FrozenBed, folder: Path) -> PeerHeat:
    """Heat the bed with the largest explicit step that is stable."""
    steps = math.ceil(bed.duration / bed.stable)
    n = len(bed.radius)
    mass = bed.capacity / bed.specific
    density = mass / (4.0 / 3.0 * math.pi * bed.radius**3)
    top = float(bed.position[:, 1].max()) + 4.0 * float(bed.radius.max())
    box = ((0.0, -2.0 * float(bed.radius.max())), (bed.period, top))
    write_bodies(
        folder / "grains.data", Bodies(bed.position, np.zeros((n, 3)), bed.radius, density, *box)
    )
    say = _lammps if dialect.name == "lammps" else _liggghts
    column = "c_Temp" if dialect.name == "lammps" else "f_Temp"
    lines = [
        "units si", *dialect.begin, "atom_modify map array sort 0 0", "boundary p f f",
        "newton off", f"processors {cores} 1 1",
        *say(bed), "neigh_modify delay 0 every 1 check yes", f"timestep {bed.duration / steps!r}",
        "thermo 1000000000",
        f"run {steps}", f"dump seen all custom 1 seen.txt id {column}",
        f"dump_modify seen {dialect.dump_format(1)}", "run 0",
    ]  # fmt: skip
    loops = run_script(dialect, program, lines, folder, cores)
    return PeerHeat(loops[0].seconds, loops[0].steps, read_dump(folder / "seen.txt", 1)[-1, :, 0])


def _lammps(bed: FrozenBed) -> list[str]:
    law = (
        f"hooke {_SPRING!r} 0.0 tangential linear_nohistory 0.0 0.0 damping mass_velocity heat "
        f"radius {bed.conductivity!r}"
    )
    return [
        "fix more all property/atom temperature heatflow", "read_data grains.data",
        f"set group all temperature {bed.cold!r}", "pair_style granular", f"pair_coeff * * {law}",
        _skin(bed),
        f"fix warm all heat/flow constant {bed.specific!r}",
        "compute Temp all property/atom temperature",
        f"fix floor all wall/gran granular {law} yplane 0.0 NULL temperature {bed.hot!r}",
    ]  # fmt: skip


def _liggghts(bed: FrozenBed) -> list[str]:
    values = {"kn": _SPRING, "kt": 0.0, "gamman": 0.0, "gammat": 0.0, "coefficientFriction": 0.0}
    thermal = {
        "thermalConductivity": bed.conductivity / _LIGGGHTS_FACTOR,
        "thermalCapacity": bed.specific,
    }
    return [
        "read_data grains.data", _skin(bed),
        *(f"fix {name} all property/global {name} peratomtypepair 1 {value!r}" for name,
            value in values.items()),
        *(f"fix {name} all property/global {name} peratomtype {value!r}" for name,
            value in thermal.items()),
        "pair_style gran model hooke/stiffness tangential no_history", "pair_coeff * *",
        ("fix floor all wall/gran model hooke/stiffness tangential no_history primitive type 1 "
            f"yplane 0.0 temperature {bed.hot!r}"),
        f"fix warm all heat/gran/conduction initial_temperature {bed.cold!r}",
    ]  # fmt: skip


def _skin(bed: FrozenBed) -> str:
    return f"neighbor {0.05 * float(bed.radius.max())!r} bin"

"""Conduction through a frozen bed, heated from its floor: the same grains, contacts and
conductances for all codes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from case import Floats, Ints
from gran_heat import FrozenBed, can_heat, heat_peer, law_of
from measure import near_pairs
from ours import Start
from peers import GranPeer
from table import draw, spread

from multicor_cli.bench.scenes import SCENES
from multicor_cli.engine import Engine, Orders
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant
from multicor_cli.model import HEAT_BOOK_NAMES, Model, State

GROWTH = 1e-3
"""All radii grow by this share, so that soft and rigid grains have the same contacts: those that
overlap then."""

DURATION = 1800.0
"""Time of heating [s]."""

COLD, HOT = 300.0, 350.0
"""Temperatures of the grains at the start, and of the floor [K]."""

_REFERENCE = 1e-8
_FINER = 8.0
_PART = ", Δt/"  # in the names of those with a finer step


@dataclass
class HeatColumn:
    """One code: name, law of a contact, times by round [s], steps, temperatures at the end [K]."""

    name: str
    law: str
    seconds: list[float]
    steps: int
    temperature: Floats


@dataclass(frozen=True)
class Heating:
    """What was found: codes, ours first; the exact temperatures of the network [K]; the bed;
    notes.
    """

    columns: list[HeatColumn]
    exact: Floats
    bed: FrozenBed
    notes: list[str]


class GrownBed:
    """The bed of the program with grown radii, its contacts under the forces that Hertz' law gives
    for their overlaps.
    """

    def __init__(self, start: Start) -> None:
        """Grow the grains of a settled bed.

        Args:
            start: The bed.
        """
        grains = start.model.grains
        self._model: Model = replace(
            start.model, grains=replace(grains, radius=grains.radius * (1.0 + GROWTH))
        )
        self._settings: HeatSettings = start.heat_settings()
        self._position = start.state.position.copy()
        self._pair, self._force, self._spot = self._contacts()

    def state(self) -> State:
        """A cold state of it."""
        state = State.at_rest(self._model, self._position)
        state.contact_i, state.contact_j = (
            self._pair[:, 0].astype(np.int32),
            self._pair[:, 1].astype(np.int32),
        )
        state.contact_impulse = np.column_stack([self._force, np.zeros_like(self._force)])
        state.last_dt = 1.0
        return state

    def _contacts(self) -> tuple[Ints, Floats, Floats]:
        """Pairs that overlap, the floor being the first shape after the grains; forces [N] and
        contact radii [m].
        """
        radius = self._model.grains.radius
        pair, gap = near_pairs(self._position[:, :2], radius, self._model.period, 0.0)
        reduced = (
            radius[pair[:, 0]] * radius[pair[:, 1]] / (radius[pair[:, 0]] + radius[pair[:, 1]])
        )
        low = np.flatnonzero(self._position[:, 1] < radius)
        pair = np.concatenate(
            [np.sort(pair, axis=1), np.column_stack([low, np.full_like(low, len(radius))])]
        )
        overlap = np.concatenate([-gap, radius[low] - self._position[low, 1]])
        reduced = np.concatenate([reduced, radius[low]])
        order = np.lexsort((pair[:, 1], pair[:, 0]))
        spot = np.sqrt(overlap * reduced)
        force = 4.0 / 3.0 * float(self._settings.laws.modulus[0, 0]) * spot**3 / reduced
        return pair[order], force[order], spot[order]

    def bed(self) -> FrozenBed:
        """What the others see."""
        assert self._model.thermal is not None
        capacity = self._model.thermal.capacity
        conductivity = float(self._settings.laws.conductivity[0])
        flow = np.zeros(len(capacity) + 1)
        for column in (0, 1):
            np.add.at(flow, self._pair[:, column], 2.0 * conductivity * self._spot)
        specific = float(capacity[0] / self._model.grains.mass[0])
        radius, stable = self._model.grains.radius, float((capacity / flow[:-1]).min())
        return FrozenBed(
            self._position[:, :2],
            radius,
            capacity,
            specific,
            conductivity,
            self._model.period,
            COLD,
            HOT,
            DURATION,
            stable,
        )

    def heat(self, tolerance: float | None = None) -> tuple[float, int, Floats]:
        """Heat it in the program: time [s], sub-steps, temperatures [K]; ``tolerance`` replaces the
        default.
        """
        state = self.state()
        settings = (
            self._settings if tolerance is None else replace(self._settings, tolerance=tolerance)
        )
        begin = time.perf_counter()
        engine = Engine(self._model, state, heat=settings)
        engine.resume(Orders(conditions=[WallHeat("temperature", Constant(HOT))], is_frozen=True))
        engine.step(DURATION, 0.0)
        seconds = time.perf_counter() - begin
        assert self._model.thermal is not None
        return seconds, sub_steps_of(state), state.temperature(self._model.thermal)


def sub_steps_of(state: State) -> int:
    """Sub-steps of the integrator since the start."""
    return round(float(state.heat_books[HEAT_BOOK_NAMES.index("sub_steps")]))


def compare_heat(
    grains: int,
    rounds: int,
    cores: int,
    peers: Sequence[GranPeer],
    folder: Path,
    say: Callable[[str], None],
) -> Heating:
    """Heat the bed in all codes that can.

    Args:
        grains: Number of grains.
        rounds: Number of rounds.
        cores: Threads and ranks.
        peers: The other codes.
        folder: Where they work.
        say: Is told what is being done.
    """
    say("our bed comes to rest")
    grown = GrownBed(Start(SCENES["heated-bed"], grains, threads=cores))
    grown.heat()  # compiles
    bed = grown.bed()
    able = [peer for peer in peers if can_heat(peer.dialect, peer.program)]
    notes = [
        f"{peer.name} is left out: this version does not conduct heat"
        for peer in peers
        if peer not in able
    ]
    columns = [HeatColumn("multicor", "H = 2 λ a, Hertz, implicit", [], 0, np.empty(0))]
    finer = replace(bed, stable=bed.stable / _FINER)
    for peer in able:
        columns += [
            HeatColumn(f"{peer.name}{more}", law_of(peer.dialect), [], 0, np.empty(0))
            for more in ("", f"{_PART}{_FINER:g}")
        ]
    for round_ in range(rounds):
        say(f"round {round_ + 1}")
        seconds, columns[0].steps, columns[0].temperature = grown.heat()
        columns[0].seconds.append(seconds)
        for k, peer in enumerate(able):
            for column, frozen in zip(columns[1 + 2 * k : 3 + 2 * k], (bed, finer), strict=True):
                found = heat_peer(peer.dialect, peer.program, cores, frozen, folder)
                column.seconds.append(found.seconds)
                column.steps, column.temperature = found.steps, found.temperature
    return Heating(columns, grown.heat(_REFERENCE)[2], bed, notes)


def taken_up(bed: FrozenBed, temperature: Floats) -> float:
    """Heat that the grains have taken up [J]."""
    return float(((temperature - bed.cold) * bed.capacity).sum())


def as_text(found: Heating) -> str:
    """The result as a table with notes."""
    bed, ours = found.bed, found.columns[0]
    headings = (
        "code",
        "s",
        "ratio",
        "steps",
        "heat [J]",
        "of ours",
        "mean T [K]",
        "largest error of θ",
    )
    rows = []
    for c in found.columns:
        error = float(np.abs(c.temperature - found.exact).max() / (bed.hot - bed.cold))
        heat = taken_up(bed, c.temperature)
        ratio = spread([b / a for a, b in zip(ours.seconds, c.seconds, strict=True)])
        rows.append(
            [c.name, spread(c.seconds), ratio, f"{c.steps}", f"{heat:.5g}",
                f"{heat / taken_up(bed, ours.temperature) - 1.0:+.1e}",
             f"{c.temperature.mean():.4f}", f"{error:.1e}"]
        )  # fmt: skip
    head = (
        f"{len(bed.radius)} grains, {bed.duration:g} s of heating; explicit step of the others: "
        f"smallest C/ΣH = {bed.stable:.3g} s"
    )
    laws = [f"{c.name}: {c.law}" for c in found.columns if _PART not in c.name]
    reference = f"θ is compared with our implicit integrator at {_REFERENCE:g}"
    return "\n".join([head, "", draw(headings, rows), "", reference, *laws, *found.notes])


def as_json(found: Heating) -> dict[str, Any]:
    """The result as JSON types."""
    bed = found.bed
    codes = [
        {
            "name": c.name,
            "seconds": c.seconds,
            "steps": c.steps,
            "heat": taken_up(bed, c.temperature),
            "mean_temperature": float(c.temperature.mean()),
            "error": float(np.abs(c.temperature - found.exact).max() / (bed.hot - bed.cold)),
        }
        for c in found.columns
    ]
    return {
        "grains": len(bed.radius),
        "duration": bed.duration,
        "codes": codes,
        "notes": found.notes,
    }

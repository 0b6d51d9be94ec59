"""Heating the same frozen bed again and again: with another gas, tolerance or integrator, and with
a clock.
"""

from __future__ import annotations

import itertools
import statistics
import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from deposited import Bed
from lattice_bed import Floats

from multicor_cli.engine import Engine, Orders
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.model import HEAT_BOOK_NAMES, State

REPEATS = 5
REFERENCE = 1e-8
TOLERANCES = (1e-3, 1e-4, 1e-5)


@dataclass(frozen=True)
class Heated:
    """The bed at the end of the heating.

    Attributes:
        temperature: Temperatures of the grains [K], shape ``(n,)``.
        sub_steps: Sub-steps of the integrator.
        closure: Relative error of the first law.
        gas_ratio: Smallest and largest λ_s s/(λ_f a) of a contact; 0 without gas.
        seconds: Time that the heating took, without compilation.
    """

    temperature: Floats
    sub_steps: int
    closure: float
    gas_ratio: tuple[float, float]
    seconds: float


@dataclass(frozen=True)
class Accuracy:
    """One way to integrate.

    Attributes:
        integrator: ``implicit`` or ``explicit``.
        tolerance: Its tolerance.
        is_default: Whether it is what the scenario takes.
        sub_steps: Sub-steps.
        seconds: Median time.
        fastest: Shortest time, which other work on the machine disturbs least.
        error: Largest |θ − θ_reference| of a grain.
        rms: Root mean square of it.
    """

    integrator: Literal["implicit", "explicit"]
    tolerance: float
    is_default: bool
    sub_steps: int
    seconds: float
    fastest: float
    error: float
    rms: float


def heat_bed(bed: Bed, settings: HeatSettings) -> Heated:
    """Heat the frozen bed from its start temperature as its scenario does, frame by frame."""
    thermal = bed.model.thermal
    assert thermal is not None
    state = _cold(bed)
    started = time.perf_counter()
    engine = Engine(bed.model, state, heat=settings)
    engine.resume(Orders(conditions=bed.conditions, is_frozen=True))
    for k in range(round(bed.duration / bed.interval)):
        engine.step(bed.interval, k * bed.interval)
    seconds = time.perf_counter() - started
    books = dict(zip(HEAT_BOOK_NAMES, state.heat_books.tolist(), strict=True))
    ratio = (books["solid_gas_min"], books["solid_gas_max"])
    return Heated(
        state.temperature(thermal), round(books["sub_steps"]), books["closure"], ratio, seconds
    )


def _cold(bed: Bed) -> State:
    """The state of the frozen bed before any heat has flowed."""
    state = State.from_dict({name: value.copy() for name, value in bed.state.as_dict().items()})
    for name in ("heat", "generated", "wear", "wall_heat", "wall_wear", "heat_books"):
        getattr(state, name)[...] = 0.0
    state.heat_dt = 0.0
    return state


def compare_integrators(bed: Bed) -> list[Accuracy]:
    """Error and time of tolerances and integrators against the implicit one at a very small
    tolerance.
    """
    reference = heat_bed(bed, replace(bed.settings, integrator="implicit", tolerance=REFERENCE))
    rows = []
    for integrator, tolerance in itertools.product(("implicit", "explicit"), TOLERANCES):
        settings = replace(bed.settings, integrator=integrator, tolerance=tolerance)
        runs = [heat_bed(bed, settings) for _ in range(REPEATS)]
        difference = (runs[0].temperature - reference.temperature) / (bed.hot - bed.reference)
        rows.append(
            Accuracy(
                integrator,
                tolerance,
                is_default=integrator == "implicit" and tolerance == bed.settings.tolerance,
                sub_steps=runs[0].sub_steps,
                seconds=statistics.median(run.seconds for run in runs),
                fastest=min(run.seconds for run in runs),
                error=float(np.abs(difference).max()),
                rms=float(np.sqrt((difference**2).mean())),
            )
        )
    return rows

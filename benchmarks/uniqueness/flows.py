"""Plane shear and a collapse, each packing with plain sweeps, with accelerated ones, and with these
from a nudged start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from driving import Driven, begin
from samples import Sample, Shift, sample, shift
from scenes import DIAMETER, RATES, collapse, column_width, shear

from multicor_cli.engine.orders import Method

WAYS: dict[str, tuple[Method, bool]] = {
    "accelerated": ("accelerated", False),
    "plain": ("gauss-seidel", False),
    "nudged": ("accelerated", True),
    "plain, nudged": ("gauss-seidel", True),
}
"""Method, and whether positions are moved by an ulp first."""

CONTRASTS = {
    "method": (("plain", "plain, nudged"), ("accelerated", "nudged")),
    "nudge": (("nudged", "plain, nudged"), ("accelerated", "plain")),
}
"""What is compared, seed by seed: the mean of the first two ways less that of the others. Each
contrast has two runs of either side of the other: if the method does no more than the nudge, both
scatter alike around 0."""


@dataclass(frozen=True)
class Flow:
    """A flow that is measured.

    Attributes:
        name: Name in the tables.
        text: Scenario of a seed.
        measure: Carries it out and returns its numbers by name.
        packings: How many for each seed that is asked for: what scatters much and costs little
            takes more.
    """

    name: str
    text: Callable[[int], str]
    measure: Callable[[Driven], dict[str, float]]
    packings: int = 1


@dataclass
class Comparison:
    """One flow.

    Attributes:
        flow: Its name.
        seeds: Number of packings.
        values: Values by quantity and way, one for each seed.
        steps: Steps by way, all seeds together.
        unconverged: Steps that missed the tolerances, by way.
    """

    flow: str
    seeds: int
    values: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    steps: dict[str, int] = field(default_factory=lambda: dict.fromkeys(WAYS, 0))
    unconverged: dict[str, int] = field(default_factory=lambda: dict.fromkeys(WAYS, 0))

    def sample(self, quantity: str, way: str) -> Sample:
        """Mean over the seeds."""
        return sample(self.values[quantity][way])

    def shift(self, quantity: str, contrast: str) -> Shift:
        """Differences of a contrast."""
        first, second = (
            np.mean([self.values[quantity][way] for way in ways], axis=0)
            for ways in CONTRASTS[contrast]
        )
        return shift(first, second)


def shear_flow(
    count: int, inertial: float, transient: float, strain: float, tolerance: float
) -> Flow:
    """Plane shear at a nominal inertial number; strains of the part that is left out and of the
    part that counts.
    """
    steady = transient / RATES[inertial]

    def measure(driven: Driven) -> dict[str, float]:
        return _measure_shear(driven, steady, RATES[inertial])

    name = f"shear, I = {inertial:g}, tolerance {tolerance:g}"
    return Flow(
        name, lambda seed: shear(count, seed, inertial, transient + strain, tolerance), measure
    )


def collapse_flow(
    count: int, settle: float, spread: float, tolerance: float, packings: int = 1
) -> Flow:
    """Collapse of a column, from the fall into the gate to rest on the floor; ``packings`` as in
    `Flow`.
    """
    name = f"collapse, tolerance {tolerance:g}"
    return Flow(
        name,
        lambda seed: collapse(count, seed, settle, spread, tolerance),
        _measure_collapse,
        packings,
    )


def _measure_shear(driven: Driven, steady: float, rate: float) -> dict[str, float]:
    """Averages over the steps after the time ``steady`` [s]."""
    model = driven.model
    area = np.pi * float((model.grains.radius**2).sum())
    bottom, top = (model.walls.names.index(name) for name in ("bottom", "top"))
    rows: list[tuple[float, float, float, float]] = []

    def look(now: Driven) -> None:
        state = now.state
        if state.time <= steady:
            state.window_wall_impulse[:] = 0.0
            return
        height = state.wall_position[top, 1] - state.wall_position[bottom, 1] - DIAMETER
        solid = area / (model.period * height)
        heat = float((state.velocity[:, 1] ** 2).mean()) / (rate * DIAMETER) ** 2
        rows.append((solid, heat, float(state.velocity[:, 2].mean()) / rate, height))

    driven.run(look)
    shear_impulse, load_impulse = driven.state.window_wall_impulse[top, :2]
    solid, heat, spin, _ = np.mean(rows, axis=0)
    return {
        "μ*": float(abs(shear_impulse) / abs(load_impulse)), "solid fraction": float(solid),
        "δv_y²/(γ̇d)²": float(heat), "spin/γ̇": float(spin),
    }  # fmt: skip


def _measure_collapse(driven: Driven) -> dict[str, float]:
    """Where the grains are in the end, in units of the width of the column."""
    width = column_width(driven.model.grain_count)
    driven.run()
    x, y = driven.state.position[:, 0], driven.state.position[:, 1] + driven.model.grains.radius
    at_wall = x < 4.0 * DIAMETER
    return {
        "run-out (95 % of x)": float(np.quantile(x, 0.95)) / width,
        "mean x": float(x.mean()) / width,
        "height at the wall": float(y[at_wall].max()) / width,
        "mean y": float(driven.state.position[:, 1].mean()) / width,
    }  # fmt: skip


def compare(flow: Flow, seeds: int, say: Callable[[str], None], first: int = 1) -> Comparison:
    """Run a flow in all ways with n seeds from the first on."""
    result = Comparison(flow.name, seeds)
    for seed in range(first, first + seeds):
        for way, (method, is_nudged) in WAYS.items():
            say(f"{flow.name}, seed {seed}, {way}")
            driven = begin(flow.text(seed), method, nudge=1000 + seed if is_nudged else None)
            for quantity, value in flow.measure(driven).items():
                result.values.setdefault(quantity, {name: [] for name in WAYS})[way].append(value)
            result.steps[way] += driven.steps
            result.unconverged[way] += driven.unconverged
    return result

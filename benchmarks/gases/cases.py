"""Gases of discs in a box: the same start for multicor and for the reference."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import thread_time

import numpy as np
from reference import simulate

from multicor_cli.engine import Engine
from multicor_cli.model import (
    ContactLaws,
    Grains,
    Model,
    ShapeKind,
    State,
    Walls,
    WallShapes,
)

DISC = 2.0
"""m a²/I."""


@dataclass(frozen=True)
class Gas:
    """Discs with an area fraction in a square box, whose rms speed is 1 m/s at first.

    Radii are 1 mm, uniformly ± 20 %.
    """

    count: int
    fraction: float
    restitution: float
    friction: float
    seed: int
    radius: np.ndarray = field(init=False)
    place: np.ndarray = field(init=False)
    velocity: np.ndarray = field(init=False)
    width: float = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        radius = 1e-3 * rng.uniform(0.8, 1.2, self.count)
        width = float(np.sqrt(np.pi * (radius**2).sum() / self.fraction))
        rows = int(np.ceil(np.sqrt(self.count)))
        cell = width / rows
        if cell <= 2.0 * radius.max():
            raise ValueError("these discs do not fit on a square lattice: a lower fraction")
        where = rng.permutation(rows * rows)[: self.count]
        place = cell * (np.column_stack([where % rows, where // rows]) + 0.5)
        velocity = rng.normal(size=(self.count, 2))
        velocity /= np.sqrt((velocity**2).sum(axis=1).mean())
        # Some ten impacts of each without losses: no lattice is left
        still, mass = np.zeros(self.count), np.pi * radius**2
        simulate(
            place, velocity, still, radius, mass, np.array([width, width]), np.zeros(2), 1.0, 0.0,
            DISC, 10.0 * cell,
        )  # fmt: skip
        for name, value in vars().copy().items():
            if name in ("radius", "place", "velocity", "width"):
                object.__setattr__(self, name, value)


def energy_of_reference(gas: Gas, duration: float) -> tuple[float, int]:
    """Kinetic energy after a duration [s] over the first, and the number of impacts."""
    mass = np.pi * gas.radius**2
    place, velocity, surface = gas.place.copy(), gas.velocity.copy(), np.zeros(gas.count)
    impacts = simulate(
        place, velocity, surface, gas.radius, mass, np.full(2, gas.width), np.zeros(2),
        gas.restitution, gas.friction, DISC, duration,
    )  # fmt: skip
    kinetic = mass @ ((velocity**2).sum(axis=1) + surface**2 / DISC)
    return float(kinetic / (mass @ (gas.velocity**2).sum(axis=1))), impacts


def engine_of(gas: Gas) -> Engine:
    """An engine with the discs of a gas in its box."""
    w, zero = gas.width, np.zeros(gas.count, np.int32)
    mass = np.pi * gas.radius**2
    grains = Grains(gas.radius, mass, mass * gas.radius**2 / DISC, zero, zero.copy())
    sides = [(0.0, 0.0, 1.0, 0.0), (w, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, w, 0.0, -1.0)]
    shapes = WallShapes(
        np.full(4, ShapeKind.PLANE, np.int32), np.zeros(4, np.int32), np.array(sides),
        np.zeros(4, np.int32),
    )  # fmt: skip
    one, none = np.ones((1, 1)), np.empty(0)
    laws = ContactLaws(
        gas.friction * one, gas.restitution * one, np.full((1, 1), -1, np.int32),
        np.zeros(1, np.int32), none, none,
    )  # fmt: skip
    walls = Walls(("box",), *(np.full(1, v) for v in (np.nan, np.nan, False, 1.0)))
    model = Model(grains, shapes, walls, laws, ("steel",), ("discs",), 0.0, np.zeros(2), DISC)
    state = State.at_rest(model, gas.place)
    state.velocity[:, :2] = gas.velocity
    return Engine(model, state, threads=1)


def energy_of_multicor(gas: Gas, duration: float, way: float) -> tuple[float, float]:
    """The same as `energy_of_reference` with steps in which 1 m/s leads over ``way`` d̄.

    Returns the energy, and milliseconds of CPU per step.
    """
    engine = engine_of(gas)
    steps = max(1, round(duration / (way * 2e-3)))
    dt = duration / steps
    engine.step(dt, 0.0)
    began = thread_time()
    for step in range(1, steps):
        engine.step(dt, step * dt)
    spent = thread_time() - began
    books = engine.state.named("books")
    return float(books["kinetic"] / books["kinetic_start"]), 1e3 * spent / max(1, steps - 1)

"""What a time step does to impacts: groups of two, three and seven discs, far from each other, with
steps of several lengths.

    python benchmarks/time_step/impacts.py

Every group starts anew, so that nothing but the order of the error in Δt is at work. The kinetic
energy that is left and the spread of the groups are compared with those of a much smaller step.
Speeds and diameters are about 1: Δt is the distance per step over d.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from multicor_cli.engine import Engine, Orders, Settings
from multicor_cli.model import ContactLaws, Grains, Model, State, Walls, WallShapes
from multicor_cli.model.model import Floats

REFERENCE = 1.0 / 320.0
STEPS = (1.0 / 80.0, 1.0 / 40.0, 1.0 / 20.0, 1.0 / 10.0, 1.0 / 5.0)
TIGHT = Settings(tolerance_rms=1e-6, tolerance_max=1e-5, tolerance_energy=1e-6, max_sweeps=3000)
FRICTIONS = (0.0, 0.8)
GROUPS, COLUMNS, APART = 512, 32, 8.0

Group = tuple[Floats, Floats]
"""Positions, shape ``(k, 2)``, and velocities with spins, shape ``(k, 3)``."""


def _direction(angle: float) -> Floats:
    return np.array([np.cos(angle), np.sin(angle)])


def _pair(rng: np.random.Generator) -> Group:
    """One disc flies at one that rests, with any offset and any phase within the step in which they
    meet.
    """
    offset, angle = rng.uniform(-1.0, 1.0), rng.uniform(0.0, 2.0 * np.pi)
    along, across = _direction(angle), _direction(angle + 0.5 * np.pi)
    distance = np.sqrt(1.0 - offset * offset) + rng.uniform(0.0, 0.4)
    return np.array([np.zeros(2), offset * across - distance * along]), np.array(
        [np.zeros(3), [*along, 0.0]]
    )


def _triple(rng: np.random.Generator) -> Group:
    """A pair, and a third disc near the one that rests, which moves at half the speed in any
    direction.
    """
    positions, velocities = _pair(rng)
    third = positions[1]
    while np.hypot(*(third - positions[1])) <= 1.0:
        third = (1.0 + rng.uniform(0.0, 0.2)) * _direction(rng.uniform(0.0, 2.0 * np.pi))
    slow = 0.5 * _direction(rng.uniform(0.0, 2.0 * np.pi))
    return np.vstack([positions, third]), np.vstack([velocities, [*slow, 0.0]])


def _seven(rng: np.random.Generator) -> Group:
    """Six discs around one, falling together, with random velocities and spins on top."""
    turn = rng.uniform(0.0, 1.0)
    ring = np.array([_direction(turn + k * np.pi / 3.0) for k in range(6)])
    positions = np.vstack([np.zeros(2), 1.25 * ring]) + rng.uniform(-0.05, 0.05, (7, 2))
    velocities = 0.4 * rng.normal(size=(7, 2)) - 0.5 * positions
    return positions, np.column_stack([velocities, 0.5 * rng.normal(size=7)])


KINDS: dict[str, tuple[Callable[[np.random.Generator], Group], float]] = {
    "pair": (_pair, 1.2),
    "triple": (_triple, 1.2),
    "seven": (_seven, 1.6),
}
"""Of each kind of group: how one is drawn, and for how long it is watched."""


def _model(count: int, friction: float) -> Model:
    """Discs of mass and diameter 1 without walls and gravity, perfectly inelastic."""
    radius, kinds, none = np.full(count, 0.5), np.zeros(count, np.int32), np.zeros(0)
    grains = Grains(radius, np.ones(count), 0.5 * radius**2, kinds, kinds)
    no_number = np.zeros(0, np.int32)
    laws = ContactLaws(
        np.full((1, 1), friction), np.zeros((1, 1)), np.full((1, 1), -1, np.int32),
        np.zeros(1, np.int32), none, none
    )  # fmt: skip
    shapes = WallShapes(no_number, no_number, np.zeros((0, 4)), no_number)
    walls = Walls((), none, none, np.zeros(0, np.bool_), none)
    return Model(grains, shapes, walls, laws, ("stuff",), ("discs",), 0.0, np.zeros(2), 2.0)


def watch(kind: str, friction: float, dt: float, seed: int = 1) -> tuple[float, float]:
    """Kinetic energy at the end over that at the start, and the rms distance of the discs from the
    centers of their groups.
    """
    draw, duration = KINDS[kind]
    rng = np.random.default_rng(seed)
    groups = [draw(rng) for _ in range(GROUPS)]
    size = len(groups[0][0])
    corners = [np.array([g % COLUMNS, g // COLUMNS]) * APART for g in range(GROUPS)]
    model = _model(GROUPS * size, friction)
    state = State.at_rest(
        model, np.vstack([corner + group[0] for corner, group in zip(corners, groups, strict=True)])
    )
    state.velocity[:] = np.vstack([group[1] for group in groups])
    engine = Engine(model, state, threads=1)
    engine.begin(Orders(settings=TIGHT))
    before = _kinetic(model, state)
    for k in range(round(duration / dt)):
        engine.step(dt, k * dt)
    at = state.position[:, :2].reshape(GROUPS, size, 2)
    return _kinetic(model, state) / before, float(
        np.sqrt(((at - at.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean())
    )


def _kinetic(model: Model, state: State) -> float:
    vx, vy, spin = state.velocity.T
    return float(
        (
            0.5 * model.grains.mass * (vx * vx + vy * vy) + 0.5 * model.grains.inertia * spin * spin
        ).sum()
    )


def main() -> None:
    """Print the table."""
    print(
        f"{'discs':>7} {'μ':>4} {'energy':>7} {'spread':>7}   change of either with the step, at "
        "Δt ="
    )
    print(" " * 31 + " ".join(f"{dt:^17g}" for dt in STEPS))
    for kind in KINDS:
        for friction in FRICTIONS:
            energy, spread = watch(kind, friction, REFERENCE)
            cells = []
            for dt in STEPS:
                new_energy, new_spread = watch(kind, friction, dt)
                cells.append(f"{new_energy - energy:+8.4f} {new_spread - spread:+8.4f}")
            print(
                f"{kind:>7} {friction:4g} {energy:7.4f} {spread:7.4f}   " + " ".join(cells),
                flush=True,
            )


if __name__ == "__main__":
    main()

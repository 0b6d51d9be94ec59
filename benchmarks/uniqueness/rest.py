"""A bed and a pile at rest, continued by one method or the other, from the last impulses, from none
and from some by lot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from driving import Driven, begin

from multicor_cli.engine.orders import Method
from multicor_cli.model.model import Floats

WAYS: dict[str, tuple[Method, str, float]] = {
    "accelerated": ("accelerated", "last step", 1.0),
    "plain": ("gauss-seidel", "last step", 1.0),
    "accelerated, from zero": ("accelerated", "zero", 1.0),
    "plain, from zero": ("gauss-seidel", "zero", 1.0),
    "accelerated, from lots": ("accelerated", "lot", 1.0),
    "accelerated, from zero, 1/100": ("accelerated", "zero", 0.01),
    "accelerated, from lots, 1/100": ("accelerated", "lot", 0.01),
}
"""Method, what each step starts from, and by what the default tolerances are multiplied. The first
is how the program does it."""

Key = tuple[int, int]


@dataclass(frozen=True)
class Kept:
    """What is left after some steps at rest.

    Attributes:
        way: Method and start.
        steps: Number of steps.
        unconverged: Of these, how many missed the tolerances.
        sweeps: Sweep-equivalents per step.
        moved: Largest way of a grain over the mean diameter.
        moved_rms: rms over the grains of the same.
        moved_late: Largest way in the second half of the steps only: whether it goes on.
        floor: Mean vertical force on floor and walls over the weight, minus 1.
        floor_worst: Largest deviation of it in a step.
        height: Change of the height of the highest grain over the mean diameter.
        contacts: Contacts that carry an impulse, in the last step.
        force: Mean normal force over the mean weight of a grain, in the last step.
        spread: Standard deviation of the normal forces over their mean.
        participation: (Σp)²/(N Σp²) of the normal forces.
        changed: rms change of the forces between the last two steps over their rms.
        differ: rms difference of the last forces from those of the first way over their rms.
        differ_mean: The same of the forces averaged over all steps.
    """

    way: str
    steps: int
    unconverged: int
    sweeps: float
    moved: float
    moved_rms: float
    moved_late: float
    floor: float
    floor_worst: float
    height: float
    contacts: int
    force: float
    spread: float
    participation: float
    changed: float
    differ: float
    differ_mean: float


@dataclass(frozen=True)
class AtRest:
    """One scene: how it came to rest, and what the ways made of it; forces of the first ways for
    the figure.
    """

    scene: str
    grains: int
    speed: float
    rows: list[Kept]
    forces: dict[str, dict[Key, tuple[float, float]]]


class _Ledger:
    """Notes of one way."""

    def __init__(self, driven: Driven) -> None:
        self.driven = driven
        self.start = driven.state.position[:, :2].copy()
        self.middle = self.start
        self.upward: list[float] = []
        self.total: dict[Key, Floats] = {}
        self.last: dict[Key, Floats] = {}
        self.before: dict[Key, Floats] = {}

    def note(self) -> None:
        table = self.driven.engine.contacts()
        loaded = table.impulse[:, 0] > 0.0
        keys = zip(table.i[loaded].tolist(), table.j[loaded].tolist(), strict=True)
        self.before, self.last = self.last, dict(zip(keys, table.impulse[loaded], strict=True))
        for key, impulse in self.last.items():
            self.total[key] = self.total.get(key, 0.0) + impulse
        self.upward.append(-float(self.driven.state.window_wall_impulse[:, 1].sum()))
        self.driven.state.window_wall_impulse[:] = 0.0


def apart(one: dict[Key, Floats], other: dict[Key, Floats]) -> float:
    """rms difference of the impulses of two sets of contacts over their rms; a contact that is
    missing carries none.
    """
    keys = list(one.keys() | other.keys())
    nothing = np.zeros(2)
    a, b = (np.array([contacts.get(key, nothing) for key in keys]) for contacts in (one, other))
    return float(np.sqrt(((a - b) ** 2).sum() / (0.5 * ((a**2).sum() + (b**2).sum()))))


def come_to_rest(text: str) -> Driven:
    """Carry out a scenario by the accelerated method."""
    return begin(text).run()


def compare(scene: str, resting: Driven, steps: int, say: Callable[[str], None]) -> AtRest:
    """Continue a scene at rest in all ways."""
    ledgers: dict[str, _Ledger] = {}
    for way, (method, start, factor) in WAYS.items():
        say(f"{scene} at rest, {way}")
        ledgers[way] = _continue(resting.branch(method, factor), start, steps)
    first = next(iter(ledgers.values()))
    rows = [_kept(way, ledger, first) for way, ledger in ledgers.items()]
    forces = {
        way: {key: (float(p[0]), float(p[1])) for key, p in ledger.last.items()}
        for way, ledger in ledgers.items()
    }
    speed = float(np.abs(resting.state.velocity[:, :2]).max())
    return AtRest(scene, resting.model.grain_count, speed, rows, forces)


def _continue(driven: Driven, start: str, steps: int) -> _Ledger:
    driven.state.window_wall_impulse[:] = 0.0
    ledger = _Ledger(driven)
    lot = np.random.Generator(np.random.Philox(7))
    for number in range(steps):
        if number == steps // 2:
            ledger.middle = driven.state.position[:, :2].copy()
        impulse = driven.state.contact_impulse
        if start == "zero":
            impulse[:] = 0.0
        elif start == "lot":
            normal = 2.0 * impulse[:, 0].mean() * lot.random(len(impulse))
            impulse[:] = np.column_stack(
                [normal, 0.3 * normal * lot.uniform(-1.0, 1.0, len(impulse))]
            )
        driven.step()
        ledger.note()
    return ledger


def _ways(driven: Driven, since: Floats) -> Floats:
    """How far each grain has come over the mean diameter."""
    return np.linalg.norm(driven.state.position[:, :2] - since, axis=1) / driven.model.mean_diameter


def _kept(way: str, ledger: _Ledger, first: _Ledger) -> Kept:
    driven, model = ledger.driven, ledger.driven.model
    moved, late = (_ways(driven, since) for since in (ledger.start, ledger.middle))
    weight = 9.81 * float(model.grains.mass.sum()) * driven.dt
    carried = np.array(ledger.upward) / weight - 1.0
    normal = np.array([impulse[0] for impulse in ledger.last.values()])
    top = [
        float((p[:, 1] + model.grains.radius).max()) for p in (driven.state.position, ledger.start)
    ]
    return Kept(
        way, driven.steps, driven.unconverged, driven.sweeps / driven.steps,
        float(moved.max()), float(np.sqrt((moved**2).mean())), float(late.max()),
        float(carried.mean()), float(np.abs(carried).max()),
        (top[0] - top[1]) / model.mean_diameter, normal.size,
        float(normal.mean() / (weight / model.grain_count)), float(normal.std() / normal.mean()),
        float(normal.sum() ** 2 / (normal.size * (normal**2).sum())),
        apart(ledger.last, ledger.before),
        apart(ledger.last, first.last), apart(ledger.total, first.total),
    )  # fmt: skip

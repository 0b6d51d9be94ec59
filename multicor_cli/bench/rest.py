"""When a scene has come to rest: when its kinetic energy says so, and for long enough. A number of steps would say nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import total
from multicor_cli.model import Model, State
from multicor_cli.running.conditions import KINETIC
from multicor_cli.running.plan import StagePlan

QUIET = 1e-7
"""Kinetic energy at rest over Σ m g d: what would lift every grain by 10⁻⁷ diameters. The tolerance of the solver leaves 10⁻⁸."""

REST_FOR = 4.0
"""For how long it must stay so, over √(d/g): a grain without support would fall eight diameters in this time."""


class NoRestError(Exception):
    """A scene did not come to rest; the message says how far it is from it."""


@dataclass
class Rest:
    """Kinetic energy no larger than `allowed` in so many steps, one after the other.

    Attributes:
        allowed: Largest kinetic energy of grains at rest [J].
        steps: Number of steps in which it must not be exceeded.
        quiet: Number of steps since it was exceeded last.
    """

    allowed: float
    steps: int
    quiet: int = 0

    @classmethod
    def of(cls, model: Model, dt: float) -> Rest:
        """Rest of the grains of a model under its gravity, in steps of ``dt`` [s]."""
        diameter, gravity = model.mean_diameter, hypot(*model.gravity.tolist())
        weight = total(model.grains.mass) * gravity
        return cls(QUIET * weight * diameter, math.ceil(REST_FOR * math.sqrt(diameter / gravity) / dt))

    @property
    def is_reached(self) -> bool:
        """Whether it has been quiet for long enough."""
        return self.quiet >= self.steps

    def note(self, state: State) -> None:
        """Look at the state after a step."""
        self.quiet = self.quiet + 1 if state.books[KINETIC] <= self.allowed else 0

    def check(self, name: str, state: State) -> None:
        """Raise `NoRestError`, with the name of the scene and its kinetic energy, if rest was not reached."""
        if self.is_reached:
            return
        raise NoRestError(
            f"the {name} did not come to rest within {state.time:.3g} s: kinetic energy {state.books[KINETIC]:.2e} J, "
            f"allowed {self.allowed:.2e} J for {self.steps} steps"
        )


@dataclass(frozen=True)
class Settling(StagePlan):
    """A stage that ends when the grains have come to rest, or when its time is over."""

    rest: Rest = field(kw_only=True)

    def has_ended(self, state: State) -> bool:
        """Whether the stage is over after the step that led to ``state``; asked once after each step."""
        self.rest.note(state)
        return self.rest.is_reached or super().has_ended(state)

"""Shear strain, as it is measured between two walls."""

from __future__ import annotations

from dataclasses import dataclass

from multicor_cli.engine.motion.spacing import Spacing
from multicor_cli.model import Model, State
from multicor_cli.model.columns import X
from multicor_cli.model.model import Floats


@dataclass(frozen=True)
class ShearGauge:
    """Measures shear strain between two walls: relative displacement in x over the distance in y, summed over the steps.

    Increments count by their absolute value, so that the strain of a stage that shears back and forth keeps growing.

    Attributes:
        height: Distance in y of the second wall from the first.
    """

    height: Spacing

    @classmethod
    def between(cls, model: Model, lower: str, upper: str) -> ShearGauge:
        """The gauge of the two walls of these names; raises as `Spacing.between`."""
        return cls(Spacing.between(model, lower, upper))

    def offset(self, wall_position: Floats) -> float:
        """How far the second wall is displaced in x relative to the first [m], given the positions of the walls."""
        return float(wall_position[self.height.upper, X] - wall_position[self.height.lower, X])

    def increment(self, state: State, wall_before: Floats) -> float:
        """Strain of the last step; ``wall_before`` are the positions before it. Walls at the same height have no strain."""
        height = self.height.of(state)
        return abs((self.offset(state.wall_position) - self.offset(wall_before)) / height) if height else 0.0

"""Gravity in each stage: what the stage says, or what the stage before had at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.motion.drives import AnyGravity, Constant, Gravity, TiltedGravity
from multicor_cli.scenario.drives import engine_signal
from multicor_cli.scenario.gravity import AnyStageGravity, TiltedGravityTable
from multicor_cli.scenario.scenario import Scenario


@dataclass(frozen=True)
class StageGravity:
    """Gravity of one stage.

    Attributes:
        stage: Index of the stage.
        gravity: What the stage says that named it, as a function of the time since the start of that stage.
        named_by: Index of that stage; the stage itself if none has named it.
    """

    stage: int
    gravity: AnyGravity
    named_by: int

    def started(self, stage_starts: Sequence[float]) -> AnyGravity:
        """Gravity as a function of the time since the start of this stage.

        A stage that says nothing keeps what there was at the end of the stage that named gravity last: a tilted chute stays tilted.

        Args:
            stage_starts: Times at which the stages up to this one have begun [s].
        """
        if self.named_by == self.stage:
            return self.gravity
        return Gravity.constant(self.gravity.value(stage_starts[self.named_by + 1] - stage_starts[self.named_by]))


def stage_gravity(scenario: Scenario) -> list[StageGravity]:
    """Gravity of all stages; that of ``[domain]`` until a stage names another."""
    x, y = scenario.domain.gravity
    current: AnyGravity = Gravity(Constant(x), Constant(y))
    named_by, found = None, []
    for number, stage in enumerate(scenario.loading):
        if stage.gravity is not None:
            current, named_by = _engine_gravity(stage.gravity, hypot(x, y)), number
        found.append(StageGravity(number, current, number if named_by is None else named_by))
    return found


def _engine_gravity(gravity: AnyStageGravity, magnitude: float) -> AnyGravity:
    """The engine's form of what a stage says; ``magnitude`` is that of the domain [m/s²]."""
    if isinstance(gravity, TiltedGravityTable):
        given = magnitude if gravity.magnitude is None else gravity.magnitude
        return TiltedGravity(engine_signal(gravity.angle), engine_signal(given))
    return Gravity(engine_signal(gravity[0]), engine_signal(gravity[1]))

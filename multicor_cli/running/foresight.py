"""How many steps the stages of a run will take, as far as their conditions can be foreseen."""

from __future__ import annotations

from collections.abc import Sequence

from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.model import State
from multicor_cli.running.conditions import StrainReached
from multicor_cli.running.plan import RunPlan, StagePlan

_SHORTEST_MARCH = 20_000  # evaluations of a signal before the interval is doubled
_DOUBLINGS = 30


def foresee_steps(plan: RunPlan, state: State) -> list[int | None]:
    """Steps of each stage at most; None where only a condition ends the stage and it cannot be foreseen."""
    starts, counts = [0.0], []
    for stage in plan.stages:
        needed = _steps_to_strain(stage, starts, state) if isinstance(stage.until, StrainReached) else None
        bounds = [count for count in (stage.step_limit, needed) if count is not None]
        count = min(bounds, default=None)
        counts.append(count)
        starts.append(starts[-1] + stage.time_after(count or 0))
    return counts


def _steps_to_strain(stage: StagePlan, starts: Sequence[float], state: State) -> int | None:
    """Steps until two walls whose motion is prescribed have reached the strain of the stage."""
    assert isinstance(stage.until, StrainReached)
    spacing = stage.until.gauge.height
    walls = spacing.lower, spacing.upper
    drives = stage.drives.started(starts)
    if any(drives[w].x.is_driven for w in walls):
        return None
    height = spacing.of(state)
    if not height:
        return None
    t, interval, left = 0.0, stage.dt, stage.until.goal
    for _ in range(_DOUBLINGS):
        for _ in range(_SHORTEST_MARCH):
            lower, upper = (_velocity(drives[w], t, interval) for w in walls)
            rate = abs((upper - lower) / height)
            if rate * interval >= left:
                return max(1, round((t + left / rate) / stage.dt))
            left -= rate * interval
            t += interval
        interval *= 2.0
    return None


def _velocity(drive: WallDrive, t: float, interval: float) -> float:
    """Prescribed velocity in x between ``t`` and ``t + interval`` [m/s]."""
    if drive.x.position is not None:
        return (drive.x.position.value(t + interval) - drive.x.position.value(t)) / interval
    return drive.x.velocity.value(t + 0.5 * interval) if drive.x.velocity is not None else 0.0

"""Time steps, durations and intervals of output go together."""

from __future__ import annotations

import math
from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.loading import Stage, frozen_dt
from multicor_cli.scenario.problems import Finding

MAX_STEPS = 1e10
MAX_FRAMES = 1e6
MAX_ROWS = 1e8
_SLACK = 1e-9


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about times."""
    durations = list(_check_durations(draft))
    yield from durations
    yield from _check_intervals(draft)
    if not durations:
        yield from _check_amounts(draft)


def _time_steps(draft: Draft) -> list[float]:
    """Time steps of the stages in which something moves, as far as they are known.

    A frozen stage is left out: its time step is the interval at which temperatures are evaluated, and output waits for it.
    """
    steps = [_time_step(draft, stage) for stage in draft.loading if stage and not stage.frozen]
    return [dt for dt in steps if dt is not None]


def _time_step(draft: Draft, stage: Stage) -> float | None:
    """Time step of a stage; None if it is not known yet: an automatic one suits the output whatever it is."""
    dt = stage.dt
    if dt is None:
        if stage.frozen:
            return frozen_dt(stage, draft.output) if draft.output else None
        dt = draft.solver.dt if draft.solver else None
    return None if dt == "auto" else dt


def _check_durations(draft: Draft) -> Iterator[Finding]:
    for k, stage in enumerate(draft.loading):
        dt = _time_step(draft, stage) if stage else None
        if stage is None or stage.duration is None or dt is None:
            continue
        path = ("loading", k, "duration")
        if stage.duration < dt * (1.0 - _SLACK):
            yield Finding(path, f"{stage.duration:g} s is shorter than the time step dt = {dt:g} s", "lower dt")
        elif stage.duration > MAX_STEPS * dt:
            what = f"{stage.duration:g} s are {stage.duration / dt:.2g} steps of dt = {dt:g} s"
            yield Finding(path, what, f"stay below {MAX_STEPS:g} steps; times are in seconds")


def _check_intervals(draft: Draft) -> Iterator[Finding]:
    output, steps = draft.output, _time_steps(draft)
    if output is None or not steps:
        return
    longest = max(steps)
    if output.frame_interval < longest * (1.0 - _SLACK):
        what = f"{output.frame_interval:g} s is less than the time step dt = {longest:g} s"
        yield Finding(("output", "frame_interval"), what, "make it at least dt")
    elif output.series_interval < longest * (1.0 - _SLACK) and not output.has_default_series:  # else there is one row per step
        what = f"{output.series_interval:g} s is less than the time step dt = {longest:g} s"
        yield Finding(("output", "series_interval"), what, "make it at least dt, or remove it")


def _check_amounts(draft: Draft) -> Iterator[Finding]:
    """A mistaken interval must not fill the disk."""
    output = draft.output
    if output is None:
        return
    stages = [stage for stage in draft.loading if stage]
    limits = (("frame_interval", output.frame_interval, MAX_FRAMES), ("series_interval", output.series_interval, MAX_ROWS))
    for key, interval, most in limits:
        times = math.fsum((stage.duration or 0.0) / _between(stage, interval) for stage in stages)
        if times > most:
            total = math.fsum(stage.duration or 0.0 for stage in stages)
            what = f"{total:g} s of loading at intervals of {interval:g} s are written {times:.2g} times"
            yield Finding(("output", key), what, f"stay below {most:g}; times are in seconds")
            return


def _between(stage: Stage, interval: float) -> float:
    """Time between two rows or frames that are wanted at an interval [s]."""
    return max(interval, stage.dt) if stage.frozen and isinstance(stage.dt, float) else interval

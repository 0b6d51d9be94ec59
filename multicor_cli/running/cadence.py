"""Times in steps: how many make up a stage, and after which of them something comes that is wanted again and again."""

from __future__ import annotations

import math

_ROUNDING = 1e-9
"""Relative amount by which a time may miss a whole number of steps."""

_LEAST = 0.1
"""Shortest last step of a stage, over the others; with less left, that is added to the last one. Forces are impulses over the
length of a step, and in a very short one what the solver leaves of velocities would be all that there is to see of them."""


def fit_steps(duration: float, dt: float) -> tuple[int, float | None]:
    """Number of steps that make up a duration, at least one.

    Returns:
        The number; and the duration [s] where it is no whole number of steps of ``dt``, so that the last one has another length.
    """
    count = duration / dt
    if _is_whole(count):
        return round(count), None
    return max(1, math.floor(count) + (count % 1.0 >= _LEAST)), duration


def count_steps(interval: float, dt: float) -> float:
    """Number of steps of ``dt`` in an interval, at least one; whole where it is but for rounding."""
    count = interval / dt
    return max(1, round(count)) if count < 1.0 or _is_whole(count) else count


def is_due(step: int, every: float) -> bool:
    """Whether what comes every so many steps, not always whole ones, comes after this one: the nearest to its time."""
    return step == math.floor(round(step / every) * every + 0.5)


def _is_whole(count: float) -> bool:
    return round(count) >= 1 and abs(count - round(count)) <= _ROUNDING * count

"""A switch for tests: every initial position moved by an ulp, to show what depends on the last bits of one trajectory.

``MULTICOR_NUDGE=SEED`` moves each coordinate of each grain at random to the next number up or down, or leaves it. Flows are
chaotic: after some hundred collisions the two runs share only their statistics. A test that passes for several seeds checks
physics; one that does not depends on one particular trajectory. Never set it for a run that is to be kept: the provenance in
run.json has an entry ``nudge`` if it was.
"""

from __future__ import annotations

import os

import numpy as np

from multicor_cli.model.columns import ANGLE, X
from multicor_cli.model.model import Floats

VARIABLE = "MULTICOR_NUDGE"

_DIGITS = 18
"""Of the longest seed: below 2⁶³."""


class NudgeError(ValueError):
    """The switch is set to something that is not a seed: one message for the user."""

    exit_code = 5


def nudge_seed() -> int | None:
    """The seed in the environment; None if positions stay as they are.

    Raises:
        NudgeError: If the variable is neither empty nor a whole number of at most 18 digits.
    """
    value = os.environ.get(VARIABLE, "")
    if not value:
        return None
    if not (value.isascii() and value.isdigit() and len(value) <= _DIGITS):
        message = (
            f"{VARIABLE}={value} is not a valid seed; unset it, or give a whole number of at most {_DIGITS} digits (for tests only)"
        )
        raise NudgeError(message)
    return int(value)


def nudge(position: Floats, period: float, seed: int) -> Floats:
    """Move x and y to a neighboring number or not at all.

    Args:
        position: x, y [m] and angle [rad], shape ``(n, 3)``; x in [0, period) if there is a period.
        period: Period of x [m]; 0: none.
        seed: Decides which way each coordinate goes.

    Returns:
        New positions. Zeros stay: the next number is 10⁻³²⁴ away, which no arithmetic would notice.
    """
    center = position[:, :2]
    lot = (np.random.Philox(seed).random_raw(center.size) % np.uint64(3)).astype(np.int64).reshape(center.shape) - 1
    moved = np.where((lot == 0) | (center == 0.0), center, np.nextafter(center, np.where(lot > 0, np.inf, -np.inf)))
    if period > 0.0:
        moved[:, X] = np.where(moved[:, X] < period, moved[:, X], center[:, X])
    return np.column_stack([moved, position[:, ANGLE]])

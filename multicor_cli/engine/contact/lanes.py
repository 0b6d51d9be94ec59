"""Where the numbers of a contact lie in the flat arrays of the sweep: blocks of rows of four, a lane for each contact of a batch.

Offsets are unsigned, so that no negative index has to be wrapped.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import BIAS, INVERSE_MASS, MASS, MU, NY, SECOND, SURFACE, TANGENTIAL, Y

PAIR_ROWS, FRAME_ROWS, IMPULSE_ROWS = 2, 5, 2
"""Rows of the blocks."""

_LANES, _SHIFT, _MASK = np.uint64(LANES), np.uint64(2), np.uint64(LANES - 1)
_PAIR, _FRAME, _IMPULSE = (np.uint64(LANES * rows) for rows in (PAIR_ROWS, FRAME_ROWS, IMPULSE_ROWS))

Y_, SURFACE_, INVERSE_MASS_ = np.uint64(Y), np.uint64(SURFACE), np.uint64(INVERSE_MASS)
NY_, MASS_, BIAS_, MU_ = (np.uint64(LANES * column) for column in (NY, MASS, BIAS, MU))
SECOND_, TANGENTIAL_ = np.uint64(LANES * SECOND), np.uint64(LANES * TANGENTIAL)
"""From the first row of a block, or the first element of a body, to another."""


@formula
def pair_place(lane: np.uint64) -> np.uint64:
    """Place of the first body of a contact among the pairs; ``lane`` counts the lanes of all batches."""
    return _PAIR * (lane >> _SHIFT) + (lane & _MASK)


@formula
def frame_place(lane: np.uint64) -> np.uint64:
    """Place of n_x of a contact among the frames."""
    return _FRAME * (lane >> _SHIFT) + (lane & _MASK)


@formula
def impulse_place(lane: np.uint64) -> np.uint64:
    """Place of p_n of a contact among the impulses."""
    return _IMPULSE * (lane >> _SHIFT) + (lane & _MASK)


@formula
def lane_of_impulse(place: int) -> int:
    """Lane of the contact with p_n at this place, the inverse of `impulse_place`."""
    return place // (IMPULSE_ROWS * LANES) * LANES + place % LANES

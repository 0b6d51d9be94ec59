"""Columns of flat arrays, for innermost loops: unsigned, so that no negative index has to be wrapped."""

from __future__ import annotations

import numpy as np

from multicor_cli.model.columns import BIAS, INVERSE_MASS, MASS, MU, NY, SECOND, SURFACE, TANGENTIAL, Y

BODY, FRAME, PAIR, IMPULSE = np.uint64(4), np.uint64(5), np.uint64(2), np.uint64(2)
"""Lengths of the rows."""

Y_, SURFACE_, INVERSE_MASS_ = np.uint64(Y), np.uint64(SURFACE), np.uint64(INVERSE_MASS)
NY_, MASS_, BIAS_, MU_ = np.uint64(NY), np.uint64(MASS), np.uint64(BIAS), np.uint64(MU)
SECOND_, TANGENTIAL_ = np.uint64(SECOND), np.uint64(TANGENTIAL)

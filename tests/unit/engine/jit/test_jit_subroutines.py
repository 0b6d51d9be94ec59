"""Functions that kernels call are compiled once, whatever integers they are called with."""

import numpy as np
import pytest

from multicor_cli.engine.jit.compile import IS_COMPILING, kernel, subroutine


@subroutine
def _next_after(values, k):
    return values[k + 1] if k + 1 < values.size else -1


@kernel
def _chased(values, narrow, wide):
    found, last = 0, 0  # a literal, before it is known that it is more
    for k in range(narrow.size):
        found += _next_after(values, narrow[k]) + _next_after(values, wide[k])
        found += _next_after(values, last) + _next_after(values, np.uint64(k))
        last = k
    return found


@pytest.mark.skipif(not IS_COMPILING, reason="nothing is compiled")
def test_integers_of_a_subroutine_are_of_one_kind():
    values, which = np.array([5, 7, 11]), np.array([0, 2, 1])
    expected = sum(
        _next_after.py_func(values, k)
        for j, k in enumerate(which)
        for k in (k, k, max(j - 1, 0), j)
    )
    assert _chased(values, which.astype(np.int32), which) == expected
    _chased.recompile()  # it may come from the cache, and has not asked for the other then
    assert len(_next_after.signatures) == 1

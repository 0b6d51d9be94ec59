"""Computed indices count from the start of an array; only those written as a number may not."""

import os
import subprocess
import sys

import numpy as np
import pytest

from multicor_cli.engine.jit.compile import IS_COMPILING, kernel

pytestmark = pytest.mark.skipif(not IS_COMPILING, reason="nothing is compiled")


@kernel
def _last(values):
    return values[-1] + 10.0 * values[-2], values[:-1].size


@kernel
def _pick(values, k):
    return values[k]


def test_indices_that_are_numbers_count_from_the_end():
    assert _last(np.arange(5.0)) == (34.0, 4)


def test_nothing_is_asked_of_an_index_that_is_computed():
    assert _pick(np.arange(5.0), 3) == 3.0
    _pick.recompile()  # it may come from the cache, which has no code to look at
    (code,) = _pick.inspect_llvm().values()
    body = code[code.index("define") :]
    assert "select" not in body[: body.index("\n}")]


def test_a_negative_one_is_found_with_bounds_checked(tmp_path):
    say = (
        "import numba, numpy as np\n"
        "import multicor_cli.engine.jit.compile\n"
        "pick = numba.njit(lambda values, k: values[k])\n"
        "print(pick(np.arange(5.0), 4))\n"
        "pick(np.arange(5.0), -1)\n"
    )
    about = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", say], env=about, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["4.0"]
    assert "IndexError" in done.stderr

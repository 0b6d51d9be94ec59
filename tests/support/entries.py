"""Functions that kernels alone call, with an entry for Python."""

import numba


def entry(function):
    """The same, compiled into a kernel of its own (which no cache keeps)."""

    @numba.njit(error_model="numpy")
    def call(*args):
        return function(*args)

    return call

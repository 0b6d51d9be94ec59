"""Numba loops over structure-of-arrays; they decorate and call the scalar formulas of `physics`."""

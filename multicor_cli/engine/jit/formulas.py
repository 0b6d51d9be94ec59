"""Scalar formulas: Python where Python calls them, machine code in kernels. Loads no Numba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

_waiting: list[Callable[..., Any]] = []
_compilers: list[Callable[[Callable[..., Any]], object]] = []


def formula(function: F) -> F:
    """Let kernels and other formulas call this function; it stays the function that it is.

    So what tests call is what runs, and modules of formulas can be used without waiting for Numba.
    """
    _waiting.append(function)
    _hand_over()
    return function


def compile_with(compiler: Callable[[Callable[..., Any]], object]) -> None:
    """Hand the formulas that there are, and all later ones, to a compiler."""
    _compilers.append(compiler)
    _hand_over()


def _hand_over() -> None:
    while _compilers and _waiting:
        _compilers[0](_waiting.pop(0))

"""Momentum of the accelerated sweeps: Nesterov's factors, and what restarts them."""

import numpy as np
import pytest
from entries import entry

from multicor_cli.engine.contact.acceleration import choose_factor, extrapolate, start_loop

factor_of = entry(choose_factor)


def factors(count, change=1.0):
    """The first factors of a momentum that nothing restarts, with its loop."""
    loop = start_loop(1)
    return [factor_of(change, 1.0, 1.5, loop[0]) for _ in range(count)], loop


def test_factors_are_nesterov_s():
    """θ_{k+1}² = (1 − θ_{k+1}) θ_k², ω_k = θ_k (1 − θ_k)/(θ_k² + θ_{k+1}), by roots of a
    polynomial."""
    found, loop = factors(50)
    theta = 1.0
    for factor in found:
        following = max(np.roots([1.0, theta**2, -(theta**2)]).real)
        assert factor == pytest.approx(theta * (1.0 - theta) / (theta**2 + following), abs=1e-12)
        theta = following
    assert loop["factor"][0] == found[-1]
    assert found[0] == 0.0
    assert found[-1] > 0.9


@pytest.mark.parametrize(("change", "onward"), [(1.6, 1.0), (0.5, -1e-300)])
def test_momentum_restarts_by_growth_and_by_direction(change, onward):
    """The change has grown to 1.5 times its lowest, or corrections point back."""
    known, loop = factors(10)
    assert factor_of(change, onward, 1.5, loop[0]) == 0.0
    again = [factor_of(change, 1.0, 1.5, loop[0]) for _ in range(9)]
    assert again == known[1:]


@pytest.mark.parametrize(("change", "onward"), [(1.4, 1.0), (0.5, 0.0)])
def test_nothing_else_restarts_it(change, onward):
    known, loop = factors(11)
    _, loop = factors(10)
    assert factor_of(change, onward, 1.5, loop[0]) == known[-1]


def test_values_move_on_by_their_last_change():
    now, before = np.random.default_rng(3).normal(size=(2, 8))
    expected = now + 0.4 * (now - before)
    moved, last = now.copy(), before.copy()
    entry(extrapolate)(2, 8, moved, last, 0.4)
    assert moved[2:] == pytest.approx(expected[2:], rel=1e-14)
    assert last[2:].tolist() == now[2:].tolist()
    assert (moved[:2].tolist(), last[:2].tolist()) == (now[:2].tolist(), before[:2].tolist())

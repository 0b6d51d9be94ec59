"""Signals of the drives."""

import math

import numpy as np
import pytest

from multicor_cli.engine.motion.drives import (
    Constant,
    Gravity,
    Interpolated,
    Ramp,
    Shifted,
    Sine,
    TiltedGravity,
)


def test_signals():
    assert Constant(3.0).value(17.0) == 3.0
    ramp = Ramp(1.0, 5.0, 2.0)
    assert [ramp.value(t) for t in (0.0, 0.5, 2.0, 9.0)] == [1.0, 2.0, 5.0, 5.0]
    sine = Sine(1.0, 2.0, 4.0)
    assert [sine.value(t) for t in (0.0, 1.0, 3.0)] == pytest.approx([1.0, 3.0, -1.0])
    table = Interpolated((0.0, 1.0, 3.0), (0.0, 10.0, 20.0))
    assert [table.value(t) for t in (-1.0, 0.0, 0.5, 2.0, 3.0, 8.0)] == [
        0.0, 0.0, 5.0, 15.0, 20.0, 20.0,
    ]  # fmt: skip


def sampled(values, interval=0.1):
    """A table of values at equal intervals."""
    return Interpolated(
        tuple(interval * k for k in range(len(values))), tuple(float(value) for value in values)
    )


TIMES = np.linspace(0.0, 3.0, 601)
WAVE = np.sin(2.0 * math.pi * TIMES / 0.5)
PERIODS = {
    "constant": (Constant(3.0), math.inf),
    "ramp": (Ramp(0.0, 1e6, 1e-6), math.inf),
    "sine": (Sine(1.0, 1e-9, 0.3), 0.3),
    "sine of no amplitude": (Sine(1.0, 0.0, 0.3), math.inf),
    "one row": (sampled([2.0]), math.inf),
    "always the same": (sampled([2.0, 2.0, 2.0]), math.inf),
    "stairs": (sampled([0, 0, 1, 1, 1, 3, 7, 7]), math.inf),
    "zigzag": (sampled([0, 1] * 5), 0.2),
    "pulse": (Interpolated((0.0, 5.0, 5.1, 5.2, 5.4, 9.0), (0.0, 0.0, -8.0, -8.0, 0.0, 0.0)),
        2.0 * 0.25),
    "two pulses": (Interpolated((0.0, 1.0, 2.0, 2.05, 2.1, 9.0), (0.0, 4.0, 0.0, 4.0, 0.0, 0.0)),
        0.1),
    "tabulated sine": (sampled(WAVE, 0.005), 0.5),
    "sine on a slope": (sampled(WAVE + TIMES, 0.005), 0.5),
    "product of sines": (sampled(WAVE * np.sin(2.0 * math.pi * TIMES / 0.3), 0.005),
        1.0 / (1.0 / 0.5 + 1.0 / 0.3)),
    # Twice the time that it is below a half
    "absolute value": (sampled(np.abs(WAVE), 0.005), 0.5 / 3.0),
    "square wave": (sampled(np.sign(WAVE), 0.005), 0.5),
    "frequency that rises": (sampled(np.sin(2.0 * math.pi * TIMES * TIMES), 0.005),
        1.0 / (2.0 * 3.0)),
    "noise": (sampled(WAVE + 4e-3 * (-1.0) ** np.arange(601), 0.005), 0.5),
}  # fmt: skip
"""Signals with their shortest period [s]."""


@pytest.mark.parametrize("name", PERIODS)
def test_the_shortest_period_of_a_signal(name):
    signal, period = PERIODS[name]
    # Whose half periods differ
    within = (
        0.15 if name in ("product of sines", "frequency that rises", "sine on a slope") else 0.03
    )
    assert signal.shortest_period(0.0, math.inf) == pytest.approx(period, rel=within)
    assert Shifted(signal, 0.0).shortest_period(0.0, math.inf) == signal.shortest_period(
        0.0, math.inf
    )


def test_only_what_is_looked_at_has_a_period():
    table = Interpolated((0.0, 0.1, 0.2, 3.0, 4.0, 5.0), (0.0, 1.0, 0.0, 0.0, 1.0, 0.0))
    assert table.shortest_period(0.0, 10.0) == pytest.approx(0.2)
    assert table.shortest_period(0.12, 10.0) == pytest.approx(2.0)
    assert table.shortest_period(0.12, 3.0) == math.inf
    assert Shifted(table, 1.0).shortest_period(0.0, 10.0) == pytest.approx(2.0)
    assert Shifted(table, 6.0).shortest_period(0.0, 10.0) == math.inf


def test_periods_of_gravity():
    shaken = Gravity(Sine(0.0, 5.0, 1e-3), Constant(-9.81))
    assert shaken.shortest_period(0.0, 1.0) == 1e-3
    still = TiltedGravity(Constant(20.0), Constant(9.81))
    assert still.shortest_period(0.0, 1.0) == math.inf
    rocking = TiltedGravity(Sine(0.0, 30.0, 2.0), Constant(9.81))
    assert rocking.shortest_period(0.0, 1.0) == pytest.approx(2.0)
    tilting = TiltedGravity(Ramp(0.0, 30.0, 1e-3), Constant(9.81))
    assert tilting.shortest_period(0.0, 1.0) == math.inf
    turning = TiltedGravity(Ramp(0.0, 36_000.0, 10.0), Constant(9.81))
    assert turning.shortest_period(0.0, 1.0) == pytest.approx(0.1)
    # at its fastest 2π · 10 turns in a second
    swinging = TiltedGravity(Sine(0.0, 3600.0, 1.0), Constant(9.81))
    assert swinging.shortest_period(0.0, 1.0) == pytest.approx(1.0 / (20.0 * math.pi))
    both = TiltedGravity(Ramp(0.0, 36_000.0, 10.0), Sine(9.0, 1.0, 0.2))
    assert both.shortest_period(0.0, 1.0) == pytest.approx(1.0 / (10.0 + 5.0))

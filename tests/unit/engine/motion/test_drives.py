"""Signals of the drives."""

import pytest

from multicor_cli.engine.motion.drives import Constant, Interpolated, Ramp, Sine


def test_signals():
    assert Constant(3.0).value(17.0) == 3.0
    ramp = Ramp(1.0, 5.0, 2.0)
    assert [ramp.value(t) for t in (0.0, 0.5, 2.0, 9.0)] == [1.0, 2.0, 5.0, 5.0]
    sine = Sine(1.0, 2.0, 4.0)
    assert [sine.value(t) for t in (0.0, 1.0, 3.0)] == pytest.approx([1.0, 3.0, -1.0])
    table = Interpolated((0.0, 1.0, 3.0), (0.0, 10.0, 20.0))
    assert [table.value(t) for t in (-1.0, 0.0, 0.5, 2.0, 3.0, 8.0)] == [0.0, 0.0, 5.0, 15.0, 20.0, 20.0]

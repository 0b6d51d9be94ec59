"""What a step is predicted to cost."""

import math
from dataclasses import replace

import pytest

from multicor_cli.engine import Settings
from multicor_cli.running.estimate import (
    CONTACTS_PER_GRAIN,
    FEWEST,
    INERTIAL_NUMBER,
    MOST,
    PER_CONTACT_OF_OUTLINES,
    PER_GRAIN_OF_OUTLINES,
    SECONDS_PER_CONTACT,
    SECONDS_PER_GRAIN,
    SECONDS_PER_STEP,
    SWEEPS,
    TOLERANCE,
    seconds_per_step,
    sweeps_of_stage,
)
from multicor_cli.running.plan import StageHeat, StagePlan
from multicor_cli.running.time_step import Scales

STAGE = StagePlan("flow", 1e-3, 10, None, 1, 1, Settings(), drives=None)


def scales(number):
    """Of a flow with this inertial number, √(m̄/P) γ̇."""
    return Scales(pressure=number / 100.0, strain=1.0 / 100.0, travel=math.inf)


def test_slow_flows_and_tight_tolerances_need_more_sweeps():
    assert sweeps_of_stage(scales(INERTIAL_NUMBER), TOLERANCE) == pytest.approx(SWEEPS)
    assert sweeps_of_stage(Scales(0.1, math.inf, math.inf), TOLERANCE) == SWEEPS
    numbers = [10.0 ** (-k / 2) for k in range(14)]
    found = [sweeps_of_stage(scales(number), TOLERANCE) for number in numbers]
    assert found == sorted(found)
    assert found[0] >= FEWEST * SWEEPS
    assert found[-1] == MOST * SWEEPS
    assert sweeps_of_stage(scales(0.1), 0.1 * TOLERANCE) > 1.5 * sweeps_of_stage(
        scales(0.1), TOLERANCE
    )


def test_time_is_that_of_its_parts():
    per_grain = CONTACTS_PER_GRAIN * 100.0 * SECONDS_PER_CONTACT + SECONDS_PER_GRAIN
    assert seconds_per_step(1000, 100.0, STAGE, 1) == pytest.approx(
        SECONDS_PER_STEP + 1000 * per_grain
    )
    assert seconds_per_step(1000, 100.0, STAGE, 8) == seconds_per_step(1000, 100.0, STAGE, 1)
    assert seconds_per_step(100_000, 100.0, STAGE, 2) < 0.7 * seconds_per_step(
        100_000, 100.0, STAGE, 1
    )
    hot = replace(STAGE, heat=StageHeat())
    frozen = replace(STAGE, heat=StageHeat(is_frozen=True))
    assert seconds_per_step(1000, 100.0, hot, 1) > seconds_per_step(1000, 100.0, STAGE, 1)
    assert seconds_per_step(1000, 0.0, frozen, 1) < seconds_per_step(1000, 10.0, STAGE, 1)
    plain = seconds_per_step(1000, 0.0, STAGE, 1)
    assert seconds_per_step(1000, 0.0, STAGE, 1, comes_and_goes=True) > plain
    shaped = seconds_per_step(1000, 0.0, STAGE, 1, has_outlines=True)
    assert shaped == pytest.approx(plain + 1000 * PER_GRAIN_OF_OUTLINES)
    assert seconds_per_step(1000, 50.0, STAGE, 1, has_outlines=True) - shaped == pytest.approx(
        PER_CONTACT_OF_OUTLINES * (seconds_per_step(1000, 50.0, STAGE, 1) - plain)
    )

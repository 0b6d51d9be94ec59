"""What a step will cost, from what the stage is about to do: sweeps of the contact solver, and the time of everything.

Fitted to the shipped scenarios on one core of an AMD EPYC (AVX2): what is said here is 0.72 to 1.4 times what whole runs
take, for the steps that they do. Most of the rest is the number of sweeps.
"""

from __future__ import annotations

import math

from multicor_cli.arithmetic import power
from multicor_cli.engine.jit.threads import PARALLEL_GRAINS
from multicor_cli.running.plan import StagePlan
from multicor_cli.running.time_step import Scales

CONTACTS_PER_GRAIN = 1.3
"""Contacts within reach, loaded or not, per grain, on average over a run: 1.0 in fast flows, 1.8 in beds."""

SWEEPS = 120.0
"""Sweeps of a step at an inertial number of `INERTIAL_NUMBER`, or where nothing sets one, at `TOLERANCE`."""

INERTIAL_NUMBER, SLOWNESS = 0.03, 0.31
"""A slower flow needs more sweeps: in proportion to the power -`SLOWNESS` of its inertial number."""

FEWEST, MOST = 0.4, 6.0
"""Bounds of that proportion."""

TOLERANCE, TIGHTNESS = 1e-3, 0.31
"""Likewise with ``tolerance_rms``."""

SECONDS_PER_CONTACT = 8.4e-9
"""One sweep over one contact on one core [s]."""

SECONDS_PER_GRAIN = 1.2e-6
"""Everything but the sweeps, per grain and step, on one core [s]."""

SECONDS_PER_STEP = 1.3e-3
"""What a step costs however few grains there are [s]."""

HEAT_PER_STEP, HEAT_PER_GRAIN = 0.3e-3, 0.1e-6
"""What heat adds to a step, and to that for each grain [s]."""

EXCHANGE_PER_STEP = 3.1e-3
"""What grains that come and go add to a step, on average [s]."""

SECONDS_PER_FROZEN_STEP, SECONDS_PER_FROZEN_GRAIN = 0.5e-3, 0.5e-6
"""Heat flow in one step of a frozen stage, and for each grain, on one core [s]."""


def sweeps_of_stage(scales: Scales, tolerance: float) -> float:
    """Rough number of sweeps of a step.

    Args:
        scales: Times that the stage has to resolve.
        tolerance: ``tolerance_rms`` of the stage.
    """
    slowness = 1.0
    if scales.pressure < math.inf and scales.strain < math.inf:
        slowness = power(scales.pressure / scales.strain / INERTIAL_NUMBER, -SLOWNESS)
    return SWEEPS * min(max(slowness, FEWEST), MOST) * power(tolerance / TOLERANCE, -TIGHTNESS)


def seconds_per_step(grains: int, sweeps: float, stage: StagePlan, threads: int, *, comes_and_goes: bool = False) -> float:
    """Rough wall-clock time of a step [s]; small problems do not profit from threads."""
    if stage.is_frozen:
        return SECONDS_PER_FROZEN_STEP + grains * SECONDS_PER_FROZEN_GRAIN
    work = grains * (CONTACTS_PER_GRAIN * sweeps * SECONDS_PER_CONTACT + SECONDS_PER_GRAIN)
    fixed = SECONDS_PER_STEP + (EXCHANGE_PER_STEP if comes_and_goes else 0.0)
    if stage.heat is not None and stage.heat.is_on:
        fixed += HEAT_PER_STEP
        work += grains * HEAT_PER_GRAIN
    return fixed + (work / (0.8 * threads) if threads > 1 and grains >= PARALLEL_GRAINS else work)

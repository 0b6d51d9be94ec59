"""The global solve of one contact problem, in slices short enough to be interrupted."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np

from multicor_cli.engine.contact.acceleration import Tolerances, iterate, start_loop, start_momentum
from multicor_cli.engine.contact.settings import Settings
from multicor_cli.engine.contact.sweep import BIPOTENTIAL, EXACT, System
from multicor_cli.engine.contact.thread_choice import SLICE, ThreadChoice


@dataclass(frozen=True)
class ResidualScale:
    """What residuals are measured against: u_ref [m/s], and ½ M u_ref² [J]."""

    velocity: float
    energy: float


@dataclass(frozen=True)
class Outcome:
    """Result of a solve; residuals over their scale, ``sweeps`` in sweep-equivalents."""

    sweeps: float
    converged: bool
    rms: float
    maximum: float
    energy: float


class Interrupted(Exception):
    """The solve was abandoned because a signal asked for it; nothing has been changed."""


def solve_system(
    system: System,
    scale: ResidualScale,
    settings: Settings,
    pace: ThreadChoice,
    should_stop: Callable[[], bool] | None = None,
) -> Outcome:
    """Sweep until the three tolerances are met or the cap is reached.

    Args:
        system: The problem, with velocities that match its impulses. **Impulses and velocities modified.**
        scale: ResidualScale of the residuals.
        settings: Method, tolerances, cap.
        pace: Decides between one thread and several, and takes note of what they cost.
        should_stop: Asked between slices.

    Raises:
        Interrupted: If ``should_stop`` says so.
    """
    count = system.pair.shape[0] + system.general_pair.shape[0]
    if count == 0 or scale.velocity == 0.0:
        return Outcome(0.0, True, 0.0, 0.0, 0.0)
    tolerance = Tolerances(
        settings.tolerance_rms * scale.velocity, settings.tolerance_max * scale.velocity, settings.tolerance_energy * scale.energy
    )
    memory, momentum = start_loop(count), start_momentum(system)
    loop = memory[0]
    partial = np.empty(system.tile_start.size - 1)
    local = EXACT if settings.local == "exact" else BIPOTENTIAL
    slice_ = max(1, SLICE // count)
    limit = 0
    outside = numba.get_num_threads()
    try:
        while not loop["is_converged"] and limit < settings.max_sweeps:
            limit = min(limit + slice_, settings.max_sweeps)
            is_last = limit == settings.max_sweeps
            parallel = pace.choose(count)
            numba.set_num_threads(pace.threads if parallel else 1)
            done, started = float(loop["sweeps"]), time.perf_counter()
            iterate(system, momentum, local, settings.method == "accelerated", parallel, limit, is_last, tolerance, memory, partial)
            pace.note(count, parallel, (float(loop["sweeps"]) - done) * count, time.perf_counter() - started)
            if should_stop is not None and should_stop():
                raise Interrupted
    finally:
        numba.set_num_threads(outside)  # the caller may have chosen it
    return Outcome(
        float(loop["sweeps"] + loop["checks"]),
        bool(loop["is_converged"]),
        float(loop["rms"] / scale.velocity),
        float(loop["maximum"] / scale.velocity),
        float(loop["energy"] / scale.energy),
    )

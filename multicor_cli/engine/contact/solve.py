"""The global solve of one contact problem, in slices short enough to be interrupted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.acceleration import (
    GAIN,
    NEVER,
    Momentum,
    Tolerances,
    begin_again,
    is_converged,
    iterate,
    start_loop,
    start_momentum,
    step_back,
)
from multicor_cli.engine.contact.contacts import Speeds
from multicor_cli.engine.contact.patches import (
    BLOCKS,
    SIZES,
    choose_patch,
    has_clusters,
    hold,
    keep_in_mind,
    nothing_met,
    release,
    solve_patch,
)
from multicor_cli.engine.contact.sweep import BIPOTENTIAL, EXACT, System
from multicor_cli.engine.jit.threads import threads_in_use, use_threads
from multicor_cli.engine.orders import PhysicsError, Settings, stop_if_asked
from multicor_cli.model.model import Floats

# ---- One thread or several: whichever was faster lately; results do not depend on it

SLICE = 2_000_000
"""Contact relaxations between two looks at the signals and the clock: well under 0.2 s."""

PARALLEL_FROM = 6_000
"""Contacts from which several threads pay; the result is the same either way."""

_LATEST = 0.3  # weight of the latest measurement in the running average
# Work between two tries of the other way, in units of `SLICE`; more if it was much slower
_PATIENCE = 40.0


class ThreadChoice:
    """Learns what a contact relaxation costs on one thread and on several.

    On idle cores, threads pay from some thousand contacts on. On cores that other programs use too,
    they can cost many times what they save, because the tiles of one color wait for the slowest
    thread four times in every sweep.
    """

    def __init__(self, threads: int = 1) -> None:
        self.threads = threads
        self._cost = {False: math.nan, True: math.nan}
        self._work = 0.0  # since the other way was tried
        self._is_warm = False

    @property
    def favorite(self) -> int:
        """Threads for what is not measured: as many as may be used unless one was faster."""
        return 1 if self._cost[False] < self._cost[True] else self.threads

    def choose(self, contacts: int) -> bool:
        if self.threads == 1 or contacts < PARALLEL_FROM:
            return False
        if math.isnan(self._cost[True]):
            return True
        if math.isnan(self._cost[False]):
            return self._work < 0.25 * _PATIENCE
        best = self._cost[True] <= self._cost[False]
        ratio = self._cost[not best] / self._cost[best]
        return best if self._work < _PATIENCE * ratio else not best

    def note(self, contacts: int, is_parallel: bool, relaxations: float, seconds: float) -> None:
        """Note the time of a slice [s]; the very first, and small problems, count for nothing."""
        if self.threads == 1 or contacts < PARALLEL_FROM or relaxations <= 0.0:
            return
        if not self._is_warm:  # the kernels were compiled or loaded in it
            self._is_warm = True
            return
        cost, before = seconds / relaxations, self._cost[is_parallel]
        other = self._cost[not is_parallel]
        was_try = not math.isnan(other) and not math.isnan(before) and before > other
        # A try counts in full: what was measured long ago says little.
        self._cost[is_parallel] = (
            cost if math.isnan(before) or was_try else (1.0 - _LATEST) * before + _LATEST * cost
        )
        self._work = 0.0 if was_try or math.isnan(before) else self._work + relaxations / SLICE


# ---- The global solve of one contact problem, in slices short enough to be interrupted


class ResidualScale(NamedTuple):
    """Scales of residuals: u_rms and u_ref [m/s], ½ M u_load u_ref [J] (theory §5.3).

    ``motion`` is the mean speed at which bodies in contact move past each other, ``load`` is u_load
    [m/s]: what rests is solved more sharply; so are impacts that lose next to nothing, by the
    ``lost`` share of their energy. Nothing is solved to less than ``least`` [m/s].
    """

    rms: float
    velocity: float
    energy: float
    motion: float = math.inf
    load: float = 0.0
    lost: float = 1.0
    least: float = 0.0

    @classmethod
    def of(
        cls, speeds: Speeds, mass: float, count: int, weight: float, thrust: float,
        attraction: float, restitution: float, crossing: float, rounding: float,
    ) -> ResidualScale:  # fmt: skip
        """What residuals of a step are measured against (theory §5.3).

        Velocities: u_rms = max(u_load, min(40 s min(1, √(s/u_load)), d̄/(12 Δt))) with the mean
        shear s, and u_ref = max(u_load, u_rms/5), with u_load = max(Δt |g|, Δt P d̄/m̄, rms of the
        closing velocities). Energies: ½ M u_load u_ref, or ½ M u_ref² where nothing loads. Without
        weight and load the attraction over m̄ stands in for them.

        Args:
            speeds: Sums over the contacts.
            mass: Mass M of all grains [kg].
            count: Their number, M/m̄.
            weight: Δt |g| [m/s].
            thrust: Δt P d̄ [N s].
            attraction: Largest F Δt of a contact [N s].
            restitution: Largest coefficient of all pairs of materials.
            crossing: d̄/Δt, which moves a grain by its diameter in a step [m/s].
            rounding: A velocity that moves nothing by more than positions are rounded [m/s].
        """
        mean_mass, closing = mass / count, speeds.closing
        load = max(
            max(weight, thrust / mean_mass) or attraction / mean_mass,
            math.sqrt(speeds.squares / closing) if closing else 0.0,
        )
        shear = speeds.shear / speeds.loaded if speeds.loaded else 0.0
        # Errors add up like a random walk: their square over the steps of a strain is what counts
        swift = min(1.0, math.sqrt(shear / load)) if load else 1.0
        rms = max(load, min(SHEARS * swift * shear, STRAY * crossing))
        reference = max(load, LARGEST * rms)
        bounce = restitution if closing else 0.0
        return cls(
            rms, reference, 0.5 * mass * ((load or reference) * reference),
            speeds.motion / speeds.met if speeds.met else math.inf, load,
            max(1.0 - bounce * bounce, LEAST_LOSS), max(rounding, REST_FLOOR * rms),
        )  # fmt: skip

    def tolerances(self, settings: Settings) -> Tolerances:
        rms, wanted = settings.tolerance_rms * self.rms, math.inf
        if self.load > 0.0:
            moves = self.motion / self.load
            at_rest = max(STILL_SHARE, REST_SHARE * min(1.0, moves / STILL))
            wanted = max(max(at_rest, moves * PER_LOAD) * self.motion, self.least)
        return Tolerances(
            rms, settings.tolerance_max * self.velocity, settings.tolerance_energy * self.energy,
            min(1.0, PER_LOSS * self.lost, wanted / rms),
        )  # fmt: skip


SHEARS, STRAY, LARGEST = 40.0, 1.0 / 12.0, 0.2
"""Scale of the rms over the mean shear of a flow that is faster than its loads, so that 8 % of it
pass by default; and at most over d̄/Δt, so that by default a step leaves errors of d̄/6000, less than
the overlap that is left alone: to correct positions costs more than the sweeps that save it. Scale
of the largest correction over that of the rms."""

STILL_SHARE, REST_SHARE = 0.002, 0.02
"""Largest rms correction over the motion that there is, where sweeps allow: where next to nothing
moves, and at rest (theory §5.3)."""

STILL, PER_LOAD = 1e-4, 0.4
"""Motion in units of u_load below which it is next to nothing; by which the share grows from there.
"""

PER_LOSS, LEAST_LOSS = 5.0, 1e-3
"""Share of the tolerance over the share 1 − e² of their energy that impacts lose, where sweeps
allow; and the least such share that is told from none."""

REST_FLOOR = 1e-11
"""Of u_rms, which no error has to be below."""


class Outcome(NamedTuple):
    """Result of a solve; residuals over their scale, ``sweeps`` in sweep-equivalents."""

    sweeps: float
    converged: bool
    rms: float
    maximum: float
    energy: float

    def require_convergence(self, settings: Settings, step: int) -> None:
        """Raise `PhysicsError` at ``step`` if ``settings`` make a failed solve an error."""
        if self.converged or settings.on_failure == "warn":
            return
        message = (
            f"the contact solver did not converge in {settings.max_sweeps} sweeps: "
            f"rms {self.rms:.2e}, max {self.maximum:.2e}, energy {self.energy:.2e} of their scale"
        )
        raise PhysicsError(step, message)


def solve_system(
    system: System, scale: ResidualScale, settings: Settings, pace: ThreadChoice,
    should_stop: Callable[[], bool] | None = None,
) -> Outcome:  # fmt: skip
    """Sweep until the three tolerances are met or the cap is reached.

    Velocities match impulses at first; both are **modified**. ``pace`` decides between one thread
    and several. ``should_stop`` is asked between slices: `Interrupted` is raised if it says so.
    """
    count = system.contacts
    if count == 0 or scale.velocity == 0.0:
        return Outcome(0.0, True, 0.0, 0.0, 0.0)
    tolerance = scale.tolerances(settings)
    memory, momentum = start_loop(count), start_momentum(system)
    loop = memory[0]
    partial = np.empty((system.tile_start.size - 1, 2))
    met = None
    local = EXACT if settings.local == "exact" else BIPOTENTIAL
    slice_, stuck = max(1, SLICE // count), 0
    outside = threads_in_use()
    try:
        while not loop["is_converged"] and loop["sweeps"] < settings.max_sweeps:
            limit = min(int(loop["sweeps"]) + slice_, settings.max_sweeps)
            is_last = limit == settings.max_sweeps
            parallel = pace.choose(count)
            if parallel:
                use_threads(pace.threads)
            done, started = float(loop["sweeps"]), time.perf_counter()
            iterate(
                system, momentum, local, settings.method == "accelerated", parallel, limit, is_last,
                tolerance, memory, partial,
            )  # fmt: skip
            taken = time.perf_counter() - started
            pace.note(count, parallel, (float(loop["sweeps"]) - done) * count, taken)
            if loop["is_stuck"]:
                # Where fresh momentum has not helped either, errors are patched wherever they are
                stuck += 1
                met = nothing_met(system) if met is None else met
                is_clustered = stuck > 1 or bool(loop["is_peak"]) or has_clusters(system)
                done = int(loop["patches"])
                if is_clustered and done < len(SIZES):
                    solve_patch(system, choose_patch(system, SIZES[done], met))
                elif is_clustered:
                    contact = choose_patch(system, BLOCKS[(done - len(SIZES)) % len(BLOCKS)], met)
                    _take_turns(
                        system, contact, momentum, local, parallel, tolerance, memory, partial,
                        should_stop,
                    )  # fmt: skip
                keep_in_mind(system, met)
                begin_again(system, momentum, is_clustered, loop)
            stop_if_asked(should_stop)
    finally:
        use_threads(outside)  # the caller may have chosen it
    return Outcome(
        float(loop["sweeps"] + loop["checks"]), bool(loop["is_converged"]),
        float(loop["rms"] / scale.rms), float(loop["maximum"] / scale.velocity),
        float(loop["energy"] / scale.energy),
    )  # fmt: skip


TURNS, SWEEPS, FUTILE = 40, 10, 12
"""Turns of a block at most; sweeps in each; turns without gain after which it is given up."""


def _take_turns(
    system: System, contact: NDArray[np.int64], momentum: Momentum, local: int, parallel: bool,
    tolerance: Tolerances, memory: NDArray[np.void], partial: Floats,
    should_stop: Callable[[], bool] | None,
) -> None:  # fmt: skip
    """Solve a patch exactly and sweep over all other contacts, by turns: block Gauss–Seidel.

    A patch that is solved once and then swept over like everything else is left again, because its
    solution is an unstable fixed point of the sweep. Held, it cannot be left. Slow shear of rough
    grains (μ = 0.8, I = 0.003) had a step in two thousand that 50,000 sweeps and patches of all
    sizes did not solve; these take one to three thousand sweeps.
    """
    loop, best, since = memory[0], np.inf, 0
    for _ in range(TURNS):
        stop_if_asked(should_stop)
        if not solve_patch(system, contact) or is_converged(system, tolerance, loop, parallel):
            return
        best, since = (loop["rms"], 0) if loop["rms"] < GAIN * best else (best, since + 1)
        if since >= FUTILE:
            return
        begin_again(system, momentum, False, loop)
        mass = hold(system, contact)
        iterate(
            system, momentum, local, True, parallel, int(loop["sweeps"]) + SWEEPS, False, NEVER,
            memory, partial,
        )  # fmt: skip
        step_back(system, momentum)
        release(system, contact, mass)

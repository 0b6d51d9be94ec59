"""The loop of the global solve: plain or accelerated Gauss–Seidel sweeps until residuals pass.

The accelerated method extrapolates the sweep as Nesterov does, y = x + ω (x − x_last), on impulses
and velocities alike (they are linear in each other). Friction makes the problem no minimization,
and unguarded momentum cycles in sliding states. Guards:

* the momentum restarts when the corrections of a sweep point against what has changed since the
  last iterate (gradient restart): they are known contact by contact, in the sweep itself;
* it restarts when the change per sweep has grown to 1.5 times its lowest value since the last
  restart (any growth: 1.5 to 3 times as many sweeps in shear; growth by 2: more sweeps, and fewer
  errors left at the same residual; by 5 and more: some sliding states cycle). A solve that is still
  not done after 250 sweeps has errors of long wavelength, which only a long run of momentum
  removes: the change may then grow threefold (a bed of 116 layers from a cold start: 1,350 sweeps
  instead of 8,645; flows that need so many sweeps: up to a quarter more);
* near the tolerance momentum's own noise in a few contacts keeps the residual up: thirty sweeps
  with half of the normal corrections calm it, in very long solves only (earlier it would end them
  with more of the smooth errors left);
* where nothing has been gained for long and the change per sweep is above the tolerance of the rms,
  a cluster of contacts may cycle. The loop says that it is stuck: such a cluster has to be solved
  in another way (`multicor_cli.engine.contact.patches`);
* so it may where the largest correction alone misses its tolerance and does not become lower. Among
  10⁵ contacts a cluster that cycles keeps neither the rms nor the change per sweep above theirs (a
  collapse of 10⁵ grains: five steps ended unconverged after 60,000 sweeps, which take 600 to 1,000
  with this).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.sweep import EXACT, Before, Relaxation, System, sweep
from multicor_cli.engine.jit.arrays import CHUNK, copy_into
from multicor_cli.engine.jit.compile import kernel, loop_body, prange, subroutine, threaded_loop
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import NORMAL, TANGENTIAL
from multicor_cli.model.model import Floats


class Momentum(NamedTuple):
    """The last iterate: velocities and impulses, as in `System`."""

    velocity: Floats
    before: Before


LOOP = np.dtype(
    [
        ("sweeps", "f8"),  # done so far
        ("checks", "f8"),  # evaluations of the residual
        ("is_converged", "?"),
        ("rms", "f8"),  # what the last evaluation said: velocity corrections [m/s] and energy [J]
        ("maximum", "f8"),
        ("energy", "f8"),
        ("active", "f8"),  # contacts that carry an impulse or would, at the last evaluation
        ("theta", "f8"),  # Nesterov's θ
        ("factor", "f8"),  # of the last extrapolation
        ("lowest", "f8"),  # change per sweep since the momentum was restarted [m/s]
        ("best", "f8"),  # change per sweep since the start, or since it was stuck
        ("best_at", "f8"),  # sweeps then
        ("mode", "i8"),  # row of `MODES`
        ("since", "f8"),  # sweeps when the mode began
        ("patience", "f8"),  # sweeps without gain after which the loop is stuck
        ("is_stuck", "?"),  # nothing has been gained for long
        ("peak", "f8"),  # lowest miss of maximum and energy since the rms met its tolerance [1]
        ("peak_at", "f8"),  # sweeps then
        ("is_peak", "?"),  # stuck though the rms has met its tolerance
        ("patches", "i8"),  # solved since the start
        ("next_check", "f8"),  # sweeps before which the residual is not evaluated again
    ],
    align=True,
)
"""What the loop carries from one slice of sweeps to the next."""


class Tolerances(NamedTuple):
    """When the loop ends: rms and largest velocity correction [m/s], and energy residual G [J].

    For its first `REST_SWEEPS` sweeps it ends only below the share ``wanted`` of all three.
    """

    rms: float
    maximum: float
    energy: float
    wanted: float = 1.0


NEVER = Tolerances(-1.0, -1.0, -1.0)
"""With these the residual is not looked at."""

FAST, CALM = 0, 1
MODES = np.array([[1.0, 1.0, 1.5], [0.5, 1.0, 1.2]])
"""Rows: factors on both corrections; growth of the change per sweep that restarts the momentum."""
GROWTH = 2  # its column
# Growth for local solves that are not exact: with more, they and the momentum drive each other
CAREFUL = 1.0
# Sweeps between which `FAST` has another growth, unless it was stuck
LONG_FROM, LONG_TO, LONG_GROWTH = 250.0, 1000.0, 3.0
# Times the tolerance; sweeps in `FAST` before; sweeps in `CALM`
CALM_BELOW, CALM_AFTER, CALM_FOR = 2.0, 1000.0, 30.0
REST_SWEEPS = 100.0  # after which what rests is solved no more sharply than what flows
GAIN = 0.9  # the loop has gained if the change per sweep is lower by this factor
PATIENCE = 1000.0  # sweeps without gain after which the loop is stuck
PEAK_PATIENCE = 200.0  # the same where the rms has met its tolerance
FAR = 100.0  # energy over its tolerance, from which on impulses are far from any solution
PATIENCE_AFTER = 15.0  # the same after a patch: what is unstable grows again
# After which patches take turns with long sweeping again: these have not helped, and they cost more
PATCHES = 20


@kernel
def start_loop(contact_count: int) -> NDArray[np.void]:
    """A loop that has not begun: one record of `LOOP`, shape ``(1,)``."""
    memory = np.zeros(1, LOOP)
    loop = memory[0]
    loop["active"] = contact_count
    loop["theta"] = 1.0
    loop["lowest"] = np.inf
    loop["best"] = np.inf
    loop["peak"] = np.inf
    loop["patience"] = PATIENCE
    return memory


def start_momentum(s: System) -> Momentum:
    """Momentum at rest, at the present iterate."""
    return Momentum(
        s.velocity[: s.inverse.shape[0]].copy(),
        Before(s.impulse.copy(), s.general_impulse.copy(), s.couples.impulse.copy()),
    )


@loop_body
def extrapolate(first: int, last: int, now: Floats, before: Floats, factor: float) -> None:
    """Values become the last iterate, ``before``, and move on by ``factor`` times their change."""
    for k in range(first, last):
        new = now[k]
        now[k] = new + factor * (new - before[k])
        before[k] = new


@threaded_loop
def _extrapolate_on_threads(now: Floats, before: Floats, factor: float, chunks: int) -> None:
    for chunk in prange(chunks):
        first = 4 * CHUNK * chunk
        extrapolate(first, min(before.size, first + 4 * CHUNK), now, before, factor)


@subroutine
def _switch(mode: int, loop: Any) -> None:
    loop["mode"], loop["since"], loop["lowest"] = mode, loop["sweeps"], np.inf


@kernel
def _choose_mode(change: float, tolerance: float, loop: Any) -> None:
    """Calm down near the tolerance, and come back; say so where it is far and nothing is gained."""
    if change < GAIN * loop["best"]:
        loop["best"], loop["best_at"] = change, loop["sweeps"]
    in_mode = loop["sweeps"] - loop["since"]
    if change > tolerance and loop["sweeps"] - loop["best_at"] >= loop["patience"]:
        loop["is_stuck"] = True
    elif loop["mode"] == CALM:
        if in_mode >= CALM_FOR:
            _switch(FAST, loop)
    elif change < CALM_BELOW * tolerance and in_mode >= CALM_AFTER:
        _switch(CALM, loop)


@kernel
def begin_again(s: System, m: Momentum, is_patched: bool, loop: Any) -> None:
    """Go on with fresh momentum after the loop was stuck; a patch may have changed the iterate."""
    velocity = m.velocity.reshape(-1)
    copy_into(velocity, s.velocity.reshape(-1)[: velocity.size])
    copy_into(m.before.impulse.reshape(-1), s.impulse.reshape(-1))
    copy_into(m.before.general_impulse.reshape(-1), s.general_impulse.reshape(-1))
    copy_into(m.before.couple, s.couples.impulse)
    loop["theta"], loop["factor"] = 1.0, 0.0
    loop["best"], loop["best_at"], loop["is_stuck"] = np.inf, loop["sweeps"], False
    loop["peak"], loop["peak_at"], loop["is_peak"] = np.inf, loop["sweeps"], False
    loop["patches"] += is_patched
    loop["patience"] = PATIENCE_AFTER if is_patched and loop["patches"] <= PATCHES else PATIENCE
    _switch(FAST, loop)


@kernel
def _growth(loop: Any) -> float:
    mode, sweeps = loop["mode"], loop["sweeps"]
    is_long = mode == FAST and loop["patches"] == 0 and LONG_FROM <= sweeps < LONG_TO
    return LONG_GROWTH if is_long else MODES[mode, GROWTH]


@subroutine
def choose_factor(change: float, onward: float, growth: float, loop: Any) -> float:
    """The factor ω of the next extrapolation, 0 if the momentum restarts; into ``loop``, too.

    ``change`` and ``onward`` are those of the last sweep (`sweep`); ``growth`` is that of the
    change over its lowest value at which the momentum restarts.
    """
    if change > growth * loop["lowest"] or onward < 0.0:
        loop["theta"], loop["lowest"] = 1.0, change
    loop["lowest"] = min(loop["lowest"], change)
    theta = loop["theta"]
    following = 0.5 * theta * (np.sqrt(theta * theta + 4.0) - theta)  # Nesterov's θ
    loop["theta"] = following
    loop["factor"] = theta * (1.0 - theta) / (theta * theta + following)
    return loop["factor"]  # type: ignore[no-any-return]


@kernel
def move_on(
    s: System, m: Momentum, change: float, onward: float, growth: float, loop: Any, parallel: bool
) -> None:
    """Record velocities and move them on; the next sweep moves impulses by ``factor`` of ``loop``.

    Arguments as `choose_factor`; velocities, momentum and ``loop`` are **modified**.
    """
    factor = choose_factor(change, onward, growth, loop)
    now, before = s.velocity.reshape(-1), m.velocity.reshape(-1)
    if parallel:
        _extrapolate_on_threads(now, before, factor, -(-before.size // (4 * CHUNK)))
    else:
        extrapolate(0, before.size, now, before, factor)


@kernel
def step_back(s: System, m: Momentum) -> None:
    """Take velocities back to where the impulses are, after `iterate` has ended at its limit.

    `move_on` moves velocities on and leaves the impulses to the next sweep. Whoever does not sweep
    next, but solves some contacts or begins again, would work with velocities of no impulses.
    """
    copy_into(s.velocity.reshape(-1), m.velocity.reshape(-1))


@formula
def _share(tolerance: Tolerances, loop: Any) -> float:
    return tolerance.wanted if loop["sweeps"] < REST_SWEEPS else 1.0


@kernel
def is_converged(s: System, tolerance: Tolerances, loop: Any, parallel: bool) -> bool:
    """Evaluate the residual; decides alone when the loop ends. No contact may be held."""
    rms, largest, energy, active = measure_residual(s, parallel)
    loop["checks"] += 1.0
    loop["rms"], loop["maximum"], loop["energy"] = rms, largest, energy
    loop["active"] = max(1.0, active)
    share = _share(tolerance, loop)
    excess = (
        max(rms / tolerance.rms, largest / tolerance.maximum, np.sqrt(energy / tolerance.energy))
        / share
    )
    # A residual far above its tolerance is not worth looking at again soon.
    loop["next_check"] = loop["sweeps"] + (2.0 if excess < 1.5 else 4.0 if excess < 4.0 else 8.0)
    loop["is_converged"] = (
        rms <= share * tolerance.rms
        and largest <= share * tolerance.maximum
        and energy <= share * tolerance.energy
    )
    return bool(loop["is_converged"])


@subroutine
def _watch_peak(has_corners: bool, tolerance: Tolerances, loop: Any) -> None:
    """Say so where the rms alone has met its tolerance for long, and nothing else comes nearer.

    The maximum misses it where a few contacts go round in circles. Among grains with corners the
    energy does, too, where impulses are far from any solution in ways that velocities do not feel,
    as after steps that had none. Where it alone misses, and not by far, sweeps get there: patches
    cost ten times as much.
    """
    if loop["rms"] > tolerance.rms:
        return
    miss, patience = loop["maximum"] / tolerance.maximum, min(loop["patience"], PEAK_PATIENCE)
    if loop["energy"] > tolerance.energy:
        if not has_corners:
            return
        if miss <= 1.0 and loop["energy"] <= FAR * tolerance.energy:
            patience = PATIENCE
        miss = max(miss, np.sqrt(loop["energy"] / tolerance.energy))
    if miss < GAIN * loop["peak"]:
        loop["peak"], loop["peak_at"] = miss, loop["sweeps"]
    elif loop["sweeps"] - loop["peak_at"] >= patience:
        loop["is_stuck"], loop["is_peak"] = True, True


@kernel
def iterate(
    s: System, m: Momentum, local: int, accelerated: bool, parallel: bool, limit: int,
    is_last: bool, tolerance: Tolerances, memory: NDArray[np.void], partial: Floats,
) -> None:  # fmt: skip
    """Sweep until converged, or until ``limit`` sweeps have been done in all.

    A caller that gives up there says so (``is_last``): the residual is then evaluated there.
    Momentum and ``memory``, from `start_loop`, are carried from one call to the next: **modified**,
    as impulses and velocities are.
    """
    loop = memory[0]
    while loop["sweeps"] < limit:
        mode = loop["mode"]
        way = Relaxation(MODES[mode, NORMAL], MODES[mode, TANGENTIAL], loop["factor"])
        squares, onward = sweep(s, m.before, local, way, parallel, partial)
        change = np.sqrt(squares / loop["active"])
        loop["sweeps"] += 1.0
        # The change per sweep is cheap; the residual is evaluated only where it may pass.
        is_end = is_last and loop["sweeps"] == limit
        may_pass = (
            change <= 2.0 * _share(tolerance, loop) * tolerance.rms
            and loop["sweeps"] >= loop["next_check"]
        )
        if may_pass or is_end:
            if is_converged(s, tolerance, loop, parallel) or is_end:
                return
            if accelerated:
                _watch_peak(s.faces is not None, tolerance, loop)
        if accelerated:
            _choose_mode(change, tolerance.rms, loop)
            if loop["is_stuck"]:
                return
            growth = _growth(loop) if local == EXACT else CAREFUL
            move_on(s, m, change, onward, growth, loop, parallel)

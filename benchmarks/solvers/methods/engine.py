"""The accelerated Gauss–Seidel of the program itself, called as the program calls it."""

from __future__ import annotations

import time

import numpy as np

from methods.operators import TIME, Log, record
from multicor_cli.engine.contact.acceleration import Tolerances, iterate, start_loop, start_momentum
from multicor_cli.engine.contact.sweep import EXACT, System
from multicor_cli.model.model import Floats


class Loop:
    """The loop of the program on a system, a few sweeps at a time. It never stops by itself, and
    its clock runs while it sweeps.

    Attributes:
        system: What is solved. After `sweep` its velocities are ahead of the last iterate by the
            extrapolation.
        work: Sweep-equivalents so far.
        seconds: Time so far [s].
    """

    def __init__(self, system: System, rms: float) -> None:
        """Begin with the present impulses; ``rms`` is the tolerance near which the loop calms down
        [m/s].
        """
        self.system = system
        self.work = 0.0
        self.seconds = 0.0
        self._partial = np.empty((system.tile_start.size - 1, 2))
        self._tolerance = Tolerances(rms, 0.0, 0.0)  # never met: the loop goes on
        self.restart()

    def restart(self) -> None:
        """Forget the momentum."""
        self._momentum = start_momentum(self.system)
        self._memory = start_loop(self.system.contacts)

    def sweep(self, count: int) -> None:
        """Do some sweeps."""
        started = time.perf_counter()
        limit = int(self._memory["sweeps"][0]) + count
        iterate(
            self.system,
            self._momentum,
            EXACT,
            True,
            False,
            limit,
            False,
            self._tolerance,
            self._memory,
            self._partial,
        )
        self.seconds += time.perf_counter() - started
        self.work += count

    def retreat(self) -> None:
        """Take back the extrapolation after the last sweep, and remember it for `advance`."""
        s, m = self.system, self._momentum
        bodies = m.velocity.shape[0]
        self._left = s.velocity[:bodies].copy(), s.impulse.copy(), s.general_impulse.copy()
        s.velocity[:bodies] = m.velocity

    def advance(self) -> None:
        """Extrapolate again, from wherever the system is now: a move since `retreat` does not count
        as momentum.
        """
        s, m = self.system, self._momentum
        ahead, impulse, general_impulse = self._left
        now = s.velocity[: len(ahead)].copy()
        s.velocity[: len(ahead)] = ahead + (now - m.velocity)
        m.velocity[:] = now
        # The next sweep extrapolates the impulses by their distance from the last ones.
        m.before.impulse[:] += s.impulse - impulse
        m.before.general_impulse[:] += s.general_impulse - general_impulse

    def note(self, log: Log, row: int) -> bool:
        """Write the errors, the work and the time of the present iterate; whether the residual is
        below ``log.stop``.
        """
        if row < len(log.rows):
            log.rows[row, TIME] = self.seconds
        return bool(record(self.system, log, row, self.work))


def run_engine(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """The loop of the program; its checks of the residual are left out, as for all methods. No
    parameters.
    """
    loop = Loop(s, float(log.stop[0]))
    if len(log.rows) == 0:
        loop.sweep(iterations)
        return iterations
    for number in range(iterations):
        loop.sweep(1)
        loop.retreat()
        if loop.note(log, number):
            return number + 1
        loop.advance()
    return iterations

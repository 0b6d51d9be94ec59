"""One thread or several: whichever has been faster lately. Results do not depend on it, so it may follow the clock."""

from __future__ import annotations

import math

SLICE = 2_000_000
"""Contact relaxations between two looks at the signals and the clock: well under 0.2 s."""

PARALLEL_FROM = 6_000
"""Contacts from which several threads pay; the result is the same either way."""

_LATEST = 0.3  # weight of the latest measurement in the running average
_PATIENCE = 40.0  # work between two tries of the other way, in units of `SLICE`; more if it was much slower


class ThreadChoice:
    """Learns what a contact relaxation costs on one thread and on several.

    On idle cores, threads pay from some thousand contacts on. On cores that other programs use too, they can cost
    many times what they save, because the tiles of one color wait for the slowest thread four times in every sweep.

    Attributes:
        threads: Number of threads that may be used.
    """

    def __init__(self, threads: int = 1) -> None:
        """Begin without knowledge; ``threads`` is the number of threads that may be used."""
        self.threads = threads
        self._cost = {False: math.nan, True: math.nan}
        self._work = 0.0  # since the other way was tried
        self._is_warm = False

    @property
    def favorite(self) -> int:
        """Number of threads for everything that is not measured: as many as may be used unless one has been faster."""
        return 1 if self._cost[False] < self._cost[True] else self.threads

    def choose(self, contacts: int) -> bool:
        """Whether to use several threads in the next slice of a problem."""
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
        """Take note of a slice; the very first one counts for nothing.

        Args:
            contacts: Contacts of the problem; small ones count for nothing.
            is_parallel: Whether it used several threads.
            relaxations: Contact relaxations in it.
            seconds: Time that it took [s].
        """
        if self.threads == 1 or contacts < PARALLEL_FROM or relaxations <= 0.0:
            return
        if not self._is_warm:  # the kernels were compiled or loaded in it
            self._is_warm = True
            return
        cost, before = seconds / relaxations, self._cost[is_parallel]
        other = self._cost[not is_parallel]
        was_try = not math.isnan(other) and not math.isnan(before) and before > other
        # A try counts in full: what was measured long ago says little.
        self._cost[is_parallel] = cost if math.isnan(before) or was_try else (1.0 - _LATEST) * before + _LATEST * cost
        self._work = 0.0 if was_try or math.isnan(before) else self._work + relaxations / SLICE

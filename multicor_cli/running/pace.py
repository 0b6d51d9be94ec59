"""How fast a run goes and when it will be done, the compilation of the kernels left out."""

from __future__ import annotations

from collections import deque

WARM_UP_STEPS = 3
"""Steps of this process that are left out: kernels compile, or are loaded from the cache, while they run."""

RECENT = 20.0
"""Length of wall-clock time over which the current speed is measured [s]."""

SPACING = 0.1
"""Shortest wall-clock time between two points [s]."""


class Pace:
    """Speed and remaining time from (clock, steps done by this process, share of the run that is done)."""

    def __init__(self) -> None:
        self._start: tuple[float, int, float] | None = None
        self._samples: deque[tuple[float, int]] = deque()
        self._progress = 0.0

    def note(self, now: float, steps: int, progress: float) -> None:
        """Note a point; points of the warm-up, and those too close to the one before, are left out.

        Args:
            now: Monotonic clock [s].
            steps: Steps done since this process began.
            progress: Share of the run that is done, 0 to 1.
        """
        if steps < WARM_UP_STEPS or (self._samples and now - self._samples[-1][0] < SPACING):
            return
        if self._start is None:
            self._start = (now, steps, progress)
        self._progress = progress
        self._samples.append((now, steps))
        while now - self._samples[0][0] > RECENT and len(self._samples) > 2:
            self._samples.popleft()

    def speed(self) -> float | None:
        """Recent speed [steps/s], or None as long as that is unknown."""
        if len(self._samples) < 2:
            return None
        (first, before), (last, after) = self._samples[0], self._samples[-1]
        return (after - before) / (last - first) if last > first else None

    def remaining(self) -> float | None:
        """Seconds left if the run goes on as it has since the warm-up, or None as long as that is unknown."""
        if self._start is None:
            return None
        begun, _, done_before = self._start
        now, done = self._samples[-1][0], self._progress - done_before
        if done <= 0.0 or now <= begun:
            return None
        return (1.0 - self._progress) * (now - begun) / done

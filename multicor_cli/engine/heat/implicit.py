"""The implicit integrator: TR-BDF2, which is of second order and L-stable, with control of the error.

Stages of a sub-step h (R. E. Bank et al., IEEE Trans. Electron Devices 32, 1985, 1992; coefficients and error estimate of
M. E. Hosea & L. F. Shampine, Appl. Numer. Math. 20, 1996, 21): with γ = 2 − √2, d = γ/2, w = √2/4

    T_γ = T_0 + d h (F_0 + F_γ),   T_1 = T_0 + h (w F_0 + w F_γ + d F_1),   F = rate/C,

and the embedded solution of third order has the weights (1−w)/3, (3w+1)/3, d/3. Heat flows at the rates of the three stages, so
that the books close to round-off however exactly the stages have been solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from multicor_cli.arithmetic import cbrt
from multicor_cli.engine.heat.flow import Flow, stop_if_asked
from multicor_cli.engine.heat.rates import Network, solve_linear, total_conductance
from multicor_cli.engine.heat.walls import WallValues
from multicor_cli.model.model import Floats

GAMMA = 2.0 - math.sqrt(2.0)
DIAGONAL = 0.5 * GAMMA
WEIGHT = 0.25 * math.sqrt(2.0)
WEIGHTS = (WEIGHT, WEIGHT, DIAGONAL)
DEFECTS = tuple(b - c for b, c in zip(WEIGHTS, ((1.0 - WEIGHT) / 3.0, (3.0 * WEIGHT + 1.0) / 3.0, DIAGONAL / 3.0), strict=True))
"""Weights of the solution minus those of the embedded one."""

SAFETY, LEAST, MOST = 0.9, 0.2, 4.0
"""Factor of caution and bounds of the change of the sub-step."""

SHARPNESS = 1e-3
"""Error of a stage over the tolerance of a sub-step."""

ROUNDING = 1e-13
"""What is left of a stage when rounding lets it be solved no further, over the temperature."""

NOISE = 1e-10
"""Smallest error of a sub-step that is told from rounding, over the temperature."""

SHORTEST = 1e-12
"""Shortest sub-step over the duration."""

NEWTON_LIMIT = 50


def advance_implicit(
    net: Network,
    capacity: Floats,
    temperature: Floats,
    walls: WallValues,
    source: Floats,
    dt: float,
    tolerance: float,
    first: float,
    should_stop: Callable[[], bool] | None = None,
) -> Flow:
    """Heat that flows within ``dt``, in sub-steps whose error is at most ``tolerance`` times the spread of the temperatures.

    The others are those of `multicor_cli.engine.heat.integration.integrate`; ``should_stop`` is asked before every sub-step.

    Raises:
        Interrupted: If ``should_stop`` says so.
        ArithmeticError: If no sub-step, however short, can be solved (temperatures that are not finite, above all).
    """
    flow = Flow.empty(capacity.size, walls.count)
    power = source / dt
    done, step = 0.0, min(first, dt) if first > 0.0 else dt
    while done < dt:
        stop_if_asked(should_stop)
        is_last = done + step >= dt * (1.0 - 1e-12)
        step = dt - done if is_last else step
        trial = _SubStep(net, capacity, temperature, walls, power, done, step, tolerance)
        error = trial.error() if trial.is_solved else math.inf
        if not error < math.inf and step < SHORTEST * dt:
            message = "the temperatures cannot be integrated: no step is short enough"
            raise ArithmeticError(message)
        if not error < math.inf:  # unsolved, or not a number
            step *= LEAST
            continue
        factor = min(MOST, max(LEAST, SAFETY / cbrt(error))) if error > 0.0 else MOST
        if error <= 1.0:
            trial.commit(flow, temperature)
            done = dt if is_last else done + step
            flow.next_step = max(flow.next_step, step * factor) if is_last else step * factor
        step *= factor if error <= 1.0 else min(factor, SAFETY)
    flow.received += source
    return flow


class _SubStep:
    """One sub-step: its three stages."""

    def __init__(
        self,
        net: Network,
        capacity: Floats,
        start: Floats,
        walls: WallValues,
        power: Floats,
        t: float,
        step: float,
        tolerance: float,
    ) -> None:
        self._net, self._capacity, self._start, self._step = net, capacity, start, step
        self._power, self._tolerance = power, tolerance
        self._values = [walls(t), walls(t + GAMMA * step), walls(t + step)]
        self._spread = max(_spread(net, start, value) for value in self._values)
        self._trial = Flow.empty(capacity.size, walls.count)
        self._total = np.empty(capacity.size)
        self.is_solved = True
        self._stages = [start]
        self._rates = [self._rate(start, 0)]
        self._solve((DIAGONAL,))
        if self.is_solved:
            self._solve((WEIGHT, WEIGHT))

    def _rate(self, temperature: Floats, stage: int) -> Floats:
        """Heat flow into the grains, sources included [W]."""
        self._trial.evaluate(self._net, temperature, self._values[stage])
        return self._trial.rate + self._power

    def _solve(self, weights: tuple[float, ...]) -> None:
        """Add a stage: T = T_0 + h (Σ weights·rates + d·rate(T))/C, by Newton's method from the stage before."""
        stage, h = len(self._stages), self._step
        known = self._start + h * sum(w * rate for w, rate in zip(weights, self._rates, strict=True)) / self._capacity
        guess = self._stages[-1].copy()
        rate = self._rate(guess, stage)
        change = np.empty(guess.size)
        # The spread may grow from zero within the step: then rounding sets the target.
        target = max(SHARPNESS * self._tolerance * self._spread, ROUNDING * float(np.abs(known).max()))
        for _ in range(NEWTON_LIMIT):
            residual = self._capacity * (known - guess) + (DIAGONAL * h) * rate
            if float(np.abs(residual / self._capacity).max()) <= target:
                break
            total_conductance(self._net, guess, self._values[stage], self._total)
            diagonal = self._capacity + (DIAGONAL * h) * self._total
            solve_linear(self._net, diagonal, DIAGONAL * h, guess, residual, self._capacity, 0.1 * target, change)
            guess += change
            # Not a number, or an overshoot below absolute zero, where T⁴ means nothing.
            if not bool(np.isfinite(guess).all()) or (self._net.radiates and float(guess.min()) <= 0.0):
                self.is_solved = False
                break
            rate = self._rate(guess, stage)
            if float(np.abs(change).max()) <= ROUNDING * float(guess.max()):
                break
        else:
            self.is_solved = False
        self._stages.append(guess)
        self._rates.append(rate)

    def error(self) -> float:
        """Estimated error over the tolerance; stiff parts are damped as the matrix of the stages would damp them."""
        defect = self._step * sum(b * rate for b, rate in zip(DEFECTS, self._rates, strict=True))
        last = self._stages[-1]
        total_conductance(self._net, last, self._values[-1], self._total)
        spread = max(self._spread, _spread(self._net, last, self._values[-1]), float(np.abs(last - self._start).max()))
        damped = float(np.abs(defect / (self._capacity + DIAGONAL * self._step * self._total)).max())
        # Where nothing differs from anything, what is left is rounding.
        return damped / max(self._tolerance * spread, NOISE * float(np.abs(self._start).max()))

    def commit(self, flow: Flow, temperature: Floats) -> None:
        """Enter the heat of this sub-step into ``flow`` and move ``temperature`` [K] on."""
        before = flow.received.copy()
        for weight, stage, value in zip(WEIGHTS, self._stages, self._values, strict=True):
            flow.add(self._net, stage, value, self._step * weight)
        flow.sub_steps += 1
        temperature += (flow.received - before + self._step * self._power) / self._capacity


def _spread(net: Network, temperature: Floats, wall_value: Floats) -> float:
    """Range of all temperatures that take part [K]."""
    everything = np.concatenate([temperature, wall_value[net.wall], net.outside_temperature])
    return float(everything.max() - everything.min())

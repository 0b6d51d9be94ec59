"""How heat flow is integrated: in sub-steps of controlled error, cut where signals of walls bend.

Three schemes, each for what it does best. With τ = C/ΣH the shortest time constant of a grain:

- **Euler's forward rule**, one step, where Δt is short against τ, as in most flows. It lets a
  difference decay at a rate that is off by ½ Δt/τ, relatively, where one grain changes alone, and
  by Δt/τ at most (two equal grains): no mode is faster than 2/τ.
- **SSPRK(3,3)**, explicit, where Δt is longer (C.-W. Shu & S. Osher, J. Comput. Phys. 77, 1988,
  439): third order, made of Euler steps none of which lets a mode overshoot. The second of its
  three solutions, of second order, gives the error::

      F = rate/C,   T_1 = T_0 + h F_0,   T_½ = T_0 + h (F_0 + F_1)/4
      T = T_0 + h (F_0 + F_1 + 4 F_½)/6

- **TR-BDF2**, implicit, of second order and L-stable, where many time constants go by (R. E. Bank
  et al., IEEE Trans. Electron Devices 32, 1985, 1992; coefficients and error estimate of M. E.
  Hosea & L. F. Shampine, Appl. Numer. Math. 20, 1996, 21): with γ = 2 − √2, d = γ/2, w = √2/4::

      T_γ = T_0 + d h (F_0 + F_γ),   T = T_0 + h (w F_0 + w F_γ + d F_1)

  and the embedded solution of third order has the weights (1−w)/3, (3w+1)/3, d/3.

Heat flows at the rates of the stages, so that the books close to round-off however exactly the
stages have been solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from multicor_cli.arithmetic import cbrt
from multicor_cli.engine.heat.rates import Flow, Network, Rates, rates_at, solve_linear, try_euler
from multicor_cli.engine.heat.walls import WallValues
from multicor_cli.engine.orders import stop_if_asked
from multicor_cli.model.model import Floats

EULER = 10.0
"""Longest single step of Euler's rule over τ, as a multiple of the tolerance.

Sub-steps of the others err by up to the tolerance, and some ten go by within a time constant.
"""

STIFF = 100.0
"""Longest explicit step of ``"auto"`` over τ while grains move: TR-BDF2 evaluates less beyond."""

GAMMA = 2.0 - math.sqrt(2.0)
DIAGONAL = 0.5 * GAMMA
WEIGHT = 0.25 * math.sqrt(2.0)
"""γ, d and w of TR-BDF2."""

SAFETY, LEAST, MOST = 0.9, 0.2, 4.0
"""Factor of caution and bounds of the change of the sub-step."""

SHARPNESS = 1e-3
"""Error of an implicit stage over the tolerance of a sub-step."""

ROUNDING = 1e-13
"""What rounding leaves unsolved of an implicit stage, over the temperature."""

NOISE = 1e-10
"""Smallest error of a sub-step that is told from rounding, over the temperature."""

BELOW_ZERO = -1e-9
"""Lowest temperature that rounding explains, over the highest."""

TRIALS, NEWTON_LIMIT = 100, 50
"""Most attempts at a sub-step, each shorter than the last, and most iterations of a stage."""

SUB_STEPS = 1e8
"""Most explicit sub-steps of a step; more would take hours."""

DRAINED = (
    "would fall below absolute zero: a wall, or a mean gradient, draws more heat than there is"
)


class CannotIntegrate(ArithmeticError):
    """Temperatures cannot be integrated further: ``why`` follows the name of a grain or body."""

    def __init__(self, node: int, why: str) -> None:
        super().__init__(node, why)
        self.node, self.why = node, why

    def __str__(self) -> str:
        return f"node {self.node} {self.why}"


@dataclass(frozen=True, kw_only=True)
class Integration:
    """Choices about the integration, named as the keys of ``[heat]``.

    Attributes:
        integrator: ``"auto"``: implicit in frozen stages and beyond `STIFF`, else explicit.
        sub_step: Largest explicit sub-step over the longest without overshoot: h ≤ sub_step τ/2.
        tolerance: Largest error of a sub-step over the spread of the temperatures.
    """

    integrator: Literal["auto", "explicit", "implicit"] = "auto"
    sub_step: float = 1.0
    tolerance: float = 1e-4


def integrate(
    net: Network, capacity: Floats, temperature: Floats, walls: WallValues, source: Floats,
    dt: float, first: float, choices: Integration, should_stop: Callable[[], bool] | None = None, *,
    is_frozen: bool,
) -> Flow:  # fmt: skip
    """Heat that flows within ``dt`` [s]; **modifies** the temperatures [K], shape ``(n,)``.

    Capacities [J/K] and ``source``, the heat generated within ``dt`` [J], have this shape too.
    ``first`` is the sub-step that is tried first [s], 0: the whole; ``should_stop`` is asked before
    each.

    Raises:
        Interrupted: If ``should_stop`` says so.
        CannotIntegrate: If a temperature would fall below absolute zero, or no sub-step is short
            enough.
    """
    flow = Flow.empty(capacity.size, len(walls.conditions))
    flow.next_step = first
    power = source / dt
    longest = min(EULER * choices.tolerance, 0.5 * choices.sub_step)
    is_implicit = choices.integrator == "implicit" or (choices.integrator == "auto" and is_frozen)
    for values, length in walls.pieces(dt):
        stop_if_asked(should_stop)
        stiffness = math.inf
        if not is_implicit:
            stiffness, coldest, hottest = try_euler(
                net, capacity, temperature, values(0.0), values(0.5 * length), power, length,
                longest,
                flow.received, flow.walls, flow.outside, flow.lasted,
            )  # fmt: skip
        if stiffness <= longest:
            if coldest < BELOW_ZERO * max(1.0, hottest):
                raise CannotIntegrate(int(np.argmin(temperature)), DRAINED)
            flow.note_sub_step(0.5 * stiffness)
        else:
            is_stiff = choices.integrator == "auto" and stiffness > STIFF
            scheme = _Implicit if is_implicit or is_stiff else _Explicit
            problem = _Problem(net, capacity, values, power, choices)
            _march(scheme, problem, temperature, length, flow, should_stop)
    flow.received += source
    return flow


@dataclass(frozen=True)
class _Problem:
    """What all sub-steps of a step share; ``power`` is the heat generated [W], shape ``(n,)``."""

    net: Network
    capacity: Floats
    walls: WallValues
    power: Floats
    choices: Integration


def _march(
    scheme: type[_SubStep], problem: _Problem, temperature: Floats, dt: float, flow: Flow,
    should_stop: Callable[[], bool] | None,
) -> None:  # fmt: skip
    """Go ``dt`` on in sub-steps of errors below the tolerance; arguments, errors as `integrate`."""
    done, trials, bound = 0.0, 0, math.inf
    step = min(flow.next_step, dt) if flow.next_step > 0.0 else dt
    flow.next_step = 0.0
    while done < dt:
        stop_if_asked(should_stop)
        if done == 0.0 or problem.net.radiates:
            bound = scheme.bound(problem, temperature, done, dt)
        step = min(step, bound)
        is_last = done + step >= dt * (1.0 - 1e-12)
        step = dt - done if is_last else step
        trial = scheme(problem, temperature, done, step)
        error = trial.error() if trial.is_solved else math.inf
        # The least if it is not a number
        factor = MOST if error == 0.0 else min(MOST, max(LEAST, SAFETY / cbrt(error)))
        if error <= 1.0 and not trial.falls_below_zero():
            trial.commit(flow, temperature)
            flow.note_sub_step(error * problem.choices.tolerance)
            done, trials = dt if is_last else done + step, 0
            # The last one may have been cut short.
            flow.next_step = max(flow.next_step, step * factor) if is_last else step * factor
            step *= factor
            continue
        trials += 1
        if trials > TRIALS or done + step == done:
            raise CannotIntegrate(
                trial.fastest(),
                f"changes so fast that no sub-step of its heat is short enough ({step:.3g} s)",
            )
        step *= min(factor, SAFETY) if error > 1.0 else LEAST


class _SubStep:
    """One attempt at a sub-step: stages, each with its temperatures and rates."""

    times: ClassVar[tuple[float, ...]]
    """When walls are looked at: of each stage, over the sub-step."""
    weights: ClassVar[tuple[float, ...]]
    """What the rates of the stages count in the solution."""
    defects: ClassVar[tuple[float, ...]]
    """The same, less what they count in the embedded one."""

    def __init__(self, problem: _Problem, start: Floats, t: float, step: float) -> None:
        self._problem, self._start, self._step = problem, start, step
        self._values = [problem.walls(t + c * step) for c in self.times]
        self._spread = max(_spread(problem.net, start, value) for value in self._values)
        self._stages: list[Floats] = []
        self._rates: list[Rates] = []
        self.is_solved = True
        self._end = self._solve()

    @staticmethod
    def bound(problem: _Problem, temperature: Floats, t: float, end: float) -> float:
        """Longest sub-step up to ``end`` [s]; `CannotIntegrate` if too many would be needed."""
        return math.inf

    def _solve(self) -> Floats:
        """Find the stages; returns the temperatures at the end [K], shape ``(n,)``."""
        raise NotImplementedError

    def _damping(self) -> Floats | float:
        """Heat capacity that stiff links add, as far as the scheme damps their errors [J/K]."""
        return 0.0

    def _add_stage(self, temperature: Floats) -> None:
        self._rates.append(
            rates_at(self._problem.net, temperature, self._values[len(self._stages)])
        )
        self._stages.append(temperature)

    def _heat(self, weights: tuple[float, ...]) -> Floats:
        """Heat of the rates of the first stages and the sources, weighted [J], shape ``(n,)``."""
        power = self._problem.power
        return np.asarray(
            self._step
            * sum(w * (rate.nodes + power) for w, rate in zip(weights, self._rates, strict=False))
        )

    def _ahead(self, weights: tuple[float, ...]) -> Floats:
        """Temperatures that this heat makes [K], shape ``(n,)``."""
        return self._start + self._heat(weights) / self._problem.capacity

    def error(self) -> float:
        """Estimated error over the tolerance."""
        problem = self._problem
        spread = max(
            self._spread,
            _spread(problem.net, self._end, self._values[-1]),
            float(np.abs(self._end - self._start).max()),
        )
        defect = float(
            np.abs(self._heat(self.defects) / (problem.capacity + self._damping())).max()
        )
        # Where nothing differs from anything, what is left is rounding.
        return defect / max(
            problem.choices.tolerance * spread, NOISE * float(np.abs(self._start).max())
        )

    def falls_below_zero(self) -> bool:
        """Whether any is below absolute zero at the end; raises if a shorter step cannot help."""
        is_below = self._end < BELOW_ZERO * max(1.0, float(self._end.max()))
        if not is_below.any():
            return False
        rate = rates_at(
            self._problem.net, np.maximum(self._end, 0.0), self._values[int(np.argmax(self.times))]
        ).nodes
        sinks = np.flatnonzero(is_below & (rate + self._problem.power < 0.0))
        if sinks.size:
            raise CannotIntegrate(int(sinks[np.argmin(self._end[sinks])]), DRAINED)
        return True

    def fastest(self) -> int:
        """The node that changes fastest at the start."""
        return int(
            np.argmax(np.abs((self._rates[0].nodes + self._problem.power) / self._problem.capacity))
        )

    def commit(self, flow: Flow, temperature: Floats) -> None:
        """Enter the heat of this sub-step into ``flow`` and move ``temperature`` [K] on."""
        before = flow.received.copy()
        stages = zip(self.weights, self._rates, self._stages, strict=True)
        for weight, rates, at in stages:
            flow.add(rates, at, self._step * weight)
        temperature += (
            flow.received - before + self._step * self._problem.power
        ) / self._problem.capacity


class _Explicit(_SubStep):
    """SSPRK(3,3)."""

    times = (0.0, 1.0, 0.5)
    weights = (1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0)
    defects = (-1.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0)

    @staticmethod
    def bound(problem: _Problem, temperature: Floats, t: float, end: float) -> float:
        """Longest that lets no mode overshoot: rates of decay ≤ 2 max(ΣH/C) (Gershgorin) [s]."""
        total = rates_at(problem.net, temperature, problem.walls(t)).total
        rates = 2.0 * total / problem.capacity
        node = int(np.argmax(rates))
        count = (end - t) * float(rates[node]) / problem.choices.sub_step
        if not count <= SUB_STEPS:
            raise CannotIntegrate(
                node,
                (
                    f"exchanges heat so fast that it takes {count:.2g} explicit sub-steps; use "
                    '"implicit"'
                ),
            )
        return (end - t) / count if count > 0.0 else math.inf

    def _solve(self) -> Floats:
        self._add_stage(self._start)
        self._add_stage(self._ahead((1.0,)))
        self._add_stage(self._ahead((0.25, 0.25)))
        return self._ahead(self.weights)


class _Implicit(_SubStep):
    """TR-BDF2; stages by Newton's method."""

    times = (0.0, GAMMA, 1.0)
    weights = (WEIGHT, WEIGHT, DIAGONAL)
    defects = (
        WEIGHT - (1.0 - WEIGHT) / 3.0,
        WEIGHT - (3.0 * WEIGHT + 1.0) / 3.0,
        DIAGONAL - DIAGONAL / 3.0,
    )

    def _solve(self) -> Floats:
        self._add_stage(self._start)
        self._solve_stage((DIAGONAL,))
        if self.is_solved:
            self._solve_stage((WEIGHT, WEIGHT))
        return self._stages[-1]

    def _solve_stage(self, weights: tuple[float, ...]) -> None:
        """Add a stage: T = T_0 + h (Σ weights·rates + d·rate(T))/C."""
        problem, h, value = self._problem, self._step, self._values[len(self._stages)]
        known = self._ahead(weights)
        guess = self._stages[-1].copy()
        rates = rates_at(problem.net, guess, value)
        change = np.empty(guess.size)
        # The spread may grow from zero within the step: then rounding sets the target.
        target = max(
            SHARPNESS * problem.choices.tolerance * self._spread,
            ROUNDING * float(np.abs(known).max()),
        )
        for _ in range(NEWTON_LIMIT):
            residual = problem.capacity * (known - guess) + (DIAGONAL * h) * (
                rates.nodes + problem.power
            )
            if float(np.abs(residual / problem.capacity).max()) <= target:
                break
            diagonal = problem.capacity + (DIAGONAL * h) * rates.total
            solve_linear(
                problem.net, diagonal, DIAGONAL * h, guess, residual, problem.capacity,
                0.1 * target, change,
            )  # fmt: skip
            guess += change
            if not bool(np.isfinite(guess).all()):
                self.is_solved = False
                break
            rates = rates_at(problem.net, guess, value)
            if float(np.abs(change).max()) <= ROUNDING * float(guess.max()):
                break
        else:
            self.is_solved = False
        self._stages.append(guess)
        self._rates.append(rates)

    def _damping(self) -> Floats:
        return DIAGONAL * self._step * self._rates[-1].total


def _spread(net: Network, temperature: Floats, wall_value: Floats) -> float:
    everything = np.concatenate([temperature, wall_value[net.wall], net.outside_temperature])
    return float(everything.max() - everything.min()) + float(np.abs(net.ahead).max(initial=0.0))

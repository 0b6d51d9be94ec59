"""Heat flow in a network: rates, linear systems of the implicit integrator, and what has flowed.

Nodes are grains, and then the walls that have a heat capacity (bodies); walls of known temperature
and what is outside are what the network exchanges heat with. Every rate is applied with opposite
signs to the two ends, so heat is conserved to round-off whatever the temperatures are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.heat.radiation import linear_coefficient
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.model.model import Floats, Ints

OUTSIDE_BOOKS = ("from_ambient", "from_surroundings")
"""Heat books of the exchange with what is outside."""


class Network(NamedTuple):
    """What conducts between ``n`` nodes, ``w`` walls and ``s`` things outside.

    Wherever the following says grain, a body may stand.

    Attributes:
        i: First grain of each link between grains, shape ``(e,)``.
        j: Second grain, shape ``(e,)``.
        conductance: H [W/K], shape ``(e,)``.
        area: Area factor of radiation along the link [m²], shape ``(e,)``; of size 0 without
            radiation between neighbors.
        ahead: How much warmer a mean gradient makes the second grain than the first [K], shape
            ``(e,)``; of size 0 without one.
        wall_i: Grain of each link to a wall of known temperature, shape ``(b,)``.
        wall: The wall, shape ``(b,)``.
        wall_conductance: H [W/K], shape ``(b,)``.
        wall_area: Area factor [m²], shape ``(b,)`` or of size 0.
        flow_i: Grain of each link to a wall of known heat flow, shape ``(f,)``.
        flow_wall: The wall, shape ``(f,)``.
        flow_share: Share of the flow of that wall, shape ``(f,)``.
        outside_book: Heat book of each thing outside, an index of `OUTSIDE_BOOKS`, shape ``(s,)``.
        outside_temperature: Its temperature [K], shape ``(s,)``.
        outside_conductance: H of each grain [W/K], shape ``(s, n)``.
        outside_area: Area factor of radiation of each grain [m²], shape ``(s, n)``.
    """

    i: Ints
    j: Ints
    conductance: Floats
    area: Floats
    ahead: Floats
    wall_i: Ints
    wall: Ints
    wall_conductance: Floats
    wall_area: Floats
    flow_i: Ints
    flow_wall: Ints
    flow_share: Floats
    outside_book: Ints
    outside_temperature: Floats
    outside_conductance: Floats
    outside_area: Floats

    @property
    def radiates(self) -> bool:
        """Whether any of the flows depends on T⁴."""
        return bool(self.area.size or self.wall_area.size or self.outside_area.any())


@subroutine
def _link(conductance: float, area: Floats, k: int, a: float, b: float, ahead: float) -> float:
    """Heat flow through a link from temperature ``b`` to ``a`` [W]; nothing radiates below 0 K.

    Stages of an integrator may get there, on the way to a sub-step that does not. A mean gradient
    is no part of the temperatures, and makes b warmer by ``ahead``.
    """
    if area.size == 0:
        return conductance * (b - a + ahead)
    if a < 0.0 or b < 0.0:
        warm_a, warm_b = max(a, 0.0), max(b, 0.0)
        coefficient = linear_coefficient(area[k], warm_a, warm_b)
        return conductance * (b - a + ahead) + coefficient * (warm_b - warm_a + ahead)
    return (conductance + linear_coefficient(area[k], a, b)) * (b - a + ahead)


@subroutine
def _steepest(conductance: float, area: Floats, k: int, a: float, b: float) -> float:
    """Largest derivative of a link's flow by a temperature: that of T⁴ at the hotter end [W/K]."""
    hotter = max(a, b, 0.0)
    return conductance + linear_coefficient(area[k], hotter, hotter) if area.size else conductance


@kernel
def heat_rates(
    net: Network, temperature: Floats, wall_value: Floats, wall_bound: Floats, rate: Floats,
    wall_rate: Floats, outside: Floats, total: Floats,
) -> None:  # fmt: skip
    """Heat flow into every grain, and what walls and the outside give [W]; ΣH of every grain [W/K].

    ``temperature`` of the grains [K], shape ``(n,)``; ``wall_value``: temperature [K] or heat flow
    [W] of each wall, shape ``(w,)``; ``wall_bound``: the same, for ΣH. There radiation counts at
    its steepest: ΣH bounds the stable step of the explicit integrator, and lets Newton's method
    approach the solution from one side. **Modifies** ``rate`` into grains, ``wall_rate`` out of
    walls, ``outside``, from there by heat book, shape ``(2,)``, and ``total``, shape ``(n,)``.
    """
    rate[:] = 0.0
    wall_rate[:] = 0.0
    outside[:] = 0.0
    total[:] = 0.0
    for k in range(net.i.size):
        i, j, h = net.i[k], net.j[k], net.conductance[k]
        a, b = temperature[i], temperature[j]
        ahead = net.ahead[k] if net.ahead.size else 0.0
        flow, steepest = _link(h, net.area, k, a, b, ahead), _steepest(h, net.area, k, a, b)
        rate[i] += flow
        rate[j] -= flow
        total[i] += steepest
        total[j] += steepest
    for k in range(net.wall_i.size):
        i, w, h = net.wall_i[k], net.wall[k], net.wall_conductance[k]
        flow = _link(h, net.wall_area, k, temperature[i], wall_value[w], 0.0)
        rate[i] += flow
        wall_rate[w] += flow
        total[i] += _steepest(h, net.wall_area, k, temperature[i], wall_bound[w])
    for k in range(net.flow_i.size):
        flow = net.flow_share[k] * wall_value[net.flow_wall[k]]
        rate[net.flow_i[k]] += flow
        wall_rate[net.flow_wall[k]] += flow
    for s in range(net.outside_temperature.size):
        b, area = net.outside_temperature[s], net.outside_area[s]
        for k in range(rate.size):
            a, h = temperature[k], net.outside_conductance[s, k]
            flow = _link(h, area, k, a, b, 0.0)
            rate[k] += flow
            outside[net.outside_book[s]] += flow
            total[k] += _steepest(h, area, k, a, b)


@kernel
def try_euler(
    net: Network, capacity: Floats, temperature: Floats, wall_start: Floats, wall_middle: Floats,
    power: Floats, dt: float, longest: float, received: Floats, given: Floats, outside: Floats,
    lasted: Floats,
) -> tuple[float, float, float]:  # fmt: skip
    """One step of Euler's rule, if it is at most ``longest`` over the shortest time constant C/ΣH.

    Values of walls at the start and in the middle of the step ``dt`` [s], which is exact for
    signals that rise linearly; ``power`` generated [W]. Returns dt over the shortest time constant,
    and the lowest and the highest temperature [K]. If the step is taken, **modifies**
    ``temperature``, and adds to what nodes have ``received``, walls ``given``, what came from
    ``outside`` [J], and how long temperatures have ``lasted``, as in `Flow`.
    """
    rate, total = np.empty(capacity.size), np.empty(capacity.size)
    wall_rate, outside_rate = np.empty(given.size), np.empty(outside.size)
    heat_rates(net, temperature, wall_middle, wall_start, rate, wall_rate, outside_rate, total)
    fastest, coldest, hottest = 0.0, np.inf, -np.inf
    for k in range(total.size):
        fastest = max(fastest, total[k] / capacity[k])
    if not dt * fastest <= longest:
        return dt * fastest, coldest, hottest
    for k in range(rate.size):
        lasted[k] += dt * temperature[k]
        received[k] += dt * rate[k]
        temperature[k] += dt * (rate[k] + power[k]) / capacity[k]
        coldest, hottest = min(coldest, temperature[k]), max(hottest, temperature[k])
    for w in range(given.size):
        given[w] += dt * wall_rate[w]
    for s in range(outside.size):
        outside[s] += dt * outside_rate[s]
    return dt * fastest, coldest, hottest


@kernel
def _apply(
    net: Network, diagonal: Floats, step: float, temperature: Floats, x: Floats, y: Floats
) -> None:
    """``y = diagonal·x − step·(links between grains)·x``: the matrix C + step K of the stages."""
    for k in range(x.size):
        y[k] = diagonal[k] * x[k]
    for k in range(net.i.size):
        i, j = net.i[k], net.j[k]
        h = step * _steepest(net.conductance[k], net.area, k, temperature[i], temperature[j])
        y[i] -= h * x[j]
        y[j] -= h * x[i]


@kernel
def solve_linear(
    net: Network, diagonal: Floats, step: float, temperature: Floats, rhs: Floats, scale: Floats,
    target: float, x: Floats,
) -> int:  # fmt: skip
    """Solve (C + step K) x = rhs by conjugate gradients, preconditioned by the diagonal.

    The loop ends when the largest |residual|/scale falls to ``target`` [K], or when rounding lets
    it fall no further (1,000 iterations at most): what is left only adds to the error of a stage,
    never to the heat balance. Returns the number of iterations.

    Walls and the outside enter through ``diagonal``, C + step ΣH [J/K]; radiation is linearized at
    ``temperature`` [K]; ``rhs`` [J]; ``scale`` are heat capacities [J/K]; all of shape ``(n,)``.
    **Modifies** ``x`` [K].
    """
    n = rhs.size
    r, z, p, q = rhs.copy(), np.empty(n), np.empty(n), np.empty(n)
    x[:] = 0.0
    rho = 0.0
    for k in range(n):
        z[k] = r[k] / diagonal[k]
        p[k] = z[k]
        rho += r[k] * z[k]
    for iteration in range(1000):
        worst = 0.0
        for k in range(n):
            worst = max(worst, abs(r[k]) / scale[k])
        if worst <= target or rho == 0.0:
            return iteration
        _apply(net, diagonal, step, temperature, p, q)
        curvature = 0.0
        for k in range(n):
            curvature += p[k] * q[k]
        alpha = rho / curvature
        rho_next = 0.0
        for k in range(n):
            x[k] += alpha * p[k]
            r[k] -= alpha * q[k]
            z[k] = r[k] / diagonal[k]
            rho_next += r[k] * z[k]
        beta = rho_next / rho
        rho = rho_next
        for k in range(n):
            p[k] = z[k] + beta * p[k]
    return 1000


# ---- Heat that has flowed within a time: what each grain received, and what the outside gave


class Rates(NamedTuple):
    """Heat flows [W]: into nodes ``(n,)``, out of walls ``(w,)``, from outside by book ``(2,)``.

    ``total`` is ΣH of the nodes [W/K], shape ``(n,)``.
    """

    nodes: Floats
    walls: Floats
    outside: Floats
    total: Floats


def rates_at(net: Network, temperature: Floats, wall_value: Floats) -> Rates:
    """Rates at these temperatures [K]; arguments as `heat_rates`."""
    n, books = temperature.size, len(OUTSIDE_BOOKS)
    rates = Rates(np.empty(n), np.empty(wall_value.size), np.empty(books), np.empty(n))
    heat_rates(net, temperature, wall_value, wall_value, *rates)
    return rates


@dataclass
class Flow:
    """Sums over the sub-steps of an integrator, and which sub-step [s] to try next.

    Heat received by nodes, given by walls and by what is outside, by heat book [J], have shapes
    ``(n,)``, ``(w,)`` and ``(2,)``; ``lasted`` is the integral of the temperatures at which it
    flowed over time [K s], ``(n,)``; ``error`` the largest estimated one of a sub-step over the
    spread of the temperatures.
    """

    received: Floats
    walls: Floats
    outside: Floats
    lasted: Floats
    sub_steps: int = 0
    next_step: float = 0.0
    error: float = 0.0

    @classmethod
    def empty(cls, grains: int, walls: int) -> Flow:
        outside = np.zeros(len(OUTSIDE_BOOKS))
        return cls(np.zeros(grains), np.zeros(walls), outside, np.zeros(grains))

    def add(self, rates: Rates, temperature: Floats, weight: float) -> None:
        """Let heat flow for ``weight`` seconds at these rates, those of these temperatures."""
        self.lasted += weight * temperature
        self.received += weight * rates.nodes
        self.walls += weight * rates.walls
        self.outside += weight * rates.outside

    def note_sub_step(self, error: float) -> None:
        """Count a sub-step of this estimated error, over the spread of the temperatures."""
        self.sub_steps += 1
        self.error = max(self.error, error)

"""Criteria compared on the same iterates: along the path of the program's own loop, each would have
ended it somewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from listening import Problem

from multicor_cli.engine.contact import acceleration as loops
from multicor_cli.engine.contact.patches import (
    SIZES,
    choose_patch,
    has_clusters,
    nothing_met,
    solve_patch,
)
from multicor_cli.engine.contact.solve import ResidualScale, ThreadChoice, solve_system
from multicor_cli.engine.contact.sweep import EXACT, Relaxation, System, sweep
from multicor_cli.engine.contact.system import flatten
from multicor_cli.engine.orders import Settings
from multicor_cli.model.model import Floats

EVERY = 4  # sweeps between two looks at the residual
BLOCK = 512
RMS, LARGEST = 1e-3, 5e-2
FORMS = ("absolute", "signed normal", "signed both")
COLUMNS = ("sweeps", "rms", "maximum", *FORMS, "distance", "vertical")
CRITERIA = [("rms and maximum alone", "absolute", np.inf)] + [
    (f"{form} {bound:g}", form, bound)
    for form, bounds in (
        ("absolute", (0.01, 0.015, 0.02, 0.03)), ("signed normal", (0.002, 0.003, 0.005)),
        ("signed both", (0.001, 0.002, 0.003, 0.005, 0.01)),
    )
    for bound in bounds
]  # fmt: skip


@dataclass(frozen=True)
class Row:
    """A criterion: its name, steps that missed it, mean and largest sweeps; where it would have
    ended, the median distance and the mean error of the mean vertical velocity, over u_ref.
    """

    name: str
    failed: int
    mean: float
    largest: float
    distance: float
    vertical: float


def reference(problem: Problem, sweeps: int) -> Floats:
    """Velocities of a solution to rms 10⁻⁶ and G = 10⁻⁵, or as far as ``sweeps`` lead."""
    system = problem.copy()
    tight = Settings(
        tolerance_rms=1e-6, tolerance_max=5e-5, tolerance_energy=1e-5, max_sweeps=sweeps
    )
    solve_system(system, problem.scale, tight, ThreadChoice())
    return system.velocity


def trace(problem: Problem, truth: Floats, limit: int) -> Floats:
    """`COLUMNS` over their scales at every fourth sweep until all criteria are met or ``limit`` is
    reached. Light contacts only.
    """
    s, scale = problem.copy(), problem.scale
    m = loops.start_momentum(s)
    memory = loops.start_loop(s.contacts)
    loop, partial, rows = memory[0], np.empty((s.tile_start.size - 1, 2)), []
    tolerance, met = RMS * scale.rms, nothing_met(s)
    while loop["sweeps"] < limit:
        way = Relaxation(*loops.MODES[loop["mode"], :2].tolist(), float(loop["factor"]))
        squares, onward = sweep(s, m.before, EXACT, way, False, partial)
        change = float(np.sqrt(squares / loop["active"]))
        loop["sweeps"] += 1.0
        if change <= 2.0 * tolerance and loop["sweeps"] % EVERY == 0:
            row, loop["active"] = measure(s, masses(s), truth, scale)
            rows.append([loop["sweeps"], *row])
            if row[0] <= RMS and row[1] <= LARGEST and row[2] <= 0.01 and row[4] <= 0.001:
                break
        loops._choose_mode(change, tolerance, loop)
        if loop["is_stuck"]:
            is_clustered = has_clusters(s)
            if is_clustered:
                size = SIZES[min(int(loop["patches"]), len(SIZES) - 1)]
                solve_patch(s, choose_patch(s, size, met))
            loops.begin_again(s, m, is_clustered, loop)
        else:
            loops.move_on(s, m, change, onward, loops._growth(loop), loop, False)
    return np.array(rows).reshape(-1, len(COLUMNS))


def masses(s: System) -> Floats:
    """Mass of each velocity [kg], of walls M, M, J; 0 where it is held."""
    own = s.velocity[: len(s.inverse), 3:] * np.array([1.0, 1.0, s.spin_factor])
    inverse = np.where(own > 0.0, own, s.inverse)
    return np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0.0)


def measure(
    s: System, weight: Floats, truth: Floats, scale: ResidualScale
) -> tuple[list[float], float]:
    """`COLUMNS` but the first, and the number of active contacts."""
    rows, v = flatten(s), s.velocity
    (i, j), (nx, ny, w, bias, mu), (p_n, p_t) = rows.pair.T, rows.frame.T, rows.impulse.T
    dx, dy = v[i, 0] - v[j, 0], v[i, 1] - v[j, 1]
    u_n, u_t = dx * nx + dy * ny + bias, dy * nx - dx * ny - v[i, 2] - v[j, 2]
    w_t = w / (1.0 + s.spin_factor)
    new_n = np.maximum(p_n - u_n * w, 0.0)
    new_t = np.clip(p_t - u_t * w_t, -mu * new_n, mu * new_n)
    e_n, e_t = (new_n - p_n) / w, (new_t - p_t) / w_t
    squares = e_n**2 + e_t**2
    active = max(1, int(np.count_nonzero((p_n > 0.0) | (squares > 0.0))))
    absolute = np.abs(p_n * u_n).sum() + np.abs(p_t * u_t + mu * p_n * np.abs(u_t)).sum()
    starts = np.arange(0, p_n.size, BLOCK)
    normal = np.abs(np.add.reduceat(p_n * u_n, starts)).sum()
    both = sum(np.abs(np.add.reduceat(power, starts)).sum() for power in (p_n * e_n, p_t * e_t))
    error, mass = (v - truth)[: len(weight), :3], weight[:, 0].sum()
    distance = np.sqrt((weight * error**2).sum() / mass)
    vertical = abs((weight[:, 1] * error[:, 1]).sum()) / mass
    speeds = [np.sqrt(squares.sum() / active), np.sqrt(squares.max())]
    powers = [value / scale.energy for value in (absolute, normal, both)]
    over_speed = [value / scale.velocity for value in (speeds[1], distance, vertical)]
    return [speeds[0] / scale.rms, over_speed[0], *powers, *over_speed[1:]], float(active)


def compare(problems: Sequence[Problem], sweeps: int, limit: int) -> list[Row]:
    """All criteria on the same problems; references take at most ``sweeps``, a solve ``limit``."""
    histories = [trace(problem, reference(problem, sweeps), limit) for problem in problems]
    return [
        _row(name, COLUMNS.index(form), bound, histories, limit) for name, form, bound in CRITERIA
    ]


def _row(name: str, column: int, bound: float, histories: list[Floats], limit: int) -> Row:
    ends, costs, failed = [], [], 0
    for history in histories:
        met = (history[:, 1] <= RMS) & (history[:, 2] <= LARGEST) & (history[:, column] <= bound)
        where = np.flatnonzero(met)
        failed += where.size == 0
        costs.append(history[where[0], 0] if where.size else float(limit))
        if len(history):
            ends.append(history[where[0] if where.size else -1, -2:])
    distances, vertical = np.array(ends).T
    return Row(
        name,
        failed,
        float(np.mean(costs)),
        float(np.max(costs)),
        float(np.median(distances)),
        float(vertical.mean()),
    )


def as_text(rows: Sequence[Row]) -> str:
    """A Markdown table."""
    lines = [
        (
            "| energy criterion | failed | mean sweeps | largest | median distance | mean "
            "vertical error |"
        ),
        "|---|---|---|---|---|---|",
    ]
    return "\n".join(
        lines
        + [
            (
                f"| {r.name} | {r.failed} | {r.mean:.0f} | {r.largest:.0f} | {r.distance:.4f} | "
                f"{r.vertical:.5f} |"
            )
            for r in rows
        ]
    )

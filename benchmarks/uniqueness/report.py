"""The tables."""

from __future__ import annotations

import math

from flows import CONTRASTS, WAYS, Comparison
from recorded import as_text as describe
from rest import AtRest
from study import Problem, Results


def as_text(results: Results) -> str:
    """Everything that was measured."""
    blocks = []
    if results.recorded is not None:
        blocks.append(describe(results.recorded))
    if results.problems:
        blocks.append(_problems(results.problems))
    blocks += [_flow(one) for one in results.flows]
    blocks += [_rest(one) for one in results.rests]
    return "\n\n".join(blocks)


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _problems(problems: list[Problem]) -> str:
    sizes = sorted({problem.grains for problem in problems})
    several = [problem for problem in problems if problem.row.distinct > 1]
    tables = [
        _table(
            _SIZE_HEAD, [_size([p for p in problems if p.grains == size], size) for size in sizes]
        )
    ]
    if several:
        tables.append(
            "Problems with several solutions:\n"
            + _table(_PROBLEM_HEAD, [_problem(problem) for problem in several])
        )
    compared = [problem.siconos.largest for problem in problems if problem.siconos is not None]
    if compared:
        tables.append(
            f"Siconos against plain sweeps, both from zero: {len(compared)} problems, apart by at "
            f"most {max(compared):.1e}."
        )
    return (
        "One problem, solved from several starts and in several orders of the contacts\n\n"
        + "\n\n".join(tables)
    )


_SIZE_HEAD = [
    "grains", "problems", "with several solutions", "solves", "that found one", "worst violation",
    "without friction: several",
    "solves", "that found one", "velocities apart", "forces apart",
]  # fmt: skip


def _size(problems: list[Problem], size: int) -> list[str]:
    rows, controls = [p.row for p in problems], [p.control for p in problems]
    solves = sum(row.solves for row in rows)
    return [
        f"{size}", f"{len(rows)}", f"{sum(row.distinct > 1 for row in rows)}", f"{solves}",
        f"{sum(row.solved for row in rows)}",
        f"{_largest([row.worst for row in rows]):.0e}", f"{sum(c.distinct > 1 for c in controls)}",
        f"{solves}",
        f"{sum(c.solved for c in controls)}", f"{_largest([c.velocities for c in controls]):.0e}",
        f"{_largest([c.forces for c in controls]):.0e}",
    ]  # fmt: skip


def _largest(values: list[float]) -> float:
    return max((value for value in values if not math.isnan(value)), default=math.nan)


_PROBLEM_HEAD = [
    "grains", "seed", "time [s]", "contacts", "solved", "velocities",
    "plain and accelerated: contacts > 1 %", "largest",
    "widest pair: contacts > 1 %", "largest", "loaded in one only", "half-way", "forces apart",
]  # fmt: skip


def _problem(problem: Problem) -> list[str]:
    row, methods, widest = problem.row, problem.row.methods, problem.row.widest
    of_methods = ["", ""] if methods is None else [f"{methods.contacts}", f"{methods.largest:.1e}"]
    of_widest = (
        ["", "", ""]
        if widest is None
        else [f"{widest.contacts}", f"{widest.largest:.3f}", f"{widest.let_go}"]
    )
    return [
        f"{problem.grains}", f"{row.seed}", f"{row.time:.3f}", f"{row.contacts}",
        f"{row.solved} of {row.solves}",
        f"{row.distinct}", *of_methods, *of_widest, f"{row.straight:.0e}", f"{row.forces:.2f}",
    ]  # fmt: skip


def _flow(one: Comparison) -> str:
    head = ["quantity", *WAYS]
    for name in CONTRASTS:
        head += [f"{name}: difference", "in errors", "scatter", "chance"]
    rows = []
    for quantity in one.values:
        means = [one.sample(quantity, way) for way in WAYS]
        row = [quantity, *(f"{mean.mean:.4f} ± {mean.error:.4f}" for mean in means)]
        for name in CONTRASTS:
            s = one.shift(quantity, name)
            row += [
                f"{s.mean:+.4f} ± {s.error:.4f}",
                f"{s.errors:+.1f}",
                f"{s.scatter:.4f}",
                f"{s.chance:.2f}",
            ]
        rows.append(row)
    missed = ", ".join(f"{way} {one.unconverged[way]} of {one.steps[way]}" for way in WAYS)
    return (
        f"{one.flow}: {one.seeds} packings\n\n{_table(head, rows)}\n\n"
        f"steps that missed the tolerances: {missed}"
    )


_REST_HEAD = [
    "way", "missed", "sweeps", "moved [d]", "rms [d]", "second half [d]", "weight carried − 1",
    "worst step", "height [d]",
    "contacts", "force", "spread", "participation", "forces: last two steps", "against first way",
    "means over steps",
]  # fmt: skip


def _rest(one: AtRest) -> str:
    rows = [
        [
            row.way, f"{row.unconverged}", f"{row.sweeps:.0f}", f"{row.moved:.1e}",
            f"{row.moved_rms:.1e}", f"{row.moved_late:.1e}",
            f"{row.floor:+.1e}",
            f"{row.floor_worst:.1e}", f"{row.height:+.1e}", f"{row.contacts}", f"{row.force:.3f}",
            f"{row.spread:.3f}",
            f"{row.participation:.3f}", f"{row.changed:.1e}", f"{row.differ:.3f}",
            f"{row.differ_mean:.3f}",
        ]
        for row in one.rows
    ]  # fmt: skip
    steps = one.rows[0].steps
    return (
        f"{one.scene}: {one.grains} grains at rest (fastest: {one.speed:.1e} m/s), {steps} steps\n"
        f"\n{_table(_REST_HEAD, rows)}"
    )

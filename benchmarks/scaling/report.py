"""Measures scenes of several sizes, and puts what a step costs beside the budgets."""

from __future__ import annotations

import argparse
import io
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from multicor_cli.bench.measuring import Task
from multicor_cli.bench.session import run_benchmark

REFERENCE = 10_000
"""Grains to which larger scenes are compared."""

Rows = dict[tuple[str, int, int], dict[str, Any]]


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Measure every scene with every size and number of threads; sizes one after the other, so that
    the threads alternate.
    """
    tasks = [
        Task(scene, grains, threads, options.rounds)
        for scene in options.scenes
        for grains in options.grains
        for threads in options.threads
    ]
    return run_benchmark(
        tasks, has_compilation=False, say=lambda text: print(text, file=sys.stderr, flush=True)
    ).as_dict()


def as_text(data: dict[str, Any]) -> str:
    """The table of all scenes, and the budgets."""
    table = Table(box=None, header_style="bold")
    headings = (
        "scene",
        "grains",
        "threads",
        "sweeps",
        "ms/step",
        "ns/contact/sweep",
        "of 10⁴",
        "sweep : C",
        "gain",
        "other at 30",
        "B/grain",
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "scene" else "right")
    rows = by_size(data)
    for row in rows.values():
        table.add_row(*_cells(row, rows))
    text = io.StringIO()
    Console(width=150, file=text).print(table)
    return text.getvalue() + "\n" + "\n".join(budgets(data))


def by_size(data: dict[str, Any]) -> Rows:
    """Scenes by name, number of grains and of threads."""
    return {(scene["scene"], scene["grains"], scene["threads"]): scene for scene in data["scenes"]}


def growth(row: dict[str, Any], rows: Rows) -> float:
    """Time per contact and sweep over that of the scene with about `REFERENCE` grains; nan if that
    was not measured.
    """
    sizes = {
        key: other
        for key, other in rows.items()
        if key[0] == row["scene"] and key[2] == row["threads"]
    }
    nearest = min(sizes, key=lambda key: abs(key[1] - REFERENCE))
    if not 0.5 < nearest[1] / REFERENCE < 2.0:
        return float("nan")
    return float(row["per_contact"] / sizes[nearest]["per_contact"])


def gain(row: dict[str, Any]) -> float:
    """How much faster a sweep is on the threads of the row than on one; nan on one."""
    times = {int(threads): seconds for threads, seconds in row["sweep"]["ours"].items()}
    return times[1] / times[row["threads"]] if row["threads"] > 1 else float("nan")


def _cells(row: dict[str, Any], rows: Rows) -> list[str]:
    head = [row["scene"], f"{row['grains']}", f"{row['threads']}", f"{row['sweeps']:.0f}"]
    if row["faults"] or row["per_contact"] is None:
        return [*head, *(["refused"] if row["faults"] else [f"{1e3 * row['step']:.3g}"])]
    ratio = row["sweep"]["ours"]
    in_c = row["sweep"]["in_c"]
    first = next(value for threads, value in ratio.items() if int(threads) == 1)
    return [
        *head, f"{1e3 * row['step']:.3g}", f"{1e9 * row['per_contact']:.1f}",
        f"{growth(row, rows):.2f}", f"{first / in_c:.2f}",
        "" if row["threads"] == 1 else f"{gain(row):.2f}", f"{100.0 * row['other_share']:.0f} %",
        f"{row['memory']:.0f}" if row["grains"] > 50_000 else "",
    ]  # fmt: skip


def budgets(data: dict[str, Any]) -> list[str]:
    """One line for each budget of the design that these scenes can show."""
    rows = by_size(data)
    lines = []
    for (scene, grains, threads), row in rows.items():
        if row["faults"] or row["per_contact"] is None or grains < 0.5 * REFERENCE:
            continue
        name = f"{scene}, {grains} grains, {threads} thread{'s' if threads > 1 else ''}"
        lines.append(
            f"{name}: everything but the solve {100.0 * row['other_share']:.0f} % at 30 sweeps "
            "(budget 25 %)"
        )
        if threads > 1:
            share = 100.0 * bandwidth_share(row, data)
            lines.append(
                f"{name}: sweep {gain(row):.2f} times as fast as on one (budget 1.7), {share:.0f} "
                "% of copying (or 70 %)"
            )
        if grains > 5 * REFERENCE:
            more = f"time per contact and sweep {growth(row, rows):.2f} of that at 10⁴ (budget 1.3)"
            lines.append(f"{name}: {more}, {row['memory']:.0f} B per grain (budget 1,500)")
    return lines


def bandwidth_share(row: dict[str, Any], data: dict[str, Any]) -> float:
    """Bytes that a sweep must move over its time, over the bandwidth of copying with the threads of
    the row.
    """
    moved = {int(threads): value for threads, value in row["sweep"]["bandwidth"].items()}
    return float(moved[row["threads"]] / data["copy_bandwidth"][str(row["threads"])])

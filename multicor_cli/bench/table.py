"""A benchmark as a table for people."""

from __future__ import annotations

from multicor_cli.bench.measuring import Result
from multicor_cli.bench.session import Benchmark

HEADINGS = (
    "scene", "grains", "threads", "contacts", "sweeps", "step [ms]", "solve", "other at 30 sweeps", "ns/contact/sweep", "sweep : C",
    "threads gain", "grain-steps/s", "B/grain",
)  # fmt: skip

_MANY = 50_000  # grains whose memory can be told from that of the kernels


def rows(benchmark: Benchmark) -> list[list[str]]:
    """One row for each scene; a scene with wrong physics has no times."""
    return [_row(result) for result in benchmark.results]


def _row(result: Result) -> list[str]:
    head = [result.scene, f"{result.grains}", f"{result.threads}", f"{result.candidates:.0f}", f"{result.sweeps:.0f}"]
    if result.faults:
        return [*head, "refused", *[""] * (len(HEADINGS) - len(head) - 1)]
    solve = result.phases.get("solve", 0.0) / max(sum(result.phases.values()), 1e-300)
    sweep, share, each = result.sweep, result.other_share, result.per_contact
    gain = "" if sweep is None or len(sweep.ours) < 2 else f"{sweep.ours[1] / sweep.ours[result.threads]:.2f}"
    return [
        *head, f"{1e3 * result.step:.3g}", f"{100.0 * solve:.0f} %", "" if share is None else f"{100.0 * share:.0f} %",
        "" if each is None else f"{1e9 * each:.1f}", "" if sweep is None or sweep.ratio != sweep.ratio else f"{sweep.ratio:.2f}",
        gain, f"{result.grain_steps:.3g}", f"{result.memory:.0f}" if result.grains >= _MANY else "",
    ]  # fmt: skip


def notes(benchmark: Benchmark) -> list[str]:
    """What the table rests on."""
    lines = [f"copying memory: {bandwidth / 1e9:.1f} GB/s with {n} threads" for n, bandwidth in benchmark.bandwidth.items()]
    for result in benchmark.results:
        if result.sweep is not None and not result.faults:
            used = ", ".join(f"{100.0 * v / benchmark.bandwidth[n]:.0f} % with {n}" for n, v in result.sweep.bandwidth.items())
            lines.append(
                f"{result.scene}, {result.grains} grains: a sweep moves {result.sweep.bytes_moved / 1e6:.1f} MB; of copying: {used}"
            )
    if benchmark.compilation is not None:
        times = benchmark.compilation
        lines.append(
            f"first steps: {times.cold:.1f} s cold, {times.cached:.2f} s cached; kernels of hard steps after {times.hard:.1f} s"
        )
    lines += [
        f"{result.scene}, {result.grains} grains: {result.missed} of {result.steps * result.rounds} steps did not converge"
        for result in benchmark.results
        if result.missed and not result.faults
    ]
    lines += [f"{result.scene}, {result.grains} grains: {fault}" for result in benchmark.results for fault in result.faults]
    return lines

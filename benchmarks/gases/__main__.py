"""Command line of the benchmark: ``python benchmarks/gases``."""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> int:
    """Compare and print; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/gases",
        description="The energy that is left in gases of discs, against an event-driven reference.",
    )
    parser.add_argument("--count", type=int, default=400, help="discs [%(default)s]")
    parser.add_argument("--fraction", type=float, default=0.4, help="of the area [%(default)s]")
    parser.add_argument("--seeds", type=int, default=3, help="starts of each gas [%(default)s]")
    parser.add_argument(
        "--ways", type=float, nargs="+", default=[0.3, 0.1, 0.03, 0.01],
        help="ways of the rms speed in a step, over the mean diameter",
    )  # fmt: skip
    parser.add_argument("--duration", type=float, default=0.01, help="[s] [%(default)s]")
    options = parser.parse_args()
    import numpy as np
    from cases import Gas, energy_of_multicor, energy_of_reference

    print("e, mu | impacts of a disc | reference | deviation of E by v dt/d | ms a step")
    for restitution, friction in [(1.0, 0.0), (0.95, 0.0), (0.8, 0.0), (0.8, 0.3), (0.5, 0.3)]:
        rows = []
        for seed in range(1, options.seeds + 1):
            gas = Gas(options.count, options.fraction, restitution, friction, seed)
            right, impacts = energy_of_reference(gas, options.duration)
            found = [energy_of_multicor(gas, options.duration, way) for way in options.ways]
            rows.append((right, impacts, found))
        right = np.mean([row[0] for row in rows])
        impacts = 2.0 * np.mean([row[1] for row in rows]) / options.count
        cells, times = [], []
        for k, way in enumerate(options.ways):
            parts = [row[2][k][0] / row[0] - 1.0 for row in rows]
            mean = round(100.0 * float(np.mean(parts)), 2) + 0.0  # no -0
            cells.append(f"{way:g}: {mean:g} % (± {100 * np.std(parts):.2f})")
            times.append(f"{np.median([row[2][k][1] for row in rows]):.2f}")
        print(
            f"{restitution:g}, {friction:g} | {impacts:.1f} | {right:.4f} | {', '.join(cells)} | "
            f"{' '.join(times)}", flush=True,
        )  # fmt: skip
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

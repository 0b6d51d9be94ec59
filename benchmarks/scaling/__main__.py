"""Command line of the benchmark: ``python benchmarks/scaling``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

SIZES = (1_000, 10_000, 100_000, 1_000_000)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/scaling",
        description=(
            "Time and memory of a step against the number of grains and of threads, beside the "
            "budgets of the design."
        ),
    )
    parser.add_argument(
        "--scenes",
        nargs="+",
        default=["bed", "shear"],
        metavar="NAME",
        help="scenes of multicor bench [bed shear]",
    )
    parser.add_argument(
        "--grains",
        nargs="+",
        type=int,
        default=list(SIZES),
        metavar="N",
        help="sizes [10³ 10⁴ 10⁵ 10⁶]",
    )
    parser.add_argument(
        "--threads",
        nargs="+",
        type=int,
        default=[1, 2],
        metavar="N",
        help="numbers of threads [1 2]",
    )
    parser.add_argument(
        "--rounds", type=int, default=5, help="rounds of which the medians are given [%(default)s]"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    parser.add_argument(
        "--read",
        type=Path,
        metavar="FILE",
        help="print and draw what --json wrote instead of measuring",
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE.png",
        help="draw time and memory against size (needs matplotlib)",
    )
    options = parser.parse_args(arguments)
    from report import as_text, measure

    data = (
        json.loads(options.read.read_text(encoding="utf-8")) if options.read else measure(options)
    )
    print(as_text(data))
    if options.json is not None:
        options.json.write_text(json.dumps(data), encoding="utf-8")
    if options.plot is not None:
        from figure import draw

        draw(data, options.plot)
    return 1 if any(scene["faults"] for scene in data["scenes"]) else 0


if __name__ == "__main__":
    sys.exit(main())

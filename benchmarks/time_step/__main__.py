"""Command line of the study: ``python benchmarks/time_step``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from cases import MU, SPEEDS, all_cases, finish
from measure import measure
from report import as_json, as_text, make_rows


def main() -> int:
    """Run what is missing and print the table; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/time_step",
        description=(
            "What the time step and the tolerance of the contact solver do to plane shear flow, "
            "and what they cost."
        ),
    )
    parser.add_argument(
        "--inertial",
        type=float,
        nargs="+",
        choices=SPEEDS,
        default=[0.1, 0.01],
        help="inertial numbers",
    )
    parser.add_argument(
        "--seeds", type=int, nargs="+", default=[1, 2, 3], help="seeds of the packings"
    )
    parser.add_argument(
        "--strain",
        type=float,
        default=16.0,
        help="shear strain of each run; the first 4 are left out",
    )
    parser.add_argument(
        "--friction",
        type=float,
        default=MU,
        metavar="MU",
        help="coefficient of friction of the discs",
    )
    parser.add_argument(
        "--restitution",
        type=float,
        default=0.0,
        metavar="E",
        help="their coefficient of restitution",
    )
    parser.add_argument(
        "--trades",
        action="store_true",
        help="shorter steps with looser tolerances, instead of one at a time",
    )
    parser.add_argument(
        "--accuracies",
        action="store_true",
        help="the automatic time step at several accuracies, with the default tolerances",
    )
    parser.add_argument(
        "--runs",
        type=Path,
        metavar="DIR",
        default=Path("runs/time-step"),
        help="where the runs are kept",
    )
    parser.add_argument(
        "--only-finished", action="store_true", help="leave out what has not been run yet"
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON list instead of the table"
    )
    parser.add_argument(
        "--plot", type=Path, metavar="DIR", help="write the figure into this folder"
    )
    options = parser.parse_args()
    results = []
    for case in all_cases(
        options.inertial,
        options.seeds,
        options.strain,
        options.friction,
        options.restitution,
        options.trades,
        options.accuracies,
    ):
        if options.only_finished and not (options.runs / case.name).is_dir():
            continue
        print(case.name, file=sys.stderr, flush=True)
        results.append((case, measure(finish(case, options.runs), case)))
    rows = make_rows(results)
    print(json.dumps(as_json(rows), indent=1) if options.json else as_text(rows))
    if options.plot is not None:
        from figure import draw_figure

        print(f"wrote {draw_figure(rows, options.plot)}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

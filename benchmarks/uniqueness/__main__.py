"""Command line of the benchmark: ``python benchmarks/uniqueness``."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PARTS = ("problems", "flows", "rest")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python benchmarks/uniqueness",
        description=(
            "With friction a contact problem can have several solutions: how many, how far apart, "
            "and what that does to flows and to what is at rest."
        ),
    )
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="packings of each scene [6; --quick: 2]"
    )
    parser.add_argument(
        "--first", type=int, default=1, metavar="SEED", help="first seed of the flows [%(default)s]"
    )
    parser.add_argument(
        "--parts", nargs="+", choices=PARTS, default=list(PARTS), help="what to measure [all]"
    )
    parser.add_argument(
        "--quick", action="store_true", help="a small check of every part, within a minute"
    )
    parser.add_argument(
        "--siconos",
        action="store_true",
        help="also solve small problems with Siconos, where it is installed",
    )
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE.npz",
        help="keep the small problem whose solutions differ most",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    parser.add_argument("--plot", type=Path, metavar="FILE.png", help="draw it (needs matplotlib)")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    from report import as_text
    from study import full, quick, run_study

    seeds = options.seeds if options.seeds is not None else 2 if options.quick else 6
    if seeds < 1:
        parser.error("--seeds must be at least 1")
    plan = (quick if options.quick else full)(seeds, options.siconos)
    results = run_study(
        plan,
        options.parts,
        lambda text: print(text, file=sys.stderr, flush=True),
        options.record,
        options.first,
    )
    print(as_text(results))
    if options.json is not None:
        options.json.write_text(json.dumps(results.as_dict()), encoding="utf-8")
    if options.plot is not None:
        from figure import draw

        print(f"wrote {draw(results, options.plot)}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

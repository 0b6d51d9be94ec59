"""Command line of the benchmark: ``python benchmarks/solvers``."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from study import Plan

_QUICK = ("gs", "engine", "restart-1.5", "cpg", "apgd", "newton")

# of the linear algebra: everything here is compared on one thread
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _parser() -> argparse.ArgumentParser:
    from methods import METHODS
    from problems import SOURCES

    parser = argparse.ArgumentParser(
        prog="python benchmarks/solvers",
        description=(
            "Which solver needs the least time for the error asked: methods on the same contact "
            "problems, on one thread."
        ),
        epilog="methods: "
        + "; ".join(f"{method.name}: {method.about}" for method in METHODS.values()),
    )
    words: dict[str, Any] = {"nargs": "+", "metavar": "NAME"}
    parser.add_argument(
        "--problems",
        default=list(SOURCES),
        help=f"of {', '.join(SOURCES)} [all], or folders of runs",
        **words,
    )
    parser.add_argument(
        "--grains",
        nargs="+",
        type=int,
        metavar="N",
        default=[1000],
        help="sizes of the scenes [%(default)s]",
    )
    parser.add_argument("--methods", default=[], help="methods, see below [all]", **words)
    parser.add_argument(
        "--rounds", type=int, default=3, help="timed runs of each method, alternating [%(default)s]"
    )
    parser.add_argument(
        "--steps",
        type=int,
        default=20,
        help="consecutive steps of each scene; 1: single problems only [%(default)s]",
    )
    parser.add_argument(
        "--cap", type=int, default=5000, help="largest number of iterations [%(default)s]"
    )
    parser.add_argument(
        "--accurate", action="store_true", help="also to rms 1e-8: engine and newton"
    )
    parser.add_argument("--starts", action="store_true", help="also compare warm starts")
    parser.add_argument("--seed", type=int, default=1, help="seed of the scenes [%(default)s]")
    parser.add_argument(
        "--work",
        type=Path,
        default=Path("runs/solver-problems"),
        metavar="DIR",
        help="kept problems [%(default)s]",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="a small check: column and shear, few steps, few methods",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    parser.add_argument(
        "--plot", type=Path, metavar="FILE.png", help="draw residual and distance against time"
    )
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison; returns the exit code."""
    try:
        import scipy  # noqa: F401
    except ImportError:
        print("this benchmark needs SciPy: pip install -e '.[bench]'", file=sys.stderr)
        return 5
    parser = _parser()
    options = parser.parse_args(arguments)
    plan = _plan(parser, options)
    from report import as_text
    from study import run_study

    results = run_study(plan, lambda text: print(text, file=sys.stderr, flush=True))
    print(as_text(results))
    if options.json is not None:
        options.json.write_text(json.dumps(results.as_dict()), encoding="utf-8")
    if options.plot is not None:
        from figure import draw

        print(f"wrote {draw(results, options.plot)}", file=sys.stderr)
    return 0


def _plan(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Plan:
    """What is asked for; ends the program if that is a mistake."""
    from methods import METHODS
    from problems import SOURCES, is_run
    from study import Plan

    sources = [name for words in options.problems for name in words.split(",")]
    names = [name for words in options.methods for name in words.split(",")]
    steps, rounds, grains = options.steps, options.rounds, options.grains
    if options.quick:
        sources, steps, rounds, grains = ["column", "shear"], 2, 1, [1000]
        names = names or list(_QUICK)
    unknown = [name for name in sources if name not in SOURCES and not is_run(name)]
    unknown += [name for name in names if name not in METHODS]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}")
    if min(rounds, steps, options.cap, *grains) < 1:
        parser.error("--rounds, --steps, --cap and --grains must be at least 1")
    methods = [METHODS[name] for name in names or METHODS]
    return Plan(
        sources, grains, methods, rounds, steps, options.cap, options.accurate, options.starts,
        options.seed, options.work
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())

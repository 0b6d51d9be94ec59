"""Command line of the benchmark: ``python benchmarks/lattice14``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path


def main() -> int:
    """Run the comparison; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/lattice14",
        description=(
            "Study 4.1: grains with one temperature each, compared with finite elements that "
            "resolve their inside."
        ),
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object instead of tables"
    )
    parser.add_argument(
        "--plot", type=Path, metavar="DIR", help="write the figures into this folder"
    )
    parser.add_argument(
        "--store",
        action="store_true",
        help="write finite_elements.csv, the curve that the tests use, and stop",
    )
    options = parser.parse_args()
    try:
        import skfem  # noqa: F401
    except ImportError:
        print("this benchmark needs scikit-fem: pip install -e '.[bench]'", file=sys.stderr)
        return 5
    if options.store:
        from stored import PATH, write_curve

        write_curve()
        print(f"wrote {PATH}", file=sys.stderr)
        return 0
    return _run(is_json=options.json, folder=options.plot)


def _run(*, is_json: bool, folder: Path | None) -> int:
    from case import read_case
    from report import as_json, as_text, make_results

    results = make_results(read_case())
    print(json.dumps(as_json(results), indent=1) if is_json else as_text(results))
    if folder is not None:
        from figures import draw_all

        for path in draw_all(results, folder):
            print(f"wrote {path}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Command line: ``python benchmarks/paper``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def main() -> int:
    """Make the figures and the page; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/paper",
        description=(
            "Run the three studies of the paper, draw its figures with our data, set each beside "
            "what the paper states."
        ),
    )
    parser.add_argument(
        "--runs",
        type=Path,
        metavar="DIR",
        default=Path("runs"),
        help=(
            "folder of the runs, each in DIR/NAME; finished ones are taken, the others are run "
            "there [%(default)s]"
        ),
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FOLDER",
        default=Path("paper-figures"),
        help="folder for index.html and the figures, PNG and PDF [%(default)s]",
    )
    options = parser.parse_args()
    return _make(options.runs, options.output)


def _make(runs: Path, folder: Path) -> int:
    from studies import make_page

    from multicor_cli.plots import PlotError
    from multicor_cli.post import PostError
    from multicor_cli.scenario.problems import ScenarioError
    from multicor_cli.store import StoreError

    try:
        page = make_page(runs, folder)
    except (
        StoreError,
        ScenarioError,
        PostError,
        PlotError,
        OSError,
        RuntimeError,
        ValueError,
    ) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"wrote {page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

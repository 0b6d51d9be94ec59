"""Command line of the benchmark: ``python benchmarks/heated_bed``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path


def main() -> int:
    """Run the comparison; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/heated_bed",
        description=(
            "Study 4.2: a deposited bed heated from below, compared with a perfect lattice; time "
            "and error of the heating."
        ),
    )
    parser.add_argument(
        "--run",
        type=Path,
        metavar="DIR",
        default=Path("runs/heated-bed"),
        help="run of configs/heated-bed.toml; made if missing [%(default)s]",
    )
    parser.add_argument(
        "--air",
        type=Path,
        metavar="DIR",
        help=(
            "run of its variant in air; made if missing [default: the bed of --run heated again "
            "in air]"
        ),
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object instead of tables"
    )
    parser.add_argument(
        "--plot", type=Path, metavar="DIR", help="write the figure into this folder"
    )
    options = parser.parse_args()
    return _compare(options.run, options.air, is_json=options.json, folder=options.plot)


def _compare(run: Path, air: Path | None, *, is_json: bool, folder: Path | None) -> int:
    from deposited import AIR, finish_run, read_bed
    from report import as_json, as_text, make_results

    from multicor_cli.store import StoreError

    try:
        bed, mechanics = read_bed(finish_run(run))
        results, beds = make_results(
            bed, mechanics, None if air is None else finish_run(air, (AIR,))
        )
    except (StoreError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    print(json.dumps(as_json(results), indent=1) if is_json else as_text(results))
    if folder is not None:
        from figure import draw_figure

        print(f"wrote {draw_figure(beds, folder)}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

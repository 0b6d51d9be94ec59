"""Command line of the benchmark: ``python benchmarks/peers CASE…``."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CASES = ("shear", "bed", "heat", "problems", "shapes")


def main() -> int:
    """Run the comparisons; returns the exit code."""
    options = _parser().parse_args()
    # Before anything is imported that reads it
    os.environ.setdefault("OMP_NUM_THREADS", str(options.cores))
    results: dict[str, Any] = {}
    from process import PeerError
    from session import Session

    with _work_folder(options.keep) as folder:
        session = Session(options, folder)
        print("\n".join(session.about()) + "\n")
        for case in options.cases:
            try:
                text, results[case] = session.compare(case)
            except PeerError as error:
                print(error, file=sys.stderr)
                return 1
            print(f"{case}\n{'=' * len(case)}\n{text}\n", flush=True)
    if options.json is not None:
        options.json.write_text(
            json.dumps({"about": session.about(), **results}, indent=1) + "\n", encoding="utf-8"
        )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python benchmarks/peers",
        description=(
            "The same cases with this program, with codes of soft grains, contact problems with "
            "Siconos, and polygons with Box2D and LMGC90."
        ),
    )
    add = parser.add_argument
    add("cases", nargs="+", choices=CASES, metavar="CASE", help=", ".join(CASES))
    add(
        "--peers",
        default="liggghts,lammps,yade,siconos,box2d,lmgc90",
        metavar="NAMES",
        help="which codes, if installed [%(default)s]",
    )
    add(
        "--grains",
        type=int,
        metavar="N",
        help="number of grains [shear: 1680; bed, heat: 10000; shapes: 1000]",
    )
    add(
        "--kappa",
        type=float,
        nargs="+",
        default=[1e4, 1e6],
        metavar="K",
        help="stiffness k_n over pressure [1e4 1e6]",
    )
    add(
        "--inertial",
        type=float,
        default=0.01,
        metavar="I",
        help="inertial number of the walls' shear rate [%(default)s]",
    )
    add("--rounds", type=int, default=3, help="rounds, alternating between the codes [%(default)s]")
    add(
        "--cores",
        type=int,
        choices=(1, 2),
        default=1,
        help="threads of ours, MPI ranks of the others [%(default)s]",
    )
    add(
        "--strain",
        type=float,
        default=1.0,
        help="strain that is measured in each round [%(default)s]",
    )
    add("--settle", type=float, default=0.5, help="strain before it [%(default)s]")
    add(
        "--soft-strain",
        type=float,
        default=0.1,
        help="the same for κ ≥ 3·10⁵, where a strain costs much [%(default)s]",
    )
    add(
        "--reference",
        type=float,
        default=3.0,
        metavar="STRAIN",
        help="strain of our run with Δt = 0.05 τ; 0: none [%(default)s]",
    )
    add(
        "--friction",
        type=float,
        default=0.5,
        metavar="MU",
        help="coefficient of friction in shear [%(default)s]",
    )
    add(
        "--sizes",
        choices=("even", "mixture"),
        default="even",
        help="grains in shear: radii spread by 20 %%, or 1, 2 and 3 mm [%(default)s]",
    )
    add("--dt-tau", type=float, help="our time step over τ = √(m/P) [the automatic one]")
    add(
        "--dt-bed",
        type=float,
        default=2e-4,
        metavar="DT",
        help="our time step for the bed [%(default)s s]",
    )
    add(
        "--tolerance",
        type=float,
        help="our tolerance of the rms velocity correction [the default of the program]",
    )
    add(
        "--substeps",
        type=float,
        default=15.0,
        help="time steps of the others in the shortest collision [%(default)s]",
    )
    add(
        "--lammps",
        metavar="PROGRAM",
        help="LAMMPS executable [lmp]; that of Debian 12 has no conduction of heat",
    )
    add(
        "--siconos",
        metavar="PYTHON",
        default="/usr/bin/python3",
        help="interpreter that has Siconos [%(default)s]",
    )
    add(
        "--python",
        metavar="PYTHON",
        default=sys.executable,
        help="interpreter that has pyb2d3 and compas_lmgc90 [this one]",
    )
    add("--quick", action="store_true", help="smaller and shorter: does everything work?")
    add("--json", type=Path, metavar="FILE", help="write the results as JSON too")
    add("--keep", type=Path, metavar="DIR", help="keep the files of the other codes in this folder")
    return parser


@contextmanager
def _work_folder(keep: Path | None) -> Iterator[Path]:
    """The folder for the files of the other codes; gone afterwards unless it is to be kept."""
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        yield keep.resolve()
        return
    with tempfile.TemporaryDirectory(prefix="peers-") as folder:
        yield Path(folder)


if __name__ == "__main__":
    sys.exit(main())

"""Command line of the study: ``python benchmarks/hard_steps``."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import deque
from pathlib import Path

import numpy as np
from criteria import as_text, compare
from ends import MEASURES, TIGHT, end_of
from listening import Heard, Problem, cold, falling_bed, run_scenario, run_scene

from multicor_cli.bench.scenes import SCENES
from multicor_cli.engine.contact.solve import ThreadChoice, solve_system
from multicor_cli.engine.orders import Settings

_CONFIGS = Path(__file__).parents[2] / "configs"
_FIRST = 450  # step of the falling bed at which it begins to collapse


def _sample(options: argparse.Namespace) -> None:
    """Criteria on every tenth step of the falling bed."""
    problems: list[Problem] = []
    for seed in options.seeds:
        heard = Heard(wanted=lambda number: number >= _FIRST and number % 10 == 5)
        run_scenario(falling_bed(seed), heard, options.set)
        problems += heard.problems
    print(f"{len(problems)} problems\n{as_text(compare(problems, 40_000, 10_000))}")


def _count(options: argparse.Namespace) -> None:
    """Sweeps and unconverged steps of whole runs."""
    print(
        "| run | seed | solves | mean sweeps | median | largest | > 1,000 | unconverged |\n"
        "|---|---|---|---|---|---|---|---|"
    )
    for name in options.names or ["falling-bed"]:
        for seed in options.seeds:
            heard = Heard()
            if name == "falling-bed":
                run_scenario(falling_bed(seed), heard, options.set)
                heard.outcomes = heard.outcomes[_FIRST:]
            elif name in SCENES and not name.startswith("heated"):
                run_scene(name, options.grains, seed, heard)
            else:
                own = [f"scenario.seed={seed}", "output.frame_interval=1.0"]
                config = _CONFIGS / f"{name.removeprefix('configs/')}.toml"
                run_scenario(config.read_text(), heard, own + options.set, config)
            if not heard.outcomes:
                print(f"| {name} | {seed} | 0 | – | – | – | – | 0 |", flush=True)  # nothing moves
                continue
            sweeps = np.array([outcome.sweeps for outcome in heard.outcomes])
            missed = sum(not outcome.converged for outcome in heard.outcomes)
            numbers = (
                f"{sweeps.mean():.0f} | {np.median(sweeps):.0f} | {sweeps.max():.0f} | "
                f"{(sweeps > 1000.0).sum()} | {missed}"
            )
            print(f"| {name} | {seed} | {len(sweeps)} | {numbers} |", flush=True)


def _cold(options: argparse.Namespace) -> None:
    """The last step of the bed of configs/heated-bed.toml before it is frozen, from impulses of
    zero.
    """
    for seed in options.seeds:
        overrides = [f"scenario.seed={seed}", "loading.2.duration=60.0", *options.set]
        heard = Heard(wanted=lambda _number: True, problems=deque(maxlen=1))
        run_scenario((_CONFIGS / "heated-bed.toml").read_text(), heard, overrides)
        problem = cold(heard.problems[-1])
        for bound in (2e-3, 3e-3, 5e-3):
            outcome = solve_system(
                problem.copy(), problem.scale, Settings(tolerance_energy=bound), ThreadChoice()
            )
            print(
                (
                    f"seed {seed}, G {bound:g}: {outcome.sweeps:.0f} sweeps, converged "
                    f"{outcome.converged}, rms {outcome.rms:.1e}"
                ),
                flush=True,
            )


def _ends(options: argparse.Namespace) -> None:
    """Ends of whole runs, with the default tolerances and with a fifth of them."""
    print("| run | seed | tolerances | measures | unconverged |\n|---|---|---|---|---|")
    for name in options.names or MEASURES:
        for seed in options.seeds:
            for tolerances, overrides in (("default", []), ("a fifth", TIGHT)):
                with tempfile.TemporaryDirectory() as folder:
                    config = _CONFIGS / f"{name.removeprefix('configs/')}.toml"
                    measures, missed = end_of(
                        config, seed, overrides + options.set, Path(folder) / "run"
                    )
                told = ", ".join(f"{what} {value:.5g}" for what, value in measures.items())
                print(f"| {name} | {seed} | {tolerances} | {told} | {missed} |", flush=True)


def main() -> int:
    """Print one of the tables; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/hard_steps",
        description="Which criteria and which loop leave no step hard.",
    )
    parser.add_argument(
        "table",
        choices=("sample", "count", "cold", "ends"),
        help=(
            "criteria compared; sweeps of whole runs; a deep bed from zero impulses; where runs end"
        ),
    )
    parser.add_argument(
        "--names",
        nargs="+",
        default=[],
        help=(
            "count: falling-bed (default), scenes of multicor bench, configs/NAME; ends: "
            "configs/NAME"
        ),
    )
    parser.add_argument(
        "--grains", type=int, default=1000, help="count: number of grains of scenes"
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[1], help="seeds")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="overrides of the scenario"
    )
    options = parser.parse_args()
    {"sample": _sample, "count": _count, "cold": _cold, "ends": _ends}[options.table](options)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What a step of a sheared cell costs, beside one of a flow between walls, on one thread and two.

``python benchmarks/cell/cost.py``: the same discs at an inertial number of 0.1, strained by 2.
Steps of both alternate.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from multicor_cli.engine import Engine
from multicor_cli.model.state import State
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import load_scenario

CONFIGS = Path(__file__).parents[2] / "configs"
ROUNDS, STEPS = 9, 4


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grains", type=int, default=100_000, help="[%(default)s]")
    parser.add_argument(
        "--steps", type=int, default=400, help="before, of 0.005 in strain [%(default)s]"
    )
    options = parser.parse_args()
    flows = {
        "walls": _flow("shear-gravity-free", _between_walls(options.grains), options.steps),
        "cell": _flow("cell-shear", _without_walls(options.grains), options.steps),
    }
    print("| threads | | grains | µs per step and grain | sweeps | cell over walls |")
    print("|---|---|---|---|---|---|")
    for threads in (1, 2):
        engines = {name: _copy(engine, threads) for name, (engine, _) in flows.items()}
        spent: dict[str, list[float]] = {name: [] for name in flows}
        sweeps: dict[str, list[float]] = {name: [] for name in flows}
        for round_ in range(ROUNDS + 1):
            for name, engine in engines.items():
                dt, start = flows[name][1], time.perf_counter()
                done = [engine.step(dt, dt * k) for k in range(STEPS)]
                if round_ > 0:  # the first compiles, and finds contacts anew
                    spent[name].append((time.perf_counter() - start) / STEPS)
                    sweeps[name].append(float(np.mean([one.sweeps for one in done])))
        per_grain = {
            name: 1e6 * np.array(spent[name]) / engines[name].model.grain_count for name in flows
        }
        ratio = float(np.median(per_grain["cell"] / per_grain["walls"]))
        for name in flows:
            last = f"{ratio:.2f}" if name == "cell" else ""
            count = engines[name].model.grain_count
            print(
                f"| {threads} | {name} | {count} | {np.median(per_grain[name]):.2f} | "
                f"{np.median(sweeps[name]):.1f} | {last} |",
                flush=True,
            )
    return 0


def _between_walls(grains: int) -> list[str]:
    wide = 0.03 * grains / 1200
    return [
        f"domain.size=[{wide},0.05]", f"particles.0.count={grains}",
        f"particles.0.region={{min=[0.0,0.0012],max=[{wide},0.0438]}}",
        f"walls.0.geometry.to=[{wide},0.0]", f"walls.1.geometry.to=[{wide},0.045]",
        f"walls.1.mass={1.6e-4 * wide / 0.03}", f"loading.0.drives.top.y.force={-10.0 * wide}",
    ]  # fmt: skip


def _without_walls(grains: int) -> list[str]:
    return [f"variables.side={32.0 * (grains / 900) ** 0.5}"]


def _flow(name: str, overrides: list[str], steps: int) -> tuple[Engine, float]:
    """A flow after so many steps of its last stage, and its time step [s]."""
    scenario = load_scenario(CONFIGS / f"{name}.toml", overrides=overrides)
    model, state = build(scenario)
    engine, plan = make_engine(scenario, model, state, 2), make_plan(scenario, model)
    for k, stage in enumerate(plan.stages):
        begin_stage(engine, stage, [0.0] * (k + 1))
        is_last = k == len(plan.stages) - 1
        for step in range(steps if is_last else int(stage.step_limit or 0)):
            engine.step(stage.dt, step * stage.dt)
    return engine, plan.stages[-1].dt


def _copy(engine: Engine, threads: int) -> Engine:
    """Another engine that goes on from a copy of the state."""
    state = State.from_dict({name: np.array(v) for name, v in engine.state.as_dict().items()})
    other = Engine(engine.model, state, threads=threads)
    other.resume(engine.orders)
    return other


if __name__ == "__main__":
    sys.exit(main())

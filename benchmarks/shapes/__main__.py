"""What a step costs before its solve, and what memory it takes, of grains of other shapes.

``python benchmarks/shapes``: the same cell, sheared at constant pressure, of discs and of others of
the same area. Steps of all alternate; times are those of the processor.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import tracemalloc
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np

from multicor_cli.engine import Engine, mechanics
from multicor_cli.engine.geometry.neighbors import SKIN, NeighborList
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import StagePlan, begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import parse_scenario

SHAPES = {
    "disc": '"disc"',
    "pentagon": '{ kind = "polygon", sides = 5, size = "area" }',
    "rod 1.7": '{ kind = "rod", aspect = 1.667, size = "area" }',
    "rod 5": '{ kind = "rod", aspect = 5.0, size = "area" }',
}
"""η = 1 − 1/aspect of the rods is 0.4 and 0.8."""

BEFORE_SOLVE = "predict", "detect", "prepare"
"""Phases of a step: list and points of near pairs, W, bias, warm start, and their order."""

NEAR = 0.3
"""Gap of circles that are near, over the mean diameter."""

_SCENARIO = """
[scenario]
name = "shapes"
seed = 1
[domain]
size = [{side!r}, {side!r}]
periodic = ["x", "y"]
gravity = [0.0, 0.0]
[materials.stuff]
density = {density!r}
[[contacts]]
pair = ["*", "*"]
friction = 0.4
restitution = 0.0
[[particles]]
name = "grains"
material = "stuff"
shape = {shape}
thickness = 1.0
sizes = {{ kind = "uniform", min = 0.45, max = 0.55 }}
count = {count}
packing = {{ kind = "random" }}
[solver]
dt = 0.05
[[loading]]
duration = {compress!r}
cell = {{ xx = {{ stress = 1.0 }}, yy = {{ stress = 1.0 }} }}
[[loading]]
duration = 1000.0
cell = {{ xx = {{ rate = 0.0 }}, xy = {{ rate = 0.1 }} }}
[output]
frame_interval = 1.0
"""
"""Mean diameter 1, of which one has the mass 1; √(m/P) is 1, and I = 0.1."""


class Flow:
    """A sheared cell of grains of one shape, some way into its flow."""

    def __init__(self, shape: str, count: int, compress: float, steps: int) -> None:
        side = math.sqrt(count * math.pi / 4.0 / 0.7)
        text = _SCENARIO.format(
            side=side, density=4.0 / math.pi, shape=SHAPES[shape], count=count, compress=compress
        )
        scenario = parse_scenario(text, Path("shapes.toml"))
        model, state = build(scenario)
        first, last = make_plan(scenario, model).stages
        self.engine: Engine = make_engine(scenario, model, state, 1)
        begin_stage(self.engine, first, [0.0])
        self._take(first, round(compress / first.dt))
        begin_stage(self.engine, last, [0.0, compress])
        self._stage, self._taken = last, 0
        self.advance(steps)

    @property
    def grains(self) -> int:
        """Their number."""
        return self.engine.model.grain_count

    def advance(self, steps: int) -> tuple[float, float]:
        """Take steps; returns the time of the processor that they took [s], and their sweeps."""
        begin = time.process_time()
        sweeps = self._take(self._stage, steps, self._taken)
        self._taken += steps
        return time.process_time() - begin, sweeps

    def _take(self, stage: StagePlan, steps: int, taken: int = 0) -> float:
        """Take steps of a stage; returns their sweeps."""
        steps_taken = range(taken, taken + steps)
        return sum(self.engine.step(stage.dt, k * stage.dt).sweeps for k in steps_taken)


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python benchmarks/shapes", description=__doc__)
    parser.add_argument("--grains", type=int, default=1000, help="[%(default)s]")
    parser.add_argument("--shapes", default=",".join(SHAPES), help="[%(default)s]")
    parser.add_argument("--rounds", type=int, default=9, help="[%(default)s]")
    parser.add_argument("--steps", type=int, default=30, help="of a round [%(default)s]")
    parser.add_argument("--compress", type=float, default=20.0, help="in √(m/P) [%(default)s]")
    parser.add_argument("--memory", action="store_true", help="memory instead of time")
    options = parser.parse_args()
    names = ["disc", *(name for name in options.shapes.split(",") if name != "disc")]
    if unknown := set(names) - set(SHAPES):
        parser.error(f"unknown shapes {', '.join(sorted(unknown))}: there are {', '.join(SHAPES)}")
    if options.memory:
        print("\n".join(_memory(names, options.grains)))
        return 0
    clock = SimpleNamespace(perf_counter=time.process_time)
    with patch.object(mechanics, "time", clock):  # phases by time of the processor
        print("\n".join(_times(names, options)))
    return 0


def _times(names: list[str], options: argparse.Namespace) -> list[str]:
    flows = {}
    for name in names:
        flows[name] = Flow(name, options.grains, options.compress, options.steps)
        print(f"{name} flows", file=sys.stderr, flush=True)
    found: dict[str, list[list[float]]] = {name: [] for name in names}
    for _ in range(options.rounds):
        for name, flow in flows.items():
            found[name].append(_round(flow, options.steps))
    rows = ["| shape | " + " | ".join(_COLUMNS) + " |", "|---" * (len(_COLUMNS) + 1) + "|"]
    discs = np.array(found["disc"])
    for name in names:
        ours = np.array(found[name])
        plain = np.median(ours[:, :_COUNTS], axis=0)
        ratio = np.median(ours[:, _COUNTS:] / discs[:, _COUNTS:], axis=0)
        cells = [*(f"{value:.2f}" for value in plain), *(f"{value:.2f}" for value in ratio)]
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return rows


_COUNTS = 3
_COLUMNS = (
    "circles near, a grain", "pairs near, a grain", "sweeps",
    "before the solve, a near pair, over discs", "of it finding them",
    "a sweep, a point, over discs", "a step, a grain, over discs",
)  # fmt: skip


def _round(flow: Flow, steps: int) -> list[float]:
    """Values of `_COLUMNS`, those from the fourth on as times [s]."""
    engine = flow.engine
    before, seconds, sweeps = dict(engine.timers), *flow.advance(steps)
    spent = {name: (now - before[name]) / steps for name, now in engine.timers.items()}
    near, points = engine.state.near_i.size, engine.contacts().i.size
    return [
        circles_near(engine) / flow.grains, near / flow.grains, sweeps / steps,
        sum(spent[name] for name in BEFORE_SOLVE) / near, spent["detect"] / near,
        spent["solve"] * steps / (sweeps * points), seconds / (steps * flow.grains),
    ]  # fmt: skip


def circles_near(engine: Engine) -> int:
    """How many pairs have circles that are near, however far the lists of the engine reach."""
    model, state = engine.model, engine.state
    listed = NeighborList(model)
    cutoff = (NEAR - SKIN) * model.mean_diameter  # beyond which a list reaches by its skin
    listed.update(scene_of(model, state.position, state.wall_position), cutoff)
    return int(listed.partner.size)


def _memory(names: list[str], count: int) -> list[str]:
    rows = ["| shape | held between steps, a grain | at the peak of a step |", "|---|---|---|"]
    for name in names:
        Flow(name, 100, 0.1, 4)  # compiles
        tracemalloc.start()
        flow = Flow(name, count, 1.0, 2)
        held = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        flow.advance(1)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        rows.append(f"| {name} | {held / count:.0f} B | {peak / count:.0f} B |")
    return rows


if __name__ == "__main__":
    sys.exit(main())

"""The accelerated solve needs no more sweeps than the plain one: same states, same tolerances, on
every shipped shear scene."""

import numpy as np
import pytest
from places import ROOT
from scene_parts import copy_of

import multicor_cli as multicor
from multicor_cli.engine import Engine, Orders, Settings
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan

CONFIGS = ROOT / "configs"


def _sweeps_from(model, state, drives, dt, t):
    """Sweep-equivalents of one step from a copied state, accelerated and plain."""
    counts = []
    for method in ("accelerated", "gauss-seidel"):
        copy = copy_of(state)
        engine = Engine(model, copy, threads=1)
        engine.resume(Orders(drives, Settings(method=method)))
        counts.append(engine.step(dt, t).sweeps)
    return counts


@pytest.mark.validation
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["shear", "shear-dynamic", "shear-gravity-free"])
def test_accelerated_needs_no_more_sweeps(name):
    scenario = multicor.load_scenario(CONFIGS / f"{name}.toml")
    model, state = build(scenario)
    engine = Engine(model, state, threads=1)
    counts, starts = [], []
    plan = make_plan(scenario, model)
    for number, stage in enumerate(scenario.loading):
        dt = plan.stages[number].dt
        state.stage, state.stage_start, state.stage_step = number, state.time, 0
        starts.append(state.time)
        drives = scenario.drives(model.walls.names)[number].started(starts)
        engine.begin(Orders(drives))
        is_last = number == len(scenario.loading) - 1
        steps = 400 if is_last else round(stage.duration / dt)
        for k in range(steps):
            if is_last and k % 20 == 19:
                counts.append(_sweeps_from(model, state, drives, dt, k * dt))
            engine.step(dt, k * dt)
    accelerated, plain = np.mean(counts, axis=0)
    print(
        f"{name}: {accelerated:.0f} sweeps accelerated, {plain:.0f} plain, ratio "
        f"{plain / accelerated:.1f}"
    )
    assert accelerated <= plain

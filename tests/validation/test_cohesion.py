"""Adhesion does not depend on the time step: the strength of a packing that is pulled apart, and
the slope of a heap, for steps over a factor of 30 (theory §3.1).

python -m pytest -m validation tests/validation/test_cohesion.py -s
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from heap_slope import slope
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.scenario import parse_scenario

pytestmark = [pytest.mark.validation, pytest.mark.timeout(3600)]

FORCE, DIAMETER, WIDTH = 1e-3, 1e-3, 20e-3
"""F_a [N], mean diameter and period [m]."""

SCENE = """
[scenario]
name = "pulled"
seed = 1
[domain]
size = [0.02, 0.04]
periodic = true
gravity = [0.0, 0.0]
[materials.glass]
density = 2500.0
[materials.glue]
density = 2500.0
[[contacts]]
pair = ["*", "*"]
friction = 0.5
adhesion = { force = 1e-3, kind = "dry" }
[[contacts]]
pair = ["glass", "glue"]
friction = 0.5
adhesion = { force = 2e-2, kind = "dry" }
[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 360
region = { min = [0.0, 0.001], max = [0.02, 0.034] }
packing = { kind = "random" }
[[walls]]
name = "bottom"
material = "glue"
geometry = { kind = "rough", from = [0.0, 0.0], to = [0.02, 0.0], side = "left" }
[[walls]]
name = "top"
material = "glue"
mass = 1e-4
geometry = { kind = "rough", from = [0.0, 0.035], to = [0.02, 0.035], side = "right" }
[solver]
dt = 2e-5
[output]
frame_interval = 0.01
series_interval = 2e-4
"""

PRESS = """
[[loading]]
name = "press"
duration = 0.15
drives.top = { y = { force = -0.1, damping = 0.1 } }
"""

PULL = """
[start]
run = "RUN"
[[loading]]
name = "pull"
duration = 0.2
until = { displacement = { wall = "top", axis = "y", above = 0.5e-3 } }
drives.top = { y = { force = { ramp = [-0.01, 0.05], duration = 0.2 }, damping = 0.1 } }
"""


def _carry_out(text: str, directory: Path, *overrides: str) -> Any:
    scenario = parse_scenario(text, directory.parent / "pulled.toml", overrides)
    return multicor.open_run(multicor.run(scenario, directory).directory)


def strength(run: Any) -> float:
    """Largest stress with which the grains have held the lid [N/m]."""
    top = run.model.walls.names.index("top")
    return -float(run.series["wall_force"][:, top, 1].min()) / WIDTH


@pytest.mark.parametrize("kind", ["dry", "wet"])
def test_a_packing_is_as_strong_at_every_time_step(
    kind: str, tmp_path: Path, record_property: Any
) -> None:
    """Its strength is near Rumpf's, the pressure that F_a makes in all contacts, ν Z F_a/(π d)."""
    steps, seeds = (6e-5, 2e-5, 2e-6), (1, 2, 3)
    found = np.empty((len(seeds), len(steps)))
    for row, seed in enumerate(seeds):
        text = SCENE.replace("seed = 1", f"seed = {seed}").replace('"dry"', f'"{kind}"')
        with _carry_out(text + PRESS, tmp_path / f"press-{seed}") as pressed:
            height, frame = pressed.frames[-1].wall_position[1, 1], pressed.frames[-1]
            fraction = np.pi * (pressed.model.grains.radius**2).sum() / (WIDTH * height)
            touching = np.count_nonzero(frame.contacts.force[:, 0])
            rumpf = fraction * 2.0 * touching / 360 * FORCE / (np.pi * DIAMETER)
        grains, walls = text.index("[[particles]]"), text.index("[[walls]]")
        pull = text[:grains] + PULL.replace("RUN", str(tmp_path / f"press-{seed}")) + text[walls:]
        for column, dt in enumerate(steps):
            name = tmp_path / f"pull-{seed}-{column}"
            with _carry_out(pull, name, f"solver.dt={dt}") as run:
                found[row, column] = strength(run) / rumpf
                assert run.info["summary"]["energy_closure"] < 1e-10
        print(kind, seed, f"{rumpf:.3f} N/m, strength over it", np.round(found[row], 3))
    keep(record_property, strength=found, steps=steps)
    assert 0.25 < found.min() < found.max() < 1.2
    # Of one packing; the scatter of packings is larger
    assert np.abs(found / found.mean(axis=1, keepdims=True) - 1.0).max() < 0.1


@pytest.mark.parametrize(("bond", "kind"), [(4, "dry"), (1, "wet")])
def test_a_heap_is_as_steep_at_every_time_step(
    bond: int, kind: str, tmp_path: Path, record_property: Any
) -> None:
    """And with four weights steeper than without adhesion, where it has 34.4 ± 0.6°."""
    steps, seeds = ("2e-4", "3e-5", "7e-6"), range(1, 5)
    adhesion = f'contacts.1.adhesion={{force="= bond * weight", kind="{kind}"}}'
    slopes = np.empty((len(steps), len(seeds)))
    for row, dt in enumerate(steps):
        for column, seed in enumerate(seeds):
            changes = f"variables.bond={bond}", "variables.rolling=0", f"scenario.seed={seed}"
            name = tmp_path / f"{dt}-{seed}"
            run_config("heap", name, *changes, f"solver.dt={dt}", adhesion)
            slopes[row, column] = slope(name)
        print(bond, kind, dt, f"{slopes[row].mean():.1f}°", np.round(slopes[row], 1))
    keep(record_property, slopes=slopes, steps=[float(dt) for dt in steps])
    mean, error = slopes.mean(axis=1), slopes.std(axis=1, ddof=1) / math.sqrt(len(seeds))
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert abs(mean[a] - mean[b]) < 2.5 * math.hypot(error[a], error[b])
    assert bond == 1 or (mean - 2.0 * error > 36.0).all()

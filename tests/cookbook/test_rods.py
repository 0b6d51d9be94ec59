"""`configs/rods.toml`: rods in a cell under shear align, more so the longer they are; pentagons in
their place are stronger and looser than discs."""

import numpy as np
import pytest
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.post import Selection, fabric, rheology

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

SHAPES = {
    "discs": 'particles.0.shape="disc"',
    "pentagons": 'particles.0.shape={ kind = "polygon", sides = 5, size = "area" }',
    "aspect 1.5": "variables.aspect=1.5",
    "aspect 2.5": "variables.aspect=2.5",
    "aspect 4": "variables.aspect=4",
}
RODS = [name for name in SHAPES if name.startswith("aspect")]
SEEDS = {"aspect 2.5": 16, "aspect 4": 16}
"""S of these two differs by 0.045 ± 0.008, and of two runs by 0.03; of others two tell enough."""


def measured(directory):
    """μ*, ν, S, director [°], share of edge-edge contacts and of their force; 0 without edges."""
    with multicor.open_run(directory) as run:
        assert run.info["summary"]["solver"]["unconverged_steps"] == 0
        flowing = Selection(start=0.4 * run.frames[-1].time)
        flow, texture = rheology(run, flowing).mean, fabric(run, flowing).mean
    named = "nematic_order", "nematic_director", "edge_edge", "edge_edge_force"
    return [flow["friction"], flow["solid_fraction"], *(texture.get(name, 0.0) for name in named)]


def test_rods_align_in_shear(tmp_path, record_property):
    found = {}
    for name, key in SHAPES.items():
        rows = [
            measured(run_config("rods", tmp_path / f"{name}-{seed}", key, f"scenario.seed={seed}"))
            for seed in range(1, SEEDS.get(name, 2) + 1)
        ]
        found[name] = np.mean(rows, axis=0)
        print(name, np.round(rows, 3).tolist())
    keep(record_property, shapes=list(found), found=list(found.values()))
    order = np.array([found[name][2] for name in RODS])
    assert (np.diff(order) > [0.05, 0.02]).all()
    # towards the flow, a little above it
    assert all(0.0 < found[name][3] < 35.0 for name in RODS)
    assert all(found[name][0] > found["discs"][0] + 0.05 for name in [*RODS, "pentagons"])
    assert found["pentagons"][1] < found["discs"][1] - 0.02

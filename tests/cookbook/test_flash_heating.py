"""`configs/flash-heating.toml`: a flow whose contacts weaken by flash heating, between the flows of
grains with either constant friction."""

import numpy as np
import pytest
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.post.rheology import rheology
from multicor_cli.post.source import Selection

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

SEEDS = (1, 2)
RATIOS = (0.01, 1.0, 10.0, 300.0)
"""Of the speed γ̇ d to the weakening speed."""

NAMES = "friction", "solid_fraction"


def mean_flow(directory, what, key):
    """μ* and ν, each the mean of the seeds."""
    found = []
    for seed in SEEDS:
        made = run_config(
            "flash-heating", directory / f"run-{what}-{seed}", key, f"scenario.seed={seed}"
        )
        with multicor.open_run(made) as run:
            table = rheology(run, Selection(start=0.25 * run.frames[-1].time))
        found.append([table.mean[name] for name in NAMES])
        errors = [table.error[name] for name in NAMES]
        print(
            f"{key}, seed {seed}:",
            ", ".join(map("{} = {:.4f} ± {:.4f}".format, NAMES, found[-1], errors)),
        )
    return np.mean(found, axis=0)


def test_friction_of_the_flow_falls_from_one_constant_to_the_other(tmp_path, record_property):
    ratios = [mean_flow(tmp_path, ratio, f"variables.ratio={ratio}") for ratio in RATIOS]
    strong, weak = (mean_flow(tmp_path, mu, f"contacts.0.friction={mu}") for mu in (0.5, 0.05))
    keep(record_property, ratio=RATIOS, weakening=ratios, strong=strong, weak=weak)
    friction, solid = np.transpose(ratios)
    assert friction[0] == pytest.approx(strong[0], abs=0.01)
    assert friction[-1] == pytest.approx(weak[0], abs=0.01)
    assert solid[0] == pytest.approx(strong[1], abs=0.002)
    assert solid[-1] == pytest.approx(weak[1], abs=0.002)
    assert (np.diff(friction) < -0.01).all()
    assert (np.diff(solid) > 0.002).all()

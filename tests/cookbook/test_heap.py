"""`configs/heap.toml`: the slopes of a heap grow with adhesion and with rolling resistance.

A body on a plane rests on slopes of tan α ≤ μ_r, a disc hangs if F_a ≥ m g (theory §3.1, §3.2,
§15.1).
"""

import math

import numpy as np
import pytest
from heap_slope import slope
from scenarios import plane, run_config, scenario

pytestmark = [pytest.mark.validation, pytest.mark.timeout(3600)]

SEEDS = range(1, 7)
VARIANTS = {"neither": (0, 0), "adhesion": (4, 0), "rolling": (0, 0.3), "both": (4, 0.3)}
"""Granular Bond number and coefficient of rolling resistance."""


def test_slopes_grow_with_adhesion_and_with_rolling_resistance(tmp_path):
    found, mean, error = {}, {}, {}
    for name, (bond, rolling) in VARIANTS.items():
        angles = []
        for seed in SEEDS:
            changes = (f"variables.bond={bond}", f"variables.rolling={rolling}")
            run_config("heap", tmp_path / f"{name}-{seed}", f"scenario.seed={seed}", *changes)
            angles.append(slope(tmp_path / f"{name}-{seed}"))
        found[name] = np.array(angles)
        mean[name], error[name] = np.mean(angles), np.std(angles, ddof=1) / math.sqrt(len(angles))
        print(f"{name}: {mean[name]:.1f} ± {error[name]:.1f}°", np.round(angles, 1))
    # By ranks, since a column that adheres may stand: of 36 pairs 29 say so at 5 % (Mann–Whitney)
    for name in ("adhesion", "rolling", "both"):
        assert np.count_nonzero(found[name][:, None] > found["neither"]) >= 29


WEIGHT = 2500.0 * 9.81 * math.pi / 4.0 * 1e-9  # of a disc with a diameter of 1 mm [N]


def ends(run, name, heights, rolling=0.0, adhesion=0.0, angle=0.0):
    """Positions and velocities of discs at the end, and the time of the run; a ceiling holds them
    with ten weights."""
    ceiling = {"geometry": plane(0.01, -1), "material": "glue"}
    one = scenario(
        size=[0.01, 0.01], gravity=[9.81 * math.sin(angle), -9.81 * math.cos(angle)],
        materials={"glass": {"density": 2500.0}, "glue": {"density": 2500.0}},
        contacts=[
            {"friction": 0.5, "rolling_friction": rolling, "adhesion": adhesion * WEIGHT},
            {"pair": ["glass", "glue"], "friction": 0.5, "adhesion": 10.0 * WEIGHT},
        ],
        grains=[[0.0, height, 0.5e-3] for height in heights],
        walls={"floor": plane(), "ceiling": ceiling},
        duration=0.2, solver={"dt": 1e-4, "tolerance_rms": 1e-5},
    )  # fmt: skip
    end = run(one, name).frames[-1]
    return end.unwrapped[:, :2], end.velocity[:, :2], end.time


@pytest.mark.parametrize("rolling", [0.05, 0.2])
def test_a_disc_rolls_down_slopes_above_the_coefficient_of_rolling_resistance(rolling, run):
    limit = math.atan(rolling)
    _, velocity, _ = ends(run, "below", [0.5e-3], rolling=rolling, angle=0.995 * limit)
    assert abs(velocity[0, 0]) < 1e-9
    angle = 1.005 * limit
    _, velocity, time = ends(run, "above", [0.5e-3], rolling=rolling, angle=angle)
    acceleration = 9.81 * (math.sin(angle) - rolling * math.cos(angle)) * 2.0 / 3.0
    assert velocity[0, 0] == pytest.approx(acceleration * time, rel=1e-6)


def test_a_pair_separates_above_its_adhesion(run):
    """The ceiling holds the upper disc, which holds the lower one if F_a ≥ m g."""
    heights = [9.5e-3, 8.5e-3]
    place, velocity, time = ends(run, "holds", heights, adhesion=1.005)
    assert place[:, 1] == pytest.approx(heights, abs=1e-6)
    assert np.abs(velocity).max() < 1e-6
    place, velocity, _ = ends(run, "separates", heights, adhesion=0.995)
    assert place[0, 1] == pytest.approx(heights[0], abs=1e-6)
    # on the floor, as it is 8 mm below and 0.2 s are five times the fall
    assert place[1, 1] == pytest.approx(0.5e-3, abs=1e-6)
    assert time == pytest.approx(0.2)

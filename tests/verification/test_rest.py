"""A packing that is pressed and left alone comes to rest: nothing creeps, and nothing is heated."""

import numpy as np
import pytest
from places import ROOT
from scenarios import engine, plane, scenario

from multicor_cli.engine import Settings
from multicor_cli.engine.contact.contacts import Speeds
from multicor_cli.engine.contact.solve import ResidualScale
from multicor_cli.scenario import load_scenario

_DIAMETER = 1e-3
_GRAINS = {
    "shape": "sphere",
    "count": 60,
    "sizes": {"kind": "uniform", "min": 0.4e-3, "max": 0.6e-3},
}


@pytest.mark.parametrize(("friction", "gravity", "stress", "method"), [
    (0.3, -9.81, 50.0, "accelerated"), (0.3, 0.0, 50.0, "gauss-seidel"),
    (0.8, 0.0, 5.0, "accelerated"),
    (0.0, -9.81, 5.0, "accelerated"),  # an error moves grains by ten times itself
])  # fmt: skip
def test_loaded_packing_rests(run, friction, gravity, stress, method):
    """For 0.05 s, 300 to 1,000 √(m/P); what rattlers still have may become heat."""
    load = {"lid": {"y": {"stress": -stress, "damping": 1.0}}}
    held = run(scenario(
        size=[8e-3, 12e-3],
        periodic=True,
        gravity=[0.0, gravity],
        friction=friction,
        grains=_GRAINS,
        walls={"floor": plane(), "lid": {"geometry": plane(11e-3, -1), "mass": 1e-4}},
        loading=[{"duration": 0.25, "drives": load}],
        solver={"dt": 5e-5, "method": method},
        output={"frame_interval": 0.05, "series_interval": 0.05},
    ))  # fmt: skip
    series = held.series
    work = series["load_work"][-1] + series["gravity_work"][-1]
    loss = series["friction_loss"] + series["impact_loss"]
    lid = [frame.wall_position[1, 1] for frame in held.frames]
    assert abs(lid[-1] - lid[-2]) < 1e-6 * _DIAMETER
    assert abs(loss[-1] - loss[-2]) < 1e-7 * work + series["kinetic"][-2]
    assert series["kinetic"][-1] < 1e-5 * work
    assert series["corrected_steps"][-1] == series["corrected_steps"][-2]


@pytest.mark.parametrize("kind", ["dry", "wet"])
@pytest.mark.parametrize("bond", [0.5, 4.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_cohesive_heap_rests(kind, bond, seed):
    """Also where contacts are at the end of their strength: to begin these anew in each step would
    push at the heap forever."""
    adhesion = f'{{ force = "= bond * weight", range = "= 0.02 * d", kind = "{kind}" }}'
    sets = {"variables.plate": 15, "variables.bond": bond, "variables.rolling": 0.0}
    heap = load_scenario(
        ROOT / "configs" / "heap.toml",
        overrides=[
            f"scenario.seed={seed}", f"contacts.0.adhesion={adhesion}", "solver.dt=1e-4",
            *(f"{key}={value}" for key, value in sets.items()),
        ],
    )  # fmt: skip
    stepper, _ = engine(heap)
    for number in range(600):
        report = stepper.step(1e-4, 1e-4 * number)
    assert np.abs(stepper.state.velocity[:, :2]).max() < 1e-11  # m/s; a weight gives 1e-3 in a step
    assert report.sweeps < 50  # of 100 that are made where they do not end


@pytest.mark.parametrize(
    ("motion", "errors"),
    [
        (1e-6, 2e-9),
        (5e-5, 5e-7),
        (1e-4, 2e-6),
        (0.05, 1e-3),
        (0.075, 0.03 * 0.075),
        (0.1, 4e-3),
        (0.25, 0.025),
        (1.0, 0.1),
        (10.0, 0.1),
    ],
)
def test_errors_stay_small_against_the_motion_that_there_is(motion, errors):
    """0.2 % of it where nothing moves, 2 % at rest, a growing share in faster flows, and never more
    than the tolerance (theory §5.3)."""
    scale = ResidualScale(rms=50.0, velocity=10.0, energy=1.0, motion=motion, load=1.0)
    tolerances = scale.tolerances(Settings(tolerance_rms=2e-3))
    assert tolerances.rms == pytest.approx(0.1)
    assert tolerances.wanted * tolerances.rms == pytest.approx(errors)


@pytest.mark.parametrize(
    ("shear", "crossing", "rms", "largest"),
    [
        (0.01, 1e3, 1.0, 1.0),
        (0.0854, 1e3, 1.0, 1.0),
        (0.25, 1e3, 5.0, 1.0),
        (1.0, 1e3, 40.0, 8.0),
        (2.0, 1e3, 80.0, 16.0),
        (2.0, 120.0, 10.0, 2.0),
        (0.25, 48.0, 4.0, 1.0),
        (2.0, 6.0, 1.0, 1.0),
    ],
)
def test_errors_are_measured_against_the_shear_in_flows_and_else_against_the_load(
    shear, crossing, rms, largest
):
    """u_rms = max(u_load, min(40 s min(1, √(s/u_load)), d̄/(12 Δt))), u_ref = max(u_load, u_rms/5)
    (theory §5.3)."""
    speeds = Speeds(squares=0.0, closing=0.0, shear=12.0 * shear, loaded=12.0, motion=0.0, met=12.0)
    scale = ResidualScale.of(
        speeds, mass=6.0, count=3, weight=1.0, thrust=0.0, attraction=0.0, restitution=0.0,
        crossing=crossing, rounding=0.0,
    )  # fmt: skip
    assert (scale.load, scale.rms) == (1.0, pytest.approx(rms, rel=2e-3))
    assert scale.velocity == pytest.approx(largest, rel=2e-3)
    assert scale.energy == pytest.approx(3.0 * largest, rel=2e-3)


def test_errors_are_measured_against_the_shear_where_nothing_loads():
    speeds = Speeds(squares=0.0, closing=0.0, shear=6.0, loaded=12.0, motion=0.0, met=12.0)
    scale = ResidualScale.of(
        speeds, mass=6.0, count=3, weight=0.0, thrust=0.0, attraction=0.0, restitution=0.0,
        crossing=1e3, rounding=0.0,
    )  # fmt: skip
    assert (scale.load, scale.rms, scale.velocity) == (0.0, 20.0, 4.0)
    assert scale.energy == pytest.approx(3.0 * 16.0)

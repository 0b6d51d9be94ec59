"""How heat flow is integrated: errors below tolerance, no overshoot, and what ends a run."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multicor_cli.engine.heat.integration import CannotIntegrate, Integration, integrate
from multicor_cli.engine.heat.radiation import STEFAN_BOLTZMANN
from multicor_cli.engine.heat.rates import Network
from multicor_cli.engine.heat.walls import WallHeat, WallValues
from multicor_cli.engine.motion.drives import Constant

NONE, NOTHING = np.zeros(0, np.int32), np.zeros(0)
WAYS = [
    (name, is_frozen) for name in ("auto", "explicit", "implicit") for is_frozen in (False, True)
]


def network(nodes, links=(), flow=(), outside=None, area=0.0, between=0.0):
    """Links of 1 W/K with the area factor ``between``; a wall flow into nodes; an outside."""
    i, j = np.array(links, np.int32).reshape(-1, 2).T.copy()
    has_outside = int(outside is not None)
    return Network(
        i, j, np.ones(i.size), np.full(i.size, between) if between else NOTHING,
        NOTHING, NONE, NONE, NOTHING, NOTHING,
        np.array(flow, np.int32), np.zeros(len(flow), np.int32),
        np.full(len(flow), 1.0 / max(1, len(flow))),
        np.zeros(has_outside, np.int32), np.full(has_outside, outside or 0.0),
        np.full((has_outside, nodes), 0.0 if area else 1.0), np.full((has_outside, nodes), area),
    )  # fmt: skip


def advance(net, start, dt, *, flow=0.0, source=0.0, steps=1, way=("auto", False), **choices):
    """Temperatures [K] after each of ``steps`` steps, with 1 J/K; and inflow in the last one."""
    temperature, capacity = np.array(start, float), np.ones(len(start))
    walls, found, first = WallValues([WallHeat("flow", Constant(flow))], 0.0), [], 0.0
    for _ in range(steps):
        heat = integrate(
            net, capacity, temperature, walls, np.full(len(start), source * dt), dt, first,
            Integration(integrator=way[0], **choices), is_frozen=way[1],
        )  # fmt: skip
        first = heat.next_step
        found.append(temperature.copy())
    return np.array(found), heat


@pytest.mark.parametrize(
    "way", WAYS, ids=lambda way: f"{way[0]}-{'frozen' if way[1] else 'moving'}"
)
@pytest.mark.parametrize("dt", [1e-5, 3e-4, 1e-3, 1e-2, 0.3, 0.5, 1.0, 1.5, 30.0, 1e3, 1e6])
def test_two_grains_approach_each_other(way, dt):
    """ΔT = 200 exp(−2t), from steps of far below C/H to a million of them; no overshoot."""
    if way[0] == "explicit" and dt > 1e4:
        dt = 3e3
    steps = 200 if dt <= 0.01 else 8 if dt <= 1e3 else 2
    found, heat = advance(network(2, [(0, 1)]), [500.0, 300.0], dt, steps=steps, way=way)
    difference = found[:, 0] - found[:, 1]
    assert found.sum(axis=1) == pytest.approx(np.full(steps, 800.0), rel=1e-14)
    assert difference == pytest.approx(200.0 * np.exp(-2.0 * dt * np.arange(1, steps + 1)), abs=0.2)
    assert np.all(difference >= -1e-9)
    assert np.all(np.diff(difference) <= 1e-9)
    assert heat.error <= 6e-4


@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6])
def test_errors_follow_the_tolerance(way, tolerance):
    """A grain in air after a time constant, and one that radiates into the cold: T⁻³ is linear."""
    found, heat = advance(network(1, outside=1000.0), [300.0], 1.0, way=way, tolerance=tolerance)
    assert found[0, 0] == pytest.approx(1000.0 - 700.0 / np.e, abs=20.0 * tolerance * 700.0)
    assert 0.0 < heat.error <= 10.0 * tolerance
    area = 1.0 / (STEFAN_BOLTZMANN * 1500.0**3)  # it cools by T in a time of C/(σ X T³) = 1 s
    net = network(1, outside=1.0, area=area)
    found, _ = advance(net, [1500.0], 10.0, way=way, tolerance=tolerance)
    exact = 1500.0 * 31.0 ** (-1.0 / 3.0)
    assert found[0, 0] == pytest.approx(exact, abs=20.0 * tolerance * 1500.0)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 12), st.floats(1e-4, 1e3), st.integers(0, 2**32 - 1), st.sampled_from(WAYS))
def test_no_temperature_leaves_the_range_of_all(count, dt, seed, way):
    if way[0] == "explicit":
        dt = min(dt, 30.0)  # it takes a sub-step per time constant
    rng = np.random.default_rng(seed)
    links = [(k, k + 1) for k in range(count - 1)] + [
        tuple(sorted(rng.choice(count, 2, replace=False))) for _ in range(count)
    ]
    start = rng.uniform(100.0, 900.0, count)
    found, _ = advance(network(count, links), start, dt, steps=3, way=way)
    slack = 1e-4 * np.ptp(start)  # the tolerance; the explicit schemes need none
    slack = 1e-9 if way[0] == "explicit" else slack
    assert start.min() - slack <= found.min()
    assert found.max() <= start.max() + slack
    assert found.sum(axis=1) == pytest.approx(np.full(3, start.sum()), rel=1e-13)


@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("radiates", [False, True])
@pytest.mark.parametrize("dt", [1e-4, 1.0, 1e6])
def test_what_a_wall_draws_ends_at_absolute_zero(way, radiates, dt):
    """5 W drawn from the first of two grains: ends where it would be below 0 K, with its name."""
    area = 1e-3 if radiates else 0.0
    net = network(2, [(0, 1)], flow=[0], outside=1.0 if radiates else None, area=area, between=area)
    start = 300.0 if dt >= 1.0 else 0.01
    with pytest.raises(CannotIntegrate, match="absolute zero") as caught:
        advance(net, [start, start], dt, flow=-5.0, steps=200, way=way)
    assert caught.value.node == 0


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_a_grain_that_is_fed_stays_above_absolute_zero_or_it_is_said(way):
    """5 W from a grain that a heated neighbor keeps warm: a long step must not end the run."""
    net, given = network(2, [(0, 1)], flow=[0]), {"flow": -5.0, "source": 2.6}
    found, _ = advance(net, [10.0, 10.0], 50.0, steps=4, way=way, **given)
    assert found.min() > 0.0
    rise = 0.1 * 50.0 * np.arange(1, 5)  # of the mean, from 10 K; the difference goes to 2.5 K
    assert found.mean(axis=1) == pytest.approx(10.0 + rise, rel=1e-12)
    assert found[-1, 1] - found[-1, 0] == pytest.approx(2.5, abs=1e-2)
    # Radiation at 10⁸⁰ K exceeds all numbers: sub-steps end, and the reason names the grain
    net = network(2, [(0, 1)], outside=300.0, area=1.0)
    with pytest.raises(CannotIntegrate, match="so fast") as caught, np.errstate(all="ignore"):
        advance(net, [300.0, 1e80], 1.0, way=way)
    assert caught.value.node == 1


def test_explicit_sub_steps_without_end_are_refused():
    """A second of C/ΣH, and thirty thousand years to go."""
    with pytest.raises(CannotIntegrate, match=r"2e\+12 explicit sub-steps"):
        advance(network(2, [(0, 1)]), [300.0, 400.0], 1e12, way=("explicit", True))

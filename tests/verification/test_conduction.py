"""Conduction through networks of touching grains against closed forms (theory §15.3), every integrator."""

import numpy as np
import pytest
from heat_parts import at_temperature, chain, exact_temperatures, heat_book, rows, touching_engine
from recorded import keep
from scene_parts import FLOOR

from multicor_cli.engine.heat import integration
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Ramp, Sine

ONE_STEP = 1e9
"""A tolerance with which every call of `advance` is one sub-step."""


def temperatures(engine):
    return engine.state.temperature(engine.model.thermal)


def run(engine, total, count):
    for k in range(count):
        engine.step(total / count, k * total / count)
    return temperatures(engine)


def pair(**settings):
    return touching_engine(chain(2), [100.0, 20.0], **settings)


@pytest.mark.parametrize(
    ("integrator", "euler", "order"),
    [("explicit", 1.0, 1), ("explicit", 0.0, 3), ("implicit", 0.0, 2)],
    ids=["Euler", "SSPRK", "TR-BDF2"],
)
def test_two_bodies_to_the_order_of_the_integrator(integrator, euler, order, monkeypatch, record_property):
    """ΔT decays with τ = C/(2H); after one τ the hot body is at 74.7152 (theory §15.3)."""
    monkeypatch.setattr(integration, "SHARPNESS", 1e-24)  # stages to rounding, although the tolerance lets every step pass
    monkeypatch.setattr(integration, "EULER", euler)
    errors = [
        abs(run(pair(integrator=integrator, tolerance=ONE_STEP), 0.5, n)[0] - (60.0 + 40.0 * np.exp(-1.0))) for n in (8, 16, 32, 64)
    ]
    assert 60.0 + 40.0 * np.exp(-1.0) == pytest.approx(74.7152, abs=5e-5)
    keep(record_property, steps=(8, 16, 32, 64), error=np.array(errors) / 80.0, order=order)
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(np.abs(np.log2(ratios) - order) < 0.12)
    assert errors[-1] < 40.0 / 64.0**order


def test_unequal_bodies_reach_the_common_temperature():
    """τ = C_1 C_2/((C_1 + C_2) H), T_∞ = 40 for capacities 1 and 3."""
    engine = touching_engine(chain(2), [100.0, 20.0], capacity=np.array([1.0, 3.0]), integrator="implicit", tolerance=1e-9)
    tau = 0.75
    assert run(engine, tau, 1)[0] == pytest.approx(40.0 + 60.0 * np.exp(-1.0), abs=1e-5)
    assert run(engine, 40.0 * tau, 1) == pytest.approx([40.0, 40.0], abs=1e-5)


NETWORKS = {
    "chain": (chain(10), [(k, k + 1) for k in range(9)]),
    "rows 2-3-4-5": (rows((2, 3, 4, 5)), None),
    "rows 5-4-5": (rows((5, 4, 5)), None),
}


def links_of(points, links):
    if links is not None:
        return links
    n = len(points)
    return [(i, j) for i in range(n) for j in range(i + 1, n) if np.hypot(*(points[i] - points[j])) < 2.0 + 1e-9]


@pytest.mark.parametrize("name", NETWORKS)
def test_networks_against_the_matrix_exponential(name):
    """Both integrators against exp(−Kt/C): 1e-6 of the spread."""
    points, links = NETWORKS[name]
    start = np.full(len(points), 20.0)
    start[0] = 100.0
    exact = exact_temperatures(links_of(points, links), np.ones(len(points)), start, 1.0)
    for integrator in ("explicit", "implicit"):
        found = run(touching_engine(points, start, integrator=integrator, tolerance=1e-9), 1.0, 1)
        assert found == pytest.approx(exact, abs=80e-6)


@pytest.mark.parametrize(
    ("counts", "bonds", "t", "expected"),
    [
        ((2, 3, 4, 5), 28, 1.0, (33.9873, 26.8225, 21.3015)),
        ((2, 3, 4, 5), 28, 5.0, (25.8272, 25.7458, 25.5860)),
        ((5, 4, 5), 27, 1.0, (40.9333, 20.6569, 20.4906)),
        ((5, 4, 5), 27, 5.0, (26.3703, 25.0806, 25.0716)),
    ],
)
def test_fourteen_discs(counts, bonds, t, expected):
    """T_1, T_5 and T_14 of the networks of theory §15.3."""
    points = rows(counts)
    assert len(links_of(points, None)) == bonds
    start = np.full(14, 20.0)
    start[0] = 100.0
    engine = touching_engine(points, start, integrator="implicit", tolerance=1e-8)
    assert run(engine, t, 1)[[0, 4, 13]] == pytest.approx(expected, abs=6e-5)
    assert run(engine, 500.0, 1) == pytest.approx(np.full(14, 25.7143), abs=1e-4)


def test_chain_on_a_wall_decays_at_the_slowest_rate():
    """4 sin²(π/(4n+2)) H/C for n grains between a wall and nothing: 0.0223383 for n = 10; H to the wall is that between grains."""
    # A wall has a* = a: twice that between grains, so its spot is 2^(1/3) wider. Glue on a grain instead: a first grain that stays.
    capacity = np.ones(11)
    capacity[0] = 1e12
    start = np.full(11, 1.0)
    start[0] = 0.0
    engine = touching_engine(chain(11), start, capacity=capacity, integrator="implicit", tolerance=1e-10)
    first = run(engine, 150.0, 1)[1:]
    second = run(engine, 20.0, 1)[1:]
    rate = -np.log(second / first) / 20.0
    assert rate == pytest.approx(np.full(10, 4.0 * np.sin(np.pi / 42.0) ** 2), rel=1e-4)
    assert 4.0 * np.sin(np.pi / 42.0) ** 2 == pytest.approx(0.0223383, abs=5e-8)


def test_semi_infinite_chain():
    """θ of the tenth grain after 50 C/H is 0.317311 (theory §15.3), node 0 held at 1."""
    capacity = np.ones(120)
    capacity[0] = 1e15
    start = np.zeros(120)
    start[0] = 1.0
    engine = touching_engine(chain(120), start, capacity=capacity, integrator="implicit", tolerance=1e-7)
    assert run(engine, 50.0, 1)[10] == pytest.approx(0.317311, abs=2e-6)


def floor_engine(condition, **settings):
    return touching_engine([[0.0, 1.0]], [300.0], shapes=FLOOR, walls=("floor",), conditions=[condition], **settings)


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_a_wall_of_known_temperature_has_the_radius_of_the_grain(integrator):
    """a* = a: H is 2^(1/3) of that between two such grains."""
    engine = floor_engine(at_temperature(400.0), integrator=integrator, tolerance=1e-8)
    rate = 2.0 ** (1.0 / 3.0)
    expected = 400.0 - 100.0 * np.exp(-0.7 * rate)
    assert run(engine, 0.7, 1)[0] == pytest.approx(expected, abs=1e-4)
    assert engine.state.wall_heat[0, 0] == pytest.approx(engine.state.heat[0], rel=1e-14)


def test_a_wall_whose_temperature_rises():
    """T_w = a t: T = a (t − τ (1 − exp(−t/τ))) above the start."""
    engine = floor_engine(WallHeat("temperature", Ramp(300.0, 400.0, 10.0)), integrator="implicit", tolerance=1e-8)
    tau = 2.0 ** (-1.0 / 3.0)
    t = 5.0
    assert run(engine, t, 10)[0] - 300.0 == pytest.approx(10.0 * (t - tau * (1.0 - np.exp(-t / tau))), rel=2e-6)


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_a_wall_of_known_flow_gives_exactly_that(integrator):
    positions = [[0.0, 1.0], [2.0, 1.0], [4.0, 1.0]]
    engine = touching_engine(
        positions, 300.0, shapes=FLOOR, walls=("floor",), conditions=[WallHeat("flow", Ramp(0.0, 6.0, 2.0))], integrator=integrator
    )
    run(engine, 2.0, 400)
    expected = 6.0
    assert engine.state.heat.sum() == pytest.approx(expected, rel=1e-9)
    assert engine.state.wall_heat[0, 0] == pytest.approx(expected, rel=1e-9)
    assert heat_book(engine.state, "undelivered") == 0.0


def test_a_flow_that_reaches_no_grain_is_reported():
    engine = touching_engine(
        [[0.0, 1.5]], 300.0, shapes=FLOOR, walls=("floor",), conditions=[WallHeat("flow", Ramp(2.0, 2.0, 1.0))]
    )
    run(engine, 3.0, 3)
    assert engine.state.heat.sum() == 0.0
    assert heat_book(engine.state, "undelivered") == pytest.approx(6.0)


def test_a_flow_that_reaches_no_grain_is_reported_whatever_its_period():
    """A sine of a period of a step, or of a part of one, is zero in the middle: ∫|sin| dt is 2/π of the time."""
    for period in (1.0, 0.1):
        conditions = [WallHeat("flow", Sine(0.0, 2.0, period))]
        engine = touching_engine([[0.0, 1.5]], 300.0, shapes=FLOOR, walls=("floor",), conditions=conditions)
        run(engine, 3.0, 3)
        assert heat_book(engine.state, "undelivered") == pytest.approx(3.0 * 2.0 * 2.0 / np.pi, rel=1e-2)


def test_an_insulated_wall_takes_and_gives_nothing():
    engine = floor_engine(WallHeat())
    run(engine, 10.0, 3)
    assert engine.state.heat[0] == 0.0

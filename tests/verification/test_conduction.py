"""Conduction through touching grains against closed forms (theory §15.3), every integrator."""

import itertools

import numpy as np
import pytest
from heat_parts import (
    advanced,
    at_temperature,
    chain,
    exact_temperatures,
    heat_book,
    on_floor,
    rows,
    touching_engine,
)
from recorded import keep

from multicor_cli.engine import PhysicsError
from multicor_cli.engine.heat import integration
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, Interpolated, Ramp, Sine

ONE_STEP = 1e9
"""A tolerance with which every call of `advance` is one sub-step."""


def pair(**settings):
    return touching_engine(chain(2), [100.0, 20.0], **settings)


@pytest.mark.parametrize(
    ("integrator", "euler", "order"),
    [("explicit", 1.0, 1), ("explicit", 0.0, 3), ("implicit", 0.0, 2)],
    ids=["Euler", "SSPRK", "TR-BDF2"],
)
def test_two_bodies_to_the_order_of_the_integrator(
    integrator, euler, order, monkeypatch, record_property
):
    """ΔT decays with τ = C/(2H); after one τ the hot body is at 74.7152 (theory §15.3)."""
    # Stages to rounding, although the tolerance lets every step pass
    monkeypatch.setattr(integration, "SHARPNESS", 1e-24)
    monkeypatch.setattr(integration, "EULER", euler)
    exact, steps = 60.0 + 40.0 * np.exp(-1.0), (8, 16, 32, 64)
    assert exact == pytest.approx(74.7152, abs=5e-5)
    engines = [pair(integrator=integrator, tolerance=ONE_STEP) for _ in steps]
    errors = np.abs([advanced(e, 0.5, n)[0] - exact for e, n in zip(engines, steps, strict=True)])
    keep(record_property, steps=steps, error=errors / 80.0, order=order)
    assert np.all(np.abs(np.log2(errors[:-1] / errors[1:]) - order) < 0.12)
    assert errors[-1] < 40.0 / 64.0**order


def test_unequal_bodies_reach_the_common_temperature():
    """τ = C_1 C_2/((C_1 + C_2) H), T_∞ = 40 for capacities 1 and 3."""
    engine = pair(capacity=np.array([1.0, 3.0]), integrator="implicit", tolerance=1e-9)
    tau = 0.75
    assert advanced(engine, tau)[0] == pytest.approx(40.0 + 60.0 * np.exp(-1.0), abs=1e-5)
    assert advanced(engine, 40.0 * tau) == pytest.approx([40.0, 40.0], abs=1e-5)


def links_of(points):
    pairs = itertools.combinations(range(len(points)), 2)
    return [(i, j) for i, j in pairs if np.hypot(*(points[i] - points[j])) < 2.0 + 1e-9]


def hot_first(count, hot=100.0, cold=20.0):
    start = np.full(count, cold)
    start[0] = hot
    return start


@pytest.mark.parametrize(
    "points", [chain(10), rows((2, 3, 4, 5)), rows((5, 4, 5))], ids=["chain", "2-3-4-5", "5-4-5"]
)
def test_networks_against_the_matrix_exponential(points):
    """Both integrators against exp(−Kt/C): 1e-6 of the spread."""
    start = hot_first(len(points))
    exact = exact_temperatures(links_of(points), np.ones(len(points)), start, 1.0)
    for integrator in ("explicit", "implicit"):
        found = advanced(touching_engine(points, start, integrator=integrator, tolerance=1e-9), 1.0)
        assert found == pytest.approx(exact, abs=80e-6)


@pytest.mark.parametrize(("counts", "bonds", "expected"), [
    ((2, 3, 4, 5), 28, {1.0: (33.9873, 26.8225, 21.3015), 5.0: (25.8272, 25.7458, 25.5860)}),
    ((5, 4, 5), 27, {1.0: (40.9333, 20.6569, 20.4906), 5.0: (26.3703, 25.0806, 25.0716)}),
])  # fmt: skip
def test_fourteen_discs(counts, bonds, expected):
    """T_1, T_5 and T_14 of the networks of theory §15.3, after 1 and 5 C/H, and in the end."""
    points = rows(counts)
    assert len(links_of(points)) == bonds
    for t, watched in expected.items():
        engine = touching_engine(points, hot_first(14), integrator="implicit", tolerance=1e-8)
        assert advanced(engine, t)[[0, 4, 13]] == pytest.approx(watched, abs=6e-5)
    assert advanced(engine, 500.0) == pytest.approx(np.full(14, 25.7143), abs=1e-4)


def held_chain(count, hot, cold, tolerance):
    """Grains in a row, of which the first keeps its temperature."""
    return touching_engine(
        chain(count), hot_first(count, hot, cold), capacity=hot_first(count, 1e15, 1.0),
        integrator="implicit", tolerance=tolerance,
    )  # fmt: skip


def test_chains_decay_at_their_slowest_rate_and_conduct_as_a_half_space():
    """4 sin²(π/(4n+2)) H/C, n grains from a wall to nothing: 0.0223383 for 10; H is the same."""
    # A wall has a* = a, so its spot is 2^(1/3) wider. Glue on a grain instead: a first that stays.
    engine = held_chain(11, hot=0.0, cold=1.0, tolerance=1e-10)
    first, second = (advanced(engine, t)[1:] for t in (150.0, 20.0))
    rate = -np.log(second / first) / 20.0
    assert rate == pytest.approx(np.full(10, 4.0 * np.sin(np.pi / 42.0) ** 2), rel=1e-4)
    assert 4.0 * np.sin(np.pi / 42.0) ** 2 == pytest.approx(0.0223383, abs=5e-8)
    # θ of the tenth grain after 50 C/H is 0.317311 (theory §15.3), node 0 held at 1
    engine = held_chain(120, hot=1.0, cold=0.0, tolerance=1e-7)
    assert advanced(engine, 50.0)[10] == pytest.approx(0.317311, abs=2e-6)


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_walls_of_known_temperature_or_flow_and_no_grain_below_absolute_zero(integrator):
    """a* = a: H is 2^(1/3) of that between two such grains."""
    engine = on_floor(at_temperature(400.0), integrator=integrator, tolerance=1e-8)
    expected = 400.0 - 100.0 * np.exp(-0.7 * 2.0 ** (1.0 / 3.0))
    assert advanced(engine, 0.7)[0] == pytest.approx(expected, abs=1e-4)
    assert engine.state.wall_heat[0, 0] == pytest.approx(engine.state.heat[0], rel=1e-14)
    flow = WallHeat("flow", Ramp(0.0, 6.0, 2.0))
    engine = on_floor(flow, positions=chain(3), integrator=integrator)
    advanced(engine, 2.0, 400)
    assert engine.state.heat.sum() == pytest.approx(6.0, rel=1e-9)
    assert engine.state.wall_heat[0, 0] == pytest.approx(6.0, rel=1e-9)
    assert heat_book(engine.state, "undelivered") == 0.0
    # A wall that draws more heat than there is ends the run
    with pytest.raises(PhysicsError, match="absolute zero"):
        on_floor(WallHeat("flow", Constant(-10.0)), integrator=integrator).step(100.0, 0.0)


def test_a_wall_whose_temperature_rises():
    """T_w = a t: T = a (t − τ (1 − exp(−t/τ))) above the start."""
    rising = WallHeat("temperature", Ramp(300.0, 400.0, 10.0))
    engine = on_floor(rising, integrator="implicit", tolerance=1e-8)
    t, tau = 5.0, 2.0 ** (-1.0 / 3.0)
    exact = 10.0 * (t - tau * (1.0 - np.exp(-t / tau)))
    assert advanced(engine, t, 10)[0] - 300.0 == pytest.approx(exact, rel=2e-6)


@pytest.mark.parametrize(("flow", "lost", "error"), [
    (Ramp(2.0, 2.0, 1.0), 2.0, 1e-6), (Sine(0.0, 2.0, 1.0), 4.0 / np.pi, 1e-2),
    (Sine(0.0, 2.0, 0.1), 4.0 / np.pi, 1e-2),
])  # fmt: skip
def test_a_flow_that_reaches_no_grain_is_reported_whatever_its_period(flow, lost, error):
    """A sine with a step's period, or less, is zero in the middle: ∫|sin| dt is 2/π of the time."""
    engine = on_floor(WallHeat("flow", flow), positions=[[0.0, 1.5]])
    advanced(engine, 3.0, 3)
    assert engine.state.heat.sum() == 0.0
    assert heat_book(engine.state, "undelivered") == pytest.approx(3.0 * lost, rel=error)


def test_an_insulated_wall_takes_and_gives_nothing():
    engine = on_floor(WallHeat())
    advanced(engine, 10.0, 3)
    assert engine.state.heat[0] == 0.0


@pytest.mark.parametrize(
    ("kind", "base", "factor"), [("flow", 0.0, 1.0), ("temperature", 300.0, 2.0 ** (1.0 / 3.0))]
)
def test_a_pulse_between_two_steps_is_felt(kind, base, factor):
    """60 J in 7 s of a step of 60 s: all of a flow arrives; of a temperature, H ∫(T_w − T) dt."""
    values = tuple(base + value for value in (0.0, 0.0, 10.0, 10.0, 0.0, 0.0))
    pulse = Interpolated((0.0, 20.0, 21.0, 26.0, 27.0, 1e4), values)
    engine = on_floor(WallHeat(kind, pulse), capacity=1e6, integrator="implicit")
    engine.step(60.0, 0.0)
    assert engine.state.heat[0] == pytest.approx(60.0 * factor, rel=1e-2)


def test_sub_steps_of_a_grain_that_is_alone():
    """Without differences of temperature the error is measured by the sub-step's change too."""
    engine = on_floor(WallHeat("flow", Sine(1.0, 5.0, 60.0)), integrator="implicit")
    engine.step(60.0, 0.0)
    assert engine.state.heat[0] == pytest.approx(60.0, abs=1.0)
    assert heat_book(engine.state, "sub_steps") < 500


@pytest.mark.parametrize("start", [300.0, [300.0, 301.0, 302.0]])
def test_nothing_depends_on_memory_that_nobody_wrote(start, monkeypatch):
    """Where stages need no iteration: steady states, and short steps to a loose tolerance."""

    def heat(fill):
        fake = type("Numpy", (), {"__getattr__": lambda _, name: getattr(np, name)})()
        fake.empty = lambda *shape: np.full(*shape, fill)
        monkeypatch.setattr(integration, "np", fake)
        engine = touching_engine(chain(3), start, integrator="implicit", tolerance=1e-2)
        engine.step(5e-6, 0.0)
        return engine.state.heat.tolist(), engine.state.heat_dt

    assert heat(np.nan) == heat(0.0)

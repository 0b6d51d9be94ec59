"""Flash temperatures of sliding contacts, by hand."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from layers import PLANE, STEEL, sliding
from layers import SPHERE as A
from scenarios import plane, rows_of, scenario

from multicor_cli.model import ShapeKind
from multicor_cli.post import PostError, Selection, hot_spots
from multicor_cli.post.heat import SPOT_QUANTITIES
from multicor_cli.post.spots import hertz_radius

ALL = Selection(start=0.0)
MODULUS = 1.05361e11


def conductance(radius, slip):
    """P/ΔT of one body: ½ π^(3/2) a λ √(4/π + Pe), Pe = (u/2) a ρc/2λ."""
    peclet = 0.5 * slip * radius * 7500.0 * 500.0 / (2.0 * 15.0)
    return 0.5 * pi**1.5 * radius * 15.0 * sqrt(4.0 / pi + peclet)


def test_a_contact_of_known_flash():
    """1 N, friction 0.5, 0.1 m/s: a spot of 17.48 µm is 29.13 K hotter, 30.35 K were it slow."""
    table = hot_spots(sliding([[(0, 1, 1.0, 0.5, -0.1)]]), ALL)
    assert table.mean["radius"] == pytest.approx(1.74776e-5, rel=1e-5)
    assert table.mean["rise_mean"] == pytest.approx(29.13, abs=0.005)
    assert table.mean["spot_max"] == pytest.approx(305.0 + table.mean["rise_max"])
    assert table.mean["peclet_max"] == pytest.approx(0.109235, rel=1e-5)
    slow = hot_spots(sliding([[(0, 1, 1.0, 0.5e5, -0.1e-5)]]), ALL)
    assert slow.mean["rise_mean"] == pytest.approx(30.35, abs=0.005)
    assert [*table.mean] == [q.name for q in SPOT_QUANTITIES if q.name != "above"]


def test_walls_take_heat_if_they_have_a_temperature():
    """On a plane a* = a; alone the sphere gets twice as hot."""
    radius = (0.75 * 2.0 * A / MODULUS) ** (1.0 / 3.0)
    body = conductance(radius, 0.3)
    contact = [[(0, 3, 2.0, -1.0, 0.3)]]
    alone = hot_spots(sliding(contact), ALL)
    assert alone.mean["radius"] == pytest.approx(radius, rel=1e-5)
    assert alone.mean["rise_max"] == pytest.approx(0.3 / body, rel=1e-5)
    assert alone.mean["spot_max"] == pytest.approx(300.0 + 0.3 / body, rel=1e-6)
    both = hot_spots(sliding(contact, floor=350.0), ALL)
    assert both.mean["rise_max"] == pytest.approx(0.15 / body, rel=1e-5)
    assert both.mean["spot_max"] == pytest.approx(325.0 + 0.15 / body, rel=1e-6)


def test_only_what_slides_under_load_counts():
    rows = [
        (0, 1, 1.0, 0.5, 0.1),
        (1, 2, 4.0, 0.3, 0.0),
        (0, 3, -1.0, 0.1, 0.2),
        (2, 3, 1.0, 0.5, 0.1),
    ]
    table = hot_spots(sliding([rows, rows[1:2]]), ALL, 330.0)
    assert table.contacts == 2
    np.testing.assert_allclose(table.values["sliding"], [0.5, 0.0])
    assert np.isnan(table.values["rise_mean"]).tolist() == [False, True]
    assert table.values["above"][0] == 1.0  # 334 K and 320 K + some 50 K
    assert hot_spots(sliding([rows]), ALL, 340.0).mean["above"] == 0.5


def test_quantiles_and_densities():
    random = np.random.default_rng(1)
    slip = random.exponential(0.01, 500) + 1e-6
    rows = [(0, 1, 1.0, 0.5, u) for u in slip]
    table = hot_spots(sliding([rows[:250], rows[250:]]), ALL)
    radius = (0.75 * 0.5 * A / MODULUS) ** (1.0 / 3.0)
    rise = np.array([0.5 * u / (2.0 * conductance(radius, u)) for u in slip])
    assert table.values["rise_95"][0] == pytest.approx(np.quantile(rise[:250], 0.95), rel=1e-5)
    assert table.values["rise_50"][1] == pytest.approx(np.median(rise[250:]), rel=1e-5)
    inside = rise >= table.rise_edges[0] * (1.0 + 1e-4)
    total = (table.rise_density * np.diff(table.rise_edges)).sum()
    assert total == pytest.approx(inside.mean(), abs=2e-3)
    assert (table.spot_density * np.diff(table.spot_edges)).sum() == pytest.approx(1.0)
    assert table.rise_edges[-1] == pytest.approx(rise.max(), rel=1e-5)


def test_effective_radii():
    for shape, expected in (
        ((ShapeKind.DISC, 0, (0.0, 0.0, 3e-3, 0.0)), 1e-3),
        ((ShapeKind.CIRCLE, 0, (0.0, 0.0, 6e-3, 0.0)), 2e-3),
        ((ShapeKind.CIRCLE, 0, (0.0, 0.0, 1.5001e-3, 0.0)), 100.0 * A),
        (PLANE, A),
    ):
        model = sliding([[]], shape=shape).model
        found = hertz_radius(model, np.array([0, 0]), np.array([3, 1]))
        assert found == pytest.approx([expected, 0.5 * A])


def test_the_lowest_ignition_or_melting_is_the_limit():
    known = f"{STEEL}melting = 1700.0\nignition = 320.0\n"
    source = sliding([[(0, 1, 1.0, 0.5, 0.1)]], scenario=known)
    table = hot_spots(source, ALL)
    assert (table.limit, table.mean["above"]) == (320.0, 1.0)
    assert hot_spots(source, ALL, 400.0).mean["above"] == 0.0


def test_the_engine_and_the_frames_see_the_same_spot(run):
    """A disc slides on a floor with a temperature: in a step, what the time series calls the
    hottest. It sees the slip half-way in the step, the frame that after it."""
    made = run(scenario(
        grains=[[0.02, 1e-3, 1e-3, 1.0, 0.0]], friction=0.3, dt=1e-4, duration=2e-3,
        frame_interval=1e-4, series_interval=1e-4, heat={"temperature": 300.0},
        walls={"floor": {"geometry": plane(), "thermal": {"temperature": 320.0}}},
    ))  # fmt: skip
    table = hot_spots(made, Selection(start=5e-4))
    series = np.asarray(made.series["hottest_spot"])
    rows = np.searchsorted(np.asarray(made.series["time"]), table.time - 1e-9)
    assert table.values["rise_max"].min() > 1.0
    np.testing.assert_allclose(table.values["spot_max"], series[rows], rtol=1e-4)


@pytest.mark.parametrize("grain", ["glass", "steel"])
def test_a_spot_between_unlike_bodies_is_as_hot_as_both(grain, run):
    """Glass (λ = 1) and steel (15) that slide slowly, at 300 and 400 K: the spot is nearly as warm
    as the steel, (λ_i T_i + λ_j T_j)/(λ_i + λ_j), for the frames and for the engine.
    """
    materials = {
        "glass": {"density": 2500.0, "young": 70e9, "poisson": 0.22, "conductivity": 1.0,
                  "heat_capacity": 800.0},
        "steel": {"density": 7800.0, "young": 193e9, "poisson": 0.29, "conductivity": 15.0,
                  "heat_capacity": 500.0},
    }  # fmt: skip
    floor = {"glass": "steel", "steel": "glass"}[grain]
    made = run(scenario(
        particles=[rows_of([[0.05, 1e-3, 1e-3, 1e-3, 0.0]]) | {"material": grain}],
        materials=materials, friction=0.01, dt=1e-4, duration=2e-4, frame_interval=1e-4,
        heat={"temperature": 300.0},
        walls={"floor": {"geometry": plane(), "material": floor,
                         "thermal": {"temperature": 400.0}}},
    ))  # fmt: skip
    conductivity = {"glass": 1.0, "steel": 15.0}
    expected = (300.0 * conductivity[grain] + 400.0 * conductivity[floor]) / 16.0
    assert made.series["hottest_spot"][-1] == pytest.approx(expected, abs=2e-3)
    table = hot_spots(made, Selection(frames=slice(-1, None)))
    assert table.mean["spot_max"] == pytest.approx(expected, abs=2e-3)


def test_wrong_runs_are_refused():
    rows = [(0, 1, 1.0, 0.5, 0.1)]
    with pytest.raises(PostError, match="no contact slides in these frames"):
        hot_spots(sliding([[(0, 1, 1.0, 0.5, 0.0)]]), ALL)
    with pytest.raises(PostError, match="slides in these frames does so without friction"):
        hot_spots(sliding([[(0, 1, 1.0, 0.0, 0.1)]]), ALL)
    with pytest.raises(PostError, match="the limit is no number"):
        hot_spots(sliding([rows]), ALL, np.nan)
    without = STEEL.replace("young = 193e9\npoisson = 0.29\n", "")
    with pytest.raises(PostError, match=r"spots need young, .* of the material 'steel'"):
        hot_spots(sliding([rows], scenario=without), ALL)
    with pytest.raises(PostError, match="there are no contact forces in frame 0"):
        hot_spots(sliding([rows], dt=0.0), ALL)
    cold = sliding([rows])
    cold.model = replace(cold.model, thermal=None)
    with pytest.raises(PostError, match="the run has no heat"):
        hot_spots(cold, ALL)

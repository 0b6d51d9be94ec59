"""Hot spots of corners and sides: closed forms, and what the engine finds."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from made_up_frames import source_of
from scenarios import plane, rows_of, scenario
from scene_parts import FLOOR
from shaped_frames import box, disc, points_of, regular, rod, shaped_frame, shaped_model
from shaped_run import measures

from multicor_cli import post
from multicor_cli.model import Thermal

ALL = post.Selection(start=0.0)
THICKNESS, SLIP, FRICTION = 0.02, 0.1, 0.5
CONDUCTIVITY, VOLUMETRIC, MODULUS = 15.0, 7500.0 * 500.0, 2e11 / (1.0 - 0.09)
STEEL = """
[materials.stuff]
density = 7500.0
young = 2e11
poisson = 0.3
conductivity = 15.0
heat_capacity = 500.0
"""


def sliding(grains, rows, *, angle=0.0, walls=FLOOR, rest=()):
    """Grains on a floor without temperature that slide at points: i, j, arm of i, normal, force.

    Those in the rows of ``rest`` stick.
    """
    model = shaped_model(grains, walls)
    around = sum(measures(*grains[0][0])[1:])
    thermal = Thermal(*np.full((2, len(grains)), 300.0), np.full(len(grains), around * THICKNESS))
    outlines = model.outlines._replace(perimeter=np.full(len(grains), around))
    model = replace(model, outlines=outlines, thermal=thermal, materials=("stuff",))
    i, j, arm, normal, force = zip(*rows, strict=True)
    force = np.array(force)
    made = points_of(
        i, j, normal, np.column_stack([force, FRICTION * force]), arm, sliding=np.ones(len(rows))
    )
    made.slip = np.full(len(rows), SLIP)
    made.sliding[list(rest)] = False
    frame = shaped_frame(
        np.zeros((len(grains), 2)), angle, walls=len(model.walls.names), contacts=made,
        temperature=np.full(len(grains), 300.0),
        wall_temperature=np.full(len(model.walls.names), np.nan),
    )  # fmt: skip
    return source_of(model, [frame], scenario_resolved=STEEL)


def rise(radius, force, bodies=1):
    """Of a spot that only the grain cools, or two alike."""
    peclet = 0.5 * SLIP * radius * VOLUMETRIC / (2.0 * CONDUCTIVITY)
    into = 0.5 * pi**1.5 * radius * CONDUCTIVITY * sqrt(4.0 / pi + peclet)
    return FRICTION * force * SLIP / (bodies * into)


def hertz(radius, force):
    return (0.75 * force * radius * 2.0 / MODULUS) ** (1.0 / 3.0)


DOWN = (0.0, 1.0)
"""Normal of the floor."""


def test_a_rounded_corner_is_a_sphere_of_its_rounding():
    """A box that stands on a corner, turned by 45°."""
    arm = (0.0, -sqrt(0.5) - 0.2)
    table = post.hot_spots(
        sliding([[box(1.0, 1.0, 0.2)]], [(0, 1, arm, DOWN, 3.0)], angle=pi / 4.0), ALL
    )
    spot = hertz(0.2, 3.0)
    assert table.mean["radius"] == pytest.approx(spot)
    assert table.mean["rise_max"] == pytest.approx(rise(spot, 3.0))
    assert (table.contacts, table.sharp) == (1, 0)


@pytest.mark.parametrize("walls", [FLOOR, ()])
def test_caps_of_rods_on_each_other(walls):
    """Beside a floor, and where no shape of a wall is."""
    ends = [(0, 1, (0.7, 0.0), (-1.0, 0.0), 2.0)]
    table = post.hot_spots(sliding([[rod(1.0, 0.2)]] * 2, ends, walls=walls), ALL)
    assert table.mean["radius"] == pytest.approx(hertz(0.1, 2.0))
    assert table.mean["rise_max"] == pytest.approx(rise(hertz(0.1, 2.0), 2.0, 2))


def test_a_cap_of_a_rod_on_the_side_of_another():
    # the upper one stands on the other, which lies
    source = sliding(
        [[rod(1.0, 0.2)]] * 2, [(0, 1, (0.0, -0.7), DOWN, 2.0)], angle=np.array([pi / 2.0, 0.0])
    )
    source.frames[0].position[0, 1] = 0.9
    assert post.hot_spots(source, ALL).mean["radius"] == pytest.approx(hertz(0.2, 2.0))


@pytest.mark.parametrize(
    ("left", "right", "length"), [(3.0, 3.0, 1.0), (5.0, 1.0, 0.5), (1.0, 9.0, 0.3)]
)
def test_a_side_has_a_spot_of_the_area_on_which_it_is_pressed(left, right, length):
    """All of it while the force is within the middle third, else three times the nearer part."""
    rows = [(0, 1, (-0.5, -0.25), DOWN, left), (0, 1, (0.5, -0.25), DOWN, right)]
    table = post.hot_spots(sliding([[box(1.0, 0.5)]], rows), ALL)
    spot = sqrt(length * THICKNESS / pi)
    assert table.contacts == 1
    assert table.mean["radius"] == pytest.approx(spot)
    assert table.mean["rise_max"] == pytest.approx(rise(spot, left + right))


@pytest.mark.parametrize("turn", [0.0, pi / 48.0])
def test_many_sides_are_a_curve(turn):
    """On a corner, and on a side with two points: the circle around them."""
    grain = [[regular(48)]]
    rows = [(0, 1, (0.0, -1.0), DOWN, 4.0)]
    if turn:
        x, y = np.sin(turn), -np.cos(turn)
        rows = [(0, 1, (-x, y), DOWN, 3.0), (0, 1, (x, y), DOWN, 1.0)]
    table = post.hot_spots(sliding(grain, rows, angle=turn), ALL)
    assert table.contacts == 1
    assert table.mean["radius"] == pytest.approx(hertz(1.0, 4.0), rel=1e-6)


def test_frames_without_contacts_have_no_spots():
    arm = (0.0, -sqrt(0.5) - 0.2)
    source = sliding([[box(1.0, 1.0, 0.2)]], [(0, 1, arm, DOWN, 1.0)], angle=pi / 4.0)
    source.frames.append(shaped_frame(
        np.zeros((1, 2)), walls=1, contacts=points_of([], [], np.zeros((0, 2)), np.zeros((0, 2)),
        np.zeros((0, 2))), temperature=np.full(1, 300.0), wall_temperature=np.array([np.nan]),
    ))  # fmt: skip
    source.frames.time = np.arange(2.0)
    source.frames.stage = np.zeros(2, np.int32)
    table = post.hot_spots(source, ALL)
    assert np.isnan(table.values["rise_max"]).tolist() == [False, True]
    assert table.mean["radius"] == pytest.approx(hertz(0.2, 1.0))


def test_discs_among_them_are_spheres():
    grains = [[box(1.0, 0.5)], [disc(0.3)]]
    source = sliding(grains, [(0, 1, (0.0, 0.25), (0.0, -1.0), 2.0)])
    source.frames[0].position[1, 1] = 0.55
    assert post.hot_spots(source, ALL).mean["radius"] == pytest.approx(hertz(0.3, 2.0))


def test_sharp_corners_have_none_and_are_counted():
    """A box stands on one; the other grain, which is rounded, slides as well; a third sticks."""
    on_corner = (0, 3, (0.0, -sqrt(0.5)), DOWN, 3.0)
    arm = (0.0, -sqrt(0.5) - 0.2)
    grains = [[box(1.0, 1.0)], [box(1.0, 1.0, 0.2)], [box(1.0, 1.0)]]
    rows = [on_corner, (1, 3, arm, DOWN, 1.0), (2, *on_corner[1:])]
    table = post.hot_spots(sliding(grains, rows, angle=pi / 4.0, rest=[2]), ALL)
    assert (table.contacts, table.sharp) == (1, 1)
    assert table.mean["sliding"] == pytest.approx(2.0 / 3.0)
    assert table.mean["radius"] == pytest.approx(hertz(0.2, 1.0))
    with pytest.raises(post.PostError, match=r"on sharp corners \(1\).*give the shapes a rounding"):
        post.hot_spots(sliding(grains[:1], [(0, 1, *on_corner[2:])], angle=pi / 4.0), ALL)


@pytest.mark.parametrize("rounding", [0.0, 0.2])
def test_the_engine_and_the_frames_see_the_same_spot(run, rounding):
    """A square slides fast on its side under a great weight, so that its spot is hot: as hot as the
    time series says, which sees slips half-way."""
    corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    reach = 1e-3
    half = reach * (1.0 - rounding) / sqrt(2.0) + rounding * reach
    made = run(scenario(
        grains={**rows_of([[0.02, half, reach, 50.0, 0.0]]),
                "shape": {"kind": "polygon", "vertices": corners, "rounding": rounding}},
        friction=0.3, gravity=[0.0, -1e4], dt=1e-6, duration=2e-5, frame_interval=1e-6,
        series_interval=1e-6, heat={"temperature": 300.0},
        walls={"floor": {"geometry": plane(), "thermal": {"temperature": 320.0}}},
    ))  # fmt: skip
    table = post.hot_spots(made, post.Selection(start=5e-6))
    series = np.asarray(made.series["hottest_spot"])
    rows = np.searchsorted(np.asarray(made.series["time"]), table.time - 1e-8)
    assert table.values["rise_max"].min() > 1.0
    np.testing.assert_allclose(table.values["spot_max"], series[rows], rtol=1e-6)

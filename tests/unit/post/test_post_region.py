"""What is in a region: closed forms for discs cut by a line, and sums that agree with profiles and
with whole domains."""

import numpy as np
import pytest
from cut_runs import BOX

import multicor_cli as multicor
from multicor_cli.model.shapes import Annulus, Polygon, Rectangle
from multicor_cli.post import PostError, Selection, in_region, profile
from multicor_cli.post.bins import find_extent
from multicor_cli.post.region import part_inside
from multicor_cli.post.sums import plane_width
from multicor_cli.scenario import parse_scenario
from multicor_cli.store import open_run

ALL = Selection(start=0.0)


@pytest.fixture(scope="module", params=["period", "walls"])
def run(request, tmp_path_factory):
    if request.param == "period":
        return open_run(request.getfixturevalue("finished"))
    path = tmp_path_factory.mktemp("run") / "run"
    return open_run(multicor.run(parse_scenario(BOX, "run.toml"), path).directory)


def test_parts_of_discs_are_those_of_sampled_points():
    line = np.linspace(-1.0, 1.0, 2001)
    points = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    points = points[(points**2).sum(axis=1) <= 1.0]
    for depth in (-2.0, -0.7, 0.0, 0.3, 0.9, 1.5):
        found = part_inside(np.array([2.0 * depth]), np.array([2.0]))[0]
        assert found == pytest.approx(np.mean(points[:, 0] >= -depth), abs=1e-3)


def around(run):
    """A rectangle around all grains, or as wide as the period."""
    low = min(float(frame.position.min()) for frame in run.frames) - 0.01
    high = max(float(frame.position.max()) for frame in run.frames) + 0.01
    ends = (0.0, run.model.period) if run.model.period else (low, high)
    return Rectangle((ends[0], low), (ends[1], high))


def test_everything_is_all_grains(run):
    area = around(run)
    table, grains = in_region(run, area, ALL), run.model.grains
    cover = np.pi * grains.radius**2
    assert table.grains.tolist() == [len(frame.position) for frame in run.frames]
    assert table.values["solid_fraction"] == pytest.approx(cover.sum() / area.size, rel=1e-12)
    speeds = np.array([cover @ frame.velocity[:, 0] / cover.sum() for frame in run.frames])
    assert table.values["velocity_x"] == pytest.approx(speeds, rel=1e-9)


def test_a_layer_is_a_bin_of_a_profile(run):
    """Also of grains that lie across the ends of a period; those at its corners are a product of
    two parts, whose errors are of either sign."""
    names, pairs = ("solid-fraction", "stress-yy", "stress-xy"), []
    for k in range(len(run.frames) - 8, len(run.frames)):
        one = Selection(frames=slice(k, k + 1))
        found = {of: profile(run, of, one, bins=3) for of in names}
        frame, extent = run.frames[k], find_extent(run, one.indices(run.frames))
        height = found["stress-yy"].y[1] - found["stress-yy"].y[0]
        low = extent.origin(frame) + found["stress-yy"].y[1] - 0.5 * height
        area = Rectangle((around(run).low[0], low), (around(run).high[0], low + height))
        table = in_region(run, area, one)
        scale = (area.high[0] - area.low[0]) / plane_width(run, frame)
        pairs.append(
            [(table.mean[of.replace("-", "_")] * scale, found[of].value[1]) for of in names]
        )
    mine, of_profile = np.mean(pairs, axis=0).T
    assert mine == pytest.approx(of_profile, rel=2e-3)


def test_parts_add_up_to_the_whole(run):
    """Layers that fill a rectangle; where nothing is periodic also its triangles and rings, but for
    corners and curvature."""
    area = around(run)
    (x, y), (u, v) = area.low, area.high
    middle = float(run.frames[0].position[:, 1].mean())
    parts = [[Rectangle((x, y), (u, middle)), Rectangle((x, middle), (u, v))]]
    if not run.model.period:
        corners = ([(x, y), (u, y), (u, v)], [(x, y), (u, v), (x, v)])
        parts.append([Polygon(np.array(three)) for three in corners])
    whole = in_region(run, area, ALL)
    for pieces in parts:
        tables = [in_region(run, piece, ALL) for piece in pieces]
        for name in ("solid_fraction", "stress_xx", "stress_yy", "stress_xy"):
            together = sum(table.area * table.values[name] for table in tables) / whole.area
            assert together == pytest.approx(whole.values[name], rel=1e-9, abs=1e-9, nan_ok=True)


def test_rings_add_up_to_a_disc_but_for_their_curvature(run):
    area = around(run)
    center = tuple(0.5 * (np.array(area.low) + np.array(area.high)))
    radius = 0.3 * (run.model.period or area.high[0] - area.low[0])
    ring, core, disc = (
        in_region(run, Annulus(center, *radii), ALL)
        for radii in ((radius, 0.5 * radius), (0.5 * radius,), (radius,))
    )
    together = 0.75 * ring.values["solid_fraction"] + 0.25 * core.values["solid_fraction"]
    assert together == pytest.approx(disc.values["solid_fraction"], rel=1e-9)


def test_where_nothing_is_it_says_so(run):
    with pytest.raises(PostError, match="no grain is in the region"):
        in_region(run, Annulus((0.0, 1e3), 0.005), ALL)


@pytest.mark.parametrize("area", [
    Annulus((0.01, 0.01), 0.001, 0.002), Rectangle((0.0, 0.0), (np.nan, 1.0)),
    Rectangle((0.0, 0.0), (0.0, 1.0)), Rectangle((1.0, 0.0), (0.0, 1.0)),
    Polygon(np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0]])),
])  # fmt: skip
def test_a_region_has_an_area(area, run):
    with pytest.raises(PostError, match="swapped"):
        in_region(run, area, ALL)
    with pytest.raises(TypeError, match="is dict"):
        in_region(run, {"min": [0.0, 0.0], "max": [1.0, 1.0]}, ALL)


def test_what_is_wider_than_the_period_is_a_rectangle(run):
    wide = Annulus((0.0, 0.005), 0.02)
    if run.model.period:
        with pytest.raises(PostError, match=r"0.04 m wide, and the period 0.02 m"):
            in_region(run, wide, ALL)
    else:
        assert in_region(run, wide, ALL).area == pytest.approx(np.pi * 0.02**2)

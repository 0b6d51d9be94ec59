"""Figures of rheology, energy, force statistics, comparisons and streamlines: what is drawn. How
they look is for eyes."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import figure_of, map_of, panel_of
from layers import sliding
from made_up_frames import source_of
from shaped_frames import points_of, regular, shaped_frame, shaped_model
from shaped_run import box

from multicor_cli import plots, post
from multicor_cli.model.outlines import Outlines
from multicor_cli.plots.fields import _draw_mesh
from multicor_cli.plots.forces import draw_angles, draw_distribution
from multicor_cli.plots.heat import draw_hot_spots
from multicor_cli.plots.over_time import FIGURES, LOOKS, draw_energy
from multicor_cli.plots.profile import draw_comparison
from multicor_cli.plots.vectors import round_below, smooth_field
from multicor_cli.post.energy import HEAT, MECHANICAL
from multicor_cli.post.grain_map import GrainScene
from multicor_cli.post.lattice import Lattice
from multicor_cli.post.rings import rings_of
from multicor_cli.store import open_run

ALL = post.Selection(start=0.0)


def test_rheology_has_a_panel_for_each_quantity_with_its_mean(column):
    table = post.rheology(column, ALL)
    figure = figure_of(FIGURES[type(table)].draw, table)
    panels = figure.axes
    assert len(panels) == 8
    assert figure.legends[0].get_texts()[0].get_text() == "mean"
    assert all("[" in panel.get_ylabel() for panel in panels)
    solid = next(panel for panel in panels if "solid" in panel.get_ylabel())
    assert solid.lines[0].get_ydata() == pytest.approx(table.values["solid_fraction"])
    assert solid.lines[1].get_ydata()[0] == pytest.approx(table.mean["solid_fraction"])
    assert "time" in panels[-1].get_xlabel()


def test_fabric_of_shapes_has_more_panels(column, shaped):
    with open_run(shaped) as run:
        table = post.fabric(run, ALL)
    renderer = FIGURES[type(table)]
    panels = [axes.get_ylabel() for axes in figure_of(renderer.draw, table).axes]
    assert panels[8:] == [
        "share of contacts [–]", "share of forces [–]", "anisotropy $a_{lt}$ [–]",
        "nematic order [–]",
    ]  # fmt: skip
    contacts = points_of([0], [1], (0.0, -1.0), (1.0, 0.0), (0.0, 0.5))
    frame = shaped_frame(np.array([[0.0, 0.0], [0.0, 1.0]]), contacts=contacts, walls=0)
    pentagons = source_of(shaped_model([[regular(5)]] * 2, walls=()), [frame])
    *shown, empty = figure_of(renderer.draw, post.fabric(pentagons, ALL)).axes
    assert [axes.get_ylabel() for axes in shown] == panels[:-1]  # no long axes, no order of them
    assert not empty.axison
    assert [axes for axes in shown if axes.get_xlabel()] == shown[-2:]
    plain = post.fabric(column, ALL, margin=0.0)
    assert len(figure_of(renderer.draw, plain).axes) == 8
    assert renderer.size(table)[1] == pytest.approx(1.5 * renderer.size(plain)[1])


def test_densities_of_hot_spots_break_at_empty_bins():
    """Small flashes and large ones, and none in between."""
    slips = [*(1e-4 * np.arange(5.0, 9.0)), *np.arange(5.0, 9.0)]
    table = post.hot_spots(sliding([[(0, 1, 1.0, 0.5, slip) for slip in slips]] * 3), ALL)
    panels = figure_of(draw_hot_spots, table).axes
    for panel, density in zip(panels, (table.rise_density, table.spot_density), strict=True):
        drawn, is_empty = panel.lines[0].get_ydata(), density == 0.0
        assert is_empty[:-1].any()
        assert np.isnan(drawn).tolist() == is_empty.tolist()
        assert drawn[~is_empty] == pytest.approx(density[~is_empty])


def test_energy_stacks_what_came_in_and_what_went_out(column):
    figure = figure_of(draw_energy, post.energy(column))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == [
        *(f"{n} since the start [J]" for n in ("energy", "heat")),
        *["closure [–]"] * 2,
    ]
    heat = figure.axes[1]
    assert [text.get_text() for text in heat.get_legend().get_texts()] == ["stored"]
    paths = [path for area in heat.collections for path in area.get_paths()]
    lowest = min(path.vertices[:, 1].min() for path in paths)
    assert lowest == pytest.approx(-post.energy(column).books["heat_stored"][-1])


def test_distributions_show_bins_with_forces_only(column):
    table = post.force_distribution(column, ALL)
    axes = panel_of(draw_distribution, table)
    assert axes.lines[0].get_ydata() == pytest.approx(table.normal[table.count > 0])
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_a_polar_map_ends_where_the_grains_do(column):
    corner = tuple(post.grain_map(column, "speed").scene.box[0])
    table = post.fields(column, ["velocity-t"], ALL, center=corner, reach=4.0)
    axes = panel_of(lambda axes, table: _draw_mesh(axes, table, table.of[0]), table)
    mesh = axes.collections[0]
    shown = ~np.ma.getmaskarray(mesh.get_array()).reshape(table.points.shape[::-1]).T.ravel()
    assert table.scene.lattice.width > 0.0  # nothing is beyond the grains to the side
    height, reach = table.points.at[shown, 1], table.scene.radius
    assert shown.any()
    assert height.min() >= (table.scene.center[:, 1] - reach).min()
    assert height.max() <= (table.scene.center[:, 1] + reach).max()
    assert np.isfinite(table.values["velocity-t"][~shown]).any()


def test_angles_are_polar_histograms_with_their_second_harmonic(column):
    table = post.angular_distribution(column, ALL)
    figure = figure_of(draw_angles, table)
    contacts, forces, across = figure.axes
    half = np.nan_to_num(table.tangential[: table.angle.size // 2])
    for axes, values in (
        (contacts, table.density), (forces, np.nan_to_num(table.normal)), (across, half)
    ):  # fmt: skip
        assert [bar.get_height() for bar in axes.patches] == pytest.approx(values)
    highest = 0.5 / np.pi * (1.0 + table.moments["a_c"])
    assert contacts.lines[0].get_ydata().max() == pytest.approx(highest, rel=1e-3)
    assert f"{table.moments['a_c']:.3f}" in contacts.get_title()
    degrees, wave = across.lines[-1].get_xydata().T
    away = np.radians(degrees - table.moments["theta_t"])
    level = np.nanmean(table.normal)
    assert wave == pytest.approx(-level * table.moments["a_t"] * np.sin(2.0 * away))


def test_comparison_shows_both_profiles_and_their_difference(column):
    of = ["velocity", "temperature"]
    found = post.compare(column, column, of, ALL, names=("one", "two"))
    figure = figure_of(draw_comparison, found)
    assert len(figure.axes) == 4
    left, right = figure.axes[:2]
    assert [line.get_label() for line in left.lines] == ["one", "two"]
    assert left.lines[1].get_xdata() == pytest.approx(found.profiles["velocity"].second.value)
    assert np.abs(right.lines[-1].get_xdata()).max(initial=0.0) == 0.0


def make_vortex(n=4000):
    """Rigid rotation about (0.5, 0.5)."""
    rng = np.random.default_rng(0)
    center = rng.random((n, 2))
    vector = np.column_stack([0.5 - center[:, 1], center[:, 0] - 0.5])
    scene = GrainScene(center, np.full(n, 0.005), [], Lattice(), np.array([[0.0, 0.0], [1.0, 1.0]]))
    speed = post.Column("value", "m/s", np.hypot(*vector.T))
    parts = {"field": post.MAPPED["fluctuation"], "scene": scene, "vector": vector, "names": ()}
    return post.GrainMap((), {"time": 1.5, "frame": 3}, [speed], flow=None, **parts)


def test_smooth_field_is_the_local_mean():
    table = make_vortex()
    x, y, field = smooth_field(table)
    inner = (np.abs(x - 0.5) < 0.3)[np.newaxis, :] & (np.abs(y - 0.5) < 0.3)[:, np.newaxis]
    assert np.isfinite(field[inner]).mean() > 0.95  # the rest are voids of this loose layer
    assert np.nanmax(np.abs(field[inner][:, 0] - (0.5 - y)[np.nonzero(inner)[0]])) < 0.05
    assert np.nanmax(np.abs(field[inner][:, 1] - (x - 0.5)[np.nonzero(inner)[1]])) < 0.05
    uniform = table.with_(vector=np.tile([1.0, -2.0], (table.value.size, 1)))
    found = smooth_field(uniform)[2]
    known = np.isfinite(found[..., 0])
    assert found[known] == pytest.approx(np.tile([1.0, -2.0], (int(known.sum()), 1)))


def test_smooth_field_weighs_grains_of_any_shape_by_area():
    """Of bars, every other one half as long and at rest, a third of the area is; all radii are
    alike."""
    table = make_vortex()
    number = np.arange(table.value.size)
    long, short = (box(-a, -0.001, a, 0.001) for a in (0.004, 0.002))
    grains = [[(long if k % 2 else short, 0.0)] for k in number]
    ones = np.ones(number.size)
    rings = rings_of(Outlines.of(grains, ones, ones)).placed(table.scene.center, 0.0 * ones)
    vector = np.column_stack([number % 2, 0.0 * ones])
    found = smooth_field(table.with_(scene=replace(table.scene, rings=rings), vector=vector))[2]
    assert np.nanmean(found[..., 0]) == pytest.approx(2.0 / 3.0, abs=0.02)


def test_smooth_field_goes_around_the_ends_of_the_period_and_leaves_empty_regions_out():
    table = make_vortex()
    low = table.scene.center[:, 1] < 0.5
    for period in (0.0, 1.0):
        center, radius = table.scene.center[low], table.scene.radius[low]
        scene = replace(table.scene, lattice=Lattice(period), center=center, radius=radius)
        right = center[:, 0] > 0.5
        vector = np.column_stack([np.where(right, 1.0, 0.0), 0.0 * right])
        half = table.with_(scene=scene, value=table.value[low], vector=vector)
        x, y, field = smooth_field(half)
        assert np.isnan(field[y > 0.7]).all()
        beside = field[10, 0, 0]  # next to x = 0, where the neighbors are beyond the period
        assert beside > 0.3 if period else beside < 1e-3
        assert x[0] < 0.02


def test_map_has_streamlines_or_arrows(column):
    from matplotlib.collections import LineCollection
    from matplotlib.quiver import Quiver

    table = make_vortex(500)
    for has_streamlines in (True, False):
        drawn = map_of(table, has_streamlines=has_streamlines).collections
        lines = [c for c in drawn if isinstance(c, LineCollection) and len(c.get_segments()) > 5]
        assert bool(lines) is has_streamlines
        assert any(isinstance(c, Quiver) for c in drawn) is not has_streamlines
    (key,) = map_of(table, has_streamlines=False).artists
    longest = np.quantile(table.value, 0.95)
    assert round_below(longest) == key.U
    assert key.text.get_text() == f"{key.U:g} m/s"
    assert key.vector.get_path_effects()
    map_of(post.grain_map(column, "fluctuation", 0))  # at rest: no lines, no error


def test_figures_are_written_and_reproducible(column, tmp_path):
    tables = (
        post.rheology(column, ALL), post.angular_distribution(column, ALL), make_vortex(300),
        post.force_network(column),
    )  # fmt: skip
    for table in tables:
        for name in ("a.svg", "b.svg"):
            plots.plot(table, tmp_path / name)
        assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_all_books_have_a_name_and_a_color():
    for line in (*MECHANICAL, *HEAT):
        if line.sign:
            assert all(LOOKS[line.name])

"""Figures of maps, force networks and θ–η: what is drawn where. How they look is for eyes."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import figure_of, map_of, panel_of
from heat_run import GRAINS
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from shaped_run import ANGLE, DUMBBELL, FRAME, LOWER, PLACES, TRIANGLE, TURN, UPPER

from multicor_cli.model.shapes import Polygon
from multicor_cli.plots.fields import _fill
from multicor_cli.plots.forces import draw_forces, forces_text, line_widths, lines_shown, segments
from multicor_cli.plots.grain_map import color_scale, count_beyond, place_scene, solid_polygons
from multicor_cli.plots.profile import draw_theta_eta
from multicor_cli.plots.style import COLORS, Terminal, house_style
from multicor_cli.plots.vectors import round_below
from multicor_cli.post import MAPPED, Selection, fields, force_network, grain_map, theta_eta
from multicor_cli.store import open_run
from multicor_cli.text import unit_sign


@pytest.mark.parametrize("of", [of for of, each in MAPPED.items() if not each.needs_axes])
def test_map_shows_every_grain_and_names_its_colors(column, of):
    table = grain_map(column, of)
    panel = map_of(table)
    discs = panel.collections[0]
    shown = np.ma.filled(discs.get_array(), np.nan)  # none crosses the ends of the period
    assert np.array_equal(shown, table.value, equal_nan=True)
    assert discs.get_offsets() == pytest.approx(table.scene.center)
    label = panel.figure.axes[1].get_xlabel() + panel.figure.axes[1].get_ylabel()
    assert table.names or f"[{unit_sign(table.field.unit)}]" in label
    assert panel.get_xlim() == (0.0, 4.0)
    assert panel.get_aspect() == 1.0


def test_what_crosses_the_ends_of_the_period_is_drawn_on_both_sides(column):
    table = grain_map(column, "temperature")
    table.scene.center[3, 0] = 0.01
    panel = map_of(table)
    offsets = panel.collections[0].get_offsets()
    assert len(offsets) == GRAINS + 1
    assert offsets[-1] == pytest.approx([4.01, table.scene.center[3, 1]])
    assert panel.collections[0].get_array()[-1] == table.value[3]
    network = force_network(column)
    network.start[0], network.end[0] = [3.98, 0.5], [4.08, 0.5]
    lines, which = segments(network)
    assert which.tolist() == [*range(GRAINS), 0]
    assert lines[-1] == pytest.approx(np.array([[-0.02, 0.5], [0.08, 0.5]]))


@pytest.fixture(scope="module")
def shapes(shaped):
    return open_run(shaped)


def test_grains_of_any_shape_are_drawn_as_they_lie(shapes):
    """With their images, colors and holes."""
    panel = map_of(grain_map(shapes, "velocity", 1))
    grains = panel.collections[0]
    paths = grains.get_paths()
    assert len(paths) == len(PLACES) + 1
    assert grains.get_array().tolist() == [*range(len(PLACES)), DUMBBELL]
    across = paths[DUMBBELL].vertices - paths[-1].vertices
    assert across == pytest.approx(np.tile([2.0, 0.0], (len(across), 1)))
    turn = 0.5 * np.pi + TURN + 2.0 * np.pi / 3.0 * np.arange(4)  # the first corner again
    corners = PLACES[TRIANGLE] + 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    assert paths[TRIANGLE].vertices == pytest.approx(corners)
    outer, hole = paths[FRAME].to_polygons()  # one that runs clockwise is a hole
    assert Polygon(outer[:-1]).signed_size == pytest.approx(0.09)
    assert Polygon(hole[:-1]).signed_size == pytest.approx(-0.01)
    assert not paths[ANGLE].contains_point(PLACES[ANGLE] + 0.05)


def test_forces_between_grains_of_any_shape_pass_through_points_of_contact(shapes):
    network = force_network(shapes, 1)
    lines, which = segments(network)
    assert sorted(which.tolist()) == sorted([*range(network.i.size)] * 2)
    floor = lines[which == np.flatnonzero(network.i == ANGLE)[0]]
    assert floor[0] == pytest.approx(np.array([PLACES[ANGLE], PLACES[ANGLE] - [0.0, 0.11]]))
    upper = lines[which == np.flatnonzero(network.j == UPPER)[0]]
    assert upper[0, 0] == pytest.approx(PLACES[LOWER])
    assert upper[0, 1] == pytest.approx(upper[1, 0])
    assert upper[0, 1, 1] == pytest.approx(0.16)


def test_solid_polygons_are_filled_and_containers_are_not():
    triangle = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    square = np.array([[5.0, 5.0], [9.0, 5.0], [9.0, 9.0], [5.0, 9.0]])
    walls = (triangle, square[::-1] * 3.0, square)
    sides = [np.stack([corners, np.roll(corners, -1, axis=0)], axis=1) for corners in walls]
    found = solid_polygons(np.concatenate(sides))
    assert [corners.tolist() for corners in found] == [triangle.tolist(), square.tolist()]


def test_color_scales(column):
    temperature, spin, heat = (grain_map(column, of) for of in ("temperature", "spin", "heat"))
    norm, extend = color_scale(temperature)
    assert (norm.vmin, norm.vmax) == (temperature.value.min(), temperature.value.max())
    assert extend == "neither"
    norm, _ = color_scale(spin)
    assert norm.vmin == -norm.vmax
    norm, extend = color_scale(heat)
    assert (norm.vmax, extend) == (heat.value.max(), "neither")
    norm, extend = color_scale(heat.with_(value=heat.value * (np.arange(GRAINS) > 3)))
    assert extend == "min"
    assert np.ma.is_masked(norm(0.0))  # drawn white: it has received nothing
    norm, _ = color_scale(heat.with_(value=np.zeros(GRAINS)))
    assert norm.vmax == 1.0
    norm, _ = color_scale(temperature.with_(value=np.full(GRAINS, 300.0)))
    assert norm.vmin < 300.0 < norm.vmax


def test_axes_of_grains_have_colors_that_end_as_they_begin(shapes):
    """Those at 0 and 180° are the same, whatever lies in between."""
    panel = map_of(grain_map(shapes, "orientation", 1))
    grains = panel.collections[0]
    assert (grains.norm.vmin, grains.norm.vmax) == (0.0, 180.0)
    first, middle, last = grains.to_rgba([0.0, 90.0, 179.999])[:, :3]
    assert first == pytest.approx(last, abs=0.01)
    assert abs(first - middle).max() > 0.5


def test_lines_of_forces_are_as_wide_as_the_forces_are_large(column):
    network = force_network(column)
    panel = panel_of(draw_forces, network)
    few = network.with_(force=network.force[:5], i=network.i[:5], j=network.j[:5])
    width = line_widths(panel, few.scene, few.force[:, 0])
    assert width / width[0] == pytest.approx([1.0, 2.0, 3.0, 4.0, 5.0])
    lines = panel.collections[-1]
    assert len(lines.get_segments()) == GRAINS
    assert lines.get_linewidths() == pytest.approx(
        line_widths(panel, network.scene, network.force[:, 0])
    )
    assert tuple(lines.get_colors()[0]) == pytest.approx(to_rgba(COLORS[1]))  # sliding
    assert tuple(lines.get_colors()[1]) == pytest.approx(to_rgba(COLORS[0]))


def test_contacts_in_tension_have_a_color_and_the_mean_is_that_of_the_table(column):
    network = force_network(column)
    force = network.force.copy()
    force[::3, 0] *= -1.0
    summary = {**network.summary, "normal_force_mean": float(force[:, 0].mean())}
    pulled = network.with_(force=force, summary=summary)
    panel = panel_of(draw_forces, pulled)
    colors = panel.collections[-1].get_colors()
    is_green = (colors == to_rgba(COLORS[2])).all(axis=1)
    assert is_green.tolist() == (force[:, 0] < 0.0).tolist()
    legend = panel.figure.legends[0]
    assert [text.get_text() for text in legend.get_texts()][2] == "in tension"
    mean = f"mean {summary['normal_force_mean']:.3g} N"
    assert legend.get_title().get_text().endswith(mean)
    assert mean in forces_text(pulled, Terminal())
    assert "green: in tension" in forces_text(pulled, Terminal())
    assert "tension" not in forces_text(network, Terminal())


def test_lines_of_a_legend_are_never_so_thick_that_they_meet(column):
    scene = force_network(column).scene
    for size in (1.0, 20.0):
        panel = panel_of(draw_forces, force_network(column))
        large = replace(scene, radius=size * scene.radius)
        lines = lines_shown(panel, large, 100.0, "N")
        (one, thin), (three, thick) = ((k, line.get_linewidth()) for k, line in lines.items())
        assert thick == pytest.approx(3.0 * thin)
        assert thick <= 8.0
        shown = np.array([float(name.removesuffix(" N")) for name in (one, three)])
        wide = line_widths(panel, large, shown, 9.0, 100.0)
        assert wide == pytest.approx([thin, thick], rel=0.03)  # two digits


def test_pictures_of_a_frame_say_when_it_was(column):
    of_grains, network = grain_map(column, "speed", 2), force_network(column, 2)
    told = {
        map_of(of_grains).get_title("left"),
        panel_of(draw_forces, network).get_title("left"),
        panel_of(draw_theta_eta, theta_eta(column, 2, wall="top")).get_title("left"),
        figure_of(_fill, fields(column, ["speed"], Selection(frames=slice(2, 3))))
        .axes[0]
        .get_title("left"),
    }
    assert told == {f"$t$ = {of_grains.time:.6g} s, frame 2"}
    several = figure_of(_fill, fields(column, ["speed"], Selection(frames=slice(1, 3))))
    assert several.axes[0].get_title("left").startswith("2 frames, $t$ = ")


def test_pictures_have_one_scale_if_asked(column):
    table = grain_map(column, "temperature")
    low, high = table.value.min() + 0.5, table.value.max() + 4.0
    panel = map_of(table, ends=(low, high))
    discs = panel.collections[0]
    assert (discs.norm.vmin, discs.norm.vmax) == (low, high)
    below = int((table.value < low).sum())
    assert below > 0
    assert f"; {below} grain{'s' * (below > 1)} below" in panel.figure.axes[1].get_xlabel()
    network = force_network(column)
    mean = float(np.abs(network.force[:, 0]).mean())
    widths = [
        line_widths(panel_of(draw_forces, network), network.scene, network.force[:, 0], unit=unit)
        for unit in (None, 2 * mean)
    ]
    wide = widths[0] < widths[0].max()  # up to the widest
    assert widths[0][wide] == pytest.approx(2.0 * widths[1][wide])
    with house_style():
        place = place_scene(Figure(), network.scene, has_bar=False)
        draw_forces(place.axes, network, unit=2.0 * mean)
    texts = [text.get_text() for text in place.axes.figure.legends[0].get_texts()]
    assert texts[2:] == [f"{2 * mean:.2g} N", f"{6 * mean:.2g} N"]


def test_a_color_bar_says_how_many_grains_are_beyond(column):
    table = grain_map(column, "temperature")
    scale, _ = color_scale(table, (table.value.min(), table.value.max()))
    assert count_beyond(table, scale) == ""
    ranks = np.sort(table.value)
    for ends, text in (
        ((ranks[1], ranks[-1]), "1 grain below"),
        ((ranks[0], ranks[-4]), "3 grains above"),
        ((ranks[2], ranks[-2]), "2 grains below, 1 above"),
    ):
        assert count_beyond(table, color_scale(table, ends)[0]) == text
    heat = grain_map(column, "heat")
    cold = heat.with_(value=heat.value * (np.arange(GRAINS) > 3))
    assert count_beyond(cold, color_scale(cold)[0]) == "white: 4 grains below"


@pytest.mark.parametrize(("value", "below"), [
    (1.0, 1.0), (0.0199, 0.01), (0.7, 0.5), (4.99, 2.0), (2.0e5, 2.0e5), (9.9e-7, 5e-7),
])  # fmt: skip
def test_keys_are_round(value, below):
    assert round_below(value) == pytest.approx(below, rel=1e-12)


def test_theta_eta_shows_grains_and_means(column):
    table = theta_eta(column, wall="top", bins=5)
    panel = panel_of(draw_theta_eta, table)
    assert panel.lines[0].get_xdata() == pytest.approx(table.eta)
    means = next(container for container in panel.containers).lines[0]
    assert means.get_ydata() == pytest.approx(table.mean)
    assert r"\eta" in panel.get_xlabel()
    assert panel.get_ylim() == (0.0, 1.0)


def test_network_without_forces_is_drawn(column):
    network = force_network(column)
    empty = network.with_(
        i=network.i[:0], j=network.j[:0], force=network.force[:0], sliding=network.sliding[:0]
    )
    panel = panel_of(draw_forces, empty)
    assert panel.figure.legends == []

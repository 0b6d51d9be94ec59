"""Figures of maps, force networks and θ–η: what is drawn where. How they look is for eyes."""

import numpy as np
import pytest
from drawn import map_of, panel_of
from heat_run import GRAINS

from multicor_cli.plots import draw_forces, draw_theta_eta
from multicor_cli.plots.forces import line_widths, segments
from multicor_cli.plots.grain_map import color_scale, solid_polygons
from multicor_cli.plots.style import COLORS
from multicor_cli.post import MAPPED, force_network, grain_map, theta_eta
from multicor_cli.text import unit_sign


@pytest.mark.parametrize("of", MAPPED)
def test_map_shows_every_grain_and_names_its_colors(column, of):
    table = grain_map(column, of)
    panel = map_of(table)
    discs = panel.collections[0]
    assert discs.get_array().tolist() == table.value.tolist()  # none crosses the ends of the period
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
    from matplotlib.colors import to_rgba

    assert tuple(lines.get_colors()[0]) == pytest.approx(to_rgba(COLORS[1]))  # sliding
    assert tuple(lines.get_colors()[1]) == pytest.approx(to_rgba(COLORS[0]))


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

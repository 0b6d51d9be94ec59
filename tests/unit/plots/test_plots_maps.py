"""Figures of maps, force networks and θ–η: what is drawn where. How they look is for eyes."""

from __future__ import annotations

import numpy as np
import pytest
from heat_run import GRAINS, write_heated_run

from multicor_cli.plots import draw_forces, draw_map, draw_theta_eta
from multicor_cli.plots.forces import line_widths, segments
from multicor_cli.plots.grain_map import color_scale, place_scene, solid_polygons
from multicor_cli.plots.style import COLORS, house_style
from multicor_cli.post import MAPPED, GrainMap, force_network, grain_map, theta_eta
from multicor_cli.store import Run, open_run
from multicor_cli.text import unit_sign


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = tmp_path_factory.mktemp("run") / "run"
    write_heated_run(path)
    return open_run(path)


def axes():
    from matplotlib.figure import Figure

    return Figure(layout="constrained").add_subplot()


def mapped(table: GrainMap):
    """The axes of a map."""
    from matplotlib.figure import Figure

    place = place_scene(Figure(), table.scene)
    draw_map(place, table)
    return place.axes


@pytest.mark.parametrize("of", MAPPED)
def test_map_shows_every_grain_and_names_its_colors(run: Run, of: str) -> None:
    with house_style():
        table = grain_map(run, of)
        panel = mapped(table)
    discs = panel.collections[0]
    assert discs.get_array().tolist() == table.value.tolist()  # none crosses the ends of the period
    assert discs.get_offsets() == pytest.approx(table.scene.center)
    label = panel.figure.axes[1].get_xlabel() + panel.figure.axes[1].get_ylabel()
    assert table.names or f"[{unit_sign(table.field.unit)}]" in label
    assert panel.get_xlim() == (0.0, 4.0)
    assert panel.get_aspect() == 1.0


def test_grains_at_the_ends_of_the_period_are_drawn_twice(run: Run) -> None:
    table = grain_map(run, "temperature")
    table.scene.center[3, 0] = 0.01
    with house_style():
        panel = mapped(table)
    offsets = panel.collections[0].get_offsets()
    assert len(offsets) == GRAINS + 1
    assert offsets[-1] == pytest.approx([4.01, table.scene.center[3, 1]])
    assert panel.collections[0].get_array()[-1] == table.value[3]


def test_solid_polygons_are_filled_and_containers_are_not() -> None:
    triangle, square = (
        np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]]),
        np.array([[5.0, 5.0], [9.0, 5.0], [9.0, 9.0], [5.0, 9.0]]),
    )
    inner = square[::-1] * 3.0
    sides = np.concatenate(
        [
            np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
            for corners in (triangle, inner, square)
        ]
    )
    found = solid_polygons(sides)
    assert [corners.tolist() for corners in found] == [triangle.tolist(), square.tolist()]


def test_color_scales(run: Run) -> None:
    temperature, spin, heat = (grain_map(run, of) for of in ("temperature", "spin", "heat"))
    norm, extend = color_scale(temperature)
    assert (norm.vmin, norm.vmax, extend) == (
        temperature.value.min(),
        temperature.value.max(),
        "neither",
    )
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


def test_lines_of_forces_are_as_wide_as_the_forces_are_large(run: Run) -> None:
    network = force_network(run)
    with house_style():
        panel = axes()
        width = line_widths(
            panel, network.with_(force=network.force[:5], i=network.i[:5], j=network.j[:5])
        )
        draw_forces(panel, network)
    assert width / width[0] == pytest.approx([1.0, 2.0, 3.0, 4.0, 5.0])
    lines = panel.collections[-1]
    assert len(lines.get_segments()) == GRAINS
    assert lines.get_linewidths() == pytest.approx(line_widths(panel, network))
    from matplotlib.colors import to_rgba

    assert tuple(lines.get_colors()[0]) == pytest.approx(to_rgba(COLORS[1]))  # sliding
    assert tuple(lines.get_colors()[1]) == pytest.approx(to_rgba(COLORS[0]))


def test_forces_across_the_ends_of_the_period_are_drawn_on_both_sides(run: Run) -> None:
    network = force_network(run)
    network.start[0], network.end[0] = [3.98, 0.5], [4.08, 0.5]
    lines, which = segments(network)
    assert which.tolist() == [*range(GRAINS), 0]
    assert lines[-1] == pytest.approx(np.array([[-0.02, 0.5], [0.08, 0.5]]))


def test_theta_eta_shows_grains_and_means(run: Run) -> None:
    table = theta_eta(run, wall="top", bins=5)
    with house_style():
        panel = axes()
        draw_theta_eta(panel, table)
    assert panel.lines[0].get_xdata() == pytest.approx(table.eta)
    means = next(container for container in panel.containers).lines[0]
    assert means.get_ydata() == pytest.approx(table.mean)
    assert r"\eta" in panel.get_xlabel()
    assert panel.get_ylim() == (0.0, 1.0)


def test_network_without_forces_is_drawn(run: Run) -> None:
    network = force_network(run)
    empty = network.with_(
        i=network.i[:0], j=network.j[:0], force=network.force[:0], sliding=network.sliding[:0]
    )
    with house_style():
        panel = axes()
        draw_forces(panel, empty)
    assert panel.figure.legends == []

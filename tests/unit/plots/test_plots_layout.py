"""Nothing is cut off and nothing overlaps: the places of all texts of all figures, for scenes of
any shape."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cells import square_of_discs
from layers import layer, sliding, with_ways
from made_up_groups import dropped, mixed, parted, stayed

from multicor_cli import post
from multicor_cli.model.shapes import Annulus
from multicor_cli.plots import plot, style
from multicor_cli.post.lattice import Lattice
from multicor_cli.store import open_run

ALL = post.Selection(start=0.0)
SHAPES = [
    (4.0, 4.0), (0.1, 0.1), (20.0, 1.0), (1.0, 20.0), (4.5e-3, 3.0e-3), (1234.5, 2345.6), (3.0, 2.2)
]  # fmt: skip


@pytest.fixture
def drawn(monkeypatch):
    """Draws a table and gives the figure instead of writing it."""
    figures = []
    monkeypatch.setattr(
        style, "save_figure", lambda figure, path: figures.append(figure) or check(figure)
    )

    def draw(table):
        plot(table, Path("figure.pdf"))
        return figures[-1]

    return draw


def check(figure):
    """All texts lie inside the figure; those of one axis, and labels of axes, do not touch."""
    figure.draw_without_rendering()
    renderer = figure._get_renderer()
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    flat = [axes for axes in figure.axes if axes.name != "polar"]
    names = [axis.label for axes in flat for axis in (axes.xaxis, axes.yaxis)]
    titles = [axes.title for axes in figure.axes]
    for text in (*names, *titles, *(text for legend in legends for text in legend.get_texts())):
        inside(text, figure, renderer)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            check_axis(axis, figure, renderer)


def check_axis(axis, figure, renderer):
    # Ticks inside the limits
    shown = [label for tick in axis._update_ticks() for label in (tick.label1, tick.label2)]
    seen = [label for label in shown if label.get_visible() and label.get_text()]
    boxes = [inside(label, figure, renderer) for label in seen]
    if axis.axes.name == "polar":
        return
    inside(axis.offsetText, figure, renderer)
    along = 0 if axis.axis_name == "x" else 1
    boxes.sort(key=lambda box: box.min[along])
    about = (axis.axes.get_xlabel(), axis.axes.get_ylabel(), [label.get_text() for label in shown])
    assert all(a.max[along] < b.min[along] for a, b in pairwise(boxes)), about
    if axis.label.get_text():
        name = axis.label.get_window_extent(renderer)
        assert not any(name.overlaps(box) for box in boxes), about


def inside(text, figure, renderer):
    """The place of a text, which must be in the figure."""
    box, whole = text.get_window_extent(renderer), figure.bbox
    if text.get_text().strip():
        is_inside = (box.min > whole.min - 1).all() and (box.max < whole.max + 1).all()
        assert is_inside, f"{text.get_text()!r} at {box.extents} in {whole.extents}"
    return box


def test_charts(column, drawn):
    pairs = post.pair_correlation(column, ALL, 1.0, margin=0.0)
    factor = post.structure_factor(square_of_discs([3e-5, 5e-5, 4e-5]), ALL)
    for table in (
        *(
            post.profiles(column, of, ALL)
            for of in ("velocity", "spin", "temperature", "stress", "kinetic-stress")
        ),
        post.profiles(column, "velocity", ALL).normalized(),
        post.theta_eta(column, wall="top"),
        post.energy(column),
        post.rheology(column, ALL),
        post.in_region(column, Annulus((2.0, 2.0), 2.0), ALL),
        post.force_distribution(column, ALL),
        post.angular_distribution(column, ALL),
        post.compare(column, column, ["velocity", "temperature"], ALL),
        post.conductivity(square_of_discs([3e-5, 5e-5, 4e-5]), ALL),
        post.layer_conductivity(layer(), ALL),
        post.layer_flow(layer(), ALL),
        post.layer_flow(with_ways(layer(), [1.0, 2.0, 0.5, -0.2]), ALL),
        post.wall_heat(layer(), ALL),
        post.heat_network(layer()),
        post.hot_spots(sliding([[(0, 1, 1.0, 0.5, 0.1 * u) for u in range(9)]] * 3), ALL, 310.0),
        post.diffusion(column, ALL, margin=0.1),
        post.fabric(column, ALL, margin=0.0),
        post.lifetimes(column, ALL, margin=0.0),
        post.chains(column, ALL),
        post.chain_lengths(column, ALL),
        post.chain_map(column),
        post.clusters(column, ALL),
        post.mobilization(column, ALL),
        pairs,
        factor,
        pairs.with_(factor=factor),
        mixed(),
        parted(),
        parted(of="size", frames=1),
        stayed(),
        dropped(),
        dropped(power_law=True),
        post.voronoi(square_of_discs([3e-5, 5e-5, 4e-5]), ALL),
        post.correlation(column, ALL, 1.0, margin=0.0),
    ):
        drawn(table)


def test_labels_have_room_beside_ticks_that_become_longer_with_the_panels(monkeypatch):
    """As those at 0.050 and 0.055 do that stand where there were some at 0.05 and 0.10; a layout
    places panels twice, and here the third place still has longer ones."""
    monkeypatch.setattr(style, "save_figure", lambda figure, _path: check(figure))
    places = []
    with style.figure_file(Path("figure.pdf"), 3.0, 2.0) as figure:
        panel = figure.add_subplot(ylabel="heat flow")

        def tick(_value, _position):
            if (place := panel.get_position().x0) not in places:
                places.append(place)
            return "0.05" + "555" * min(len(places), 3)

        panel.yaxis.set_major_formatter(tick)
    assert len(places) > 3


@pytest.mark.parametrize("count", [2, 8, 12])
def test_many_groups_have_a_legend_of_as_many_colors(column, drawn, count):
    """In a wide scene names would lie over each other below a bar."""
    names = tuple(f"written-out {k}" for k in range(count))
    table = post.grain_map(column, "group").with_(names=names)
    figure = drawn(reshaped(table, 20.0, 8.0))
    picture, bar = figure.axes
    grains = picture.collections[0]
    assert len({tuple(color) for color in grains.to_rgba(np.arange(count))}) == count
    legend = bar.get_legend()
    assert (legend is not None) == (count > 2)
    if legend is not None:
        assert tuple(text.get_text() for text in legend.get_texts()) == names
        assert not legend.get_window_extent().overlaps(picture.xaxis.label.get_window_extent())


def test_fields_of_shapes(shaped, drawn):
    with open_run(shaped) as run:
        drawn(post.profiles(run, "nematic", ALL))
        drawn(post.force_network(run))


def test_no_legend_of_a_function_lies_on_its_curve(column, drawn):
    """A curve may be high anywhere: g at its peaks, C where all grains move together."""
    for table in (
        post.pair_correlation(column, ALL, 1.0, margin=0.0),
        post.voronoi(square_of_discs([3e-5, 5e-5, 4e-5]), ALL),
        post.correlation(column, ALL, 1.0, margin=0.0),
    ):
        axes = drawn(table).axes[0]
        assert not axes.get_legend().get_window_extent().overlaps(axes.get_window_extent())


def test_times_late_in_a_run_do_not_lie_over_each_other(drawn):
    """Of a short flow after a long soak: 200.055 s, 200.060 s, …"""
    table = post.conductivity(square_of_discs(np.linspace(3e-5, 5e-5, 29)), ALL)
    table.time = np.linspace(200.0546, 200.0913, 29)
    drawn(table)


def reshaped(table, across, upwards):
    """The same grains in a box of another shape."""
    scene = table.scene
    low, high = scene.box
    stretch = np.array([across, upwards]) / (high - low)
    center = (scene.center - low) * stretch
    box = np.array([[0.0, 0.0], [across, upwards]])
    lines = [outline for outline in scene.walls if outline.radius is None]
    radius = scene.radius * stretch.min()
    return table.with_(
        scene=replace(scene, center=center, radius=radius, walls=lines, lattice=Lattice(), box=box)
    )


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape[0]:g}x{shape[1]:g}")
@pytest.mark.parametrize("of", ["temperature", "velocity", "heat", "spin"])
def test_maps_of_any_shape(column, drawn, shape, of):
    table = reshaped(post.grain_map(column, of), *shape)
    figure = drawn(table)
    axes, bar = figure.axes
    box = axes.get_window_extent()
    # to scale, and no room is left empty
    assert box.width / box.height == pytest.approx(shape[0] / shape[1], rel=1e-6)
    assert not bar.get_window_extent().overlaps(box)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape[0]:g}x{shape[1]:g}")
def test_networks_of_any_shape(column, drawn, shape):
    network = reshaped(post.force_network(column), *shape)
    figure = drawn(network)
    (axes,) = figure.axes
    legend = figure.legends[0].get_window_extent()
    assert not legend.overlaps(axes.get_window_extent())

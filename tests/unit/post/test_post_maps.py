"""Maps of how far grains have come and turned, and how values become colors and widths."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_up_frames import frame_of, source_of
from scenarios import scenario
from scene_parts import make_model

import multicor_cli as multicor
from multicor_cli import post
from multicor_cli.post.quantities import MAPPED, color_range


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """One grain without weight that passes the ends of the period twice."""
    path = tmp_path_factory.mktemp("flight") / "run"
    grains = [[0.01, 0.013, 0.5e-3, 1.0, -0.1, -7.0]]
    free = {"periodic": True, "gravity": [0.0, 0.0], "walls": {}, "size": [0.02, 0.02]}
    times = {"duration": 0.05, "dt": 1e-4, "frame_interval": 0.01}
    multicor.run(scenario(grains=grains, **free, **times), path)
    with multicor.open_run(path) as run:
        yield run


@pytest.mark.parametrize(("of", "rate"), [("displacement", np.hypot(1.0, 0.1)), ("rotation", -7.0)])
def test_a_grain_that_flies_freely_comes_as_far_as_its_velocity_says(flight, of, rate):
    for k, frame in enumerate(flight.frames):
        expected = pytest.approx(rate * frame.time, rel=1e-12, abs=1e-15)
        assert post.grain_map(flight, of, k).value == expected


def test_rotations_count_from_the_first_frame():
    """Grains that are no discs begin at any angle, and runs that go on from others at theirs."""
    angles = [np.array([5.0, -3.0]), np.array([5.5, -3.0])]
    frames = [frame_of([[0.0, 0.0], [1.0, 0.0]], angle=angle) for angle in angles]
    source = source_of(make_model([0.5, 0.5], period=0.0), frames)
    values = [MAPPED["rotation"].of_grain(source, k).tolist() for k in (0, 1)]
    assert values == [[0.0, 0.0], [0.5, 0.0]]


def test_vertical_velocities_are_those_of_the_frame(flight):
    assert np.array_equal(
        post.grain_map(flight, "velocity-y").value, flight.frames[-1].velocity[:, 1]
    )


@pytest.mark.parametrize("of", ["velocity-y", "rotation", "spin"])
def test_colors_of_signed_fields_are_centered(of):
    low, high = color_range(MAPPED[of], np.array([-1.0, 0.2, 3.0]), 3)
    assert (low, high) == (-3.0, 3.0)
    assert MAPPED[of].colors == "balance"


def test_widths_in_the_legend_are_those_of_the_forces(flight):
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    from multicor_cli.plots.forces import draw_forces

    force = np.column_stack([[1.0, 2.0, 3.0, 2.0], np.zeros(4)])  # mean 2
    ends, number = np.linspace(0.0, 0.01, 4)[:, np.newaxis] + np.zeros(2), np.arange(4)
    contacts = {"start": ends, "end": ends + 1e-3, "sliding": np.zeros(4, bool), "force": force}
    scene = post.make_scene(flight, flight.frames[0])
    network = post.force_network(flight).with_(scene=scene, i=number, j=number, **contacts)
    axes = Figure().add_subplot()
    draw_forces(axes, network)
    (legend,) = axes.figure.legends
    lines = zip(legend.get_texts(), legend.get_lines(), strict=True)
    width = {text.get_text(): line.get_linewidth() for text, line in lines}
    drawn = axes.collections[-1].get_linewidths()
    for name, shown in width.items():
        if name.endswith(" N"):  # lines of 2 N are drawn[1] wide
            assert shown == pytest.approx(0.5 * float(name[:-2]) * drawn[1], rel=0.03)
    assert sum(name.endswith(" N") for name in width) == 2
    assert drawn[2] / drawn[0] == pytest.approx(3.0)


def test_values_beyond_a_signed_scale_have_the_colors_of_its_ends():
    pytest.importorskip("matplotlib")
    from multicor_cli.plots.grain_map import _colors

    colors = _colors(SimpleNamespace(names=(), field=MAPPED["velocity-y"]))
    assert colors(-0.1) == colors(0.0)
    assert colors(1.1) == colors(1.0)


def test_what_has_received_no_heat_is_not_black():
    pytest.importorskip("matplotlib")
    from multicor_cli.plots.grain_map import _colors, color_scale

    scene, value = SimpleNamespace(radius=np.ones(4)), np.array([-1.0, 0.0, 1e-6, 1.0])
    table = SimpleNamespace(names=(), field=MAPPED["heat"], value=value, scene=scene)
    norm, extend = color_scale(table)
    colors = _colors(table)(norm(value))
    assert np.array_equal(colors[:2], np.ones((2, 4)))  # white
    assert colors[3, :3].mean() > 0.5
    assert extend == "min"

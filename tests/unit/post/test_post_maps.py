"""Maps of how far grains have come and turned, and how values become colors and widths."""

import numpy as np
import pytest

import multicor_cli as multicor
from multicor_cli import post
from multicor_cli.post.quantities import MAPPED, color_range

FLIGHT = {
    "scenario": {"name": "flight", "seed": 1},
    "domain": {"size": [0.02, 0.02], "periodic": True, "gravity": [0.0, 0.0]},
    "materials": {"glass": {"density": 2500.0}},
    "contacts": [{"pair": ["*", "*"], "friction": 0.3}],
    "particles": [
        {
            "name": "one", "material": "glass", "shape": "disc", "thickness": 1e-3, "count": 1,
            "velocity": [1.0, -0.1],
            "spin": -7.0, "sizes": {"kind": "list", "radii": [0.5e-3]},
            "packing": {"kind": "random"},
            "region": {"min": [0.0, 0.012], "max": [0.02, 0.014]},
        }
    ],
    "loading": [{"duration": 0.05}],
    "solver": {"dt": 1e-4},
    "output": {"frame_interval": 0.01},
}  # fmt: skip


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    directory = tmp_path_factory.mktemp("flight") / "run"
    multicor.run(multicor.Scenario.from_dict(FLIGHT), directory)
    with multicor.open_run(directory) as run:
        yield run


@pytest.mark.parametrize(("of", "rate"), [("displacement", np.hypot(1.0, 0.1)), ("rotation", -7.0)])
def test_a_grain_that_flies_freely_comes_as_far_as_its_velocity_says(flight, of, rate):
    for k, frame in enumerate(flight.frames):  # it passes the ends of the period twice
        assert post.grain_map(flight, of, k).value == pytest.approx(
            rate * frame.time, rel=1e-12, abs=1e-15
        )


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

    count = 4
    force = np.column_stack([[1.0, 2.0, 3.0, 2.0], np.zeros(count)])  # mean 2
    scene = post.make_scene(flight, flight.frames[0])
    ends = np.linspace(0.0, 0.01, count)[:, np.newaxis] + np.zeros(2)
    contacts = {
        "i": np.arange(count),
        "j": np.arange(count),
        "start": ends,
        "end": ends + 1e-3,
        "sliding": np.zeros(count, bool),
    }
    network = post.force_network(flight).with_(scene=scene, force=force, **contacts)
    figure = Figure()
    axes = figure.add_subplot()
    draw_forces(axes, network)
    legend = {
        text.get_text(): line.get_linewidth() for text, line in zip(*_legend(figure), strict=True)
    }
    drawn = axes.collections[-1].get_linewidths()
    assert legend["2 N"] == pytest.approx(drawn[1])
    assert legend["6 N"] == pytest.approx(3.0 * drawn[1])
    assert drawn[2] / drawn[0] == pytest.approx(3.0)


def _legend(figure):
    (legend,) = figure.legends
    return legend.get_texts(), legend.get_lines()


def test_values_beyond_a_signed_scale_have_the_colors_of_its_ends():
    pytest.importorskip("matplotlib")
    from multicor_cli.plots.grain_map import _colors

    class Table:
        names = ()
        field = MAPPED["velocity-y"]

    colors = _colors(Table)
    assert colors(-0.1) == colors(0.0)
    assert colors(1.1) == colors(1.0)


def test_what_has_received_no_heat_is_not_black():
    pytest.importorskip("matplotlib")
    from multicor_cli.plots.grain_map import _colors, color_scale

    class Table:
        names = ()
        field = MAPPED["heat"]
        value = np.array([-1.0, 0.0, 1e-6, 1.0])
        scene = type("Scene", (), {"radius": np.ones(4)})

    norm, extend = color_scale(Table)
    colors = _colors(Table)(norm(Table.value))
    assert np.array_equal(colors[:2], np.ones((2, 4)))  # white
    assert colors[3, :3].mean() > 0.5
    assert extend == "min"

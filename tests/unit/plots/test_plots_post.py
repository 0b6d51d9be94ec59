"""Figures of rheology, energy, force statistics, comparisons and streamlines: what is drawn. How
they look is for eyes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from heat_run import write_heated_run

from multicor_cli.plots import (
    draw_angles,
    draw_comparison,
    draw_distribution,
    draw_energy,
    draw_map,
    draw_rheology,
    plot,
)
from multicor_cli.plots.fields import _draw_mesh
from multicor_cli.plots.grain_map import place_scene, smooth_field
from multicor_cli.plots.style import house_style
from multicor_cli.post import (
    MAPPED,
    Column,
    GrainMap,
    Selection,
    angular_distribution,
    compare,
    energy,
    fields,
    force_distribution,
    force_network,
    grain_map,
    profiles,
    rheology,
    theta_eta,
)
from multicor_cli.post.grain_map import GrainScene
from multicor_cli.store import Run, open_run

ALL = Selection(start=0.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = tmp_path_factory.mktemp("run") / "run"
    write_heated_run(path)
    return open_run(path)


def make_figure():
    from matplotlib.figure import Figure

    return Figure(layout="constrained")


def test_rheology_has_a_panel_for_each_quantity_with_its_mean(run: Run) -> None:
    table = rheology(run, ALL)
    with house_style():
        figure = make_figure()
        draw_rheology(figure, table)
    panels = figure.axes
    assert len(panels) == 8
    assert figure.legends[0].get_texts()[0].get_text() == "mean"
    assert all("[" in panel.get_ylabel() for panel in panels)
    solid = next(panel for panel in panels if "solid" in panel.get_ylabel())
    assert solid.lines[0].get_ydata() == pytest.approx(table.values["solid_fraction"])
    assert solid.lines[1].get_ydata()[0] == pytest.approx(table.mean["solid_fraction"])
    assert "time" in panels[-1].get_xlabel()


def test_energy_stacks_what_came_in_and_what_went_out(run: Run) -> None:
    with house_style():
        figure = make_figure()
        draw_energy(figure, energy(run))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == [
        "energy since the start [J]",
        "heat since the start [J]",
        "closure [–]",
        "closure [–]",
    ]
    heat = figure.axes[1]
    assert [text.get_text() for text in heat.get_legend().get_texts()] == ["stored"]
    lowest = min(
        path.vertices[:, 1].min() for area in heat.collections for path in area.get_paths()
    )
    assert lowest == pytest.approx(-energy(run).books["heat_stored"][-1])


def test_distributions_show_bins_with_forces_only(run: Run) -> None:
    table = force_distribution(run, ALL)
    with house_style():
        axes = make_figure().add_subplot()
        draw_distribution(axes, table)
    assert axes.lines[0].get_ydata() == pytest.approx(table.normal[table.count > 0])
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_a_polar_map_ends_where_the_grains_do(run: Run) -> None:
    table = fields(
        run, ["velocity-t"], ALL, center=tuple(grain_map(run, "speed").scene.box[0]), reach=4.0
    )
    with house_style():
        mesh, _ = _draw_mesh(make_figure().add_subplot(), table, table.of[0])
    shown = ~np.ma.getmaskarray(mesh.get_array()).reshape(table.points.shape[::-1]).T.ravel()
    assert table.scene.period > 0.0  # nothing is beyond the grains to the side
    height, reach = table.points.at[shown, 1], table.scene.radius
    assert shown.any()
    assert height.min() >= (table.scene.center[:, 1] - reach).min()
    assert height.max() <= (table.scene.center[:, 1] + reach).max()
    assert np.isfinite(table.values["velocity-t"][~shown]).any()


def test_angles_are_polar_histograms_with_their_second_harmonic(run: Run) -> None:
    table = angular_distribution(run, ALL)
    with house_style():
        figure = make_figure()
        draw_angles(figure, table)
    contacts, forces = figure.axes
    assert [bar.get_height() for bar in contacts.patches] == pytest.approx(table.density)
    assert [bar.get_height() for bar in forces.patches] == pytest.approx(
        np.nan_to_num(table.normal)
    )
    assert contacts.lines[0].get_ydata().max() == pytest.approx(
        0.5 / np.pi * (1.0 + table.moments["a_c"]), rel=1e-3
    )
    assert f"{table.moments['a_c']:.3f}" in contacts.get_title()


def test_comparison_shows_both_profiles_and_their_difference(run: Run) -> None:
    found = compare(run, run, of=["velocity", "temperature"], selection=ALL, names=("one", "two"))
    with house_style():
        figure = make_figure()
        draw_comparison(figure, found)
    assert len(figure.axes) == 4
    left, right = figure.axes[:2]
    assert [line.get_label() for line in left.lines] == ["one", "two"]
    assert left.lines[1].get_xdata() == pytest.approx(found.profiles["velocity"].second.value)
    assert np.abs(right.lines[-1].get_xdata()).max(initial=0.0) == 0.0


def make_vortex(n: int = 4000) -> GrainMap:
    """Rigid rotation about (0.5, 0.5)."""
    rng = np.random.default_rng(0)
    center = rng.random((n, 2))
    vector = np.column_stack([0.5 - center[:, 1], center[:, 0] - 0.5])
    scene = GrainScene(center, np.full(n, 0.005), [], 0.0, np.array([[0.0, 0.0], [1.0, 1.0]]))
    speed = Column("value", "m/s", np.hypot(*vector.T))
    return GrainMap(
        (), {}, [speed], field=MAPPED["fluctuation"], scene=scene, vector=vector, names=()
    )


def test_smooth_field_is_the_local_mean() -> None:
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


def test_smooth_field_goes_around_the_ends_of_the_period_and_leaves_empty_regions_out() -> None:
    table = make_vortex()
    low = table.scene.center[:, 1] < 0.5
    for period in (0.0, 1.0):
        scene = replace(
            table.scene,
            period=period,
            center=table.scene.center[low],
            radius=table.scene.radius[low],
        )
        right = scene.center[:, 0] > 0.5
        half = table.with_(
            scene=scene,
            value=table.value[low],
            vector=np.column_stack([np.where(right, 1.0, 0.0), 0.0 * right]),
        )
        x, y, field = smooth_field(half)
        assert np.isnan(field[y > 0.7]).all()
        beside = field[10, 0, 0]  # next to x = 0, where the neighbors are beyond the period
        assert beside > 0.3 if period else beside < 1e-3
        assert x[0] < 0.02


def test_map_has_streamlines_or_arrows(run: Run) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.quiver import Quiver

    table = make_vortex(500)
    for has_streamlines in (True, False):
        with house_style():
            place = place_scene(make_figure(), table.scene)
            draw_map(place, table, has_streamlines=has_streamlines)
        axes = place.axes
        lines = [
            c
            for c in axes.collections
            if isinstance(c, LineCollection) and len(c.get_segments()) > 5
        ]
        assert bool(lines) is has_streamlines
        assert any(isinstance(c, Quiver) for c in axes.collections) is not has_streamlines
    with house_style():
        still = grain_map(run, "fluctuation", 0)
        draw_map(place_scene(make_figure(), still.scene), still)  # at rest: no lines, no error


def test_figures_are_written_and_reproducible(run: Run, tmp_path: Path) -> None:
    for name in ("a", "b"):
        plot(rheology(run, ALL), tmp_path / f"rheology-{name}.svg")
        plot(energy(run), tmp_path / f"energy-{name}.svg")
        plot(force_distribution(run, ALL), tmp_path / f"distribution-{name}.svg")
        plot(angular_distribution(run, ALL), tmp_path / f"angles-{name}.svg")
        plot(compare(run, run, selection=ALL), tmp_path / f"compare-{name}.svg")
        plot(profiles(run, "stress", ALL), tmp_path / f"stress-{name}.svg")
        plot(make_vortex(300), tmp_path / f"map-{name}.svg")
        plot(force_network(run), tmp_path / f"forces-{name}.svg")
        plot(theta_eta(run, wall="top"), tmp_path / f"theta-{name}.svg")
    written = sorted(path.name for path in tmp_path.iterdir())
    assert len(written) == 18
    for first, second in zip(written[::2], written[1::2], strict=True):
        assert (tmp_path / first).read_bytes() == (tmp_path / second).read_bytes()

"""Figures of profiles: what is drawn, labeled and written. How they look is for eyes."""

import sys

import numpy as np
import pytest
from drawn import figure_of, panel_of
from made_up_frames import profile_of

from multicor_cli.optional import MissingLibrary
from multicor_cli.plots import PlotError, plot
from multicor_cli.plots.profile import FIGURES, axis_labels, draw_profile
from multicor_cli.plots.style import COLUMN
from multicor_cli.post import Selection
from multicor_cli.post.profile import profiles
from multicor_cli.store import open_run


def make_table(*, error=0.01, low=0.0):
    y = np.linspace(0.05, 0.95, 10)
    return profile_of("velocity", y, 0.3 * y, error, at_walls=(low, 0.3), shear_rate=0.3 - low)


def test_axes_carry_quantity_and_unit():
    assert axis_labels(make_table()) == ("horizontal velocity $v_x$ [m/s]", "height $y$ [m]")
    across, upwards = axis_labels(make_table().normalized())
    assert "wall" in across
    assert upwards == "height $y/H$ [–]"
    assert "v_0" in axis_labels(make_table(low=-0.3).normalized())[0]


def test_bands_are_errors_around_the_mean_where_there_are_any():
    axes = panel_of(draw_profile, make_table())
    line, band = axes.lines[0], axes.collections[0]
    assert np.allclose(line.get_xdata(), make_table().value)
    edges = band.get_paths()[0].vertices
    assert edges[:, 0].min() == pytest.approx(make_table().value[0] - 0.01)
    assert edges[:, 0].max() == pytest.approx(make_table().value[-1] + 0.01)
    assert axes.get_ylim() == (0.0, 1.0)
    assert axes.get_legend() is not None
    axes = panel_of(draw_profile, make_table(error=np.nan))
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["mean, errors not known"]


def test_errors_that_are_not_known_leave_no_islands():
    """Each known error is a box about its value, each other value a hollow marker."""
    table = make_table()
    error = table.error.copy()
    error[[0, 2, 3, 5]] = np.nan
    axes = panel_of(draw_profile, table.with_(error=error))
    known = np.isfinite(error)
    assert len(axes.patches) == known.sum()
    for box, k in zip(axes.patches, np.flatnonzero(known), strict=True):
        sides = box.get_x() + 0.01, box.get_width(), box.get_y() + 0.05, box.get_height()
        assert sides == pytest.approx((table.value[k], 0.02, table.y[k], 0.1))
    hollow = axes.lines[-1]
    assert hollow.get_ydata().tolist() == table.y[~known].tolist()
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(texts) == ["mean", "mean, error not known", "standard error"]
    only = profile_of("velocity", np.array([0.5]), np.array([0.1]), 0.02)
    (box,) = panel_of(draw_profile, only).patches
    assert (box.get_y(), box.get_height(), box.get_width()) == pytest.approx((0.0, 1.0, 0.04))


def test_fields_in_several_units_have_an_axis_each(shaped):
    """Order and director have a panel each, beside each other; stresses share one."""
    with open_run(shaped) as run:
        nematic, stress = (profiles(run, of, Selection(start=0.0)) for of in ("nematic", "stress"))
    renderer = FIGURES[type(nematic)]
    order, director = figure_of(renderer.draw, nematic).axes
    assert order.get_xlabel() == "nematic order $S$ [–]"
    assert director.get_xlabel() == r"director of the long axes $\theta_S$ [°]"
    assert (order.get_ylabel(), director.get_ylabel()) == ("height $y$ [m]", "")
    for axes, table in zip((order, director), nematic.tables, strict=True):
        assert axes.lines[0].get_xdata() == pytest.approx(table.value, nan_ok=True)
    (only,) = figure_of(renderer.draw, stress).axes
    assert only.get_xlabel() == "contact stress, compression positive [N/m]"
    assert renderer.text(nematic, None).count("height y [m]") == 2
    assert renderer.text(stress, None).count("height y [m]") == 1


def test_figures_are_a_column_wide_and_reproducible(tmp_path):
    from PIL import Image

    for name in ("a.png", "b.png", "a.svg", "b.svg", "a.pdf", "b.pdf"):
        plot(make_table(), tmp_path / name)
    for suffix in ("png", "svg", "pdf"):
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
    with Image.open(tmp_path / "a.png") as image:
        assert image.width == pytest.approx(300 * COLUMN, abs=2)
    assert "velocity" in (tmp_path / "a.svg").read_text()  # text stays text


def test_unknown_formats_and_missing_libraries_are_named(tmp_path, monkeypatch):
    with pytest.raises(PlotError, match=r"\.png, \.svg, \.pdf"):
        plot(make_table(), tmp_path / "a.jpg")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(
        MissingLibrary, match="figures need matplotlib, which is not installed: pip install"
    ):
        plot(make_table(), tmp_path / "a.png")

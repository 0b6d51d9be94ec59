"""Tables as DataFrames and in notebooks; distributions and θ over several frames."""

import sys

import numpy as np
import pytest
from page_tables import MEASURED, POST, with_tables

from multicor_cli import post
from multicor_cli.optional import MissingLibrary
from multicor_cli.post import QUANTITIES
from multicor_cli.post.compare import _labels
from multicor_cli.post.sums import scatter


def test_frames_of_pandas_have_names_and_units(column):
    pytest.importorskip("pandas")
    table = post.profile(column, "temperature", post.Selection(start=0.0))
    frame = table.to_pandas()
    units = {"y": "m", "temperature": "K", "standard error": "K", "area": "m2"}
    assert list(frame.columns) == list(units)
    assert frame.attrs["units"] == units
    assert frame["temperature"].to_numpy() == pytest.approx(table.value, nan_ok=True)
    books = post.energy(column)
    at_end = books.to_pandas().set_index("quantity")
    assert at_end.loc["lost to friction", "unit"] == "J"
    assert at_end.loc["heat stored in the grains", "at the end"] == books.books["heat_stored"][-1]
    assert len(books.to_pandas(is_detailed=True)) == books.time.size
    with pytest.raises(ValueError, match="no details"):
        table.to_pandas(is_detailed=True)


def test_without_pandas_the_extra_is_named(column, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingLibrary, match=r"multicor-cli\[study\]"):
        post.energy(column).to_pandas()


def test_tables_show_themselves(column):
    table = post.profile(column, "temperature", post.Selection(start=0.0), 3)
    assert repr(table).startswith("<ProfileTable: 3 rows of y [m], temperature [K]")
    assert table._repr_html_().count("<tr>") == 4


@pytest.mark.parametrize("wrong", [None, 5, "velocity"])
def test_figures_are_drawn_of_tables(wrong, column, tmp_path):
    pytest.importorskip("matplotlib")
    from multicor_cli.plots import plot

    with pytest.raises(TypeError, match="drawn of tables of"):
        plot(column if wrong is None else wrong, tmp_path / "a.png")


def test_other_values_leave_everything_else_as_it_is(column):
    table = post.energy(column).with_(time=post.energy(column).time + 1.0)
    assert table.time[0] == post.energy(column).time[0] + 1.0
    table = post.series(column, ["kinetic", "max_overlap"])
    other = table.with_(kinetic=2.0 * table.values["kinetic"])
    assert other.mean["kinetic"] == pytest.approx(2.0 * table.mean["kinetic"])
    assert other.mean["max_overlap"] == table.mean["max_overlap"]
    assert other.rows[0][1] == other.mean["kinetic"]
    assert other.as_dict().keys() == table.as_dict().keys()


@pytest.mark.parametrize("bins", [0, -3, 10**9, 3.5, "many"])
@pytest.mark.parametrize("command", [
    lambda run, bins: post.profile(run, "velocity", bins=bins),
    lambda run, bins: post.force_distribution(run, bins=bins),
    lambda run, bins: post.angular_distribution(run, bins=bins),
    lambda run, bins: post.mobilization(run, bins=bins),
    lambda run, bins: post.pair_correlation(run, bins=bins),
    lambda run, bins: post.voronoi(run, bins=bins),
    lambda run, bins: post.theta_eta(run, wall="top", bins=bins),
])  # fmt: skip
def test_numbers_of_bins_are_whole_and_not_too_many(command, bins, column):
    with pytest.raises(post.PostError, match=r"must be a whole one|choose between 1 and 100000"):
        command(column, bins)


def test_bins_have_a_number_or_a_width(column):
    with pytest.raises(post.PostError, match="exclude each other"):
        post.profile(column, "velocity", bins=4, bin_width=2.0)


def test_theta_of_several_frames(column):
    chosen = post.Selection(frames=slice(-3, None))
    several = post.theta_eta(column, selection=chosen, wall="top", bins=4)
    single = [
        post.theta_eta(column, int(k), wall="top", bins=4, height=several.height)
        for k in several.frames
    ]
    assert several.eta.size == sum(one.eta.size for one in single)
    expected = np.std([one.mean for one in single], axis=0, ddof=1)
    assert several.scatter == pytest.approx(expected, nan_ok=True)
    assert np.isnan(single[0].scatter).all()
    assert len(several.headings) == len(several.rows[0]) == 1 + len(single[0].headings)
    assert len(single[0].rows[0]) == len(single[0].headings)


def test_distributions_of_several_frames_scatter_as_those_of_each(column):
    chosen = post.Selection(frames=slice(-3, None))
    for make, name in ((post.force_distribution, "normal"), (post.angular_distribution, "density")):
        several = make(column, chosen)
        alone = [
            make(column, post.Selection(frames=slice(k, k + 1))) for k in several.frames.tolist()
        ]
        expected = np.std([getattr(one, name) for one in alone], axis=0, ddof=1)
        assert getattr(several, f"{name}_scatter") == pytest.approx(expected)
        assert np.isnan(getattr(alone[0], f"{name}_scatter")).all()


def test_scatter_and_names_of_runs():
    rows = np.array([[1.0, np.nan], [2.0, 5.0], [4.0, np.nan]])
    assert scatter(rows) == pytest.approx([np.std([1.0, 2.0, 4.0], ddof=1), np.nan], nan_ok=True)
    friction, seed = ("contacts.0.friction", "0.3", "0.5"), ("scenario.seed", "1", "2")
    assert _labels([friction, seed], ("a", "b")) == ("friction = 0.3", "friction = 0.5")
    assert _labels([seed], ("a", "b")) == ("seed = 1", "seed = 2")
    assert _labels([friction, ("solver.dt", "1", "2")], ("a", "b")) == ("a", "b")
    assert _labels([], ("a", "b")) == ("a", "b")


def test_the_page_lists_what_is_measured():
    text = POST.read_text(encoding="utf-8")
    assert with_tables(text) == text, "run python tests/support/page_tables.py"


def test_one_quantity_has_one_name():
    """What has the name of a profile or map is called so everywhere; what is added says where."""
    called = {quantity.name.replace("-", "_"): quantity.label for quantity in QUANTITIES.values()}
    other = {
        "pressure",
        "fluctuation",
        "stress_xx",
        "stress_xy",
        "stress_yy",
    }  # of walls, of heat, …
    for command, quantities in MEASURED.items():
        for each in quantities:
            name = each.name.replace("-", "_")
            if name in called and name not in other:
                label = each.label.strip().removeprefix("of this ")
                assert label.startswith(called[name]), (command, each)

"""Energy books over time, and comparisons of two runs."""

from types import SimpleNamespace

import numpy as np
import pytest
from heat_run import GRAINS
from scenes import write_small

import multicor_cli as multicor
from multicor_cli.post import PostError, Selection, compare, energy, profile, rheology
from multicor_cli.post.energy import HEAT, MECHANICAL
from multicor_cli.store import open_run


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """The small run twice, with another seed and a faster wall."""
    path = tmp_path_factory.mktemp("pair")
    write_small(path)
    common = ["loading.0.duration=0.01", "loading.1.until.strain.value=3.0"]
    common += ["output.frame_interval=0.001"]
    other = ["scenario.seed=4", "loading.1.drives.top.x.velocity.ramp=[0.0, 0.2]"]
    for name, overrides in (("a", common), ("b", common + other)):
        multicor.run(path / "small.toml", path / name, overrides=overrides, threads=1)
    return open_run(path / "a"), open_run(path / "b")


def test_books_balance_in_every_row(pair):
    table = energy(pair[0])
    books = table.books
    came = sum(entry.sign * books[entry.name] for entry in table.entries if entry.sign)
    slack = 1e-12 * float(np.abs(books["wall_work"]).max())
    assert books["kinetic_gain"] - came == pytest.approx(books["imbalance"], abs=slack)
    assert table.heat_closure is None
    assert table.closure[-1] <= 1e-10
    labels = dict(table.rows)
    assert labels["lost to friction [J]"] == books["friction_loss"][-1] > 0.0
    lines = len(MECHANICAL) - 5  # no grains come or go, none adheres, expands or shrinks
    assert len(table.rows) == lines + 1
    assert len(table.detail_headings) == len(table.detail_rows[0]) == lines + 2
    assert len(table.detail_rows) == table.time.size == pair[0].series.row_count
    assert table.as_dict()["end"]["friction_loss"] == books["friction_loss"][-1]
    part = energy(pair[0], table.time[5], table.time[9])  # counts from the start as well
    assert part.books["wall_work"].tolist() == books["wall_work"][5:10].tolist()


def test_books_add_up_where_grains_come_and_go():
    """Made-up books: grains bring 5 J and take 2 J along, gravity works 1 J, friction takes 0.5 J;
    heat likewise."""
    names = [e.name for e in (*MECHANICAL, *HEAT) if e.name != "kinetic_gain"]
    values = {
        "kinetic_in": 5.0, "kinetic_out": 2.0, "gravity_work": 1.0, "friction_loss": 0.5,
        "kinetic": 3.5, "heat_friction": 0.5,
        "heat_out": 0.2, "heat_stored": 0.3,
    }  # fmt: skip
    series = {
        name: np.array([0.0, values.get(name, 0.0)])
        for name in (*names, "kinetic", "kinetic_start", "closure", "heat_closure")
    }
    table = energy(SimpleNamespace(series={"time": np.array([0.0, 1.0]), **series}))
    ends = {entry.name: entry.sign * table.books[entry.name][-1] for entry in table.entries}
    heat = sum(value for name, value in ends.items() if name.startswith("heat"))
    assert sum(ends.values()) - heat == pytest.approx(table.books["kinetic_gain"][-1])
    assert heat == pytest.approx(table.books["heat_stored"][-1])
    assert dict(table.rows)["brought by grains that came [J]"] == 5.0
    assert dict(table.rows)["heat taken along by grains that went [J]"] == 0.2


def test_books_of_heat(column):
    table = energy(column)
    assert table.heat_closure is not None
    assert table.books["heat_stored"][-1] == pytest.approx(column.series["heat_stored"][-1])
    assert (
        len(table.rows) == len(MECHANICAL) + len(HEAT) - 7 + 2
    )  # as above, no heat taken along or by a gradient
    assert len(table.detail_headings) == len(table.detail_rows[0])
    assert table.as_dict()["heat_closure"] == 1e-15


def test_comparison_of_two_runs(pair):
    later = Selection(start=0.03)
    found = compare(*pair, of=["velocity", "coordination"], selection=later, names=("a", "b"))
    keys = {key: (first, second) for key, first, second in found.keys}
    assert keys["scenario.seed"] == ("3", "4")
    assert "loading.1.drives.top.x.velocity.ramp.1" in keys
    assert len(keys) == 2
    numbers = {p.name: p for p in found.numbers}
    assert numbers["grain_count"].difference == 0.0
    assert numbers["friction_loss"].second == energy(pair[1]).books["friction_loss"][-1]
    one, two = (rheology(run, later) for run in pair)
    rate = numbers["shear_rate"]  # the ratios are those of plain loops in the verification
    assert rate.difference == pytest.approx(two.mean["shear_rate"] - one.mean["shear_rate"])
    speed = found.profiles["velocity"]
    assert speed.first.value.tolist() == profile(pair[0], "velocity", later).value.tolist()
    assert speed.second.y.size == speed.first.y.size
    assert np.isfinite(speed.ratio).any()
    assert len(found.detail_rows) == 2 * speed.y.size
    assert found.as_dict()["profiles"]["velocity"]["rms_difference_over_error"] == speed.rms_ratio
    assert len(found.rows) == len(found.numbers) + 2


def test_runs_that_are_not_alike_compare_in_what_they_share(pair, column):
    """No heat in common; one bin per grain of the column."""
    found = compare(column, pair[0], selection=Selection(frames=slice(-3, None)))
    names = {p.name for p in found.numbers}
    assert "wall_work" in names
    assert "heat_stored" not in names
    assert found.profiles["velocity"].y.size == GRAINS - 2  # a layer at each wall is left out
    with pytest.raises(PostError, match="no heat"):
        compare(column, pair[0], of=["temperature"])

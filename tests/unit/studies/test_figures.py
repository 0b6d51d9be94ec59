"""Points of figures out of tables made by hand, fits, formulas, and numbers with their errors."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from multicor_cli.plots.style import PlotError
from multicor_cli.studies.directory import StudyDirectory
from multicor_cli.studies.figure import draw, draw_into, draw_letters, fit, formula
from multicor_cli.studies.table import (
    PlotRequest,
    Row,
    Series,
    StudyTable,
    make_panels,
    over_seeds,
    with_error,
)

FRICTION, SPEED, KIND = "contacts.0.friction", "variables.speed", "particles.0.shape"


def table(*points, keys=(FRICTION, SPEED)):
    rows = tuple(
        Row(
            values,
            "finished",
            {"mu": (mu, 0.01, 3), "I": (2.0 * mu, 0.02, 3)},
            {"mu": 0.02},
            "ok",
            0.1,
        )
        for values, mu in points
    )
    return StudyTable(keys, ("mu", "I"), rows, is_mean=True, directory=StudyDirectory(Path("none")))


def grid(*more):
    return [
        ({FRICTION: friction, SPEED: speed, **dict(more)}, friction + speed)
        for speed in (3.0, 1.0, 2.0)
        for friction in (0.2, 0.4)
    ]


def test_series_by_all_other_keys_and_ascending():
    (panel,) = make_panels(table(*grid()), PlotRequest("mu", "speed"))
    assert [line.label for line in panel.series] == ["friction = 0.2", "friction = 0.4"]
    assert panel.series[0].x.tolist() == [1.0, 2.0, 3.0]
    assert panel.series[0].y == pytest.approx([1.2, 2.2, 3.2])
    assert panel.series[0].error.tolist() == [0.02] * 3  # the larger one
    assert np.isnan(panel.series[0].x_error).all()


def test_panels_and_some_values_of_a_key():
    panels = make_panels(table(*grid()), PlotRequest("mu", "speed", facet="friction"))
    assert [panel.title for panel in panels] == ["friction = 0.2", "friction = 0.4"]
    assert [[line.label for line in panel.series] for panel in panels] == [[""], [""]]
    (panel,) = make_panels(table(*grid()), PlotRequest("mu", "speed", where=(("friction", "0.4"),)))
    assert [line.label for line in panel.series] == [""]
    with pytest.raises(PlotError, match=r"has no value 0.3; it has 0.2, 0.4"):
        make_panels(table(*grid()), PlotRequest("mu", "speed", where=(("friction", "0.3"),)))


def test_values_that_are_alike_to_six_digits_are_told_apart():
    a, b = 0.1234561, 0.1234562
    rows = [({FRICTION: f, SPEED: s}, f) for f in (a, b) for s in (1.0, 2.0)]
    (panel,) = make_panels(table(*rows), PlotRequest("mu", "speed"))
    assert [line.label for line in panel.series] == [f"friction = {value}" for value in (a, b)]
    (panel,) = make_panels(
        table(*rows), PlotRequest("mu", "speed", where=(("friction", "0.1234562"),))
    )
    assert [line.y.tolist() for line in panel.series] == [[b, b]]


def test_an_observable_across():
    """The key with the most values runs along each series."""
    (panel,) = make_panels(table(*grid()), PlotRequest("mu", "I"))
    assert [line.label for line in panel.series] == ["friction = 0.2", "friction = 0.4"]
    assert panel.series[1].x == pytest.approx([2.8, 4.8, 6.8])
    assert panel.series[1].x_error.tolist() == [0.02] * 3


def test_points_at_the_same_place_are_refused():
    points = [*grid((KIND, "disc")), *grid((KIND, "polygon"))]
    found = table(*points, keys=(FRICTION, SPEED, KIND))
    assert len(make_panels(found, PlotRequest("mu", "speed"))[0].series) == 4
    with pytest.raises(
        PlotError,
        match=(
            r"points of friction = 0.2 differ by shape as well: choose with --by, --facet or "
            r"--where shape"
        ),
    ):
        make_panels(found, PlotRequest("mu", "speed", by="friction"))
    assert len(make_panels(found, PlotRequest("mu", "speed", by="friction", facet="shape"))) == 2
    with pytest.raises(PlotError, match="no numbers"):
        make_panels(found, PlotRequest("mu", "shape"))


@pytest.mark.parametrize(("question", "what"), [
    (PlotRequest("nu", "speed"), "observes no nu; it observes mu, I"),
    (PlotRequest("mu", "sped"), "varies no sped; it varies friction, speed"),
    (PlotRequest("mu", "speed", by="x"), "varies no x"),
])  # fmt: skip
def test_what_is_not_there(question, what):
    with pytest.raises(PlotError, match=what):
        make_panels(table(*grid()), question)


def test_figures_are_drawn(tmp_path):
    question = PlotRequest("mu", "speed", facet="friction")
    found = table(*grid())
    panels = make_panels(found, question)
    fits = [[fit("line", line) for line in panel.series] for panel in panels]
    draw(
        tmp_path / "a.svg",
        found,
        panels,
        question,
        fits,
        [formula("law: 1 + x"), formula("1 / (x - 1)")],
        log="xy",
    )
    text = (tmp_path / "a.svg").read_text()
    assert all(word in text for word in ("friction = 0.4", "law", "speed"))
    letters = draw_letters(found, panels, question)
    assert letters.count("friction = ") == 2


@pytest.mark.parametrize("speeds", [(1.0, 2.0, 3.0), (0.02, 0.1, 0.9), (1e-4, 0.03, 20.0)])
def test_labels_of_logarithmic_axes_do_not_lie_over_each_other(speeds):
    """And a symbol is in italics: an upright I reads as a bar."""
    from matplotlib.figure import Figure

    points = [({FRICTION: 0.2, SPEED: speed}, 0.3 + 0.01 * speed) for speed in speeds]
    found, question = table(*points), PlotRequest("I", "speed")
    figure = Figure((3.4, 2.7), layout="constrained")
    draw_into(figure, found, make_panels(found, question), question, [], log="x")
    figure.draw_without_rendering()
    (axes,) = figure.axes
    assert axes.get_ylabel() == "$I$"
    shown = [
        label
        for label in [*axes.get_xticklabels(), *axes.get_xticklabels(minor=True)]
        if label.get_text()
        and axes.bbox.x0 <= label.get_window_extent().get_points()[:, 0].mean() <= axes.bbox.x1
    ]
    ends = sorted(label.get_window_extent().get_points()[:, 0].tolist() for label in shown)
    assert len(ends) >= 2
    assert all(left[1] < right[0] for left, right in itertools.pairwise(ends))


def test_curves_are_found_and_told():
    x = np.geomspace(0.003, 0.3, 12)
    for kind, y in (
        ("line", 1.0 + 2.0 * x), ("power", 3.0 * x**0.4), ("mu-of-I", 0.25 + 0.5 / (1.0 + 0.2 / x)),
    ):  # fmt: skip
        found = fit(kind, Series("", x, y, np.full(12, 1e-3), np.full(12, math.nan)))
        assert found.value(x) == pytest.approx(y, rel=1e-6), kind
    with pytest.raises(PlotError, match="needs 4 points"):
        fit("mu-of-I", Series("", x[:3], x[:3], x[:3], x[:3]))
    law = formula("da Cruz 2005, μ = 0.4: 0.25 + 1.1*x")
    assert law.text == "da Cruz 2005, μ = 0.4"
    assert law.value(np.array([0.0, 0.1])) == pytest.approx([0.25, 0.36])
    assert math.isnan(formula("1/x").value(np.zeros(1))[0])
    for bad in ("a: y + 1", "a: 1 +", "__import__('os')"):
        with pytest.raises(PlotError, match="--curve"):
            formula(bad)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.25923, 0.00182, "0.2592 ± 0.0018"), (26.61, 0.4, "26.61 ± 0.40"), (0.5, math.nan, "0.5"),
        (math.nan, 1.0, "–"),
        (1234567.0, 2300.0, "(1.2346 ± 0.0023)e+6"), (4e-9, 2e-10, "(4.00 ± 0.20)e-9"),
        (3.0, 0.0, "3"),
    ],
)  # fmt: skip
def test_numbers_with_errors(value, error, text):
    assert with_error(value, error) == text


def test_keys_have_other_headings_than_observables():
    keys, row = ("variables.mu", "variables.P"), Row({}, "finished", {}, {}, "ok", 0.1)
    table = StudyTable(keys, ("mu",), (row,), is_mean=False, directory=StudyDirectory(Path("none")))
    assert table.headings[:4] == ["variables.mu", "P", "status", "mu"]
    assert table.lines[0][:4] == table.headings[:4]
    assert len({*table.headings}) == len(table.headings)


@pytest.mark.parametrize(("hours", "why"), [
    (0.1, "no case that has finished has mu"), (math.nan, "no case with mu has finished yet"),
])  # fmt: skip
def test_what_no_case_has_is_said(hours, why):
    rows = tuple(Row({FRICTION: mu}, "", {}, {}, "", hours) for mu in (0.2, 0.4))
    table = StudyTable(
        (FRICTION,), ("mu",), rows, is_mean=False, directory=StudyDirectory(Path("none"))
    )
    with pytest.raises(PlotError, match=why):
        make_panels(over_seeds(table), PlotRequest("mu", FRICTION))


def test_means_over_seeds():
    rows = tuple(Row({FRICTION: 0.2, "scenario.seed": seed}, "finished", {"mu": (mu, 0.03, 1)}, {},
        "ok", 0.1)
                 for seed, mu in ((1, 0.1), (2, 0.2), (3, 0.6)))  # fmt: skip
    mean = over_seeds(StudyTable(
        (FRICTION, "scenario.seed"), ("mu",), rows, is_mean=False,
        directory=StudyDirectory(Path("none")),
    ))  # fmt: skip
    (row,) = mean.rows
    assert row.numbers["mu"] == pytest.approx((0.3, 0.03 / math.sqrt(3.0), 3))
    assert row.between["mu"] == pytest.approx(np.std([0.1, 0.2, 0.6], ddof=1) / math.sqrt(3.0))
    assert mean.lines[1] == [["0.2", "3 of 3 finished", "0.30 ± 0.15", "ok", "0.3"]]

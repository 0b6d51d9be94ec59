"""Charts of letters: every point where it belongs, ends of the axes named."""

from __future__ import annotations

import numpy as np

from multicor_cli.plots.text_chart import HEIGHT, WIDTH, TextLine, draw_text


def area(chart: str) -> list[str]:
    """The rows between the axes, padded."""
    return [row.split(" |", 1)[1].ljust(WIDTH) for row in chart.splitlines() if " |" in row]


def test_straight_line_goes_from_corner_to_corner_without_gaps() -> None:
    chart = draw_text([TextLine("", np.array([1.0, 3.0]), np.array([-2.0, 5.0]))], "time [s]", "height [m]")
    rows = area(chart)
    assert len(rows) == HEIGHT
    assert (rows[0][WIDTH - 1], rows[-1][0]) == ("*", "*")
    assert all("*" in row for row in rows)
    assert all(any(row[column] == "*" for row in rows) for column in range(WIDTH))
    lines = chart.splitlines()
    assert lines[0].strip() == "height [m]"
    assert lines[1].startswith(" 5 |") or lines[1].split("|")[0].strip() == "5"
    assert lines[HEIGHT].split("|")[0].strip() == "-2"
    assert lines[-1].split() == ["1", "time", "[s]", "3"]


def test_several_lines_have_letters_and_the_first_is_in_front() -> None:
    x = np.array([0.0, 1.0])
    chart = draw_text([TextLine("one", x, x), TextLine("two", x, 1.0 - x)], "x", "y")
    rows = area(chart)
    assert (rows[0][WIDTH - 1], rows[-1][0], rows[0][0], rows[-1][WIDTH - 1]) == ("a", "a", "b", "b")
    assert chart.splitlines()[-2:] == ["  a  one", "  b  two"]
    same = area(draw_text([TextLine("one", x, x), TextLine("two", x, x)], "x", "y"))
    assert not any("b" in row for row in same)


def test_points_that_are_not_known_are_left_out() -> None:
    chart = draw_text([TextLine("", np.array([0.0, 1.0, 2.0]), np.array([1.0, np.nan, 3.0]))], "x", "y")
    assert sum("*" in row for row in area(chart)) == HEIGHT
    assert draw_text([TextLine("", np.array([0.0]), np.array([np.nan]))], "x", "y") == "y: nothing to draw"
    assert draw_text([], "x", "y") == "y: nothing to draw"


def test_constant_and_single_points_lie_in_the_middle() -> None:
    rows = area(draw_text([TextLine("", np.array([2.0]), np.array([0.0]))], "x", "y"))
    assert "".join(rows).count("*") == 1
    assert any(0.4 * HEIGHT < number < 0.6 * HEIGHT and "*" in row for number, row in enumerate(rows))

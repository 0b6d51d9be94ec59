"""What figures have in common: axes of small rises, charts of letters, pictures in the terminal."""

import re

import numpy as np
import pytest
from cells import square_of_discs
from layers import layer, sliding
from made_up_frames import profile_of
from made_up_groups import dropped, mixed, parted, stayed
from matplotlib.figure import Figure

from multicor_cli import post
from multicor_cli.plots import Terminal, show, style
from multicor_cli.plots.profile import draw_profile
from multicor_cli.post.lattice import Lattice

# ---- Axes of temperatures that differ by millikelvin


@pytest.mark.parametrize(("low", "high", "expected"), [
    (298.15, 298.18, 298.15), (298.1503, 298.1553, 298.15), (298.15512, 298.15538, 298.155),
    (298.15021, 298.1508, 298.15), (298.15512, 298.15518, 298.1551),
    (298.149, 298.16, 298.15),  # it started there, and one grain has cooled
    (298.147, 298.16, 298.14), (298.15, 298.60, None), (298.15, 298.15, None),
    (298.15, 298.15 + 1e-13, None),  # a mean over grains that are all as warm
])  # fmt: skip
def test_reference_is_a_round_temperature_near_the_lowest(low, high, expected):
    reference = style.rise_reference("K", low, high)
    assert reference is None if expected is None else reference == pytest.approx(expected, abs=1e-9)
    assert style.rise_reference("m/s", low, high) is None  # only kelvin have an arbitrary zero


def test_numbers_are_millikelvin_above_it():
    show = style.rise_formatter(298.15)
    assert [show(value, 0) for value in (298.15, 298.1525, 298.149)] == ["0", "2.5", "−1"]
    assert style.rise_label("temperature", "T", 298.15) == "temperature $T$ − 298.15 K [mK]"


def test_profile_of_a_small_rise_has_no_offset_beside_its_label():
    y = np.linspace(0.05, 0.95, 10)
    table = profile_of("temperature", y, 298.15 + 5e-3 * y, 1e-5, at_walls=(298.15, 298.15))
    with style.house_style():
        figure = Figure()
        axes = figure.add_subplot()
        draw_profile(axes, table)
        figure.draw_without_rendering()
    assert axes.get_xlabel() == "temperature $T$ − 298.15 K [mK]"
    assert axes.xaxis.get_offset_text().get_text() == ""
    texts = filter(None, (label.get_text() for label in axes.get_xticklabels()))
    shown = [float(text.replace("−", "-")) for text in texts]
    assert 0.0 <= min(shown) < max(shown) <= 6.0


# ---- Charts of letters: every point where it belongs, ends of the axes named


def area(chart):
    """The rows between the axes, padded."""
    return [row.split(" |", 1)[1].ljust(style.WIDTH) for row in chart.splitlines() if " |" in row]


def chart(x, y, *names, **options):
    """A chart of one line."""
    return style.draw_text(
        [style.TextLine("", np.array(x), np.array(y))], *(names or ("x", "y")), **options
    )


def test_straight_line_goes_from_corner_to_corner_without_gaps():
    drawn = chart([1.0, 3.0], [-2.0, 5.0], "time [s]", "height [m]")
    rows = area(drawn)
    assert len(rows) == style.HEIGHT
    assert (rows[0][style.WIDTH - 1], rows[-1][0]) == ("*", "*")
    assert all("*" in row for row in rows)
    assert all(any(row[column] == "*" for row in rows) for column in range(style.WIDTH))
    lines = drawn.splitlines()
    assert lines[0].strip() == "height [m]"
    assert lines[1].startswith(" 5 |") or lines[1].split("|")[0].strip() == "5"
    assert lines[style.HEIGHT].split("|")[0].strip() == "-2"
    assert lines[-1].split() == ["1", "time", "[s]", "3"]


def test_several_lines_have_letters_and_the_first_is_in_front():
    x = np.array([0.0, 1.0])
    drawn = style.draw_text(
        [style.TextLine("one", x, x), style.TextLine("two", x, 1.0 - x)], "x", "y"
    )
    rows = area(drawn)
    corners = (rows[0][style.WIDTH - 1], rows[-1][0], rows[0][0], rows[-1][style.WIDTH - 1])
    assert corners == ("a", "a", "b", "b")
    assert drawn.splitlines()[-2:] == ["  a  one", "  b  two"]
    same = area(
        style.draw_text([style.TextLine("one", x, x), style.TextLine("two", x, x)], "x", "y")
    )
    assert not any("b" in row for row in same)


def test_points_that_are_not_known_are_left_out_and_constant_ones_in_the_middle():
    known, unknown = chart([0.0, 1.0, 2.0], [1.0, np.nan, 3.0]), chart([0.0], [np.nan])
    assert sum("*" in row for row in area(known)) == style.HEIGHT
    assert unknown == style.draw_text([], "x", "y") == "y: nothing to draw"
    marked = ["*" in row for row in area(chart([2.0], [0.0]))]
    assert sum(marked) == 1
    assert 0.4 * style.HEIGHT < marked.index(True) < 0.6 * style.HEIGHT


# ---- Figures for the terminal: every table has one, and pictures of grains have the colors of the
#      figures in files

ALL = post.Selection(start=0.0)
TERMINAL = Terminal(columns=40, rows=20)


def test_every_table_can_be_shown_in_a_terminal(column):
    arranged = post.pair_correlation(column, ALL, 1.0, margin=0.0)
    of_waves = post.structure_factor(square_of_discs([0.3, 0.5]), ALL)
    tables = {
        "height y [m]": post.profiles(column, "stress", ALL),
        "theta [–]": post.theta_eta(column, wall="top"),
        "energy [J]": post.energy(column),
        "of a square [W/K]": post.conductivity(square_of_discs([0.3, 0.5]), ALL),
        "anisotropy [–]": post.fabric(column, ALL, margin=0.0),
        "share of contacts [–]": post.lifetimes(column, ALL, margin=0.0),
        "chains/1000 grains [–]": post.chains(column, ALL),
        "share of the chains [–]": post.chain_lengths(column, ALL),
        "red: in a chain": post.chain_map(column),
        "clusters/1000 grains [–]": post.clusters(column, ALL),
        "mobilization [–]": post.mobilization(column, ALL),
        "0.3 |": post.layer_conductivity(layer(), ALL),
        "heat flow [W]": post.layer_flow(layer(), ALL),
        "h [W/(m² K)]": post.wall_heat(layer(), ALL),
        "heat flow, mean": post.heat_network(layer()),
        "flash [K]": post.hot_spots(sliding([[(0, 1, 1.0, 0.5, 0.1)]]), ALL),
        "mean square [m": post.diffusion(column, ALL, margin=0.1),
        "pair correlation g [–]": arranged,
        "structure factor S [–]": arranged.with_(factor=of_waves),
        "local solid fraction [–]": post.voronoi(square_of_discs([0.3, 0.5]), ALL),
        "correlation C [–]": post.correlation(column, ALL, 1.0, margin=0.0),
        "friction mu* [–]": post.rheology(column, ALL),
        "mixing index M [–]": mixed(),
        "share of large [–]": parted(),
        "share still inside [–]": stayed(),
        "pull [N]": dropped(),
        "probability density [–]": post.force_distribution(column, ALL),
        "direction [°]": post.angular_distribution(column, ALL),
        "height y/H [–]": post.compare(column, column, ["velocity"], ALL),
        "temperature [K] from": post.grain_map(column, "temperature"),
        "normal force, mean": post.force_network(column),
    }
    for text, table in tables.items():
        shown = show(table, TERMINAL)
        assert text in shown, text
        assert "\x1b" not in shown


def test_logarithmic_axes():
    drawn = chart([0.01, 1.0, 0.0], [1.0, 100.0, 5.0], rows=5, is_logarithmic=True)
    places = [row.index("*") for row in area(drawn)]
    assert places == sorted(places, reverse=True)
    assert drawn.splitlines()[1].startswith("100 |")
    assert drawn.splitlines()[-1].split() == ["0.01", "x", "1"]  # the point at 0 is left out


def scene(across, upwards):
    box = np.array([[0.0, 0.0], [across, upwards]])
    return post.GrainScene(np.zeros((0, 2)), np.zeros(0), [], Lattice(), box)


def quarters(axes):
    """Red at the lower left, blue at the upper right."""
    axes.fill_between([0.0, 0.5], 0.0, 0.5, color="#ff0000", linewidth=0.0)
    axes.fill_between([0.5, 1.0], 0.5, 1.0, color="#0000ff", linewidth=0.0)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)


def test_picture_has_two_pixels_in_a_letter():
    terminal = Terminal(columns=8, rows=50, colors="truecolor")
    lines = style.draw_picture(scene(1.0, 1.0), quarters, terminal).splitlines()
    assert len(lines) == 4
    cell = r"\x1b\[38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m(▀+)"
    cells = [re.findall(cell, line) for line in lines]
    white, red, blue = ["255"] * 3, ["255", "0", "0"], ["0", "0", "255"]
    for row, found in enumerate(cells):
        letters = [(list(cell[:3]), list(cell[3:6])) for cell in found for _ in cell[6]]
        left, right = (white, blue) if row < 2 else (red, white)
        assert letters == [(left, left)] * 4 + [(right, right)] * 4


def test_picture_without_colors_tells_dark_from_light():
    picture = style.draw_picture(scene(1.0, 1.0), quarters, Terminal(columns=4, rows=50))
    upper, lower = picture.splitlines()
    assert (upper[:2], len(lower)) == ("  ", 2)  # white
    assert upper[2] == upper[3] == lower[0] == lower[1] != " "  # red and blue are a third as light


@pytest.mark.parametrize(
    ("across", "upwards", "size"), [(1.0, 1.0, (20, 10)), (4.0, 1.0, (30, 4)), (1.0, 3.0, (7, 10))]
)
def test_picture_fits_into_the_terminal(across, upwards, size):
    def draw(axes):
        axes.axvspan(-9.0, 9.0, color="black")

    lines = style.draw_picture(scene(across, upwards), draw, Terminal(30, 10)).splitlines()
    assert (max(map(len, lines)), len(lines)) == pytest.approx(size, abs=1)

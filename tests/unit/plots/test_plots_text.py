"""Figures for the terminal: every table has one, and pictures of grains have the colors of the figures in files."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from heat_run import write_heated_run

from multicor_cli.plots import Terminal, show
from multicor_cli.plots.text_chart import TextLine, draw_text
from multicor_cli.plots.text_picture import draw_picture
from multicor_cli.post import (
    GrainScene,
    Selection,
    angular_distribution,
    compare,
    energy,
    force_distribution,
    force_network,
    grain_map,
    profiles,
    rheology,
    theta_eta,
)
from multicor_cli.store import Run, open_run

ALL = Selection(start=0.0)
TERMINAL = Terminal(columns=40, rows=20)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = tmp_path_factory.mktemp("run") / "run"
    write_heated_run(path)
    return open_run(path)


def test_every_table_can_be_shown_in_a_terminal(run: Run) -> None:
    tables: dict[str, Any] = {
        "height y [m]": profiles(run, "stress", ALL),
        "theta [–]": theta_eta(run, wall="top"),
        "energy [J]": energy(run),
        "friction mu* [–]": rheology(run, ALL),
        "probability density [–]": force_distribution(run, ALL),
        "direction [°]": angular_distribution(run, ALL),
        "height y/H [–]": compare(run, run, ["velocity"], ALL),
        "temperature [K] from": grain_map(run, "temperature"),
        "normal force, mean": force_network(run),
    }
    for text, table in tables.items():
        shown = show(table, TERMINAL)
        assert text in shown, text
        assert "\x1b" not in shown


def test_logarithmic_axes() -> None:
    chart = draw_text(
        [TextLine("", np.array([0.01, 1.0, 0.0]), np.array([1.0, 100.0, 5.0]))], "x", "y", rows=5, is_logarithmic=True
    )
    rows = [row.split(" |", 1)[1] for row in chart.splitlines() if " |" in row]
    assert [row.index("*") for row in rows] == sorted((row.index("*") for row in rows), reverse=True)
    assert chart.splitlines()[1].startswith("100 |")
    assert chart.splitlines()[-1].split() == ["0.01", "x", "1"]  # the point at 0 is left out


def scene(across: float, upwards: float) -> GrainScene:
    box = np.array([[0.0, 0.0], [across, upwards]])
    return GrainScene(np.zeros((0, 2)), np.zeros(0), [], 0.0, box)


def quarters(axes: Any) -> None:
    """Red at the lower left, blue at the upper right."""
    axes.fill_between([0.0, 0.5], 0.0, 0.5, color="#ff0000", linewidth=0.0)
    axes.fill_between([0.5, 1.0], 0.5, 1.0, color="#0000ff", linewidth=0.0)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)


def test_picture_has_two_pixels_in_a_letter() -> None:
    picture = draw_picture(scene(1.0, 1.0), quarters, Terminal(columns=8, rows=50, colors="truecolor"))
    lines = picture.splitlines()
    assert len(lines) == 4
    cells = [re.findall(r"\x1b\[38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m(▀+)", line) for line in lines]
    white, red, blue = ["255"] * 3, ["255", "0", "0"], ["0", "0", "255"]
    for row, found in enumerate(cells):
        letters = [(list(cell[:3]), list(cell[3:6])) for cell in found for _ in cell[6]]
        left, right = (white, blue) if row < 2 else (red, white)
        assert letters == [(left, left)] * 4 + [(right, right)] * 4


def test_picture_without_colors_tells_dark_from_light() -> None:
    upper, lower = draw_picture(scene(1.0, 1.0), quarters, Terminal(columns=4, rows=50)).splitlines()
    assert (upper[:2], len(lower)) == ("  ", 2)  # white
    assert upper[2] == upper[3] == lower[0] == lower[1] != " "  # red and blue are a third as light


@pytest.mark.parametrize(("across", "upwards", "size"), [(1.0, 1.0, (20, 10)), (4.0, 1.0, (30, 4)), (1.0, 3.0, (7, 10))])
def test_picture_fits_into_the_terminal(across: float, upwards: float, size: tuple[int, int]) -> None:
    lines = draw_picture(scene(across, upwards), lambda axes: axes.axvspan(-9.0, 9.0, color="black"), Terminal(30, 10)).splitlines()
    assert (max(map(len, lines)), len(lines)) == pytest.approx(size, abs=1)

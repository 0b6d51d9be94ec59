"""Axes of temperatures that differ by millikelvin."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from multicor_cli.plots.profile import draw_profile
from multicor_cli.plots.small_rises import rise_formatter, rise_label, rise_reference
from multicor_cli.plots.style import house_style
from multicor_cli.post import PROFILED, ProfileTable


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (298.15, 298.18, 298.15),
        (298.1503, 298.1553, 298.15),
        (298.15512, 298.15538, 298.155),
        (298.15021, 298.1508, 298.15),
        (298.15512, 298.15518, 298.1551),
        (298.149, 298.16, 298.15),  # it started there, and one grain has cooled
        (298.147, 298.16, 298.14),
        (298.15, 298.60, None),
        (298.15, 298.15, None),
    ],
)
def test_reference_is_a_round_temperature_near_the_lowest(low: float, high: float, expected: float | None) -> None:
    reference = rise_reference("K", low, high)
    if expected is None:
        assert reference is None
    else:
        assert reference == pytest.approx(expected, abs=1e-9)


def test_only_kelvin_have_an_arbitrary_zero() -> None:
    assert rise_reference("m/s", 298.15, 298.18) is None


def test_numbers_are_millikelvin_above_it() -> None:
    show = rise_formatter(298.15)
    assert [show(value, 0) for value in (298.15, 298.1525, 298.149)] == ["0", "2.5", "−1"]
    assert rise_label("temperature", "T", 298.15) == "temperature $T$ − 298.15 K [mK]"


def test_profile_of_a_small_rise_has_no_offset_beside_its_label() -> None:
    y = np.linspace(0.05, 0.95, 10)
    table = ProfileTable(
        PROFILED["temperature"], y, 298.15 + 5e-3 * y, np.full(10, 1e-5), np.ones(10), 0.1, 1.0, (298.15, 298.15),
        ("bottom", "top"), 1.0, np.arange(5), (0.0, 1.0),
    )  # fmt: skip
    with house_style():
        figure = Figure()
        axes = figure.add_subplot()
        draw_profile(axes, table)
        figure.draw_without_rendering()
    assert axes.get_xlabel() == "temperature $T$ − 298.15 K [mK]"
    assert axes.xaxis.get_offset_text().get_text() == ""
    shown = [float(label.get_text().replace("−", "-")) for label in axes.get_xticklabels() if label.get_text()]
    assert 0.0 <= min(shown) < max(shown) <= 6.0

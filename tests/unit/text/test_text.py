"""Text for people."""

import math

import pytest

from multicor_cli.text import unit_sign, with_error, with_unit_signs


@pytest.mark.parametrize(
    ("mean", "error", "text"),
    [
        (0.10241, 0.00231, "0.1024 ± 0.0023"),
        (-0.09579, 0.014, "−0.096 ± 0.014"),
        (12345.6, 250.0, "12346 ± 250"),
        (-3.0844e-6, 5.3e-8, "(−3.084 ± 0.053)·10⁻⁶"),
        (2.5e7, 1e6, "(2.50 ± 0.10)·10⁷"),
        (0.25, math.nan, "0.25"),
        (-1.5, 0.0, "−1.5"),
        (0.0, 2e-9, "(0.0 ± 2.0)·10⁻⁹"),
    ],
)
def test_a_mean_has_the_digits_that_its_error_leaves(mean, error, text):
    assert with_error(mean, error) == text


@pytest.mark.parametrize(
    ("unit", "sign"), [("1", "–"), ("m2/s2", "m²/s²"), ("kg m2", "kg m²"), ("deg", "°"), ("1/s", "1/s"), ("m3", "m³")]
)
def test_units_have_their_signs(unit, sign):
    assert unit_sign(unit) == sign
    assert with_unit_signs(f"quantity [{unit}]") == f"quantity [{sign}]"


def test_brackets_that_are_no_units_stay():
    assert with_unit_signs("loading[1] is a stage") == "loading[1] is a stage"

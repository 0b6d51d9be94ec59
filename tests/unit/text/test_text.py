"""Text for people."""

import math
from textwrap import fill

import pytest

from multicor_cli.text import unit_sign, unwrapped, with_error, with_unit_signs


@pytest.mark.parametrize(("mean", "error", "text"), [
    (0.10241, 0.00231, "0.1024 ± 0.0023"), (-0.09579, 0.014, "−0.096 ± 0.014"),
    (12345.6, 250.0, "12346 ± 250"), (-3.0844e-6, 5.3e-8, "(−3.084 ± 0.053)·10⁻⁶"),
    (2.5e7, 1e6, "(2.50 ± 0.10)·10⁷"), (0.25, math.nan, "0.25"), (-1.5, 0.0, "−1.5"),
    (0.0, 2e-9, "(0.0 ± 2.0)·10⁻⁹"),
])  # fmt: skip
def test_a_mean_has_the_digits_that_its_error_leaves(mean, error, text):
    assert with_error(mean, error) == text


@pytest.mark.parametrize(("unit", "sign"), [
    ("1", "–"), ("m2/s2", "m²/s²"), ("kg m2", "kg m²"), ("deg", "°"), ("1/s", "1/s"), ("m3", "m³"),
])  # fmt: skip
def test_units_have_their_signs(unit, sign):
    assert unit_sign(unit) == sign
    assert with_unit_signs(f"quantity [{unit}]") == f"quantity [{sign}]"


def test_brackets_that_are_no_units_stay():
    assert with_unit_signs("loading[1] is a stage") == "loading[1] is a stage"


FIRST = (
    "Run a scenario, or continue a run that was stopped: the same command does both, as often as "
    "it is given."
)
SECOND = "Ctrl-C stops after a checkpoint, a second one at once."
ITEM = (
    "- an item of a list, which may be longer than a line of the source is; the next one begins a "
    "line"
)
EXAMPLE = "    multicor run configs/shear.toml   # as it stands"


@pytest.mark.parametrize("width", [30, 60, 100, 132])
@pytest.mark.parametrize("indent", ["", "    "])
def test_a_docstring_says_the_same_however_its_source_is_wrapped(width, indent):
    paragraphs = [
        fill(FIRST, width),
        fill(SECOND, width),
        f"{fill(ITEM, width, subsequent_indent='  ')}\n- second",
        EXAMPLE,
    ]
    lines = "\n\n".join(paragraphs).splitlines()
    docstring = "\n".join([lines[0], *(indent + line if line else "" for line in lines[1:])])
    assert unwrapped(docstring) == f"{FIRST}\n\n{SECOND}\n\n{ITEM}\n- second\n\n{EXAMPLE}"

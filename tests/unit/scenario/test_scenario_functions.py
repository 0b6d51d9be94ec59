"""What an expression is worth: against Python's own reading, exact powers, and the program's
elementary functions."""

import math
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multicor_cli import arithmetic
from multicor_cli.scenario import Refused
from multicor_cli.scenario.expressions import CONSTANTS, FUNCTIONS, MAX_LENGTH, Expression, raised

VALUES = {"d": 1.5e-3, "n": 7, "g": 9.81}


def value(text):
    return Expression(text).value(VALUES)


@pytest.mark.parametrize(("text", "expected"), [
    ("=1", 1), ("=   2 + 3 * 4", 14), ("= -n", -7), ("= +(2 - 5) * -1", 3), ("= n / 2", 3.5),
    ("= 7 / 7", 1.0), ("= 2 * d", 3e-3), ("= 1e3 * g", 9810.0), ("= 2**10", 1024), ("= -2**2", -4),
    ("= 2**3**2", 512), ("= min(3, 1, 2)", 1), ("= max(n, 2.5)", 7), ("= abs(-n)", 7),
    ("= floor(-2.5)", -3), ("= ceil(2.1)", 3), ("= round(2.6)", 3), ("= round(2.5)", 2),
    ("= 2 * pi", 2 * math.pi), ("= radians(180)", math.pi), ("= degrees(pi)", 180.0),
    ("= cbrt(-8)", -2.0), ("= sqrt(2)", math.sqrt(2)), ("= 0.1**0", 1.0),
])  # fmt: skip
def test_values_by_hand(text, expected):
    assert value(text) == expected
    assert type(value(text)) is type(expected)


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log", "asin", "acos", "cbrt", "atan2"])
def test_elementary_functions_are_those_of_the_program(name):
    """The same bits as in a kernel, and hence on every machine."""
    arguments = (0.3, 0.7)[: FUNCTIONS[name].fewest]
    assert value(f"= {name}({', '.join(map(repr, arguments))})") == getattr(arithmetic, name)(
        *arguments
    )


@pytest.mark.parametrize("name", ["tan", "atan", "radians", "degrees"])
@pytest.mark.parametrize("x", [-1.4, -0.3, 1e-9, 0.7, 1.5])
def test_what_is_made_of_them_is_right_to_a_few_digits_less(name, x):
    expected = getattr(mpmath, name)(mpmath.mpf(x))
    assert abs(FUNCTIONS[name].compute(x) - expected) <= 4 * math.ulp(float(expected))


FINITE = st.floats(-1e6, 1e6)


@given(st.integers(-1000, 1000), st.integers(0, 100))
def test_powers_of_integers_are_exact(x, n):
    assert raised(x, n) == x**n
    assert isinstance(raised(x, n), int)


@given(FINITE.filter(lambda x: abs(x) > 1e-6), st.integers(-8, 8))
def test_whole_powers_are_rounded_once(x, n):
    assert raised(x, n) == raised(x, float(n)) == float(Fraction(x) ** n)


@given(st.floats(1e-6, 1e6), FINITE.map(lambda y: y / 1e6))
def test_other_powers_are_those_of_the_program(x, y):
    expected = mpmath.power(mpmath.mpf(x), mpmath.mpf(y))
    assert abs(raised(x, y) - expected) <= 4 * math.ulp(float(expected))


def test_powers_of_negative_numbers_have_a_sign_where_they_are_real():
    assert raised(-1, 10**6 + 1) == -1.0
    assert raised(-1.0, 10**6) == 1.0
    assert raised(-1.1, 2001.0) == -raised(1.1, 2001.0)
    assert math.isnan(raised(-2, 0.5))


LEAVES = st.sampled_from([*VALUES, "pi", "0", "1", "3", "0.25", "1e-3", "1_000", "0x10", "2e200"])
PLAIN = [name for name, function in FUNCTIONS.items() if function.fewest == 1]


def _grown(inner):
    return st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"),
            inner).map(lambda parts: "({} {} {})".format(*parts)),
        inner.map(lambda part: f"-{part}"),
        st.tuples(st.sampled_from(PLAIN), inner).map(lambda parts: "{}({})".format(*parts)),
        st.tuples(st.sampled_from(["min", "max", "atan2"]), inner,
            inner).map(lambda parts: "{}({}, {})".format(*parts)),
    )  # fmt: skip


@settings(max_examples=400, deadline=None)
@given(st.recursive(LEAVES, _grown, max_leaves=6).filter(lambda text: len(text) < MAX_LENGTH))
def test_expressions_mean_what_they_mean_in_python(text):
    """To the bit; what Python cannot compute either, or ends in no finite number on the way, is
    refused."""
    functions = {name: function.compute for name, function in FUNCTIONS.items()}
    try:
        found = value(f"= {text}")
    except Refused as error:
        message = error.what
    else:
        assert found == eval(text, {"__builtins__": {}}, functions | VALUES | CONSTANTS)
        return
    assert any(word in message for word in ("by zero", "finite", "larger than", "real number"))


WORDS = [*FUNCTIONS, *VALUES, "(", ")", ",", "**", "*", "+", "-", "/", "9", "1e308", " "]
ANYTHING = st.one_of(
    st.text("0123456789.eE+-*/() ", max_size=40),
    st.text("dng sincoqrtmax123.+-*/()**,[]{}:=<>!&|^%~@;'\"#\\\n\0_éµ·²", max_size=30),
    st.text(max_size=20),
    st.lists(st.sampled_from(WORDS), max_size=20).map("".join),
    st.sampled_from(
        ["(", "-", "9**", "+", "~", "sin(", "not ", "lambda:", "1if 1 else ", "[", "x.", "1,"]
    ).flatmap(lambda part: st.integers(1, 400).map(lambda count: part * count + "1")),
)


@settings(max_examples=800, deadline=None)
@given(ANYTHING)
def test_any_text_is_a_number_or_refused_at_a_place_in_it(text):
    text, wrong = f"={text}", None
    try:
        expression = Expression(text)
        expression.check_names(VALUES)
        found = expression.value(VALUES)
    except Refused as error:
        wrong = error
    if wrong is None:
        assert type(found) in (int, float)
        assert math.isfinite(found)
    else:
        assert wrong.what
        assert wrong.remedy
        assert 0 <= wrong.inside[1] <= len(text)

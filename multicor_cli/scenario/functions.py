"""The words of expressions: functions, constants, and what a variable may be called.

The functions are those of `multicor_cli.arithmetic`, or rounded by IEEE 754: an expression has the same bits on every machine.
"""

from __future__ import annotations

import keyword
import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

from pydantic import AfterValidator, Field

from multicor_cli.arithmetic import acos, asin, atan2, cbrt, cos, exp, log, power, sin
from multicor_cli.scenario.problems import Refused

Value = int | float

_MANY_BITS = 2048
_MANY = 100


class Function(NamedTuple):
    """A function, and how many arguments it takes."""

    compute: Callable[..., Value]
    fewest: int = 1
    most: int = 1


def raised(x: Value, y: Value) -> Value:
    """x^y: of whole exponents exact for integers and rounded once for others, `power` where that takes too many digits.

    nan where it is not a real number.

    Raises:
        OverflowError: It is larger than any number.
        ZeroDivisionError: Zero to a negative power.
    """
    if y == int(y) and _is_short(x, int(y)):
        return _whole_power(x, int(y))
    if x == 0 and y < 0:
        raise ZeroDivisionError
    size = power(float(abs(x)), float(y))
    if x >= 0 or y % 2 == 0:
        return size
    return -size if y % 2 == 1 else math.nan


def _is_short(x: Value, n: int) -> bool:
    above, below = x.as_integer_ratio()
    return max(above.bit_length(), below.bit_length()) * abs(n) <= _MANY_BITS


def _whole_power(x: Value, n: int) -> Value:
    above, below = x.as_integer_ratio() if n >= 0 else reversed(x.as_integer_ratio())
    above, below = math.prod([above] * abs(n)), math.prod([below] * abs(n))
    return above if isinstance(x, int) and n >= 0 else above / below  # Python rounds a quotient of integers once


def _sqrt(x: Value) -> float:
    return math.sqrt(x) if x >= 0 else math.nan


def _cbrt(x: Value) -> float:
    return math.copysign(cbrt(abs(x)), x)


def _tan(x: Value) -> float:
    return sin(x) / cos(x)


def _atan(x: Value) -> float:
    return atan2(x, 1.0)


def _radians(x: Value) -> float:
    return x * math.pi / 180.0


def _degrees(x: Value) -> float:
    return x * 180.0 / math.pi


FUNCTIONS = {
    "sqrt": Function(_sqrt),
    "cbrt": Function(_cbrt),
    "exp": Function(exp),
    "log": Function(log),
    "sin": Function(sin),
    "cos": Function(cos),
    "tan": Function(_tan),
    "asin": Function(asin),
    "acos": Function(acos),
    "atan": Function(_atan),
    "atan2": Function(atan2, 2, 2),
    "radians": Function(_radians),
    "degrees": Function(_degrees),
    "abs": Function(abs),
    "min": Function(min, 2, _MANY),
    "max": Function(max, 2, _MANY),
    "floor": Function(math.floor),
    "ceil": Function(math.ceil),
    "round": Function(round),
}
CONSTANTS = {"pi": math.pi}


def _not_reserved(name: str) -> str:
    if name in FUNCTIONS or name in CONSTANTS:
        raise Refused((), f"'{name}' is a {'function' if name in FUNCTIONS else 'constant'} of expressions", "choose another name")
    if keyword.iskeyword(name):
        raise Refused((), f"'{name}' cannot stand in an expression", f"choose another name, as {name}_")
    return name


VariableName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=64), AfterValidator(_not_reserved)]
"""A name that can stand in an expression."""

Variable = Annotated[float, Field(ge=-1e100, le=1e100)]

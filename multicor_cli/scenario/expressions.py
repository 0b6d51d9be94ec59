"""Expressions, as ``"= -g * cos(angle)"``: read, evaluated, and replaced by their numbers.

Only numbers, names, + - * / **, parentheses and calls of `FUNCTIONS` reach the evaluator. Length,
depth and integers are bounded, and every intermediate result is finite: nothing can hang or take
much memory.
"""

from __future__ import annotations

import ast
import keyword
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, BaseModel, Field

from multicor_cli.arithmetic import acos, asin, atan2, cbrt, cos, exp, log, power, sin
from multicor_cli.scenario.problems import KeyPath, Refused, name_list, show
from multicor_cli.scenario.translate import did_you_mean, types_inside

# ---- The words: functions, constants, and what a variable may be called. The functions are those
#      of `multicor_cli.arithmetic`, or rounded by IEEE 754: the same bits on every machine.

Value = int | float

_MANY_BITS = 2048
_MANY = 100


class Function(NamedTuple):
    """A function, and how many arguments it takes."""

    compute: Callable[..., Value]
    fewest: int = 1
    most: int = 1


def raised(x: Value, y: Value) -> Value:
    """x^y, nan where it is not real: of whole exponents exact for integers and rounded once for
    others, `power` where that takes too many digits.

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
    # Python rounds a quotient of integers once
    return above if isinstance(x, int) and n >= 0 else above / below


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
        raise Refused(
            (),
            f"'{name}' is a {'function' if name in FUNCTIONS else 'constant'} of expressions",
            "choose another name",
        )
    if keyword.iskeyword(name):
        raise Refused(
            (), f"'{name}' cannot stand in an expression", f"choose another name, as {name}_"
        )
    return name


VariableName = Annotated[
    str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=64), AfterValidator(_not_reserved)
]
"""A name that can stand in an expression."""

Variable = Annotated[float, Field(ge=-1e100, le=1e100)]


# ---- Expressions

MAX_LENGTH = 200
MAX_DEPTH = 60
_OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: raised,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_NODES = (ast.Constant, ast.Name, ast.UnaryOp, ast.BinOp, ast.Call)
_STRANGE = re.compile(r"[^\x20-\x7e]|[#\\'\"]")
_CLEAR = re.compile(
    r"'.' was never closed|unmatched '.'|invalid \w+ literal|closing parenthesis '.' does not "
    r"match .*"
)
_EXAMPLE = "write arithmetic, as = 2 * d or = g * sin(radians(24)) or = d**2 / 4"


class Expression:
    """An expression: its text, which begins with ``=``, and the names of variables in it."""

    def __init__(self, text: str) -> None:
        """Read an expression; raises `Refused` if it is too long, or is not arithmetic."""
        self.text = text
        self._source = text[1:].strip(" ")
        self._start = len(text) - len(text[1:].lstrip(" "))
        self._check_characters()
        self._tree = self._parsed()
        located = [
            node for node in ast.walk(self._tree) if isinstance(node, ast.expr | ast.keyword)
        ]
        self._nodes = sorted(located, key=operator.attrgetter("col_offset"))
        self._check_nodes()
        called = {id(node.func) for node in self._nodes if isinstance(node, ast.Call)}
        self._names = [
            node for node in self._nodes if isinstance(node, ast.Name) and id(node) not in called
        ]
        self.names = {node.id for node in self._names} - CONSTANTS.keys()

    def _error(self, what: str, remedy: str, at: int) -> Refused:
        return Refused((), f"{what} in {show(self.text)}", remedy, (self.text, self._start + at))

    def _wrong(self, node: ast.AST, what: str, remedy: str) -> Refused:
        """The error at a node; ``what`` follows its text."""
        part = ast.get_source_segment(self._source, node) or self._source
        return self._error(f"{show(part)} {what}", remedy, getattr(node, "col_offset", 0))

    def _check_characters(self) -> None:
        if len(self.text) > MAX_LENGTH:
            what = f"an expression of {len(self.text)} characters (at most {MAX_LENGTH})"
            raise Refused((), what, "split it into several variables", (self.text, 0))
        if match := _STRANGE.search(self._source):
            raise self._error(
                f"the character {show(match[0])} cannot stand", _EXAMPLE, match.start()
            )
        if not self._source:
            raise Refused(
                (), f"nothing follows the = of {show(self.text)}", _EXAMPLE, (self.text, 0)
            )

    def _parsed(self) -> ast.expr:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's advice on style
                return ast.parse(self._source, mode="eval").body
        except SyntaxError as error:
            at = min(error.offset - 1, len(self._source)) if error.offset else len(self._source)
            rest = self._source[at:]
            what = (
                error.msg
                if _CLEAR.fullmatch(error.msg)
                else f"{show(rest)} cannot follow"
                if rest
                else "something is missing"
            )
            raise self._error(what, _EXAMPLE, at) from None
        except (RecursionError, MemoryError):
            raise self._too_deep() from None

    def _too_deep(self) -> Refused:
        return self._error(
            "too many parentheses or terms in a row", "split it into several variables", 0
        )

    def _check_nodes(self) -> None:
        if _depth(self._tree) > MAX_DEPTH:
            raise self._too_deep()
        for node in self._nodes:
            if isinstance(node, ast.Call) and not isinstance(node.func, ast.Name):
                raise self._wrong(node.func, "cannot be called", "write * between factors")
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
                raise self._wrong(node, "is no power", "write ** for a power")
            if not self._is_arithmetic(node):
                raise self._wrong(node, "is not arithmetic", _EXAMPLE)

    @staticmethod
    def _is_arithmetic(node: ast.AST) -> bool:
        if isinstance(node, ast.Constant):
            return type(node.value) in (int, float)
        if isinstance(node, ast.BinOp | ast.UnaryOp):
            return type(node.op) in _OPERATORS
        return isinstance(node, _NODES)

    def check_names(self, variables: Mapping[str, object]) -> None:
        """Raise `Refused` if a variable or function does not exist."""
        for node in self._names:
            if node.id in FUNCTIONS:
                raise self._wrong(node, "is a function", f"write {node.id}(...)")
            if node.id not in variables and node.id not in CONSTANTS:
                known = (
                    did_you_mean(node.id, [*variables, *CONSTANTS])
                    or f"define it: [variables] {node.id} = ..."
                )
                raise self._error(f"unknown name '{node.id}'", known, node.col_offset)
        for call in self._nodes:
            if isinstance(call, ast.Call) and (name := ast.unparse(call.func)) not in FUNCTIONS:
                if name in variables or name in CONSTANTS:
                    raise self._wrong(call.func, "is no function", f"write {name} * (...)")
                remedy = did_you_mean(name, FUNCTIONS) or f"known here: {', '.join(FUNCTIONS)}"
                raise self._error(f"unknown function '{name}'", remedy, call.col_offset)

    def value(self, variables: Mapping[str, Value]) -> Value:
        """The value; an int where only whole numbers are added, multiplied, raised. May refuse."""
        from simpleeval import SimpleEval  # few scenarios have expressions

        names = {**variables, **CONSTANTS}
        evaluator = SimpleEval(
            operators=_OPERATORS,
            functions={name: f.compute for name, f in FUNCTIONS.items()},
            names=names,
        )
        evaluator.nodes = {kind: partial(self._evaluated, evaluator.nodes[kind]) for kind in _NODES}
        value: Value = evaluator.eval(self._source, self._tree)
        return value

    def _evaluated(self, evaluate: Callable[[Any], Any], node: Any) -> Value:
        """The value of a part, which is checked to be a finite number."""
        if isinstance(node, ast.Call):
            self._check_arguments(node)
        try:
            value: Value = evaluate(node)
            is_finite, is_nan = math.isfinite(value), math.isnan(value)
        except ZeroDivisionError:
            raise self._wrong(node, "divides by zero", "keep the divisor from zero") from None
        except OverflowError:
            raise self._wrong(
                node, "is larger than any number", "keep numbers below 1e308"
            ) from None
        if is_nan:
            raise self._wrong(
                node, "is not a real number", "keep the arguments within the domain of the function"
            )
        if not is_finite:
            raise self._wrong(node, "is not finite", "keep numbers below 1e308")
        return value

    def _check_arguments(self, node: ast.Call) -> None:
        name = ast.unparse(node.func)
        _, fewest, most = FUNCTIONS[name]
        if not fewest <= len(node.args) <= most:
            takes = (
                f"{fewest} argument{'s' * (fewest > 1)}"
                if fewest == most
                else f"{fewest} or more arguments"
            )
            raise self._wrong(
                node,
                f"has {len(node.args) or 'no'} argument{'s' * (len(node.args) != 1)}",
                f"{name} takes {takes}",
            )


def _depth(tree: ast.AST) -> int:
    depth, level = 0, [tree]
    while level:
        depth, level = depth + 1, [child for node in level for child in ast.iter_child_nodes(node)]
    return depth


# -- Numbers in place of the expressions of a document: between reading and validation

MAX_EXPRESSIONS = 500
"""Most expressions of a scenario: what is evaluated in a fraction of a second."""

_TABLE = "variables"
_LARGEST = 1e308


@dataclass
class Evaluated:
    """What has become of the expressions of a document.

    Attributes:
        shown: The expression and its value, as messages show it, by place.
        used: Names of the variables that expressions refer to.
        findings: What is wrong with expressions.
        failed: Places of expressions without a value, which are left as they are.
    """

    shown: dict[KeyPath, tuple[str, str]] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    findings: list[Refused] = field(default_factory=list)
    failed: set[KeyPath] = field(default_factory=set)


def evaluate_expressions(data: dict[str, Any], model: type[BaseModel]) -> Evaluated:
    """Replace the expressions of a parsed document, which is **modified**, by their values.

    A string is an expression if it begins with ``=`` and stands where the models take a number.
    """
    places = list(_places((), data, [model]))
    return _Document(data).evaluate(places) if places else Evaluated()


def unused_overrides(
    data: dict[str, Any], set_paths: Iterable[KeyPath], used: set[str]
) -> list[Refused]:
    """Findings about variables from the command line that no expression uses: slips."""
    findings = []
    for path in set_paths:
        if path[0] == _TABLE and isinstance(data[_TABLE], dict):
            for name in path[1:2] or data[_TABLE]:
                if name not in used:
                    remedy = (
                        did_you_mean(str(name), used)
                        or f"expressions refer to {name_list(sorted(used)) or 'no variable'}"
                    )
                    findings.append(
                        Refused((_TABLE, name), "no expression refers to this variable", remedy)
                    )
    return findings


class _Place(NamedTuple):
    """Where an expression stands, its text, and whether its value must be whole."""

    path: KeyPath
    text: str
    is_whole: bool


def _places(path: KeyPath, node: Any, types: list[Any]) -> Iterator[_Place]:
    """The expressions in a node that may be of these types, in the order of the document."""
    for key, value in enumerate(node) if isinstance(node, list) else node.items():
        if isinstance(value, dict | list):
            yield from _places((*path, key), value, types_inside(types, key))
        elif isinstance(value, str) and value.startswith("="):
            inside = types_inside(types, key)
            if int in inside or float in inside:
                yield _Place((*path, key), value, float not in inside)


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= _LARGEST


class _Document:
    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        table = data.get(_TABLE)
        self.variables: dict[str, Any] = table if isinstance(table, dict) else {}
        self.is_table = isinstance(table, dict | None)
        self.values: dict[str, Value] = {
            name: value for name, value in self.variables.items() if _is_number(value)
        }
        self.expressions: dict[KeyPath, Expression] = {}
        self.whole: set[KeyPath] = set()
        self.result = Evaluated()

    def evaluate(self, places: list[_Place]) -> Evaluated:
        """Evaluate the expressions at these places, variables first."""
        for place in places[:MAX_EXPRESSIONS]:
            self._read(place)
        if more := [place.path for place in places[MAX_EXPRESSIONS:]]:
            remedy = "write numbers, or put tables of grains into a file"
            self.result.findings.append(
                Refused(more[0], f"more than {MAX_EXPRESSIONS} expressions", remedy)
            )
            self.result.failed.update(more)
        variables = [(_TABLE, name) for name in self._order_of_variables()]
        for path in dict.fromkeys([*variables, *self.expressions]):
            self._evaluate(path)
        return self.result

    def _fail(self, refused: Refused) -> None:
        self.result.failed.add(refused.where)
        self.result.findings.append(refused)

    def _read(self, place: _Place) -> None:
        try:
            expression = Expression(place.text)
            if self.is_table:
                expression.check_names(self.variables)
        except Refused as error:
            self._fail(error.within(*place.path))
            return
        self.expressions[place.path] = expression
        self.result.used |= expression.names
        if place.is_whole:
            self.whole.add(place.path)

    def _order_of_variables(self) -> Iterator[str]:
        """Variables that are expressions, each after those it refers to, without circles."""
        from graphlib import CycleError, TopologicalSorter

        names = {
            str(path[1]): expression.names
            for path, expression in self.expressions.items()
            if path[0] == _TABLE
        }
        sorter = TopologicalSorter(names)
        try:
            sorter.prepare()
        except CycleError as error:
            self._refuse_circle(error.args[1][:0:-1], list(names))
        while ready := sorter.get_ready():
            yield from (name for name in ready if name in names)
            sorter.done(*ready)

    def _refuse_circle(self, circle: list[str], names: list[str]) -> None:
        """Refuse variables of which each refers to the next, the last to the first."""
        first = circle.index(min(circle, key=names.index))
        chain = [*circle[first:], *circle[:first]]
        shown = [*chain, chain[0]] if len(chain) <= 10 else [*chain[:10], "...", chain[0]]
        self._fail(
            Refused(
                (_TABLE, chain[0]),
                f"refers to itself: {' -> '.join(shown)}",
                "give one of them a number",
            )
        )

    def _evaluate(self, path: KeyPath) -> None:
        expression = self.expressions[path]
        if not expression.names <= self.values.keys():  # what is wrong is said of the variable
            self.result.failed.add(path)
            return
        try:
            value = expression.value(self.values)
        except Refused as error:
            self._fail(error.within(*path))
            return
        if path in self.whole and value != int(value):
            what = f"must be a whole number, is {show(value)} ({show(expression.text)})"
            self._fail(Refused(path, what, "use round(...), floor(...) or ceil(...)"))
            return
        self._put(path, int(value) if path in self.whole else value)
        self.result.shown[path] = (expression.text, show(value))

    def _put(self, path: KeyPath, value: Value) -> None:
        node: Any = self.data
        for part in path[:-1]:
            node = node[part]
        node[path[-1]] = value
        if path[0] == _TABLE:
            self.values[str(path[1])] = value

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
    above, below = x.as_integer_ratio()
    if y == int(y) and max(above.bit_length(), below.bit_length()) * abs(int(y)) <= _MANY_BITS:
        n = int(y)
        above, below = (above, below) if n >= 0 else (below, above)
        above, below = math.prod([above] * abs(n)), math.prod([below] * abs(n))
        # Python rounds a quotient of integers once
        return above if isinstance(x, int) and n >= 0 else above / below
    if x == 0 and y < 0:
        raise ZeroDivisionError
    size = power(float(abs(x)), float(y))
    if x >= 0 or y % 2 == 0:
        return size
    return -size if y % 2 == 1 else math.nan


FUNCTIONS = {
    "sqrt": Function(lambda x: math.sqrt(x) if x >= 0 else math.nan),
    "cbrt": Function(lambda x: math.copysign(cbrt(abs(x)), x)),
    "exp": Function(exp),
    "log": Function(log),
    "sin": Function(sin),
    "cos": Function(cos),
    "tan": Function(lambda x: sin(x) / cos(x)),
    "asin": Function(asin),
    "acos": Function(acos),
    "atan": Function(lambda x: atan2(x, 1.0)),
    "atan2": Function(atan2, 2, 2),
    "radians": Function(lambda x: x * math.pi / 180.0),
    "degrees": Function(lambda x: x * 180.0 / math.pi),
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
        what = f"'{name}' is a {'function' if name in FUNCTIONS else 'constant'} of expressions"
        raise Refused((), what, "choose another name")
    if keyword.iskeyword(name):
        what = f"'{name}' cannot stand in an expression"
        raise Refused((), what, f"choose another name, as {name}_")
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
            what = f"the character {show(match[0])} cannot stand"
            raise self._error(what, _EXAMPLE, match.start())
        if not self._source:
            what = f"nothing follows the = of {show(self.text)}"
            raise Refused((), what, _EXAMPLE, (self.text, 0))

    def _parsed(self) -> ast.expr:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's advice on style
                return ast.parse(self._source, mode="eval").body
        except SyntaxError as error:
            at = min(error.offset - 1, len(self._source)) if error.offset else len(self._source)
            rest = self._source[at:]
            what = f"{show(rest)} cannot follow" if rest else "something is missing"
            if _CLEAR.fullmatch(error.msg):
                what = error.msg
            raise self._error(what, _EXAMPLE, at) from None
        except (RecursionError, MemoryError):
            raise self._too_deep() from None

    def _too_deep(self) -> Refused:
        return self._error(
            "too many parentheses or terms in a row", "split it into several variables", 0
        )

    def _check_nodes(self) -> None:
        depth = 0
        level: list[ast.AST] = [self._tree]
        while level:
            depth, level = depth + 1, [e for node in level for e in ast.iter_child_nodes(node)]
        if depth > MAX_DEPTH:
            raise self._too_deep()
        for node in self._nodes:
            if isinstance(node, ast.Call) and not isinstance(node.func, ast.Name):
                raise self._wrong(node.func, "cannot be called", "write * between factors")
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
                raise self._wrong(node, "is no power", "write ** for a power")
            is_arithmetic = isinstance(node, _NODES)
            if isinstance(node, ast.Constant):
                is_arithmetic = type(node.value) in (int, float)
            elif isinstance(node, ast.BinOp | ast.UnaryOp):
                is_arithmetic = type(node.op) in _OPERATORS
            if not is_arithmetic:
                raise self._wrong(node, "is not arithmetic", _EXAMPLE)

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

        evaluator = SimpleEval(
            operators=_OPERATORS,
            functions={name: f.compute for name, f in FUNCTIONS.items()},
            names={**variables, **CONSTANTS},
        )
        evaluator.nodes = {kind: partial(self._evaluated, evaluator.nodes[kind]) for kind in _NODES}
        value: Value = evaluator.eval(self._source, self._tree)
        return value

    def _evaluated(self, evaluate: Callable[[Any], Any], node: Any) -> Value:
        """The value of a part, which is checked to be a finite number."""
        if isinstance(node, ast.Call):
            name, count = ast.unparse(node.func), len(node.args)
            _, fewest, most = FUNCTIONS[name]
            if not fewest <= count <= most:
                takes = f"{fewest} argument{'s' * (fewest > 1)}"
                if fewest < most:
                    takes = f"{fewest} or more arguments"
                what = f"has {count or 'no'} argument{'s' * (count != 1)}"
                raise self._wrong(node, what, f"{name} takes {takes}")
        try:
            value: Value = evaluate(node)
            is_finite, is_nan = math.isfinite(value), math.isnan(value)
        except ZeroDivisionError:
            raise self._wrong(node, "divides by zero", "keep the divisor from zero") from None
        except OverflowError:
            what = "is larger than any number"
            raise self._wrong(node, what, "keep numbers below 1e308") from None
        if is_nan:
            remedy = "keep the arguments within the domain of the function"
            raise self._wrong(node, "is not a real number", remedy)
        if not is_finite:
            raise self._wrong(node, "is not finite", "keep numbers below 1e308")
        return value


# -- Numbers in place of the expressions of a document: between reading and validation

MAX_EXPRESSIONS = 500
"""Most expressions of a scenario: what is evaluated in a fraction of a second."""

_TABLE = "variables"
_LARGEST = 1e308


def unused_overrides(
    data: dict[str, Any], set_paths: Iterable[KeyPath], used: set[str]
) -> list[Refused]:
    """Findings about variables from the command line that no expression uses: slips."""
    findings = []
    for path in set_paths:
        if path[0] == _TABLE and isinstance(data[_TABLE], dict):
            for name in path[1:2] or data[_TABLE]:
                if name not in used:
                    remedy = did_you_mean(str(name), used)
                    remedy = (
                        remedy or f"expressions refer to {name_list(sorted(used)) or 'no variable'}"
                    )
                    what = "no expression refers to this variable"
                    findings.append(Refused((_TABLE, name), what, remedy))
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


class Evaluated:
    """Replaces the expressions of a parsed document, which is **modified**, by their values.

    A string is an expression if it begins with ``=`` and stands where the models take a number.

    Attributes:
        shown: The expression and its value, as messages show it, by place.
        used: Names of the variables that expressions refer to.
        findings: What is wrong with expressions.
        failed: Places of expressions without a value, which are left as they are.
    """

    def __init__(self, data: dict[str, Any], model: type[BaseModel]) -> None:
        self.shown: dict[KeyPath, tuple[str, str]] = {}
        self.used: set[str] = set()
        self.findings: list[Refused] = []
        self.failed: set[KeyPath] = set()
        self._data, self._table = data, data.get(_TABLE)
        self._variables: dict[str, Any] = self._table if isinstance(self._table, dict) else {}
        self._values: dict[str, Value] = {
            name: value
            for name, value in self._variables.items()
            if type(value) in (int, float) and abs(value) <= _LARGEST
        }
        self._expressions: dict[KeyPath, Expression] = {}
        self._whole: set[KeyPath] = set()
        places = list(_places((), data, [model]))
        for place in places[:MAX_EXPRESSIONS]:
            self._read(place)
        if more := [place.path for place in places[MAX_EXPRESSIONS:]]:
            what = f"more than {MAX_EXPRESSIONS} expressions"
            remedy = "write numbers, or put tables of grains into a file"
            self.findings.append(Refused(more[0], what, remedy))
            self.failed.update(more)
        variables = [(_TABLE, name) for name in self._order_of_variables()]
        for path in dict.fromkeys([*variables, *self._expressions]):
            self._evaluate(path)

    def _fail(self, refused: Refused) -> None:
        self.failed.add(refused.where)
        self.findings.append(refused)

    def _read(self, place: _Place) -> None:
        try:
            expression = Expression(place.text)
            if isinstance(self._table, dict | None):
                expression.check_names(self._variables)
        except Refused as error:
            self._fail(error.within(*place.path))
            return
        self._expressions[place.path] = expression
        self.used |= expression.names
        if place.is_whole:
            self._whole.add(place.path)

    def _order_of_variables(self) -> Iterator[str]:
        """Variables that are expressions, each after those it refers to, without circles."""
        from graphlib import CycleError, TopologicalSorter

        names = {
            str(path[1]): expression.names
            for path, expression in self._expressions.items()
            if path[0] == _TABLE
        }
        sorter = TopologicalSorter(names)
        try:
            sorter.prepare()
        except CycleError as error:
            # each refers to the next, the last to the first
            circle, known = error.args[1][:0:-1], list(names)
            first = circle.index(min(circle, key=known.index))
            chain = [*circle[first:], *circle[:first]]
            shown = [*chain, chain[0]] if len(chain) <= 10 else [*chain[:10], "...", chain[0]]
            what = f"refers to itself: {' -> '.join(shown)}"
            self._fail(Refused((_TABLE, chain[0]), what, "give one of them a number"))
        while ready := sorter.get_ready():
            yield from (name for name in ready if name in names)
            sorter.done(*ready)

    def _evaluate(self, path: KeyPath) -> None:
        expression = self._expressions[path]
        if not expression.names <= self._values.keys():  # what is wrong is said of the variable
            self.failed.add(path)
            return
        try:
            value = expression.value(self._values)
        except Refused as error:
            self._fail(error.within(*path))
            return
        if path in self._whole and value != int(value):
            what = f"must be a whole number, is {show(value)} ({show(expression.text)})"
            self._fail(Refused(path, what, "use round(...), floor(...) or ceil(...)"))
            return
        number = int(value) if path in self._whole else value
        node: Any = self._data
        for part in path[:-1]:
            node = node[part]
        node[path[-1]] = number
        if path[0] == _TABLE:
            self._values[str(path[1])] = number
        self.shown[path] = (expression.text, show(value))

"""Numbers in place of the expressions of a document: between reading and validation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from multicor_cli.scenario.describe import types_inside
from multicor_cli.scenario.models import ScenarioModel
from multicor_cli.scenario.problems import Finding, KeyPath, name_list, show
from multicor_cli.scenario.translate import did_you_mean

if TYPE_CHECKING:
    from multicor_cli.scenario.expressions import Expression
    from multicor_cli.scenario.functions import Value

MAX_EXPRESSIONS = 500
"""Most expressions of a scenario: what is evaluated in a fraction of a second."""

_TABLE = "variables"
_LARGEST = 1e308


@dataclass
class Evaluated:
    """What has become of the expressions of a document.

    Attributes:
        shown: The expression and its value, as messages show it, of each place at which one stood.
        used: Names of the variables that expressions refer to.
        findings: What is wrong with expressions.
        failed: Places of expressions without a value, which are left as they are.
    """

    shown: dict[KeyPath, tuple[str, str]] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    findings: list[Finding] = field(default_factory=list)
    failed: set[KeyPath] = field(default_factory=set)


def evaluate_expressions(data: dict[str, Any]) -> Evaluated:
    """Replace the expressions of a parsed document by their values.

    A string is an expression if it begins with ``=`` and stands where the models take a number; others are left alone.

    Args:
        data: The document. **Modified.**
    """
    places = list(_places((), data))
    return _Document(data).evaluate(places) if places else Evaluated()


def unused_overrides(data: dict[str, Any], set_paths: Iterable[KeyPath], used: set[str]) -> list[Finding]:
    """Findings about variables from the command line that no expression refers to: a slip, since nothing would change."""
    findings = []
    for path in set_paths:
        if path[0] == _TABLE and isinstance(data[_TABLE], dict):
            for name in path[1:2] or data[_TABLE]:
                if name not in used:
                    remedy = did_you_mean(str(name), used) or f"expressions refer to {name_list(sorted(used)) or 'no variable'}"
                    findings.append(Finding((_TABLE, name), "no expression refers to this variable", remedy))
    return findings


class _Place(NamedTuple):
    """Where an expression stands, its text, and whether its value must be whole."""

    path: KeyPath
    text: str
    is_whole: bool


def _places(path: KeyPath, node: Any) -> Iterator[_Place]:
    """The expressions in a node, in the order of the document."""
    for key, value in enumerate(node) if isinstance(node, list) else node.items():
        if isinstance(value, dict | list):
            yield from _places((*path, key), value)
        elif isinstance(value, str) and value.startswith("="):
            types = _types_at((*path, key))
            if int in types or float in types:
                yield _Place((*path, key), value, float not in types)


def _types_at(path: KeyPath) -> list[Any]:
    """The types that the models allow at a place."""
    types: list[Any] = [ScenarioModel]
    for part in path:
        types = types_inside(types, part)
    return types


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= _LARGEST


class _Document:
    """A document while its expressions are evaluated."""

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        table = data.get(_TABLE)
        self.variables: dict[str, Any] = table if isinstance(table, dict) else {}
        self.is_table = isinstance(table, dict | None)
        self.values: dict[str, Value] = {name: value for name, value in self.variables.items() if _is_number(value)}
        self.expressions: dict[KeyPath, Expression] = {}
        self.whole: set[KeyPath] = set()
        self.result = Evaluated()

    def evaluate(self, places: list[_Place]) -> Evaluated:
        """Evaluate the expressions at these places, variables first."""
        for place in places[:MAX_EXPRESSIONS]:
            self._read(place)
        if more := [place.path for place in places[MAX_EXPRESSIONS:]]:
            remedy = "write numbers, or put tables of grains into a file"
            self.result.findings.append(Finding(more[0], f"more than {MAX_EXPRESSIONS} expressions", remedy))
            self.result.failed.update(more)
        variables = [(_TABLE, name) for name in self._order_of_variables()]
        for path in dict.fromkeys([*variables, *self.expressions]):
            self._evaluate(path)
        return self.result

    def _fail(self, path: KeyPath, message: str, remedy: str, inside: tuple[str, int] | None = None) -> None:
        self.result.failed.add(path)
        self.result.findings.append(Finding(path, message, remedy, inside))

    def _read(self, place: _Place) -> None:
        from multicor_cli.scenario.expressions import Expression, ExpressionError

        try:
            expression = Expression(place.text)
            if self.is_table:
                expression.check_names(self.variables)
        except ExpressionError as error:
            self._fail(place.path, error.message, error.remedy, (place.text, error.offset))
            return
        self.expressions[place.path] = expression
        self.result.used |= expression.names
        if place.is_whole:
            self.whole.add(place.path)

    def _order_of_variables(self) -> Iterator[str]:
        """Names of the variables that are expressions, each after those that it refers to; those in a circle are left out."""
        from graphlib import CycleError, TopologicalSorter

        names = {str(path[1]): expression.names for path, expression in self.expressions.items() if path[0] == _TABLE}
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
        self._fail((_TABLE, chain[0]), f"refers to itself: {' -> '.join(shown)}", "give one of them a number")

    def _evaluate(self, path: KeyPath) -> None:
        """Put the value of the expression at a place into the document."""
        from multicor_cli.scenario.expressions import ExpressionError

        expression = self.expressions[path]
        if not expression.names <= self.values.keys():  # what is wrong is said of the variable
            self.result.failed.add(path)
            return
        try:
            value = expression.value(self.values)
        except ExpressionError as error:
            self._fail(path, error.message, error.remedy, (expression.text, error.offset))
            return
        if path in self.whole and value != int(value):
            what = f"must be a whole number, is {show(value)} ({show(expression.text)})"
            self._fail(path, what, "use round(...), floor(...) or ceil(...)")
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

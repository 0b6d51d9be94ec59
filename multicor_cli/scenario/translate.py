"""From errors of the validation library to findings in a scenario's words."""

from __future__ import annotations

import difflib
import re
import types
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from multicor_cli.scenario.problems import KeyPath, Refused, name_list, show
from multicor_cli.text import count_noun

# ---- What the models say about a place in a scenario: its description, and the keys of its table


@dataclass(frozen=True)
class Location:
    """A place: its path, the models' text on the last known key (or none), the model of its table,
    and those of all kinds of table that might stand there, if there are several; kinds of tables
    that might stand in place of a word.
    """

    path: KeyPath
    description: str
    table: type[BaseModel]
    kinds: tuple[type[BaseModel], ...] = ()
    instead: tuple[str, ...] = ()

    @property
    def known_keys(self) -> list[str]:
        """Keys that the innermost table knows."""
        return [field.alias or name for name, field in self.table.model_fields.items()]

    @property
    def kinds_with_key(self) -> list[str]:
        """Kinds of the table that know the last key."""
        known = (each for each in self.kinds if find_field(each, str(self.path[-1])))
        return [kind for kind in map(_kind_of, known) if kind]

    @property
    def expected(self) -> str:
        """What the models expect there, as a remedy."""
        return f"expected: {self.description}" if self.description else ""


def find_location(model: type[BaseModel], location: tuple[str | int, ...]) -> Location:
    """Follow a validation error through the models; tags of unions, no keys, are left out."""
    path: list[str | int] = []
    description, table = "", model
    kinds: tuple[type[BaseModel], ...] = ()
    instead: tuple[str, ...] = ()
    annotation: Any = model
    for part in location:
        annotation = _strip(annotation)
        member = _union_member(annotation, part)
        if member is not None:
            kinds = tuple(each for each in map(_strip, _members(annotation)) if _kind_of(each))
            found = () if kinds else map(_kind_of, _alternatives(annotation))
            instead = tuple(kind for kind in found if kind)
            annotation = member
            continue
        if part == "[key]":
            continue
        instead = ()
        path.append(part)
        if _is_table(annotation):
            table = annotation
            field = find_field(table, str(part))
            description = (field.description or "") if field else description
        annotation = _inside(annotation, part)
    return Location(tuple(path), description, table, kinds if table in kinds else (), instead)


def types_inside(types: Iterable[Any], part: str | int) -> list[Any]:
    """The types that ``part`` of something of one of these types may have; unions one by one."""
    return [member for annotation in types for member in _alternatives(_inside(annotation, part))]


def find_field(table: type[BaseModel], key: str) -> FieldInfo | None:
    """The field of ``table`` for a TOML key."""
    for name, field in table.model_fields.items():
        if key == (field.alias or name):
            return field
    return None


def _is_table(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _strip(annotation: Any) -> Any:
    """The type below annotations and "or None"."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        members = [member for member in _members(annotation) if member is not type(None)]
        if len(members) != 1:
            return annotation
        annotation = members[0]


def _members(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else ()


def _alternatives(annotation: Any) -> Iterator[Any]:
    """The types that something of type ``annotation`` may have."""
    annotation = _strip(annotation)
    members = _members(annotation)
    for member in members:
        yield from _alternatives(member)
    if not members:
        yield annotation


def _union_member(annotation: Any, part: str | int) -> Any:
    """The member of a union that ``part`` is the tag of, or the kind."""
    for member in _members(annotation):
        tags = [data.tag for data in get_args(member)[1:] if isinstance(data, Tag)]
        if part in (*tags, _kind_of(_strip(member))):
            return member
    return None


def _kind_of(table: Any) -> str | None:
    """The ``kind`` of a table, if it has one."""
    kind = table.model_fields.get("kind") if _is_table(table) else None
    if kind is None or get_origin(kind.annotation) is not Literal:
        return None
    return str(get_args(kind.annotation)[0])


def _inside(annotation: Any, part: str | int) -> Any:
    """Type of the element or key ``part`` of something of type ``annotation``."""
    if _is_table(annotation):
        field = find_field(annotation, str(part))
        return field.annotation if field else None
    if get_origin(annotation) is dict:
        return get_args(annotation)[1]
    if get_origin(annotation) is tuple:
        return get_args(annotation)[0]
    return None


# ---- From errors to findings

_UNIT_SUFFIX = re.compile(
    r"(.+?)_(mm|cm|um|nm|km|ms|us|min|h|hours|deg|degrees|g|mpa|gpa|kpa|celsius|m|s|kg|pa|rad|k)",
    re.IGNORECASE,
)

_TYPES = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be a string in quotes",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "finite_number": "must be a finite number",
    "string_unicode": "must be valid text",
}
_BOUNDS = {
    "greater_than": ("gt", "must be greater than"),
    "greater_than_equal": ("ge", "must be at least"),
    "less_than": ("lt", "must be less than"),
    "less_than_equal": ("le", "must be at most"),
}
_TINY = 1e-6
_OTHER_WORDS = {
    **dict.fromkeys(("timestep", "time_step", "step", "delta_t", "deltat"), "dt"),
    **dict.fromkeys(("mu", "friction_coefficient", "coefficient_of_friction"), "friction"),
    **dict.fromkeys(
        ("cor", "coefficient_of_restitution", "restitution_coefficient"), "restitution"
    ),
    **dict.fromkeys(("youngs_modulus", "young_modulus", "elastic_modulus"), "young"),
    **dict.fromkeys(("poisson_ratio", "poissons_ratio"), "poisson"),
    **dict.fromkeys(("rho", "mass_density"), "density"),
    **dict.fromkeys(("cp", "c_p", "specific_heat"), "heat_capacity"),
    **dict.fromkeys(("thermal_conductivity", "lambda"), "conductivity"),
    **dict.fromkeys(("n", "number", "grains"), "count"),
    **dict.fromkeys(("t_end", "end_time", "time", "length"), "duration"),
}
"""Keys by what other programs and papers call them."""


def translate(model: type[BaseModel], errors: Iterable[ErrorDetails]) -> list[Refused]:
    """Findings for validation errors of ``model``: one per mistake, however many errors."""
    causes = [error for error in errors if not _is_consequence(error)]
    placed = [(find_location(model, error["loc"]), error) for error in causes]
    meant: set[KeyPath] = set()  # keys that are only misspelled, hence not missing
    for place, error in placed:
        if error["type"] == "extra_forbidden":
            meant.add((*place.path[:-1], _intended(place) or ""))
    findings: dict[KeyPath, Refused] = {}
    for place, error in placed:
        if not (error["type"] == "missing" and place.path in meant):
            finding = _HANDLERS.get(error["type"], _wrong_type)(place, error)
            findings.setdefault(finding.where, finding)
    return list(findings.values())


def without_unknown_keys(model: type[BaseModel], table: Any, errors: Iterable[ErrorDetails]) -> Any:
    """A table without unknown keys: misspelled ones get their names, others are left out.

    None if a key is meant that cannot be told: one with a unit may be a thousand times too large.
    """
    places = [
        find_location(model, error["loc"]) for error in errors if error["type"] == "extra_forbidden"
    ]
    if not places:
        return None
    known = deepcopy(table)
    # Each form that a table may have complains of the same key
    for place in {each.path: each for each in places}.values():
        owner, key = known, str(place.path[-1])
        for part in place.path[:-1]:
            owner = owner[part]
        value = owner.pop(key)
        intended = _intended(place)
        if intended is not None:
            if _UNIT_SUFFIX.fullmatch(key):
                return None
            owner.setdefault(intended, value)
    return known


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The known words closest to ``word``, as a question; empty if none is close."""
    names = _closest(word, known)
    return f"did you mean {' or '.join(map(repr, names))}?" if names else ""


def _closest(word: str, known: Iterable[str]) -> list[str]:
    """The known words that are closest to ``word``: one, several that are as close, or none."""
    names = list(known)[:200]
    meant = _OTHER_WORDS.get(word.lower())
    if meant in names:
        return [meant]
    given = word.lower()[:100]
    matches = difflib.get_close_matches(given, names, n=3, cutoff=0.6)
    near = [difflib.SequenceMatcher(None, match, given).ratio() for match in matches]
    return [match for match, ratio in zip(matches, near, strict=True) if ratio == near[0]]


def _is_consequence(error: ErrorDetails) -> bool:
    """Whether it follows from another: a default of a wrong value, elements not counted."""
    if error["type"] == "default_factory_not_called":
        return True
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _intended(place: Location) -> str | None:
    """The key that is meant by an unknown one."""
    key, known = str(place.path[-1]), place.known_keys
    if (match := _UNIT_SUFFIX.fullmatch(key)) and match[1] in known:
        return match[1]
    if place.kinds_with_key:
        return None
    return next(iter(_closest(key, known)), None)


def _wrong_type(place: Location, error: ErrorDetails) -> Refused:
    what = _TYPES.get(error["type"], error["msg"])
    return Refused(place.path, f"{what}, is {show(error['input'])}", place.expected)


def _no_array(place: Location, error: ErrorDetails) -> Refused:
    if len(place.path) > 1:
        what, remedy = "must be an array", place.expected
    else:
        what, remedy = "must be an array of tables", f"write [[{place.path[0]}]]"
    return Refused(place.path, f"{what}, is {show(error['input'])}", remedy)


def _out_of_bounds(place: Location, error: ErrorDetails) -> Refused:
    key, what = _BOUNDS[error["type"]]
    bound, value = error["ctx"][key], error["input"]
    what = f"{what} {bound:g}"
    if 0.0 < bound < _TINY and value <= 0.0:
        what = "must be positive"
    return Refused(place.path, f"{what}, is {show(value)}", place.expected)


def _missing(place: Location, error: ErrorDetails) -> Refused:
    key = place.path[-1]
    if isinstance(key, int):
        what = f"has too few elements: {show(error['input'])}"
        return Refused(place.path[:-1], what, place.expected)
    added = str(key)
    if len(place.path) == 1:
        added = f"[[{key}]]" if key in ("particles", "loading") else f"[{key}]"
    return Refused(place.path, "is missing", f"add {added}: {place.description}")


def _unknown_key(place: Location, _error: ErrorDetails) -> Refused:
    known = place.known_keys
    if (match := _UNIT_SUFFIX.fullmatch(str(place.path[-1]))) and match[1] in known:
        what = "unknown key: keys carry no unit, all numbers are in SI units"
        return Refused(place.path, what, f"did you mean '{match[1]}'?")
    if kinds := place.kinds_with_key:
        what = f'unknown key of kind = "{_kind_of(place.table)}"'
        return Refused(place.path, what, f"remove it: it belongs to {name_list(kinds)}")
    remedy = did_you_mean(str(place.path[-1]), known) or f"known here: {name_list(known)}"
    return Refused(place.path, "unknown key", remedy)


def _not_one_of(place: Location, error: ErrorDetails) -> Refused:
    path, value, context = place.path, error["input"], error["ctx"]
    if "expected_tags" in context:
        path, value = (*path, "kind"), value.get("kind")
    choices = re.findall(r"'([^']*)'", context.get("expected_tags") or context["expected"])
    one, use = ("one of ", "use one of them") if len(choices) > 1 else ("", place.expected)
    remedy = did_you_mean(value, choices) if isinstance(value, str) else ""
    what = f"{show(value)} is not {one}{name_list(choices)}"
    if place.instead and path == place.path:
        is_kind = value in place.instead
        remedy = f'write {{ kind = "{value}", … }}' if is_kind else remedy or place.expected
    return Refused(path, what, remedy or use)


def _no_tag(place: Location, error: ErrorDetails) -> Refused:
    if isinstance(error["input"], dict):
        return Refused((*place.path, "kind"), "is missing", f"add kind: {place.description}")
    return Refused(place.path, f"must be a table, is {show(error['input'])}", place.expected)


def _not_exactly_one(place: Location, error: ErrorDetails) -> Refused:
    value, what = error["input"], f"is {show(error['input'])}"
    if isinstance(value, dict):
        what = f"has {name_list(map(str, value)) or 'none'}"
    return Refused(place.path, what, error["msg"])


def _wrong_length(place: Location, error: ErrorDetails) -> Refused:
    context, value = error["ctx"], error["input"]
    side, key = ("at most", "max_length") if "max_length" in context else ("at least", "min_length")
    size = count_noun(context[key], "element")
    if isinstance(value, str):
        size = f"{context[key]} characters"
    return Refused(place.path, f"must have {side} {size}, has {len(value)}", place.expected)


def _wrong_characters(place: Location, error: ErrorDetails) -> Refused:
    what = f"{show(error['input'])} is empty or has characters that are not allowed here"
    pattern = error["ctx"]["pattern"]
    signs = " . _ -" if "._-" in pattern else " _ -" if "_-" in pattern else " _"
    rule = f"use letters, digits and{signs} only; " if "A-Za-z" in pattern else ""
    return Refused(place.path, what, f"{rule}{place.expected}")


_HANDLERS: dict[str, Callable[[Location, ErrorDetails], Refused]] = {
    "missing": _missing,
    "extra_forbidden": _unknown_key,
    "literal_error": _not_one_of,
    "union_tag_invalid": _not_one_of,
    "union_tag_not_found": _no_tag,
    "one_of": _not_exactly_one,
    "tuple_type": _no_array,
    **dict.fromkeys(_BOUNDS, _out_of_bounds),
    **dict.fromkeys(("too_long", "too_short"), _wrong_length),
    **dict.fromkeys(("string_too_long", "string_too_short"), _wrong_length),
    "string_pattern_mismatch": _wrong_characters,
    "value_error": lambda place, error: error["ctx"]["error"].within(*place.path),
}

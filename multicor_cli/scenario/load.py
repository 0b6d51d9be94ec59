"""Reading scenario files and values from the command line: all that is wrong, with positions."""

from __future__ import annotations

import difflib
import errno
import re
import tomllib
from collections.abc import Sequence
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from multicor_cli.files import Unfit, read_regular
from multicor_cli.scenario.base import DIRECTORY
from multicor_cli.scenario.checks import check_all
from multicor_cli.scenario.expressions import Evaluated, unused_overrides
from multicor_cli.scenario.particles import take_groups
from multicor_cli.scenario.problems import (
    MAX_NESTING,
    OVERRIDE,
    KeyPath,
    Lines,
    Problem,
    Refused,
    ScenarioError,
    Sources,
    find_deep_nesting,
    format_key,
    name_list,
    parse_key,
    show,
)
from multicor_cli.scenario.tables import PartialScenario, ScenarioModel
from multicor_cli.scenario.translate import translate

# ---- Values from the command line: `--set loading.1.duration=2.0`

_WORD = re.compile(r"[^\W\d][\w ./:~+-]*|[./~][\w ./:~+-]*")


def apply_overrides(
    data: dict[str, Any], overrides: Sequence[str]
) -> tuple[dict[KeyPath, str], list[Problem]]:
    """Set values in a parsed document, which is **modified**.

    Each override, applied in their order, is ``key=value``: a dotted key with 0-based indices for
    elements of arrays, and a value in TOML syntax; words that are no TOML values, and expressions
    (``key== 2*d``), are taken as strings. Tables that are missing on the way are added, elements of
    arrays are not. Returns the argument that has set each path, and the problems of the others.
    """
    applied: dict[KeyPath, str] = {}
    problems = []
    for argument in overrides:
        try:
            path = _assign(data, *_parse(argument))
        except Refused as error:
            key = format_key(error.where)
            problems.append(Problem(OVERRIDE, 0, 0, key, error.what, error.remedy, argument))
            continue
        # What is set again is set last: overrides are kept in the order in which they hold
        applied.pop(path, None)
        applied[path] = argument
    return applied, problems


def _parse(argument: str) -> tuple[KeyPath, Any]:
    remedy = "write key=value, as loading.1.duration=2.0"
    if find_deep_nesting(argument) is not None:
        raise Refused((), f"nested more than {MAX_NESTING} deep", remedy)
    try:
        key, end = parse_key(argument)
    except ValueError:
        raise Refused((), f"{show(argument)} has no key", remedy) from None
    text = argument[end + 1 :].strip()
    try:
        table = tomllib.loads(f"value = {text}")
    except ValueError:
        table = {}
    if len(table) == 1:
        return key, table["value"]
    if _WORD.fullmatch(text) or text.startswith("="):
        return key, text
    remedy = 'write it as in the file, strings in quotes: name="a b"'
    raise Refused(key, f"{show(text)} is not a valid TOML value", remedy)


def _assign(data: dict[str, Any], key: KeyPath, value: Any) -> KeyPath:
    """Set ``value``; returns the path (indices as numbers) of the outermost new or changed key."""
    node: Any = data
    path: KeyPath = ()
    for depth, part in enumerate(key[:-1], start=1):
        place = _place(node, part, key, path)
        path = (*path, place)
        if isinstance(node, dict) and place not in node:
            if any(str(part).isdecimal() for part in key[depth:]):
                matches = difflib.get_close_matches(str(part)[:100], list(node)[:200], n=1)
                remedy = f"there is {name_list(node) or 'nothing'}"
                if matches:
                    remedy = f"did you mean '{matches[0]}'?"
                raise Refused(key, f"there is no {format_key(key[:depth])}", remedy)
            for inner in reversed(key[depth:]):  # new tables
                value = {inner: value}
            node[place] = value
            return path
        node = node[place]
    place = _place(node, key[-1], key, path)
    node[place] = value
    return (*path, place)


def _place(node: Any, part: str | int, key: KeyPath, path: KeyPath) -> str | int:
    """Key or index at which ``part`` is found in ``node``."""
    name, text = format_key(path) or "the scenario", str(part)
    if isinstance(node, dict):
        if text.isdecimal() and part not in node:
            known = name_list(node) or "nothing"
            raise Refused(key, f"{name} is not an array: it has no index {part}", f"it has {known}")
        return part
    if not isinstance(node, list):
        raise Refused(key, f"{name} is {show(node)}: it has no key {show(part)}", "shorten the key")
    if not (text.isdecimal() and text.isascii()) or len(text) > 9 or int(text) >= len(node):
        limits = f"use 0 to {len(node) - 1}" if node else "it is empty"
        what = f"{name} is an array of {len(node)}: it has no index {show(part)}"
        raise Refused(key, what, limits)
    return int(text)


# ---- Files

MAX_FILE_SIZE = 1_000_000
"""Largest scenario file [bytes], checked in about a second; tables of grains go elsewhere."""

_MAX_ERRORS = 500
_SYNTAX_POSITION = re.compile(
    r"^(.*?) \(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL
)
_QUOTED_PATH = re.compile(r"\((('[^']*'(, |,)?)+)\)")
_QUOTED_PART = re.compile(r"'([^']*)'")
_LONG_NUMBER = re.compile(r"[0-9_]{1000,}")


def read_tables(
    text: str, path: Path, overrides: Sequence[str], file: str
) -> tuple[ScenarioModel, Sources]:
    """The tables of a text, and what gives later problems their positions.

    Paths in it are relative to the directory of ``path``; messages call it ``file``, or name keys
    only if that is empty. Raises `ScenarioError` about all that is wrong.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n")
    data = deepcopy(parse_toml(text, file))
    applied, problems = apply_overrides(data, overrides)
    evaluated = Evaluated(data, ScenarioModel)
    sources = Sources(file, text, applied, evaluated.shown, overrides)
    has_taken = take_groups(data, path.parent)
    model, invalid = check_document(data, path.parent)
    if has_taken:  # what is wrong with a group is at the key of the run: the file does not name it
        invalid = [
            Refused(("start", "run"), f"{format_key(f.where)} of this run: {f.what}", f.remedy)
            if f.where[0] == "particles"
            else f
            for f in invalid
        ]
    findings = evaluated.findings + [
        f for f in invalid if not _is_within(f.where, evaluated.failed)
    ]
    findings = _add_new(findings, unused_overrides(data, applied, evaluated.used))
    if model is None or problems or findings:
        raise ScenarioError([*problems, *sources.problems(findings)])
    return model, sources


def check_document(
    data: dict[str, Any], directory: Path
) -> tuple[ScenarioModel | None, list[Refused]]:
    """All that is wrong with a document, and its model if each table is valid on its own."""
    context = {DIRECTORY: directory}
    try:
        model = ScenarioModel.model_validate(data, context=context)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        findings = translate(ScenarioModel, errors[:_MAX_ERRORS])
        return None, _add_new(findings, check_all(PartialScenario.of_document(data, context)))
    return model, _add_new([], check_all(PartialScenario.of_model(model)))


def _add_new(findings: list[Refused], further: list[Refused]) -> list[Refused]:
    """``findings`` with those of ``further`` that are about other keys."""
    known = {finding.where for finding in findings}
    for finding in further:
        if not _is_within(finding.where, known):
            findings.append(finding)
            known.add(finding.where)
    return findings


def _is_within(path: KeyPath, known: set[KeyPath]) -> bool:
    """Whether a problem at this key or around it is known already."""
    return any(path[:end] in known for end in range(1, len(path) + 1))


def read_text(path: Path, *, kind: str = "scenario") -> str:
    """Text of a file; raises `ScenarioError` if it is unreadable, too large, or not UTF-8."""
    line = column = 0
    try:
        content = read_regular(path, MAX_FILE_SIZE)
        return content.decode("utf-8")
    except FileNotFoundError:
        hint = ", or make one with: multicor new NAME" if kind == "scenario" else ""
        what, remedy = "there is no such file", f"check the path{hint}"
    except Unfit as error:
        what = f"this cannot be a {kind}: {error.strerror}"
        remedy = f"give the path of a {kind} file"
        if error.errno == errno.EFBIG:
            remedy = "put long tables of grains into a CSV file"
    except OSError as error:
        what = f"the file cannot be read: {error.strerror}"
        remedy = "check the path and its permissions"
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        begin = content.rfind(b"\n", 0, error.start) + 1
        column = len(content[begin : error.start].decode("utf-8", "replace")) + 1
        what = f"the byte 0x{content[error.start]:02x} is not UTF-8"
        remedy = "save the file with the encoding UTF-8"
    raise ScenarioError([Problem(str(path), line, column, "", what, remedy)])


@lru_cache(maxsize=4)  # a study makes all its cases from one text
def parse_toml(text: str, file: str) -> dict[str, Any]:
    """A document, not to be modified; raises `ScenarioError` if not TOML, or too deep."""
    offset = find_deep_nesting(text)
    message, remedy = f"nested more than {MAX_NESTING} deep", "use fewer levels"
    if offset is None:
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError([_syntax_problem(file, text, str(error))]) from None
        except (ValueError, RecursionError) as error:  # numbers with thousands of digits
            number = _LONG_NUMBER.search(text)
            message = "a number has too many digits" if number else f"not TOML: {error}"
            offset, remedy = number.start() if number else 0, "write it as 1e3"
    lines = Lines(text)
    line, column = lines.position(offset)
    raise ScenarioError([Problem(file, line, column, "", message, remedy, lines.line(line))])


def _syntax_problem(file: str, text: str, message: str) -> Problem:
    lines = Lines(text.rstrip("\n"))
    line, column, what = lines.count, len(lines.line(lines.count)) + 1, message
    if match := _SYNTAX_POSITION.match(message):
        what = match[1]
        line, column = (int(match[2]), int(match[3])) if match[2] else (line, column)
    what = _QUOTED_PATH.sub(lambda path: format_key(tuple(_QUOTED_PART.findall(path[1]))), what)
    remedy = "write [table], then key = value lines; strings in quotes"
    if text.lstrip().startswith(("{", "---", "<")):
        remedy = "this looks like JSON, YAML or XML; write TOML: [table], then key = value lines"
    elif what.startswith(("Cannot declare", "Cannot mutate")):
        remedy = "write a table once; [[name]] for each of several tables"
    elif what.startswith(("Cannot overwrite", "Duplicate")):
        remedy = "give each key once"
    return Problem(file, line, column, "", f"not TOML: {what}", remedy, lines.line(line))

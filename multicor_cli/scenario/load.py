"""Reading scenario files: everything that is wrong is found at once, with its position."""

from __future__ import annotations

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
from multicor_cli.scenario.checks import Draft, check_all
from multicor_cli.scenario.csv_columns import DIRECTORY
from multicor_cli.scenario.evaluate import evaluate_expressions, unused_overrides
from multicor_cli.scenario.locate import MAX_NESTING, Lines, find_deep_nesting
from multicor_cli.scenario.models import ScenarioModel
from multicor_cli.scenario.overrides import apply_overrides
from multicor_cli.scenario.problems import Finding, KeyPath, Problem, ScenarioError, format_key
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.sources import Sources
from multicor_cli.scenario.start import take_groups
from multicor_cli.scenario.translate import translate

MAX_FILE_SIZE = 1_000_000
"""Largest scenario file [bytes]: what can be parsed and checked in about a second; tables of grains go into other files."""

_MAX_ERRORS = 500
_SYNTAX_POSITION = re.compile(r"^(.*?) \(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)
_QUOTED_PATH = re.compile(r"\((('[^']*'(, |,)?)+)\)")
_QUOTED_PART = re.compile(r"'([^']*)'")
_LONG_NUMBER = re.compile(r"[0-9_]{1000,}")


def load_scenario(path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Load and check a scenario file.

    Args:
        path: The TOML file.
        overrides: Values set on the command line, each ``key=value`` as in ``loading.1.duration=2.0``.

    Raises:
        ScenarioError: The file cannot be read or the scenario is wrong; its ``problems`` say all that is wrong.
    """
    path = Path(path)
    return parse_scenario(read_text(path), path, overrides)


def parse_scenario(text: str, path: str | Path, overrides: Sequence[str] = (), *, file: str | None = None) -> Scenario:
    """Check the text of a scenario file; as `load_scenario`, with ``path`` used for messages and relative paths only.

    Args:
        text: The text.
        path: The file.
        overrides: Values set on the command line.
        file: What messages call the file, if that is not its path; empty: they name keys only.

    Raises:
        ScenarioError: The scenario is wrong.
    """
    file = str(path) if file is None else file
    path, text = Path(path), text.removeprefix("\ufeff").replace("\r\n", "\n")
    data = deepcopy(parse_toml(text, file))
    applied, problems = apply_overrides(data, overrides)
    evaluated = evaluate_expressions(data)
    sources = Sources(file, text, applied, evaluated.shown, overrides)
    has_taken = take_groups(data, path.parent)
    model, invalid = check_document(data, path.parent)
    if has_taken:
        invalid = [_about_start(finding) for finding in invalid]
    findings = [*evaluated.findings, *(finding for finding in invalid if not _is_within(finding.path, evaluated.failed))]
    findings = _add_new(findings, unused_overrides(data, applied, evaluated.used))
    if model is None or problems or findings:
        raise ScenarioError([*problems, *sources.problems(findings)])
    return Scenario(model, path, sources)


def _about_start(finding: Finding) -> Finding:
    """A problem of a group that the file does not name, where the file names the run that has it."""
    if finding.path[0] != "particles":
        return finding
    return Finding(("start", "run"), f"{format_key(finding.path)} of this run: {finding.message}", finding.remedy)


def check_document(data: dict[str, Any], directory: Path) -> tuple[ScenarioModel | None, list[Finding]]:
    """Everything that is wrong with a parsed document, and its model if each table is valid on its own.

    Args:
        data: The document.
        directory: That of its file, to which paths in it are relative.
    """
    context = {DIRECTORY: directory}
    try:
        model = ScenarioModel.model_validate(data, context=context)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        findings = translate(ScenarioModel, errors[:_MAX_ERRORS])
        return None, _add_new(findings, check_all(Draft.of_document(data, context)))
    return model, _add_new([], check_all(Draft.of_model(model)))


def _add_new(findings: list[Finding], further: list[Finding]) -> list[Finding]:
    """``findings`` with those of ``further`` that are about other keys."""
    known = {finding.path for finding in findings}
    for finding in further:
        if not _is_within(finding.path, known):
            findings.append(finding)
            known.add(finding.path)
    return findings


def _is_within(path: KeyPath, known: set[KeyPath]) -> bool:
    """Whether a problem at this key or around it is known already."""
    return any(path[:end] in known for end in range(1, len(path) + 1))


def read_text(path: Path, *, kind: str = "scenario") -> str:
    """Text of a file of some ``kind``.

    Raises:
        ScenarioError: It cannot be read, is too large, or is not UTF-8.
    """
    try:
        content = read_regular(path, MAX_FILE_SIZE)
    except FileNotFoundError:
        hint = ", or make one with: multicor new NAME" if kind == "scenario" else ""
        raise ScenarioError([_whole_file(path, "there is no such file", f"check the path{hint}")]) from None
    except Unfit as error:
        is_large = error.errno == errno.EFBIG
        remedy = "put long tables of grains into a CSV file" if is_large else f"give the path of a {kind} file"
        raise ScenarioError([_whole_file(path, f"this cannot be a {kind}: {error.strerror}", remedy)]) from None
    except OSError as error:
        what = f"the file cannot be read: {error.strerror}"
        raise ScenarioError([_whole_file(path, what, "check the path and its permissions")]) from None
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ScenarioError([_not_utf8(path, content, error.start)]) from None


def _whole_file(path: Path, message: str, remedy: str) -> Problem:
    return Problem(str(path), 0, 0, "", message, remedy)


def _not_utf8(path: Path, content: bytes, offset: int) -> Problem:
    line = content.count(b"\n", 0, offset) + 1
    begin = content.rfind(b"\n", 0, offset) + 1
    column = len(content[begin:offset].decode("utf-8", "replace")) + 1
    message = f"the byte 0x{content[offset]:02x} is not UTF-8"
    return Problem(str(path), line, column, "", message, "save the file with the encoding UTF-8")


@lru_cache(maxsize=4)  # a study makes all its cases from one text
def parse_toml(text: str, file: str) -> dict[str, Any]:
    """The document of a text, which must not be modified.

    Raises:
        ScenarioError: It is not TOML, or nested too deep.
    """
    if (offset := find_deep_nesting(text)) is not None:
        message = f"nested more than {MAX_NESTING} deep"
        raise ScenarioError([_at_offset(file, text, offset, message, "use fewer levels")])
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError([_syntax_problem(file, text, str(error))]) from None
    except (ValueError, RecursionError) as error:  # numbers with thousands of digits
        number = _LONG_NUMBER.search(text)
        message = "a number has too many digits" if number else f"not TOML: {error}"
        raise ScenarioError([_at_offset(file, text, number.start() if number else 0, message, "write it as 1e3")]) from None


def _at_offset(file: str, text: str, offset: int, message: str, remedy: str) -> Problem:
    lines = Lines(text)
    line, column = lines.position(offset)
    return Problem(file, line, column, "", message, remedy, lines.line(line))


def _syntax_problem(file: str, text: str, message: str) -> Problem:
    lines = Lines(text.rstrip("\n"))
    line, column, what = lines.count, len(lines.line(lines.count)) + 1, message
    if match := _SYNTAX_POSITION.match(message):
        what = match[1]
        line, column = (int(match[2]), int(match[3])) if match[2] else (line, column)
    what = _QUOTED_PATH.sub(lambda path: format_key(tuple(_QUOTED_PART.findall(path[1]))), what)
    return Problem(file, line, column, "", f"not TOML: {what}", _syntax_remedy(text, what), lines.line(line))


def _syntax_remedy(text: str, what: str) -> str:
    if text.lstrip().startswith(("{", "---", "<")):
        return "this looks like JSON, YAML or XML; write TOML: [table], then key = value lines"
    if what.startswith(("Cannot declare", "Cannot mutate")):
        return "write a table once; [[name]] for each of several tables"
    if what.startswith(("Cannot overwrite", "Duplicate")):
        return "give each key once"
    return "write [table], then key = value lines; strings in quotes"

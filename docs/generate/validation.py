"""The page of what validation prints, and the figures of what it found:
``python docs/generate/validation.py LONG.xml SHORT.xml``.

The files come from a quarter of an hour of tests, the long ones and those against closed forms::

    python -m pytest -m validation --junitxml=LONG.xml -o junit_logging=system-out
    python -m pytest tests/verification --junitxml=SHORT.xml
"""

from __future__ import annotations

import ast
import json
import sys
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from validation_figures import draw_figures

import multicor_cli
from multicor_cli.store.provenance import processor

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "recorded-validation.md"
_HEAD = """# Validation, as recorded

What `python -m pytest -m validation` printed on {date} (multicor {version}, {processor}): {passed}
tests passed, {failed} failed. {short} further tests against closed forms and independent
computations (`tests/verification`), which are part of every run of the tests, passed, too.
`python docs/generate/validation.py` made this page and the figures of [validation](validation.md)
of it. Runs give the same bits everywhere; what is asked of the numbers stands in the tests.
"""


def main() -> None:
    """Write the page."""
    suites = [ET.parse(file).getroot().findall("testsuite") for file in sys.argv[1:]]
    cases, short = (
        [
            case
            for suite in of_file
            for case in suite.findall("testcase")
            if case.find("skipped") is None
        ]
        for of_file in suites
    )
    draw_figures(_numbers(cases + short), ROOT / "docs" / "pictures")
    assert all(map(_has_passed, short))
    failed = [case for case in cases if not _has_passed(case)]
    parts = [
        _HEAD.format(
            date=suites[0][0].attrib["timestamp"][:10], version=multicor_cli.__version__,
            processor=processor(),
            passed=len(cases) - len(failed), failed=len(failed), short=len(short),
        )
    ]  # fmt: skip
    by_module = defaultdict(list)
    for case in cases:
        by_module[case.attrib["classname"]].append(case)
    for module, members in by_module.items():
        path = Path(*module.split(".")).with_suffix(".py")
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        about = {
            node.name: ast.get_docstring(node)
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef)
        }
        parts.append(f"## {_first(ast.get_docstring(tree))}\n\n`{path}`\n")
        parts += [_case(case, about.get(case.attrib["name"].partition("[")[0])) for case in members]
    PAGE.write_text("\n".join(parts), encoding="utf-8")


def _numbers(cases: Iterable[ET.Element]) -> dict[str, list[dict[str, Any]]]:
    """What tests have kept (`tests/support/recorded.py`), by the names of their functions."""
    found = defaultdict(list)
    for case in cases:
        for kept in case.iter("property"):
            found[case.attrib["name"].partition("[")[0]].append(json.loads(kept.attrib["value"]))
    return found


def _has_passed(case: ET.Element) -> bool:
    return case.find("failure") is None and case.find("error") is None


def _case(case: ET.Element, docstring: str | None) -> str:
    name, seconds = case.attrib["name"], float(case.attrib["time"])
    result = "passed" if _has_passed(case) else "**failed**"
    title = name.removeprefix("test_").replace("_", " ").replace("[", ": ").replace("]", "")
    lines = [f"**{title[0].upper()}{title[1:]}**: {result}, {seconds:.0f} s."]
    if docstring:
        lines[0] += f" {_first(docstring)}"
    out = case.find("system-out")
    printed = [
        line.rstrip()
        for line in ((out.text or "") if out is not None else "").splitlines()
        if line.strip(" -")
    ]
    if printed and "Captured Out" in printed[0]:
        printed = printed[1:]
    if printed:
        lines.append("```text\n" + "\n".join(printed) + "\n```")
    return "\n\n".join(lines) + "\n"


def _first(docstring: str | None) -> str:
    """The first paragraph of a docstring."""
    return " ".join((docstring or "").split("\n\n")[0].split()).rstrip(".")


if __name__ == "__main__":
    main()

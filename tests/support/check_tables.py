"""The tables of docs/reference/checks.md: ``python tests/support/check_tables.py`` writes them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from multicor_cli import checks
from multicor_cli.checks import Rule

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "checks.md"

_TABLE = re.compile(r"(<!-- table (\w+) -->\n).*?(\n<!-- end -->)", re.DOTALL)


def with_tables(text: str) -> str:
    """The text of the page with its tables as they are now."""
    return _TABLE.sub(lambda found: found[1] + _table(getattr(checks, found[2])) + found[3], text)


def _table(rules: tuple[Rule[Any], ...]) -> str:
    lines = ["| check | limit | meaning | remedy |", "|---|---|---|---|"]
    for rule in rules:
        limit = f"{rule.limit} {rule.unit}" if rule.unit and rule.limit != "none" else rule.limit
        lines.append(f"| {rule.name} | {limit} | {rule.meaning} | {rule.remedy} |")
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")

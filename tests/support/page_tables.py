"""Tables in pages about checks and files: ``python tests/support/page_tables.py`` writes them."""

import re
from pathlib import Path

from multicor_cli import checks
from multicor_cli.model import shapes
from multicor_cli.store import schema

_REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
CHECKS = _REFERENCE / "checks.md"
FORMATS = tuple(
    _REFERENCE / "formats" / f"{name}.md" for name in ("results", "checkpoint", "run-directory")
)

_TABLE = re.compile(r"(<!-- table (\w+) -->\n).*?(\n<!-- end -->)", re.DOTALL)
_VERSION = re.compile(r"(\*\*Format version )[\d.]+(\.\*\*)")


def with_tables(text: str) -> str:
    """The text of a page with its tables, and the version of the format, as they are now."""
    version = ".".join(map(str, schema.FORMAT_VERSION))
    text = _VERSION.sub(rf"\g<1>{version}\g<2>", text)
    return _TABLE.sub(lambda found: found[1] + _table(found[2]) + found[3], text)


def _table(name: str) -> str:
    if name == "SHAPES":
        return shapes.markdown()
    if hasattr(schema, name):
        return schema.markdown(getattr(schema, name))
    lines = ["| check | limit | meaning | remedy |", "|---|---|---|---|"]
    for rule in getattr(checks, name):
        limit = f"{rule.limit} {rule.unit}" if rule.unit and rule.limit != "none" else rule.limit
        lines.append(f"| {rule.name} | {limit} | {rule.meaning} | {rule.remedy} |")
    return "\n".join(lines)


if __name__ == "__main__":
    for page in (CHECKS, *FORMATS):
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")

"""The tables in pages on the file format: ``python tests/support/format_tables.py`` writes them."""

from __future__ import annotations

import re
from pathlib import Path

from multicor_cli.model import shapes
from multicor_cli.store import schema

FORMATS = Path(__file__).resolve().parents[2] / "docs" / "reference" / "formats"
PAGES = tuple(FORMATS / f"{name}.md" for name in ("results", "checkpoint", "run-directory"))

_TABLE = re.compile(r"(<!-- table (\w+) -->\n).*?(\n<!-- end -->)", re.DOTALL)
_VERSION = re.compile(r"(\*\*Format version )[\d.]+(\.\*\*)")


def with_tables(text: str) -> str:
    """The text of a page with its tables, and the version of the format, as they are now."""
    version = ".".join(map(str, schema.FORMAT_VERSION))
    text = _VERSION.sub(rf"\g<1>{version}\g<2>", text)
    return _TABLE.sub(lambda found: found[1] + _table(found[2]) + found[3], text)


def _table(name: str) -> str:
    return shapes.markdown() if name == "SHAPES" else schema.markdown(getattr(schema, name))


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")

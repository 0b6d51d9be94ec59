"""Tables in pages about checks, files and what is measured: ``python tests/support/page_tables.py``
writes them."""

import re
from pathlib import Path

from multicor_cli import checks, post
from multicor_cli.model import shapes
from multicor_cli.post.avalanches import EVENTS
from multicor_cli.post.conductivity import FLUX_QUANTITIES
from multicor_cli.post.conductivity import QUANTITIES as OF_CONDUCTIVITY
from multicor_cli.post.energy import HEAT, MECHANICAL
from multicor_cli.post.fabric import OF_SHAPES
from multicor_cli.post.field_sums import Known, field_list
from multicor_cli.post.forces import NUMBERS
from multicor_cli.post.mixing import MIXING, SEGREGATION
from multicor_cli.post.region import QUANTITIES as OF_REGION
from multicor_cli.post.rheology import CELL_QUANTITIES
from multicor_cli.post.rheology import QUANTITIES as OF_RHEOLOGY
from multicor_cli.post.table import Quantity, split_unit
from multicor_cli.store import schema
from multicor_cli.text import unit_sign

_REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
CHECKS = _REFERENCE / "checks.md"
POST = _REFERENCE / "post.md"
FORMATS = tuple(
    _REFERENCE / "formats" / f"{name}.md" for name in ("results", "checkpoint", "run-directory")
)


def _label_and_unit(text: str) -> tuple[str, str, str]:
    label, unit = split_unit(text)
    return label, "", unit or "1"


_TABLE = re.compile(r"(<!-- table (\w+) -->\n).*?(\n<!-- end -->)", re.DOTALL)
_VERSION = re.compile(r"(\*\*Format version )[\d.]+(\.\*\*)")


def with_tables(text: str) -> str:
    """The text of a page with its tables, and the version of the format, as they are now."""
    version = ".".join(map(str, schema.FORMAT_VERSION))
    text = _VERSION.sub(rf"\g<1>{version}\g<2>", text)
    return _TABLE.sub(lambda found: found[1] + _table(found[2]) + found[3], text)


MEASURED: dict[str, tuple[Quantity, ...]] = {
    "profile": tuple(post.PROFILED.values()),
    "map": tuple(post.MAPPED.values()),
    "fields": tuple(field_list("xy", Known(True, True, True))),
    "rheology": OF_RHEOLOGY,
    "rheology of a cell": CELL_QUANTITIES,
    "region": OF_REGION,
    "conductivity": (*OF_CONDUCTIVITY, *FLUX_QUANTITIES),
    "fabric": OF_SHAPES,
    "forces": tuple(Quantity(n, *_label_and_unit(text)) for n, text in NUMBERS.items()),
    "mixing": (*MIXING, *SEGREGATION.values()),
    "avalanches": EVENTS,
    "energy": (*MECHANICAL, *HEAT),
}
"""Quantities by command."""


def _measured() -> str:
    """A row for each quantity, with its names and all commands that have it."""
    symbols: dict[tuple[str, str], str] = {}
    names: dict[tuple[str, str], list[str]] = {}
    commands: dict[tuple[str, str], list[str]] = {}
    for command, quantities in MEASURED.items():
        for each in quantities:
            row = each.label.strip().removeprefix("of this "), unit_sign(each.unit)
            symbols[row] = symbols.get(row) or each.symbol
            names.setdefault(row, []).append(f"`{each.name}`")
            commands.setdefault(row, []).append(command)
    lines = ["| Quantity | Symbol | Unit | Names | Of |", "|---|---|---|---|---|"]
    for (label, unit), symbol in symbols.items():
        tex = re.sub(r"\|(.*?)\|", r"\\lvert \1\\rvert{}", f"${symbol}$") if symbol else ""
        cells = (label.replace("|", r"\|"), tex, unit, *(
            ", ".join(dict.fromkeys(told[label, unit])) for told in (names, commands)
        ))  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _table(name: str) -> str:
    if name == "SHAPES":
        return shapes.markdown()
    if name == "MEASURED":
        return _measured()
    if hasattr(schema, name):
        return schema.markdown(getattr(schema, name))
    lines = ["| check | limit | meaning | remedy |", "|---|---|---|---|"]
    for rule in getattr(checks, name):
        limit = f"{rule.limit} {rule.unit}" if rule.unit and rule.limit != "none" else rule.limit
        lines.append(f"| {rule.name} | {limit} | {rule.meaning} | {rule.remedy} |")
    return "\n".join(lines)


if __name__ == "__main__":
    for page in (CHECKS, POST, *FORMATS):
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")

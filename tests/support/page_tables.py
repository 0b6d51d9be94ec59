"""Tables in pages about checks, files and what is measured: ``python tests/support/page_tables.py``
writes them."""

import re
from pathlib import Path

from multicor_cli import checks, post
from multicor_cli.model.books import entry_counts
from multicor_cli.model.shapes import SHAPES
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


_SYMBOLS: dict[str, str] = {
    "one": "1", "frame": "K", "frame_edge": "K+1", "particle_row": "P", "contact_row": "C",
    "rolling_row": "C°", "near_row": "C⁺", "series_row": "S", "grain": "n", "shape": "m",
    "wall": "w", "material": "k", "group": "g", "stage": "L", "table_edge": "T+1", "table_row": "R",
    "heat_grain": "n*", "heat_wall": "w*", "heat_book": "b*", "mean_row": "A", "stage_note": "N",
    "origin_row": "w°", "surface_row": "w°", "ahead_row": "w°", "before_row": "B", "outlet": "o",
    "exchange_grain": "n°", "exchange_group": "g°", "exchange_outlet": "o°", "exchange_book": "x°",
    "bridge_row": "V", "adhesion_book": "a°", "cell_grain": "n⁺", "gradient_book": "G°",
    "flux_book": "F°",
    "expansion_grain": "n†", "expansion_book": "G†", "point_row": "C‡",
    "near_point_row": "C‡", "late_row": "C′", "grain_edge": "n+1",
    "piece": "p", "piece_edge": "p+1", "corner": "v",
}  # fmt: skip
"""Of dimensions."""


def _datasets(table: tuple[schema.Dataset, ...]) -> str:
    """Path, type, shape, unit, meaning, since (and feature)."""
    symbols = _SYMBOLS | {dim: str(count) for dim, count in entry_counts().items()}
    lines = ["| path | type | shape | unit | meaning | since |", "|---|---|---|---|---|---|"]
    for row in table:
        shape = ", ".join(symbols[d] if isinstance(d, str) else str(d) for d in row.dims)
        since = ".".join(map(str, row.since)) + (f", {row.only_with}" if row.only_with else "")
        meaning = row.meaning.replace("|", "\\|")
        lines.append(
            f"| `{row.path}` | {row.dtype} | ({shape}) | {row.unit} | {meaning} | {since} |"
        )
    return "\n".join(lines)


def _shapes() -> str:
    lines = ["| kind | name | what it is | four numbers |", "|---|---|---|---|"]
    for kind, shape in SHAPES.items():
        lines.append(f"| {kind:d} | {shape.name} | {shape.meaning} | {shape.numbers} |")
    return "\n".join(lines)


def _table(name: str) -> str:
    if name == "SHAPES":
        return _shapes()
    if name == "MEASURED":
        return _measured()
    if hasattr(schema, name):
        return _datasets(getattr(schema, name))
    lines = ["| check | limit | meaning | remedy |", "|---|---|---|---|"]
    for rule in getattr(checks, name):
        limit = f"{rule.limit} {rule.unit}" if rule.unit and rule.limit != "none" else rule.limit
        lines.append(f"| {rule.name} | {limit} | {rule.meaning} | {rule.remedy} |")
    return "\n".join(lines)


if __name__ == "__main__":
    for page in (CHECKS, POST, *FORMATS):
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")

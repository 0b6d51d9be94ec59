"""What all tables of `post` can do, besides what they hold: show themselves, and become a DataFrame of pandas."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Sequence
from typing import Any

from multicor_cli.optional import library
from multicor_cli.text import with_unit_signs

_UNIT = re.compile(r"(.*) \[([^\]]*)\]")
_SHOWN = 60  # rows in a notebook


class Table:
    """A table with ``headings`` and ``rows`` (and, where it is made of more, ``detail_headings`` and ``detail_rows``)."""

    @property
    def headings(self) -> Sequence[str]:
        """Names of the columns of `rows`, with their units in brackets."""
        raise NotImplementedError

    @property
    def rows(self) -> Sequence[Sequence[Any]]:
        """The rows."""
        raise NotImplementedError

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        raise NotImplementedError

    def to_pandas(self, *, is_detailed: bool = False) -> Any:
        """The table as a DataFrame; units of the columns are in its ``attrs["units"]``, those of quantities in a column ``unit``.

        Args:
            is_detailed: Whether to take what the table was made of (over time, or of single grains or contacts), as ``--csv`` does.

        Raises:
            MissingLibrary: If pandas is not installed.
            ValueError: If there are no details.
        """
        pd = library("pandas")
        if is_detailed and not hasattr(self, "detail_rows"):
            message = f"{type(self).__name__} has no details: leave out is_detailed"
            raise ValueError(message)
        table: Any = self
        headings, rows = (table.detail_headings, table.detail_rows) if is_detailed else (self.headings, self.rows)
        parts = [split_unit(heading) for heading in headings]
        found = pd.DataFrame([tuple(row) for row in rows], columns=[name for name, _ in parts])
        if headings[0] == "quantity":
            labels = [split_unit(label) for label in found["quantity"]]
            found["quantity"] = [name.strip() for name, _ in labels]
            found.insert(1, "unit", [unit for _, unit in labels])
        found.attrs["units"] = {name: unit for name, unit in parts if unit}
        return found

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.rows)} rows of {', '.join(self.headings)}>"

    def _repr_html_(self) -> str:
        """The table for a notebook, five digits of each number; of long tables the beginning."""
        head = "".join(f"<th>{html.escape(with_unit_signs(heading))}</th>" for heading in self.headings)
        body = "".join(f"<tr>{''.join(f'<td>{_cell(v)}</td>' for v in row)}</tr>" for row in self.rows[:_SHOWN])
        more = len(self.rows) - _SHOWN
        rest = f"<p>… and {more} more rows</p>" if more > 0 else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}"


def split_unit(text: str) -> tuple[str, str]:
    """Name and unit of a heading ``name [unit]``; without brackets there is no unit."""
    found = _UNIT.fullmatch(text)
    return (found[1], found[2]) if found else (text, "")


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.5g}"
    return html.escape(with_unit_signs(str(value)))

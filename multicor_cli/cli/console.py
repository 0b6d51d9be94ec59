"""What goes to the terminal: results on stdout, everything for people on stderr."""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Sequence
from typing import Any

from multicor_cli.text import brief, printable


def say(text: str = "") -> None:
    """A line for people, on stderr; if no one can read it anymore (a closed pipe, a closed terminal), nothing happens."""
    with contextlib.suppress(OSError):
        print(brief(printable(text)), file=sys.stderr, flush=True)


def complain(text: str) -> None:
    """An error, on stderr: one line, whatever the names in it are."""
    say(f"multicor: {text}".replace("\n", "\\n"))


def emit(text: str) -> None:
    """A line of the result, on stdout."""
    print(text)


def emit_json(data: Any) -> None:
    """The result as JSON, on stdout; numbers that are not finite become null."""
    print(json.dumps(_plain(data), indent=2, ensure_ascii=False, allow_nan=False))


def emit_table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "", has_header: bool = True) -> None:
    """A table on stdout; numbers belong into right-aligned columns, so all but the first are."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title or None, title_justify="left", box=SIMPLE_HEAD, show_header=has_header, pad_edge=False)
    for number, name in enumerate(columns):
        table.add_column(Text(name), justify="left" if number == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*(Text(brief(printable(cell))) for cell in row))
    is_terminal = sys.stdout.isatty()
    Console(file=sys.stdout, width=None if is_terminal else 200, highlight=False).print(table)


def emit_pairs(pairs: Sequence[tuple[str, str]]) -> None:
    """Names and values on stdout, aligned."""
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        emit(brief(printable(f"{name:<{width}}  {value}")))


def format_seconds(seconds: float) -> str:
    """A span of time for people, as ``42 s``, ``3 min 05 s``, ``2 h 10 min``."""
    if seconds < 99.5:
        return f"{seconds:.0f} s" if seconds >= 9.95 else f"{seconds:.2g} s"
    minutes = round(seconds) // 60
    if minutes < 60:
        return f"{minutes} min {round(seconds) % 60:02d} s"
    if minutes < 48 * 60:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{minutes / 1440:.1f} days"


def _plain(value: Any) -> Any:
    """Python's own types, with None for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

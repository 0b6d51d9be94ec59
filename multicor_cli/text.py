"""Text for people; text from outside is made safe to print, since control characters could command a terminal.

Uses the standard library only.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def printable(text: str) -> str:
    """Any text with control characters escaped, except line breaks and tabs."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str) -> str:
    """Any text on one line, one printed character for each of its own: what cannot be printed becomes ``�``."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def format_bytes(size: float) -> str:
    """A size in bytes with a unit, as ``1.5 GB``."""
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 999.5 or unit == "TB":
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.3g} {unit}"
        size /= 1000.0
    raise AssertionError


def count_noun(number: int, noun: str) -> str:
    """A number with its noun: ``1 stage``, ``2 stages``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def choices(word: str, known: Iterable[str]) -> str:
    """What there is instead of a word that is not known, the most similar first: for the end of a message."""
    names = list(known)
    near = difflib.get_close_matches(word[:100], names, 1)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return f"{hint}choose from: {', '.join(names)}"

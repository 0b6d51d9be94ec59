"""Text from outside, made safe to print: control characters could command a terminal. Uses the standard library only."""

from __future__ import annotations


def printable(text: str) -> str:
    """Any text with control characters escaped, except line breaks and tabs."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str) -> str:
    """Any text on one line, one printed character for each of its own: what cannot be printed becomes ``�``."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)

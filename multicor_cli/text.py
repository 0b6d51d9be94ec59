"""Texts that came from outside must not command a terminal. Needs nothing but Python."""

from __future__ import annotations


def printable(text: str) -> str:
    """Any text with control characters as their escapes; lines stay lines."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str) -> str:
    """Any text on one line and as wide as it is long: what cannot be printed becomes ``�``."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)

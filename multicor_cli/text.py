"""Text for people; made safe to print, since control characters could command a terminal.

Uses the standard library only.
"""

from __future__ import annotations

import difflib
import inspect
import math
import re
from collections.abc import Iterable
from typing import Any


def printable(text: str) -> str:
    """Any text with control characters escaped, except line breaks and tabs."""
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def one_line(text: str) -> str:
    """Any text on one line, as many characters: what cannot be printed becomes ``�``."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


LONGEST_WORD = 400
"""No file name is longer, and no path that people give [characters]."""

_LONGEST_LINE = 3000
_LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")


def shortened(text: str, most: int = LONGEST_WORD) -> str:
    """A text of at most ``most`` characters: the middle is left out, with a note of the length."""
    if len(text) <= most:
        return text
    mark = f"…({len(text):,} characters)…"
    room = max(most - len(mark), 2)
    return text[: room - room // 3] + mark + text[-(room // 3) :]


def brief(message: str) -> str:
    """A message that quotes what others have named, its long words, then long lines, shortened."""
    lines = (_LONG_WORD.sub(lambda word: shortened(word[0]), line) for line in message.split("\n"))
    return "\n".join(shortened(line, _LONGEST_LINE) for line in lines)


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


_OWN_LINE = re.compile(r"\n(?=- | {4})")


def unwrapped(docstring: str) -> str:
    """The text of a docstring, whatever width its source is wrapped to: a line per paragraph.

    Items of lists (``- ``) and lines indented by four spaces, as examples are, stay lines.
    """
    paragraphs = re.split(r"\n\s*\n", inspect.cleandoc(docstring))
    lines = (_OWN_LINE.split(paragraph) for paragraph in paragraphs)
    return "\n\n".join(
        "\n".join(line if line.startswith("    ") else " ".join(line.split()) for line in each)
        for each in lines
    )


_POWER = re.compile(r"(?<=[a-z])[23]")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNIT = re.compile(r"(?<= )\[([^\]\[]*)\]")


def unit_sign(unit: str) -> str:
    """A unit as people read it: ``m2/s2`` as ``m²/s²``, ``deg`` as ``°``, ``1`` as a dash."""
    if unit == "1":
        return "–"
    return _POWER.sub(lambda power: "²³"[int(power[0]) - 2], unit.replace("deg", "°"))


def with_error(mean: float, error: float) -> str:
    """A mean ± standard error, two digits of it: ``0.1024 ± 0.0023``; four of the mean if nan."""
    if not (math.isfinite(error) and error > 0.0):
        return f"{mean:.4g}".replace("-", "−")
    exponent = math.floor(math.log10(max(abs(mean), error)))
    power = exponent if not -4 < exponent < 5 else 0
    decimals = max(0, 1 - math.floor(math.log10(error)) + power)
    found = f"{mean / 10.0**power:.{decimals}f} ± {error / 10.0**power:.{decimals}f}".replace(
        "-", "−"
    )
    return f"({found})·10{str(power).translate(_RAISED)}" if power else found


def with_unit_signs(text: str) -> str:
    """A heading ``name [unit]`` as people read it."""
    return _UNIT.sub(lambda unit: f"[{unit_sign(unit[1])}]", text)


def json_value(value: Any) -> Any:
    """What JSON can say of a value: lists of arrays, null of numbers that are not finite."""
    if hasattr(value, "tolist"):  # an array or a number of NumPy
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def choices(word: str, known: Iterable[str]) -> str:
    """What to choose instead of an unknown word, the most similar first: to end a message."""
    names = list(known)
    if not names:
        return "there are none"
    near = difflib.get_close_matches(word[:100], names, 1)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return f"{hint}choose from: {', '.join(names)}"

"""Equations of the pages: TeX as it is written, MathML as browsers set it, without scripts and without anything from elsewhere."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterable
from functools import cache
from importlib.resources import files

import pypandoc
from fontTools import subset
from fontTools.ttLib import TTFont

_EQUATION = re.compile(
    r'<span class="arithmatex">\\\((?P<inline>.*?)\\\)</span>|'
    r'<div class="arithmatex">\s*\\\[(?P<display>.*?)\\\]\s*</div>',
    re.DOTALL,
)
_MATH = re.compile(r"<math.*?</math>", re.DOTALL)
_ANNOTATION = re.compile(r"<annotation.*?</annotation>", re.DOTALL)
_ITALICS = [*range(0x1D434, 0x1D468), *range(0x1D6E2, 0x1D71C), 0x210E]
"""What browsers ask a font for where a letter stands alone, since one letter is set in italics."""


def set_equations(content: str) -> str:
    """The HTML of a page with its equations, as `pymdownx.arithmatex` leaves them, made MathML.

    Raises:
        ValueError: An equation that is no TeX.
    """
    equations = list(_EQUATION.finditer(content))
    if not equations:
        return content
    pieces, end = [], 0
    for equation, math in zip(equations, _mathml(tuple(map(_markdown, equations))), strict=True):
        pieces += [content[end : equation.start()], math]
        end = equation.end()
    return "".join([*pieces, content[end:]])


def math_font(contents: Iterable[str]) -> bytes:
    """A WOFF font with what the equations of pages need of STIX Two Math (SIL Open Font License; it comes with `ziamath`)."""
    text = {character for content in contents for math in _MATH.findall(content) for character in html.unescape(math)}
    font = TTFont(str(files("ziamath") / "fonts" / "STIXTwoMath-Regular.ttf"))
    subsetter = subset.Subsetter(subset.Options(layout_features=["*"]))
    subsetter.populate(text="".join(sorted(text)), unicodes=[*range(0x20, 0x7F), *_ITALICS])
    subsetter.subset(font)
    font.flavor = "woff"
    written = io.BytesIO()
    font.save(written)
    return written.getvalue()


def _markdown(equation: re.Match[str]) -> str:
    if equation["inline"] is not None:
        return f"${html.unescape(equation['inline']).strip()}$"
    return f"$${html.unescape(equation['display']).strip()}$$"


@cache
def _mathml(equations: tuple[str, ...]) -> list[str]:
    """Equations in Markdown as MathML, by Pandoc."""
    made = pypandoc.convert_text("\n\n".join(equations), "html", format="markdown", extra_args=["--mathml", "--wrap=none"])
    paragraphs = made.strip().split("</p>")[:-1]
    for equation, paragraph in zip(equations, paragraphs, strict=True):
        if "<math" not in paragraph:
            raise ValueError(f"no equation that Pandoc can set: {equation}")
    found = [_ANNOTATION.sub("", _MATH.findall(paragraph)[0]) for paragraph in paragraphs]
    return [f'<div class="equation">{math}</div>' if 'display="block"' in math else math for math in found]

"""Equations of the pages: TeX as it is written, MathML as browsers set it, without scripts and
without anything from elsewhere.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

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
_BESIDE = re.compile(r'[^\s<>]*<math display="inline"(?:(?!</math>).)*</math>[^\s<>]*', re.DOTALL)
"""An equation in a line, with what stands beside it without a space: browsers would break the line
there."""
_OPERATOR = r'<mrow><mi mathvariant="normal">\w+</mi><mo>&#8289;</mo></mrow>'
_NAMED = re.compile(
    rf"(</m[a-z]+>)?(<(msu[bp])>{_OPERATOR}<m[in]>[^<]+</m[in]></\3>|(?<!<msu[bp]>){_OPERATOR})(<m(?!o|space))?"
)
"""The name of a function as Pandoc writes it, with its power or index, between the end of what is
before and the next element."""
_ACCENT = re.compile(r'<mo accent="true">(.)</mo>')
_ACCENTS = str.maketrans("\u0307\u0303\u0302", "\u02d9\u02dc\u02c6")
"""Accents that stand by themselves, for combining ones, which have no width to be centered by."""
_THIN = '<mspace width="0.167em"></mspace>'
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
    return _BESIDE.sub(
        lambda found: f'<span class="unbroken">{found[0]}</span>', "".join([*pieces, content[end:]])
    )


def math_font(contents: Iterable[str]) -> bytes:
    """A WOFF font with what the equations of pages need of STIX Two Math (SIL Open Font License; it
    comes with `ziamath`).
    """
    text = {
        character
        for content in contents
        for math in _MATH.findall(content)
        for character in html.unescape(math)
    }
    package = find_spec("ziamath")
    assert package is not None
    assert package.origin is not None
    font = TTFont(Path(package.origin).parent / "fonts" / "STIXTwoMath-Regular.ttf")
    subsetter = subset.Subsetter(subset.Options(layout_features=["*"]))
    subsetter.populate(
        text="".join(sorted(text)), unicodes=[*range(0x20, 0x7F), ord("√"), *_ITALICS]
    )
    subsetter.subset(font)
    font.flavor = "woff"
    written = io.BytesIO()
    font.save(written)
    return written.getvalue()


def _for_browsers(math: str) -> str:
    """Thin spaces beside sin and the like, which browsers do not set, and accents that are centered
    and do not stretch.
    """

    def spaced(named: re.Match[str]) -> str:
        before, name, after = named[1] or "", named[2], named[4] or ""
        apart = before and before not in ("</mo>", "</mspace>")
        return f"{before}{_THIN if apart else ''}{name}{_THIN if after else ''}{after}"

    math = _NAMED.sub(spaced, math)
    return _ACCENT.sub(
        lambda accent: f'<mo accent="true" stretchy="false">{accent[1].translate(_ACCENTS)}</mo>',
        math,
    )


def _markdown(equation: re.Match[str]) -> str:
    if equation["inline"] is not None:
        return f"${html.unescape(equation['inline']).strip()}$"
    return f"$${html.unescape(equation['display']).strip()}$$"


@cache
def _mathml(equations: tuple[str, ...]) -> list[str]:
    """Equations in Markdown as MathML, by Pandoc."""
    made = pypandoc.convert_text(
        "\n\n".join(equations), "html", format="markdown", extra_args=["--mathml", "--wrap=none"]
    )
    paragraphs = made.strip().split("</p>")[:-1]
    for equation, paragraph in zip(equations, paragraphs, strict=True):
        if "<math" not in paragraph:
            raise ValueError(f"no equation that Pandoc can set: {equation}")
    found = [
        _for_browsers(_ANNOTATION.sub("", _MATH.findall(paragraph)[0])) for paragraph in paragraphs
    ]
    return [
        f'<div class="equation">{math}</div>' if 'display="block"' in math else math
        for math in found
    ]

"""What MkDocs does beyond its own: pages made from the program, and pages and files of the
repository outside ``docs``.
"""

from __future__ import annotations

import posixpath
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from commands import command_pages
from equations import math_font, set_equations
from keys import key_pages
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from notebooks import notebook_pages
from performance import MARK, budgets

ROOT = Path(__file__).resolve().parents[2]
OUTSIDE = "repository"
"""Where what lies outside ``docs`` stands on the site."""

_LINK = re.compile(r"(\]\()([^)\s:]+?)(#[^)\s]*)?\)")
_FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made, and what pages link to outside ``docs``."""
    for path, content in {
        **key_pages(),
        **command_pages(),
        **notebook_pages(ROOT / "docs"),
    }.items():
        files.append(File.generated(config, path, content=content))
    for path in _outside():
        files.append(File.generated(config, f"{OUTSIDE}/{path}", abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links lead to where their files stand on the site; a folder is no page, so its name is
    left.
    """
    place = _in_repository(page.file.src_uri)
    markdown = markdown.replace(MARK, budgets()) if MARK in markdown else markdown

    def moved(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(place), link[2]))
        if target.startswith("docs/") or not (ROOT / target).exists():
            target = target.removeprefix("docs/").replace(".ipynb", ".md")  # see `notebook_pages`
        else:
            target = f"{OUTSIDE}/{target}"
        target = posixpath.relpath(target, posixpath.dirname(page.file.src_uri) or ".")
        return f"{link[1]}{target}{link[3] or ''})"

    return _outside_fences(_without_folders(markdown, place), lambda text: _LINK.sub(moved, text))


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """Set the equations."""
    try:
        return set_equations(content)
    except ValueError as error:
        raise PluginError(f"{page.file.src_uri}: {error}") from None


def on_post_build(config: Any) -> None:
    """Put the font of the equations beside the style sheet that names it."""
    site = Path(config.site_dir)
    pages = (page.read_text(encoding="utf-8") for page in site.rglob("*.html"))
    (site / "pictures" / "math.woff").write_bytes(math_font(pages))


def _without_folders(markdown: str, place: str) -> str:
    def plain(link: re.Match[str]) -> str:
        target = ROOT / posixpath.join(posixpath.dirname(place), link[2])
        return link[1] if target.is_dir() else link[0]

    return _outside_fences(
        markdown, lambda text: re.sub(r"\[([^\]]*)\]\(([^)\s:#]+)\)", plain, text)
    )


def _outside_fences(markdown: str, change: Callable[[str], str]) -> str:
    """``change`` what stands outside blocks of code."""
    parts, end = [], 0
    for fence in _FENCE.finditer(markdown):
        parts += [change(markdown[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, change(markdown[end:])])


def _in_repository(page: str) -> str:
    return page.removeprefix(f"{OUTSIDE}/") if page.startswith(f"{OUTSIDE}/") else f"docs/{page}"


def _outside() -> list[str]:
    """Files outside ``docs`` that its pages link to, and those that these link to in turn."""
    found: set[str] = set()
    waiting = [path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")]
    while waiting:
        page = waiting.pop()
        for target in _targets(page):
            if not target.startswith("docs/") and target not in found and (ROOT / target).is_file():
                found.add(target)
                if target.endswith(".md"):
                    waiting.append(target)
    return sorted(found)


def _targets(page: str) -> Iterator[str]:
    text = _FENCE.sub("", (ROOT / page).read_text(encoding="utf-8"))
    for link in _LINK.finditer(text):
        yield posixpath.normpath(posixpath.join(posixpath.dirname(page), link[2]))

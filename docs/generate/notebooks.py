"""Notebooks as pages: their cells with what these gave when they were last executed."""

from __future__ import annotations

from pathlib import Path

from nbconvert import MarkdownExporter


def notebook_pages(docs: Path) -> dict[str, str | bytes]:
    """Pages and pictures of all notebooks below a folder, by their paths within it."""
    made: dict[str, str | bytes] = {}
    for notebook in sorted(docs.rglob("*.ipynb")):
        place = notebook.relative_to(docs)
        body, resources = MarkdownExporter().from_filename(str(notebook))
        for name, picture in resources["outputs"].items():
            made[f"{place.parent.as_posix()}/{place.stem}-{name}"] = picture
            body = body.replace(f"]({name})", f"]({place.stem}-{name})")
        title, _, rest = body.lstrip().partition("\n")
        link = f'<a href="{place.name}" download>Download it</a> to open it in Jupyter.'
        made[place.with_suffix(".md").as_posix()] = f"{title}\n\n{link}\n{rest}"
    return made

"""Notebooks as pages: they are carried out when the site is built, and their pages show what came
out.
"""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbconvert import MarkdownExporter

ROOT = Path(__file__).resolve().parents[2]


def notebook_pages(docs: Path) -> dict[str, str | bytes]:
    """Pages and pictures of all notebooks below a folder, by their paths within it."""
    made: dict[str, str | bytes] = {}
    for notebook in sorted(docs.rglob("*.ipynb")):
        place = notebook.relative_to(docs)
        body, pictures = _carried_out(notebook.read_text(encoding="utf-8"))
        for name, picture in pictures.items():
            made[f"{place.parent.as_posix()}/{place.stem}-{name}"] = picture
            body = body.replace(f"]({name})", f"]({place.stem}-{name})")
        title, _, rest = body.lstrip().partition("\n")
        link = f'<a href="{place.name}" download>Download it</a> to open it in Jupyter.'
        made[place.with_suffix(".md").as_posix()] = f"{title}\n\n{link}\n{rest}"
    return made


@cache  # a served site is built anew whenever a page changes
def _carried_out(text: str) -> tuple[str, dict[str, bytes]]:
    """Markdown of a notebook with its outputs, and its pictures by name."""
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            nbformat.reads(text, as_version=4),
            timeout=300,
            resources={"metadata": {"path": folder}},
            # it warns of what does not matter on one machine, and a build has no warnings
            extra_arguments=["--log-level=ERROR"],
        )
        notebook = client.execute(
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        )
    body, resources = MarkdownExporter().from_notebook_node(notebook)
    return body, resources["outputs"]

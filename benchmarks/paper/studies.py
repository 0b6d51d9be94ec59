"""All figures of the paper and their page."""

from __future__ import annotations

import sys
from pathlib import Path

from bed_study import bed_entries
from entry import Entry
from lattice_study import lattice_entries
from page import write_page
from runs import finish_study
from shear_study import shear_entries

_NAMES = ("lattice14", "heated-bed", "shear", "shear-dynamic")


def make_page(runs: Path, folder: Path) -> Path:
    """Run what is missing, write every figure and the page into a folder; returns the path of the
    page.

    Raises:
        StoreError, ScenarioError, RuntimeError: See `finish_study`.
        PlotError: If matplotlib is not installed.
        OSError: If a file cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        message = f"{folder}: this is a file; choose a folder for the page with -o"
        raise FileExistsError(message)
    folder.mkdir(parents=True, exist_ok=True)  # before the runs, which take minutes
    studies = {name: finish_study(name, runs) for name in _NAMES}
    entries = [
        *lattice_entries(studies["lattice14"].path),
        *bed_entries(studies["heated-bed"].path),
        *shear_entries(studies["shear"].path, studies["shear-dynamic"].path),
    ]
    for entry in entries:
        _write(entry, folder)
    return write_page(folder, entries, list(studies.values()))


def _write(entry: Entry, folder: Path) -> None:
    for panel in entry.panels:
        panel.write(folder)
        print(f"wrote {folder / panel.name}.png, .pdf", file=sys.stderr, flush=True)

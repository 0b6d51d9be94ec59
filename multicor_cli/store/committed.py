"""Which segments of an unfinished run count: those in the manifest, which must hold all that a checkpoint relies on."""

from __future__ import annotations

from pathlib import Path

from multicor_cli.store import layout
from multicor_cli.store.checkpoint import newest_first
from multicor_cli.store.documents import read_document
from multicor_cli.store.errors import DamagedRun, StorageError
from multicor_cli.store.manifest import NAME, Segment, read_manifest


def committed_segments(run: Path) -> list[Segment]:
    """The segments of a run directory, in order.

    A manifest that lost lines at its end looks like a shorter one, so it is compared with the newest checkpoint. Checkpoints are
    read first: while a run goes on, its manifest only grows.

    Raises:
        DamagedRun: If a line is damaged, or lines are missing.
        StorageError: If a file cannot be read.
    """
    directory = run / layout.SEGMENTS
    sidecar, names = _listed_by_checkpoint(run / layout.CHECKPOINTS)
    segments = read_manifest(directory)
    if [segment.name for segment in segments[: len(names)]] != names:
        raise DamagedRun(f"{directory / NAME}: damaged (segments listed in {sidecar} are missing); continue the run to repair it")
    return segments


def _listed_by_checkpoint(directory: Path) -> tuple[str, list[str]]:
    """Name of the newest description of a checkpoint that can be read, and its segments."""
    for sidecar in newest_first(directory):
        try:
            listed = read_document(sidecar)["segments"]
            return sidecar.name, [str(segment["name"]) for segment in listed]
        except (DamagedRun, StorageError, KeyError, TypeError):
            continue
    return "", []

"""Which segments of an unfinished run count: those in the manifest, which must hold all that a checkpoint relies on."""

from __future__ import annotations

from pathlib import Path

from multicor_cli.store import layout
from multicor_cli.store.checkpoint import START_AGAIN, Identity, load_newest, newest_first
from multicor_cli.store.documents import read_document
from multicor_cli.store.errors import DamagedRun, StorageError
from multicor_cli.store.manifest import NAME, Segment, read_manifest
from multicor_cli.store.run_document import read_run_document


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
        what = f"{directory / NAME}: damaged (segments listed in {sidecar} are missing)"
        raise DamagedRun(f"{what}; {_remedy(run)}")
    return segments


def _remedy(run: Path) -> str:
    """What helps if the manifest of a run is damaged: to continue from a checkpoint whose segments are whole, if there is one."""
    try:
        found = load_newest(run / layout.CHECKPOINTS, Identity.of(read_run_document(run)), run / layout.SEGMENTS)
    except (DamagedRun, StorageError):
        found = None
    if found is None:
        return f"no checkpoint has all its segments; {START_AGAIN}"
    return f"continue the run to repair it, from step {found.state.step}"


def _listed_by_checkpoint(directory: Path) -> tuple[str, list[str]]:
    """Name of the newest description of a checkpoint that can be read, and its segments."""
    for sidecar in newest_first(directory):
        try:
            listed = read_document(sidecar)["segments"]
            return sidecar.name, [str(segment["name"]) for segment in listed]
        except (DamagedRun, StorageError, KeyError, TypeError):
            continue
    return "", []

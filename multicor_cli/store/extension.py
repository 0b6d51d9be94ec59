"""Adding loading stages to the end of a run.

The order is that of the commit protocol. Until ``run.json`` is replaced the run is what it was: its
scenario is found among the former ones, and new segments and checkpoints beside ``results.h5`` do
no harm. From then on it is the longer run.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from multicor_cli.files import LARGEST_RECORD, Unfit, read_regular
from multicor_cli.model import Model
from multicor_cli.store import layout, schema
from multicor_cli.store.atomic import (
    commit_bytes,
    described,
    file_digest,
    fsync_path,
    kill_point,
    make_directory,
    remove_own,
    storage_errors,
)
from multicor_cli.store.checkpoint import Identity, load_newest, write_checkpoint
from multicor_cli.store.documents import Document, read_scenario, write_document
from multicor_cli.store.errors import DamagedRun, DirectoryRefused
from multicor_cli.store.hdf5 import CheckedFile
from multicor_cli.store.provenance import new_session
from multicor_cli.store.results import FILETYPE as RESULTS_FILETYPE
from multicor_cli.store.results import read_model, read_offsets, write_model
from multicor_cli.store.segments import FrameWriter, Segment

SERIES_ROWS = 4096
"""So many rows of the time series are copied at a time."""


@dataclass(frozen=True)
class Extension:
    """A longer scenario of a run: as given, resolved, and the names of all its stages."""

    source: str
    resolved: str
    stages: Sequence[str]


def extend(path: Path, document: Document, extension: Extension) -> None:
    """Extend a locked run by the new stages; ``document``, its ``run.json``, is **modified**.

    Raises `StorageFull` if there is no space for what a finished run needs besides its results,
    `StorageError`, `DamagedRun` if ``results.h5`` is damaged or there is no checkpoint, and
    `DirectoryRefused` if a foreign file has the name of one that is to be written.
    """
    has_results = bool(document["results"])
    if has_results:
        _reopen(path, document)
    _keep_former(path, document)
    commit_bytes(path / layout.SOURCE, "scenario", extension.source.encode())
    commit_bytes(path / layout.RESOLVED, "scenario", extension.resolved.encode())
    kill_point("extension.before")
    summary = document["summary"] or {}
    step = {
        **new_session(),
        "stages_before": len(document["stages"]),
        "stages": len(extension.stages),
        "step": summary.get("step"),
        "time": summary.get("time"),
        "source_sha256": document["source_sha256"],
        "resolved_sha256": document["resolved_sha256"],
    }
    document |= {
        "status": "stopped",
        "stop_reason": "extended",
        "exit_code": None,
        "stages": list(extension.stages),
        "source_sha256": hashlib.sha256(extension.source.encode()).hexdigest(),
        "resolved_sha256": hashlib.sha256(extension.resolved.encode()).hexdigest(),
        "extensions": [*document.get("extensions", []), step],
        "results": None,
    }
    write_document(path / layout.RUN, "runjson", document)
    kill_point("extension.after")
    # All of results.h5 is in segments now; if it stays, it is replaced at the end of the run.
    if has_results:
        with contextlib.suppress(OSError):
            for name in (layout.VTKHDF, layout.RESULTS):
                remove_own(path / name)
            fsync_path(path)


def _keep_former(path: Path, document: Document) -> None:
    """The scenario files as they have been so far, under names of their own."""
    number = len(document.get("extensions", [])) + 1
    for name, key in ((layout.SOURCE, "source_sha256"), (layout.RESOLVED, "resolved_sha256")):
        text = read_scenario(path / name, str(document[key])).encode()
        former = path / layout.former_name(name, number)
        if os.path.lexists(former):
            there = None
            with storage_errors(former), contextlib.suppress(FileNotFoundError, Unfit):
                there = read_regular(former, LARGEST_RECORD)
            if there != text:
                raise DirectoryRefused(
                    f"{former}: is in the way of the former scenario of the run; move it away"
                )
        commit_bytes(former, "scenario", text)


def _reopen(path: Path, document: Document) -> None:
    """Model, segments and a checkpoint of a finished run, made of its ``results.h5``."""
    results, run_id = path / layout.RESULTS, str(document["run_id"])
    if file_digest(results) != document["results"]["blake2b"]:
        raise DamagedRun(
            f"{results}: damaged (it does not match its digest in {layout.RUN}); nothing was "
            "changed"
        )
    for name in (layout.SEGMENTS, layout.CHECKPOINTS):
        make_directory(path / name)
    with storage_errors(path / layout.SEGMENTS):
        for entry in layout.own_files(path, layout.SEGMENTS):  # of an attempt that was interrupted
            remove_own(entry)
    identity = Identity.of(document)
    with CheckedFile(results, RESULTS_FILETYPE, run_id=run_id) as file:
        model = read_model(file)
        last = load_newest(path / layout.CHECKPOINTS, identity, None, model)
        if last is None:
            raise DamagedRun(
                f"{path / layout.CHECKPOINTS}: there is no checkpoint from which the run could go "
                "on"
            )
        write_model(path / layout.MODEL, model, run_id)
        segments = _write_segments(file, path / layout.SEGMENTS, run_id, model, document)
    write_checkpoint(  # the last one once more, with the segments that there are now
        path / layout.CHECKPOINTS,
        last.state,
        model,
        identity,
        model_digest=last.model_digest,
        segments=segments,
        last_steps=last.last_steps,
    )
    document["model"] = described(path / layout.MODEL)


def _write_segments(
    file: CheckedFile, directory: Path, run_id: str, model: Model, document: Document
) -> list[Segment]:
    writer = FrameWriter(
        directory,
        run_id,
        model,
        precision="single" if document["precision"] == "single" else "double",
        version=min(file.version, schema.FORMAT_VERSION),
    )
    # Frames one by one, as stored, then the series in pieces.
    offsets = {name: read_offsets(file, spec) for name, spec in schema.OFFSET_OF.items()}
    for k in range(int(file.dataset(schema.DATASETS["steps/step"]).shape[0])):
        spans = {name: offset[k : k + 2].tolist() for name, offset in offsets.items()}
        writer.copy_frame(
            {s.path: file.read(s, *spans.get(str(s.row), (k, k + 1))) for s in writer.frame_table}
        )
    count = int(file.dataset(schema.DATASETS["series/step"]).shape[0])
    for start in range(0, count, SERIES_ROWS):
        stop = min(start + SERIES_ROWS, count)
        writer.copy_series(
            {spec.path: file.read(spec, start, stop) for spec in writer.series_table}
        )
    writer.flush()
    return writer.segments

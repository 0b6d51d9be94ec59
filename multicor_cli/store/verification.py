"""Checking all files of a run: digests, checksums, counts, ranges, finite values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from multicor_cli.model import Model
from multicor_cli.store import layout, schema
from multicor_cli.store.atomic import file_digest, is_regular
from multicor_cli.store.checkpoint import (
    Identity,
    committed_segments,
    load_checkpoint,
    newest_first,
    step_of,
)
from multicor_cli.store.documents import Document, read_run_document, read_scenario
from multicor_cli.store.errors import DamagedRun, NothingStored, StoreError
from multicor_cli.store.hdf5 import CheckedFile, data_digest
from multicor_cli.store.results import FILETYPE as RESULTS_FILETYPE
from multicor_cli.store.results import (
    check_features,
    load_model,
    read_description,
    read_model,
    read_offsets,
)
from multicor_cli.store.schema import Dataset
from multicor_cli.store.segments import FILETYPE as SEGMENT_FILETYPE
from multicor_cli.store.segments import Segment, check_segment, model_dims, segment_dims
from multicor_cli.store.vtkhdf import check_view


@dataclass(frozen=True)
class FileFinding:
    """Something wrong with a file, or worth knowing.

    An ``error``: data are lost or not to be trusted; a ``warning``: nothing is lost.
    """

    severity: Literal["error", "warning"]
    file: str
    message: str


_CONTACT_BLOCK = 1 << 20


def verify(path: Path | str) -> list[FileFinding]:
    """Read everything that a run has stored and compare it with its digests; changes nothing.

    Args:
        path: A run directory, or a ``results.h5`` on its own.

    Returns:
        What is wrong; empty if nothing is.

    Raises:
        DirectoryRefused: If there is no run.
    """
    path = Path(path)
    if is_regular(path):
        return _run_checks([(path, partial(_check_results, path))])
    if not is_regular(path / layout.RUN) and is_regular(path / layout.RESULTS):
        return _missing_run_document(path) + verify(path / layout.RESULTS)
    try:
        document = read_run_document(path)
    except NothingStored:
        raise
    except DamagedRun as error:
        return [FileFinding("error", str(path / layout.RUN), str(error))]
    scenarios = ((layout.SOURCE, "source_sha256"), (layout.RESOLVED, "resolved_sha256"))
    findings = _run_checks(
        (path / name, partial(read_scenario, path / name, str(document[key])))
        for name, key in scenarios
    )
    if document["results"]:
        results = path / layout.RESULTS
        findings += _run_checks([(results, partial(_check_results, results, document))])
    else:
        findings += _verify_segments(path, document)
    return findings + _verify_checkpoints(path, document) + list(_leftovers(path, document))


def _missing_run_document(path: Path) -> list[FileFinding]:
    """Results may lie alone in a directory; beside other files of a run ``run.json`` is missing."""
    others = (layout.SOURCE, layout.RESOLVED, layout.MODEL, layout.CHECKPOINTS)
    if not any((path / name).exists() for name in others):
        return []
    message = "missing: the run cannot be continued; results.h5 can be read without it"
    return [FileFinding("error", str(path / layout.RUN), message)]


def _run_checks(checks: Iterable[tuple[Path, Callable[[], object]]]) -> list[FileFinding]:
    findings = []
    for file, check in checks:
        try:
            check()
        except StoreError as error:
            findings.append(FileFinding("error", str(file), str(error)))
    return findings


def _verify_segments(path: Path, document: Document) -> list[FileFinding]:
    directory, whole, run_id = path / layout.SEGMENTS, path / layout.MODEL, str(document["run_id"])
    try:
        segments = committed_segments(path)
    except StoreError as error:
        return [FileFinding("error", str(path), str(error))]
    if not segments and not whole.exists():
        return []
    try:
        model = load_model(whole, run_id)
        if "model" in document:
            _check_whole(whole, document["model"])
    except StoreError as error:
        return [FileFinding("error", str(whole), str(error))]

    def check(segment: Segment) -> None:
        check_segment(directory, segment)
        dims, name = segment_dims(segment) | model_dims(model), directory / segment.name
        with CheckedFile(name, SEGMENT_FILETYPE, run_id=run_id, dims=dims) as file:
            check_features(file, schema.features_of(model))
            _check_tables(file, schema.SEGMENT_TABLE, model, len(document["stages"]))

    return _run_checks((directory / each.name, partial(check, each)) for each in segments)


def _check_results(path: Path, document: Document | None = None) -> None:
    run_id = str(document["run_id"]) if document else None
    with CheckedFile(path, RESULTS_FILETYPE, run_id=run_id) as file:
        file.check_texts()
        model = read_model(file)
        read_description(file)
        stages = len(file.strings(schema.SCENARIO[-1]))
        digest = data_digest(_check_tables(file, schema.RESULTS_TABLE, model, stages))
        expected = {file.text("data_digest")}
    if document:
        expected.add(document["results"]["data_digest"])
    if expected != {digest}:
        raise DamagedRun(f"{path}: the data do not match their digest")
    check_view(path)
    if document:
        _check_whole(path, document["results"])


def _check_whole(path: Path, recorded: Document) -> None:
    if path.stat().st_size != recorded["size"]:
        raise DamagedRun(f"{path}: has {path.stat().st_size} bytes instead of {recorded['size']}")
    if recorded["blake2b"] != file_digest(path):
        raise DamagedRun(
            f"{path}: the data are whole, but something beside them has changed since the file "
            "was written"
        )


def _check_tables(
    file: CheckedFile, table: tuple[Dataset, ...], model: Model, stages: int
) -> dict[str, str]:
    """Digest, finite values, counts and ranges of the datasets of a run; returns the digests."""
    specs = schema.select(table, schema.features_of(model), file.version)
    digests = {spec.path: file.check_digest(spec) for spec in specs}
    for spec in specs:
        if spec.finite and file.dataset(spec).dtype.kind == "f":
            for block in file.blocks(spec):
                if not np.isfinite(block).all():
                    raise DamagedRun(f"{file.path}: {spec.path} holds a value that is not finite")
    _check_rows(file, model)
    for path, highest in (
        ("contacts/sliding", 2),
        ("steps/contacts_recorded", 2),
        ("steps/stage", max(stages, 1)),
    ):
        for block in file.blocks(schema.DATASETS[path]):
            if ((block < 0) | (block >= highest)).any():
                raise DamagedRun(f"{file.path}: {path} holds a value outside 0 … {highest - 1}")
    return digests


def _check_rows(file: CheckedFile, model: Model) -> None:
    n, walls, shapes = model.grain_count, model.wall_count, model.shape_count
    rows, _ = (read_offsets(file, spec) for spec in schema.OFFSETS)
    if (np.diff(rows) != n).any():
        raise DamagedRun(f"{file.path}: a frame does not hold {n} grains")
    if file.dims["wall"] != walls:
        raise DamagedRun(f"{file.path}: holds {file.dims['wall']} walls instead of {walls}")
    for path in ("steps/step", "series/step"):
        if (np.diff(file.read(schema.DATASETS[path])) <= 0).any():
            raise DamagedRun(f"{file.path}: {path} does not ascend")
    for start in range(0, file.dims["contact_row"], _CONTACT_BLOCK):
        stop = min(start + _CONTACT_BLOCK, file.dims["contact_row"])
        i, j, kind = (
            file.read(schema.DATASETS[f"contacts/{name}"], start, stop)
            for name in ("i", "j", "kind")
        )
        if ((i < 0) | (i >= n) | (j <= i) | (j >= n + shapes)).any():
            raise DamagedRun(f"{file.path}: a contact names a shape that does not exist")
        if (kind != (j >= n)).any():
            raise DamagedRun(f"{file.path}: contacts/kind does not fit contacts/j")


def _verify_checkpoints(path: Path, document: Document) -> list[FileFinding]:
    directory = path / layout.CHECKPOINTS
    identity = Identity.of(document)
    sidecars = newest_first(directory)
    findings = _run_checks((file, partial(load_checkpoint, file, identity)) for file in sidecars)
    is_named = document["summary"] and document["status"] != "finished"
    named = document["summary"]["step"] if is_named else -1
    if named > max(map(step_of, sidecars), default=-1):
        what = f"the checkpoint at step {named}, of which {layout.RUN} knows, is missing"
        findings.append(FileFinding("error", str(directory), f"{directory}: {what}"))
    return findings


def _leftovers(path: Path, document: Document) -> Iterator[FileFinding]:
    segments = path / layout.SEGMENTS
    for entry in filter(Path.exists, layout.temporaries(path)):
        message = "left by an interrupted write; the next start removes it"
        yield FileFinding("warning", str(entry), message)
    for entry in sorted(segments.glob("*.orphan")):
        message = "written after the checkpoint from which the run was continued; not used"
        yield FileFinding("warning", str(entry), message)
    if document["results"] and segments.exists() and document["status"] == "finished":
        remedy = (
            "the next start removes it"
            if layout.own_files(path, layout.SEGMENTS)
            else "it is a link or holds files that no run has made, and stays"
        )
        yield FileFinding("warning", str(segments), f"not needed beside results.h5; {remedy}")

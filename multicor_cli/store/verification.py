"""Checking all files of a run: digests, checksums, counts, ranges, finite values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

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
    segment_dims,
)
from multicor_cli.store.schema import Dataset
from multicor_cli.store.segments import FILETYPE as SEGMENT_FILETYPE
from multicor_cli.store.segments import Segment, check_segment
from multicor_cli.store.vtkhdf import check_view


@dataclass(frozen=True)
class FileFinding:
    """Something wrong, or worth knowing.

    Attributes:
        severity: ``error``: data are lost or not to be trusted; ``warning``: nothing is lost.
        file: The file.
        message: What was found.
    """

    severity: Literal["error", "warning"]
    file: str
    message: str


Check = Callable[[], object]

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
        return _run_checks([(path, partial(_check_results, path, None, None))])
    if not is_regular(path / layout.RUN) and is_regular(path / layout.RESULTS):
        return _missing_run_document(path) + verify(path / layout.RESULTS)
    try:
        document = read_run_document(path)
    except NothingStored:
        raise
    except DamagedRun as error:
        return [FileFinding("error", str(path / layout.RUN), str(error))]
    scenarios = (
        (path / layout.SOURCE, "source_sha256"),
        (path / layout.RESOLVED, "resolved_sha256"),
    )
    findings = _run_checks(
        [(file, partial(read_scenario, file, str(document[key]))) for file, key in scenarios]
    )
    if document["results"]:
        results = path / layout.RESULTS
        findings += _run_checks(
            [
                (
                    results,
                    partial(_check_results, results, str(document["run_id"]), document["results"]),
                )
            ]
        )
    else:
        findings += _verify_segments(path, document)
    return findings + _verify_checkpoints(path, document) + list(_leftovers(path, document))


def _missing_run_document(path: Path) -> list[FileFinding]:
    """Results may lie alone in a directory; beside other files of a run ``run.json`` is missing."""
    if not any(
        (path / name).exists()
        for name in (layout.SOURCE, layout.RESOLVED, layout.MODEL, layout.CHECKPOINTS)
    ):
        return []
    return [
        FileFinding(
            "error",
            str(path / layout.RUN),
            "missing: the run cannot be continued; results.h5 can be read without it",
        )
    ]


def _run_checks(checks: list[tuple[Path, Check]]) -> list[FileFinding]:
    findings = []
    for file, check in checks:
        try:
            check()
        except StoreError as error:
            findings.append(FileFinding("error", str(file), str(error)))
    return findings


def _verify_segments(path: Path, document: Document) -> list[FileFinding]:
    directory, file, run_id = path / layout.SEGMENTS, path / layout.MODEL, str(document["run_id"])
    try:
        segments = committed_segments(path)
    except StoreError as error:
        return [FileFinding("error", str(path), str(error))]
    if not segments and not file.exists():
        return []
    try:
        model = load_model(file, run_id)
        if "model" in document:
            _check_whole(file, document["model"])
    except StoreError as error:
        return [FileFinding("error", str(file), str(error))]
    limits = _limits(model, len(document["stages"]))
    return _run_checks(
        [
            (directory / s.name, partial(_check_one_segment, directory, s, run_id, limits))
            for s in segments
        ]
    )


def _check_one_segment(directory: Path, segment: Segment, run_id: str, limits: Limits) -> None:
    check_segment(directory, segment)
    dims = {**segment_dims(segment), "wall": limits.walls, "outlet": limits.outlets}
    with CheckedFile(directory / segment.name, SEGMENT_FILETYPE, run_id=run_id, dims=dims) as file:
        check_features(file, limits.features)
        _check_tables(file, schema.SEGMENT_TABLE, limits)


def _check_results(path: Path, run_id: str | None, recorded: Document | None) -> None:
    with CheckedFile(path, RESULTS_FILETYPE, run_id=run_id) as file:
        file.check_texts()
        model = read_model(file)
        read_description(file)
        stages = len(file.strings(schema.SCENARIO[-1]))
        limits = _limits(model, stages)
        digest = data_digest(_check_tables(file, schema.RESULTS_TABLE, limits))
        expected = {file.text("data_digest"), *([recorded["data_digest"]] if recorded else [])}
    if expected != {digest}:
        raise DamagedRun(f"{path}: the data do not match their digest")
    check_view(path)
    if recorded:
        _check_whole(path, recorded)


def _check_whole(path: Path, recorded: Document) -> None:
    if path.stat().st_size != recorded["size"]:
        raise DamagedRun(f"{path}: has {path.stat().st_size} bytes instead of {recorded['size']}")
    if recorded["blake2b"] != file_digest(path):
        raise DamagedRun(
            f"{path}: the data are whole, but something beside them has changed since the file "
            "was written"
        )


@dataclass(frozen=True)
class Limits:
    """What values are compared with: how many there are, and the features of the run."""

    grains: int
    shapes: int
    walls: int
    outlets: int
    stages: int
    features: frozenset[str]


def _limits(model: Model, stages: int) -> Limits:
    return Limits(
        model.grain_count,
        model.shape_count,
        model.wall_count,
        len(model.outlets or ()),
        stages,
        schema.features_of(model),
    )


def _check_tables(file: CheckedFile, table: tuple[Dataset, ...], limits: Limits) -> dict[str, str]:
    """Digest, finite values, counts and ranges of the datasets of a run; returns the digests."""
    specs = schema.select(table, limits.features, file.version)
    digests = {spec.path: file.check_digest(spec) for spec in specs}
    for spec in specs:
        if spec.finite and file.dataset(spec).dtype.kind == "f":
            for block in file.blocks(spec):
                if not np.isfinite(block).all():
                    raise DamagedRun(f"{file.path}: {spec.path} holds a value that is not finite")
    _check_rows(file, limits)
    _check_contacts(file, limits)
    for path, highest in (
        ("contacts/sliding", 2),
        ("steps/contacts_recorded", 2),
        ("steps/stage", max(limits.stages, 1)),
    ):
        for block in file.blocks(_SPECS[path]):
            if ((block < 0) | (block >= highest)).any():
                raise DamagedRun(f"{file.path}: {path} holds a value outside 0 … {highest - 1}")
    return digests


_SPECS = {spec.path: spec for spec in schema.RESULTS_TABLE}


def _check_rows(file: CheckedFile, limits: Limits) -> None:
    rows: NDArray[np.int64] = read_offsets(
        file, _SPECS["steps/particle_offset"], file.dims["particle_row"]
    )
    read_offsets(file, _SPECS["steps/contact_offset"], file.dims["contact_row"])
    if (np.diff(rows) != limits.grains).any():
        raise DamagedRun(f"{file.path}: a frame does not hold {limits.grains} grains")
    if file.dims["wall"] != limits.walls:
        raise DamagedRun(f"{file.path}: holds {file.dims['wall']} walls instead of {limits.walls}")
    for path in ("steps/step", "series/step"):
        if (np.diff(file.read(_SPECS[path])) <= 0).any():
            raise DamagedRun(f"{file.path}: {path} does not ascend")


def _check_contacts(file: CheckedFile, limits: Limits) -> None:
    for start in range(0, file.dims["contact_row"], _CONTACT_BLOCK):
        stop = min(start + _CONTACT_BLOCK, file.dims["contact_row"])
        i, j, kind = (
            file.read(_SPECS[f"contacts/{name}"], start, stop) for name in ("i", "j", "kind")
        )
        if ((i < 0) | (i >= limits.grains) | (j <= i) | (j >= limits.grains + limits.shapes)).any():
            raise DamagedRun(f"{file.path}: a contact names a shape that does not exist")
        if (kind != (j >= limits.grains)).any():
            raise DamagedRun(f"{file.path}: contacts/kind does not fit contacts/j")


def _verify_checkpoints(path: Path, document: Document) -> list[FileFinding]:
    directory = path / layout.CHECKPOINTS
    identity = Identity.of(document)
    sidecars = newest_first(directory)
    named = (
        document["summary"]["step"]
        if document["summary"] and document["status"] != "finished"
        else -1
    )
    findings = _run_checks(
        [(sidecar, partial(load_checkpoint, sidecar, identity)) for sidecar in sidecars]
    )
    if named > max((step_of(sidecar) for sidecar in sidecars), default=-1):
        message = (
            f"{directory}: the checkpoint at step {named}, of which {layout.RUN} knows, is missing"
        )
        findings.append(FileFinding("error", str(directory), message))
    return findings


def _leftovers(path: Path, document: Document) -> Iterator[FileFinding]:
    for entry in layout.temporaries(path):
        if entry.exists():
            yield FileFinding(
                "warning", str(entry), "left by an interrupted write; the next start removes it"
            )
    for entry in sorted((path / layout.SEGMENTS).glob("*.orphan")):
        yield FileFinding(
            "warning",
            str(entry),
            "written after the checkpoint from which the run was continued; not used",
        )
    if (
        document["results"]
        and (path / layout.SEGMENTS).exists()
        and document["status"] == "finished"
    ):
        is_ours = bool(layout.own_files(path, layout.SEGMENTS))
        remedy = (
            "the next start removes it"
            if is_ours
            else "it is a link or holds files that no run has made, and stays"
        )
        yield FileFinding(
            "warning", str(path / layout.SEGMENTS), f"not needed beside results.h5; {remedy}"
        )

"""Checkpoints: a state, exactly, and its output; two are kept, in case that one is damaged."""

from __future__ import annotations

import contextlib
import re
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Strict

from multicor_cli.model import Model, State
from multicor_cli.model.books import FLUX_BOOKS, HEAT_BOOKS, entry_counts
from multicor_cli.model.state import digest_of, find_misfit
from multicor_cli.scenario.documents import Count
from multicor_cli.store import layout, schema
from multicor_cli.store.atomic import (
    described,
    kill_point,
    remove_own,
    require_described,
    storage_errors,
)
from multicor_cli.store.documents import (
    Document,
    Steered,
    SummaryDocument,
    check_version,
    read_document,
    read_run_document,
    record_of,
    write_document,
)
from multicor_cli.store.errors import DamagedRun, StorageError, UnsupportedVersion
from multicor_cli.store.hdf5 import CheckedFile, Hdf5Writer, dtype_of, estimate_size, write_hdf5
from multicor_cli.store.segments import MANIFEST, Segment, check_segment, read_manifest
from multicor_cli.store.snapshot import Summary, summarize

FILETYPE = "multicor-checkpoint"
KEEP = 2

START_AGAIN = "begin again with the same command and --overwrite, or in another directory with -o"

_NAME = re.compile(r"step-(\d+)(?:\.(\d+))?\.json")


@dataclass(frozen=True)
class Checkpoint:
    """A state and the output that belongs to it.

    Attributes:
        state: The state.
        segments: Segments committed up to it.
        last_steps: Steps of the last frame and of the last row of the series in them; -1 if none.
        summary: See `summarize`.
        model_digest: Digest of the model of the run.
        name: Name of its files, without the ending.
        steering: ``decisions`` and ``notes`` of the program that steers the run; None if none does.
        warnings: What was wrong with newer checkpoints that could not be used.
    """

    state: State
    segments: tuple[Segment, ...]
    last_steps: tuple[int, int]
    summary: Summary
    model_digest: str
    name: str
    steering: Document | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Identity:
    """What a checkpoint shares with its run; ``former``: digests of scenarios with fewer stages."""

    run_id: str
    scenario: str
    stages: int
    former: tuple[str, ...] = ()

    @classmethod
    def of(cls, document: Document) -> Identity:
        former = tuple(str(each["resolved_sha256"]) for each in document.get("extensions", []))
        scenario, stages = str(document["resolved_sha256"]), len(document["stages"])
        return cls(str(document["run_id"]), scenario, stages, former)


class CheckpointDocument(BaseModel):
    """What the description of a checkpoint says."""

    run_id: str
    scenario_digest: str
    model_digest: str
    size: Count
    blake2b: str
    segments: list[Segment]
    last_frame_step: Annotated[int, Strict()]
    last_series_step: Annotated[int, Strict()]
    summary: SummaryDocument
    steering: Steered | None = None


def write_checkpoint(
    directory: Path,
    state: State,
    model: Model,
    identity: Identity,
    *,
    model_digest: str,
    segments: list[Segment],
    last_steps: tuple[int, int],
    steering: Document | None = None,
) -> Summary:
    """Commit a checkpoint, verify it by reading it back, then remove all but the newest `KEEP`.

    Returns the summary of the state. Raises `StorageFull`, `StorageError`, or `DamagedRun` if what
    is read back is not the state.
    """
    path = _free_name(directory, state.step)
    summary = summarize(state, model)
    data = state.as_dict()
    columns = {
        spec.path: np.atleast_1d(data[spec.name]).astype(dtype_of(spec, "double"), casting="equiv")
        for spec in schema.CHECKPOINT
    }

    def fill(writer: Hdf5Writer) -> None:
        writer.write_table(schema.CHECKPOINT, columns)

    def verify(temporary: Path) -> None:
        if _read_state(temporary, identity.run_id)[1] != digest:
            raise DamagedRun(f"{temporary}: what was read back is not what was written")

    digest = summary["state_digest"]
    attributes = {"filetype": FILETYPE, "run_id": identity.run_id, "state_digest": digest}
    size = estimate_size(schema.CHECKPOINT, sum(values.nbytes for values in columns.values()))
    write_hdf5(path, "checkpoint", attributes, fill, size=size, verify=verify)
    document = {
        "filetype": FILETYPE,
        "format_version": list(schema.FORMAT_VERSION),
        "run_id": identity.run_id,
        "scenario_digest": identity.scenario,
        "model_digest": model_digest,
        **described(path),
        "segments": [asdict(segment) for segment in segments],
        "last_frame_step": last_steps[0],
        "last_series_step": last_steps[1],
        "summary": summary,
    }
    if steering is not None:
        document["steering"] = {name: steering[name] for name in ("decisions", "notes")}
    write_document(path.with_suffix(".json"), "checkpointjson", document)
    kill_point("checkpoint.before_prune")
    prune(directory)
    return summary


def load_newest(
    directory: Path, identity: Identity, segments: Path | None, model: Model | None = None
) -> Checkpoint | None:
    """The newest checkpoint that is whole, with the segments that it needs; None without any.

    ``segments`` is their directory, None if they are not needed; ``model``, if known, is what the
    state must fit.

    Raises:
        DamagedRun: If there are checkpoints and none can be used.
        UnsupportedVersion: If one was made by an incompatible version.
        StorageError: If a file cannot be read.
    """
    problems: list[str] = []
    for sidecar in newest_first(directory):
        try:
            found = load_checkpoint(sidecar, identity, model)
            if segments is not None:
                for segment in found.segments:
                    check_segment(segments, segment)
        except UnsupportedVersion:
            raise
        except DamagedRun as error:
            problems.append(str(error))
            continue
        warnings = tuple(f"{problem}; going back to an older checkpoint" for problem in problems)
        return replace(found, warnings=warnings)
    if problems:
        raise DamagedRun("; ".join([*problems, f"no usable checkpoint is left; {START_AGAIN}"]))
    return None


def load_checkpoint(sidecar: Path, identity: Identity, model: Model | None = None) -> Checkpoint:
    """Read and check the checkpoint of a ``.json``; arguments and errors as `load_newest`."""
    # First what the description says of itself and its run, then its file, then the state in it.
    document = read_document(sidecar)
    if document.get("filetype") != FILETYPE:
        raise DamagedRun(f"{sidecar}: not the description of a checkpoint")
    check_version(sidecar, document.get("format_version"))
    said = record_of(CheckpointDocument, document, sidecar)
    if said.run_id != identity.run_id:
        raise DamagedRun(f"{sidecar}: belongs to another run")
    if said.scenario_digest not in (identity.scenario, *identity.former):
        raise DamagedRun(f"{sidecar}: belongs to another scenario than scenario.resolved.toml")
    path = sidecar.with_suffix(".h5")
    require_described(path, said.size, said.blake2b, sidecar.name)
    state, digest = _read_state(path, identity.run_id)
    if model is not None and model.is_cell and not state.nonaffine.size:  # format 1.8 had none
        state.nonaffine = np.zeros((model.grain_count, 2))
    misfit = find_misfit(state, model) if model is not None else None
    if state.stage > identity.stages:
        misfit = f"it is in stage {state.stage + 1} of {identity.stages}"
    if misfit is not None:
        raise DamagedRun(f"{path}: does not fit the model: {misfit}")
    if digest != document["summary"]["state_digest"]:
        raise DamagedRun(f"{path}: the state does not match its digest")
    return Checkpoint(
        state=state,
        segments=tuple(said.segments),
        last_steps=(said.last_frame_step, said.last_series_step),
        summary=document["summary"],
        model_digest=said.model_digest,
        name=sidecar.stem,
        steering=document.get("steering"),
    )


def newest_first(directory: Path) -> list[Path]:
    """Sidecars of the checkpoints in ``directory``, the newest first."""
    found = []
    for path in directory.glob("step-*.json"):
        match = _NAME.fullmatch(path.name)
        if match:
            found.append((int(match[1]), int(match[2] or 0), path))
    return [path for *_, path in sorted(found, reverse=True)]


def step_of(sidecar: Path) -> int:
    """Step of a checkpoint, by the name of its ``.json``."""
    match = _NAME.fullmatch(sidecar.name)
    return int(match[1]) if match else -1


def prune(directory: Path, newest: str | None = None) -> None:
    """Remove all but the newest `KEEP` checkpoints, and what a crash left; raises `StorageError`.

    ``newest`` names the one from which the run goes on: newer ones, which are damaged, go too.
    """
    names = [path.stem for path in newest_first(directory)]
    first = names.index(newest) if newest else 0
    keep = set(names[first : first + KEEP])
    with storage_errors(directory):
        # Descriptions first: state and description are a checkpoint only together.
        for path in sorted(
            directory.glob("step-*"), key=lambda path: (path.suffix != ".json", path.name)
        ):
            name = path.name.removesuffix(".json").removesuffix(".h5")
            if path.suffix == ".tmp" or name not in keep:
                remove_own(path)


def _free_name(directory: Path, step: int) -> Path:
    """Never the name of an existing checkpoint: a second one at the same step gets a number."""
    path, count = directory / f"step-{step:011d}.h5", 0
    while path.exists() or path.with_suffix(".json").exists():
        count += 1
        path = directory / f"step-{step:011d}.{count}.h5"
    return path


def _read_state(path: Path, run_id: str) -> tuple[State, str]:
    """The state in a checkpoint, and the digest of what is stored of it."""
    with CheckedFile(path, FILETYPE, run_id=run_id) as file:
        file.check_texts()
        file.dims |= entry_counts(file.version)
        columns = {spec.name: file.read(spec) for spec in filter(file.has, schema.CHECKPOINT)}
        lengths = file.dims | entry_counts()
    if columns["heat_books"].size:
        is_cell = "nonaffine" in columns and columns["nonaffine"].size > 0
        lengths["heat_book"] = len(HEAT_BOOKS)
        lengths["flux_book"] = 0 if is_cell else len(FLUX_BOOKS)
    numbers = {spec.name for spec in schema.CHECKPOINT if spec.dims == ("one",)}
    columns |= {name: np.asarray(columns[name][0]) for name in numbers & columns.keys()}
    whole = {
        spec.name: _complete(columns.get(spec.name), spec, lengths) for spec in schema.CHECKPOINT
    }
    return State.from_dict(whole), digest_of(columns)


def _complete(
    values: NDArray[Any] | None, spec: schema.Dataset, lengths: dict[str, int]
) -> NDArray[Any]:
    """Zeros for what a file of an older version lacks: a dataset, or the last entries of books.

    Rows that nothing else counts are none.
    """
    shape = () if spec.dims == ("one",) else spec.shape(lengths)
    if values is None:
        return np.zeros(shape, dtype_of(spec, "double"))
    missing = shape[0] - len(values) if shape else 0
    return np.concatenate([values, np.zeros(missing)]) if missing > 0 else values


# ---- Which segments of an unfinished run count: those in the manifest, all that checkpoints need


def committed_segments(run: Path) -> list[Segment]:
    """The segments of a run directory, in order; raises `DamagedRun` or `StorageError`.

    A manifest that lost lines at its end looks like a shorter one, so it is compared with the
    newest checkpoint. Checkpoints are read first: while a run goes on, its manifest only grows.
    """
    directory = run / layout.SEGMENTS
    listed: list[Segment] = []
    for sidecar in newest_first(run / layout.CHECKPOINTS):
        with contextlib.suppress(DamagedRun, StorageError):
            listed = record_of(CheckpointDocument, read_document(sidecar), sidecar).segments
            break
    names = [segment.name for segment in listed]
    segments = read_manifest(directory)
    if [segment.name for segment in segments[: len(names)]] == names:
        return segments
    what = f"{directory / MANIFEST}: damaged (segments listed in {sidecar.name} are missing)"
    # What helps is to go on from a checkpoint with whole segments
    try:
        usable = load_newest(
            run / layout.CHECKPOINTS, Identity.of(read_run_document(run)), run / layout.SEGMENTS
        )
    except (DamagedRun, StorageError):
        usable = None
    if usable is None:
        raise DamagedRun(f"{what}; no checkpoint has all its segments; {START_AGAIN}")
    raise DamagedRun(f"{what}; continue the run to repair it, from step {usable.state.step}")

"""Small JSON documents of a run (``run.json``, manifest, sidecars): a digest, and a model of each.

A document is kept as the dictionary that was read: what a newer minor version has added stays.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Strict,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from multicor_cli.files import LARGEST_RECORD, read_regular
from multicor_cli.model import EXCHANGE_NAMES
from multicor_cli.scenario.documents import Count, Decision
from multicor_cli.store import layout
from multicor_cli.store.atomic import commit_bytes, is_regular, storage_errors
from multicor_cli.store.errors import DamagedRun, NothingStored, UnsupportedVersion
from multicor_cli.store.schema import FORMAT_VERSION
from multicor_cli.store.snapshot import empty_summary
from multicor_cli.text import json_value

# ---- JSON with a digest

Document = dict[str, Any]

SIZE_LIMIT = 256 << 20
"""Largest document that is read [bytes]."""

_CHECK = "check"


def write_document(path: Path, label: str, data: Document) -> None:
    """Commit ``data`` as JSON with its digest; numbers that are not finite become null."""
    commit_bytes(
        path, label, (json.dumps(_sealed(data), indent=1, ensure_ascii=False) + "\n").encode()
    )


def document_line(data: Document) -> bytes:
    """One line of JSON with its digest."""
    return (json.dumps(_sealed(data), ensure_ascii=False) + "\n").encode()


def read_document(path: Path) -> Document:
    """Read a document, check its digest; raises `StorageError`, or `DamagedRun` if changed."""
    with storage_errors(path):
        data = read_regular(path, SIZE_LIMIT)
    return parse_document(data, str(path))


def parse_document(data: bytes, where: str) -> Document:
    """Parse one document and check its digest; ``where`` names it in `DamagedRun`."""
    try:
        value = json.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise DamagedRun(f"{where}: damaged ({error})") from error
    if not isinstance(value, dict):
        raise DamagedRun(f"{where}: damaged (not a JSON object)")
    page = json.dumps(value, indent=1, ensure_ascii=False) + "\n"
    # Not a blank more
    is_as_written = data.decode() in (page, json.dumps(value, ensure_ascii=False))
    check = value.pop(_CHECK, None)
    if check != _digest(value) or not is_as_written:
        raise DamagedRun(f"{where}: damaged or edited (its content does not match its digest)")
    return value


def _sealed(data: Document) -> Document:
    clean = json_value(data)
    return {**clean, _CHECK: _digest(clean)}


def _digest(data: Document) -> str:
    text = json.dumps(data, sort_keys=True, ensure_ascii=True, allow_nan=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def check_version(path: Path, version: Any) -> None:
    """Refuse another major version of the format, or what is not one: `UnsupportedVersion`."""
    parts = version if isinstance(version, list) else []
    is_version = len(parts) == 2 and all(isinstance(part, int) for part in parts)
    if not is_version or parts[0] != FORMAT_VERSION[0]:
        given = ".".join(map(str, parts)) if isinstance(version, list) else str(version)[:40]
        raise UnsupportedVersion(
            f"{path}: has format version {given}, this program reads {FORMAT_VERSION[0]}.x; "
            f"use the version of multicor that made it, or run the scenario again"
        )


# ---- What documents may say: they may come from elsewhere, and hold anything


def _scalar(value: Any) -> Any:
    is_integer = isinstance(value, int) and abs(value) < 2**63
    if not (is_integer or value is None or isinstance(value, float | str)):
        raise ValueError
    return value


Number = Annotated[float, Strict()]
Scalar = Annotated[Any, AfterValidator(_scalar)]
"""A number that a machine can hold, a text, or null."""

T = TypeVar("T")
_checker = functools.cache(TypeAdapter)


def record_of(kind: type[T], document: Any, where: Path | str = "") -> T:
    """What a document, or a part, says; `DamagedRun` about ``where`` names the first wrong key."""
    try:
        return cast("T", _checker(cast("Any", kind)).validate_python(document))
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
    key = ".".join(map(str, first["loc"]))
    if first["type"] == "missing":
        raise DamagedRun(f"{where}: damaged (lacks {key})")
    raise DamagedRun(f"{where}: damaged ({key} is {str(first['input'])[:60]}, which no run writes)")


# ---- From which moment of which run a run goes on


@dataclass(frozen=True)
class Origin:
    """A moment of another run.

    Attributes:
        run: Directory of the run.
        run_id: Identity of the run.
        frame: Index of the frame, from 0; None: its last checkpoint.
        step: Steps that it had done.
        time: Time since its start [s].
        digest: Digest of what was taken: that of the state of a checkpoint
            (`multicor_cli.model.State.digest`), or of the frame.
        walls: Walls that have their place and velocity from it.
        new_walls: Walls that it does not have: they are where the scenario puts them.
        lost_walls: Walls of it that the scenario does not have: they are gone.
    """

    run: str
    run_id: str
    frame: Count | None
    step: Count
    time: Number
    digest: str
    walls: tuple[str, ...] = ()
    new_walls: tuple[str, ...] = ()
    lost_walls: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """From where, in words."""
        moment = "its end" if self.frame is None else f"frame {self.frame}"
        return (
            f"{self.run}, {moment}: step {self.step}, t = {self.time:.6g} s, digest {self.digest}"
        )

    @property
    def wall_texts(self) -> list[str]:
        """What happens to walls that only one of the two runs has, in words."""
        walls = {
            "new, not in that run": self.new_walls,
            "gone, not in this scenario": self.lost_walls,
        }
        return [f"{what}: {', '.join(names)}" for what, names in walls.items() if names]


# ---- Why and when each loading stage of a run ended, and how people are told

Reason = Literal["duration", "condition", "timeout", "steered"]


@dataclass(frozen=True)
class StageEnd:
    """The end of a loading stage.

    Attributes:
        stage: Index of the stage.
        name: Name of the stage.
        reason: ``duration``: it lasted as long as it was to; ``condition``: its condition held;
            ``timeout``: its duration was over before its condition held; ``steered``: the program
            that steers the run has ended it.
        step: Steps done since the start of the run.
        time: Time since the start of the run [s].
        duration: Time since the start of the stage [s].
        quantity: What its condition looks at, in words, and why it has no value if it has none;
            empty without condition.
        value: Value of this quantity at the end; None if there is none.
        relation: How the value had to be: ``at least`` or ``at most``; empty without condition.
        goal: Value asked for; None without condition.
        unit: SI unit of value and goal; ``1`` if dimensionless.
    """

    stage: Count
    name: str
    reason: Reason
    step: Count
    time: Number
    duration: Number
    quantity: str = ""
    value: Number | None = None
    relation: str = ""
    goal: Number | None = None
    unit: str = "1"

    @property
    def text(self) -> str:
        return f"t = {self.time:.6g} s, step {self.step}: {self.why}"

    @property
    def why(self) -> str:
        if self.reason == "duration":
            return f"its duration of {self.duration:.6g} s was over"
        if self.reason == "steered":
            return f"ended by the program that steers the run, after {self.duration:.6g} s"
        unit = f" {self.unit}" if self.unit != "1" else ""
        was = "never had a value" if self.value is None else f"was {self.value:.5g}{unit}"
        goal = math.nan if self.goal is None else self.goal
        reached = f"{self.quantity} {was}, asked for was {self.relation} {goal:.5g}{unit}"
        is_late = self.reason == "timeout"
        return f"timed out after {self.duration:.6g} s; {reached}" if is_late else reached


# ---- Models of the documents


class _SolverSummary(BaseModel):
    sweeps_mean: Scalar
    residual_rms_max: Scalar
    residual_max_max: Scalar
    unconverged_steps: Count


class _Temperature(BaseModel):
    mean: Number
    min: Number
    max: Number


class _HeatSummary(BaseModel):
    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Scalar]
    books: dict[str, Scalar]
    temperature: _Temperature


class _OutletFlow(BaseModel):
    grains: Scalar
    mass: Scalar


class _ExchangeSummary(BaseModel):
    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Number]
    outlets: dict[str, _OutletFlow]

    @model_validator(mode="after")
    def _has_books(self) -> _ExchangeSummary:
        if not set(EXCHANGE_NAMES) <= self.model_fields_set:
            raise ValueError
        return self


class SummaryDocument(BaseModel):
    """See `multicor_cli.store.summarize`; runs of every version have what the first had."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Scalar]
    step: Count
    time: Number
    stage: Count
    grain_count: Count
    solver: _SolverSummary
    books: dict[str, Scalar]
    heat: _HeatSummary | None
    exchange: _ExchangeSummary | None = None

    @model_validator(mode="after")
    def _is_whole(self) -> SummaryDocument:
        first = empty_summary((1, 0))
        has_books = first["books"].keys() <= self.books.keys()
        if not (has_books and first.keys() <= self.model_fields_set):
            raise ValueError
        return self


class _Provenance(BaseModel):
    seed: Annotated[int, Strict()]


class Steered(BaseModel):
    """What checkpoints keep of the program that steers a run."""

    decisions: list[Decision]
    notes: Document


class _Steering(Steered):
    by: str
    every: Count


class ResultsDocument(BaseModel):
    """What ``results.h5`` says of its run beside the data."""

    status: Literal["creating", "running", "finished", "stopped", "failed"]
    provenance: _Provenance
    summary: SummaryDocument | None
    stage_ends: list[StageEnd] = []  # earlier versions have none of these three
    origin: Origin | None = None
    steering: _Steering | None = None


class _File(BaseModel):
    size: Count
    blake2b: str


class _Results(_File):
    frames: Count
    data_digest: str


class _Extension(BaseModel):
    """When stages were added, and what the run had been before."""

    started: str
    stages_before: Count
    stages: Count
    step: Number | None
    time: Number | None
    source_sha256: str
    resolved_sha256: str


class RunDocument(ResultsDocument):
    """What ``run.json`` says."""

    run_id: str
    stop_reason: str
    exit_code: Count | None
    started: str
    finished: str
    updated: str
    precision: str
    stages: list[str]
    source_sha256: str
    resolved_sha256: str
    extensions: list[_Extension] = []
    sessions: list[Document]
    timings: dict[str, Number]
    results: _Results | None
    model: _File | None = None  # until it is there


# ---- `run.json`

FILETYPE = "multicor-run"
CREATING = "creating"
"""Status of a run of which not all files are there yet; nothing has been computed."""


def read_run_document(path: Path) -> Document:
    """``run.json`` of a run directory, checked; raises `DirectoryRefused` if there is no run.

    Raises `DamagedRun` if it is damaged, of an incompatible version (`UnsupportedVersion`), or only
    begun (`NothingStored`), and `StorageError` if it cannot be read.
    """
    file = path / layout.RUN
    if not is_regular(file):
        raise layout.no_run(path)
    document = read_document(file)
    if document.get("filetype") != FILETYPE:
        raise DamagedRun(f"{file}: not the description of a run")
    check_version(file, document.get("format_version"))
    if document.get("status") == CREATING:
        raise NothingStored(path)
    record_of(RunDocument, document, file)
    return document


def decisions_of(document: Document) -> list[Decision]:
    """What the program that steers the run has decided; empty if none does."""
    steering = document.get("steering") or {"decisions": []}
    return [record_of(Decision, decision) for decision in steering["decisions"]]


def read_scenario(path: Path, sha256: str) -> str:
    """Text of a scenario file; `DamagedRun` if it was changed, `StorageError` if unreadable.

    Where the run was being extended when its process died, it is still the run of a former
    scenario, kept beside the new one.
    """
    for file in (path, *reversed(layout.former_files(path))):
        with storage_errors(file):
            data = read_regular(file, LARGEST_RECORD)
        if hashlib.sha256(data).hexdigest() == sha256:
            return data.decode()
    raise DamagedRun(
        f"{path}: was changed after the run had begun; put the original back, or start another run"
    )

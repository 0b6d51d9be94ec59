"""``run.json``: what a run is, where it comes from, and how it ended."""

from __future__ import annotations

import hashlib
import shlex
import uuid
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from multicor_cli.model import EXCHANGE_NAMES
from multicor_cli.scenario.steered import Decision, is_decision
from multicor_cli.store import layout
from multicor_cli.store.atomic import is_regular
from multicor_cli.store.documents import Document, plain, read_document
from multicor_cli.store.errors import DamagedRun, NothingStored, no_run
from multicor_cli.store.hdf5 import Precision, check_version
from multicor_cli.store.provenance import current_command
from multicor_cli.store.schema import FORMAT_VERSION
from multicor_cli.store.stage_ends import Origin, is_origin, is_stage_end
from multicor_cli.store.summary import empty_summary

FILETYPE = "multicor-run"
CREATING = "creating"
"""Status of a run of which not all files are there yet; nothing has been computed."""


def read_run_document(path: Path) -> Document:
    """``run.json`` of a run directory, checked.

    Raises:
        DirectoryRefused: If there is no run.
        DamagedRun: If it is damaged, or of an incompatible version (`UnsupportedVersion`), or only begun (`NothingStored`).
        StorageError: If it cannot be read.
    """
    file = path / layout.RUN
    if not is_regular(file):
        raise no_run(path)
    document = read_document(file)
    if document.get("filetype") != FILETYPE:
        raise DamagedRun(f"{file}: not the description of a run")
    check_version(file, document.get("format_version"))
    if document.get("status") == CREATING:
        raise NothingStored(path)
    missing = _KEYS - document.keys()
    if missing:
        raise DamagedRun(f"{file}: lacks {', '.join(sorted(missing))}")
    check_types(file, document)
    return document


def check_types(file: Path, document: Document) -> None:
    """Compare the values that ``document`` has with what they must be; raises `DamagedRun` about ``file``."""
    wrong = [name for name, is_right in _TYPES.items() if name in document and not is_right(document[name])]
    if wrong:
        raise DamagedRun(f"{file}: damaged ({wrong[0]} is {str(document[wrong[0]])[:60]}, which no run writes)")


def new_document(
    source: bytes,
    resolved: str,
    provenance: Mapping[str, Any],
    stages: Sequence[str],
    precision: Precision,
    origin: Origin | None = None,
    steering: Document | None = None,
) -> Document:
    """The document of a run that begins now; arguments as for ``RunDirectory.create``."""
    return {
        "filetype": FILETYPE,
        "format_version": list(FORMAT_VERSION),
        "run_id": uuid.uuid4().hex,
        "status": CREATING,
        "stop_reason": "",
        "exit_code": None,
        "started": now(),
        "finished": "",
        "updated": now(),
        "precision": precision,
        "stages": list(stages),
        "stage_ends": [],
        "source_sha256": hashlib.sha256(source).hexdigest(),
        "resolved_sha256": hashlib.sha256(resolved.encode()).hexdigest(),
        "origin": None if origin is None else origin.as_document(),
        "provenance": plain(dict(provenance)),
        "extensions": [],
        "steering": steering,
        "sessions": [new_session()],
        "timings": {},
        "summary": None,
        "results": None,
    }


def new_session() -> Document:
    """When and by which command this process began to work on a run."""
    return {"started": now(), "command": shlex.join(current_command())}


def now() -> str:
    """This moment in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


_LATER = {"stage_ends", "origin", "extensions", "steering"}
"""Keys that runs of earlier versions lack."""

_KEYS = set(new_document(b"", "", {}, (), "double")) - _LATER


def decisions_of(document: Document) -> list[Decision]:
    """What the program that steers the run has decided; empty if none does."""
    steering = document.get("steering")
    return [] if steering is None else [Decision.of_document(decision) for decision in steering["decisions"]]


def _is_steering(value: Any) -> bool:
    """Whether it is what is kept of a program that steers a run."""
    return (
        isinstance(value, dict)
        and isinstance(value.get("by"), str)
        and isinstance(value.get("every"), int)
        and isinstance(value.get("decisions"), list)
        and all(map(is_decision, value["decisions"]))
        and isinstance(value.get("notes"), dict)
    )


def _is_results(value: Any) -> bool:
    return value is None or (
        isinstance(value, dict)
        and all(isinstance(value.get(name), int) for name in ("size", "frames"))
        and all(isinstance(value.get(name), str) for name in ("data_digest", "blake2b"))
    )


def _is_extension(value: Any) -> bool:
    """Whether it is what `multicor_cli.store.extension` writes."""
    if not isinstance(value, dict):
        return False
    texts = [value.get(name) for name in ("started", "source_sha256", "resolved_sha256")]
    counts = [value.get(name) for name in ("stages_before", "stages")]
    places = [value.get(name) for name in ("step", "time")]
    return (
        all(isinstance(text, str) for text in texts)
        and all(isinstance(count, int) and _is_number(count) for count in counts)
        and all(place is None or _is_number(place) for place in places)
    )


def _is_file(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("size"), int) and isinstance(value.get("blake2b"), str)


def _is_summary(value: Any) -> bool:
    """Whether it has the keys that all summaries have, and its values are numbers but for the digest and what it does not have."""
    if value is None:
        return True
    heat: dict[str, Any] = {"books": {}, "temperature": {}}
    if not _is_like(value, empty_summary((1, 0))) or not _is_like(value["heat"], heat, is_optional=True):
        return False
    if not _is_exchange(value.get("exchange")):
        return False
    counts = [*(value[name] for name in ("step", "time", "stage", "grain_count")), value["solver"]["unconverged_steps"]]
    temperature = [value["heat"]["temperature"].get(name) for name in ("mean", "min", "max")] if value["heat"] else []
    return all(_is_number(item) for item in [*counts, *temperature])


def _is_exchange(value: Any) -> bool:
    """Whether it is what a summary says of grains that come and go; None where none does, or in an older run."""
    if value is None:
        return True
    flows = value.get("outlets") if isinstance(value, dict) else None
    if not isinstance(flows, dict) or not all(_is_like(flow, {"grains": None, "mass": None}) for flow in flows.values()):
        return False
    counts = {name: number for name, number in value.items() if name != "outlets"}
    return counts.keys() >= set(EXCHANGE_NAMES) and all(map(_is_number, counts.values()))


def _is_number(value: Any) -> bool:
    """Whether it is a number that a machine can hold."""
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**63)


def _is_like(value: Any, reference: dict[str, Any], *, is_optional: bool = False) -> bool:
    """Whether a value has the tables and keys of ``reference``, and all else in it is a number, a text or null."""
    if not isinstance(value, dict) or not value.keys() >= reference.keys():
        return is_optional and value is None
    tables = {name: table for name, table in reference.items() if isinstance(table, dict)}
    rest = (item for name, item in value.items() if name not in tables and name not in ("heat", "exchange"))
    return all(_is_like(value[name], table) for name, table in tables.items()) and all(
        item is None or isinstance(item, str) or _is_number(item) for item in rest
    )


def _is_provenance(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("seed"), int)


_TYPES: dict[str, Callable[[Any], bool]] = {
    "run_id": lambda value: isinstance(value, str),
    "status": lambda value: value in (CREATING, "running", "finished", "stopped", "failed"),
    "stages": lambda value: isinstance(value, list) and all(isinstance(name, str) for name in value),
    "stage_ends": lambda value: isinstance(value, list) and all(map(is_stage_end, value)),
    "origin": lambda value: value is None or is_origin(value),
    "extensions": lambda value: isinstance(value, list) and all(map(_is_extension, value)),
    "steering": lambda value: value is None or _is_steering(value),
    "sessions": lambda value: isinstance(value, list) and all(isinstance(item, dict) for item in value),
    "provenance": _is_provenance,
    "timings": lambda value: isinstance(value, dict) and all(map(_is_number, value.values())),
    "started": lambda value: isinstance(value, str),
    "updated": lambda value: isinstance(value, str),
    "model": _is_file,  # once it is there
    "results": _is_results,
    "summary": _is_summary,
}

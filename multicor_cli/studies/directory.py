"""The directory of a study: what it is, its cases, and how each of them stands.

``study.json`` says which scenario and which cases; ``cases/NAME`` is the run of a case, an ordinary
run directory, which alone says how far it has come; ``failed/NAME.json`` tells why a case failed;
``observed/NAME.json`` keeps numbers taken from a finished run; ``pages/NAME.html`` are reports
about runs, if they were asked for. Nothing else is kept, so nothing can disagree.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

from multicor_cli.files import read_object, read_regular
from multicor_cli.running.differences import find_differences
from multicor_cli.scenario.problems import Refused
from multicor_cli.store import layout
from multicor_cli.store.atomic import commit_bytes, make_directory, storage_errors
from multicor_cli.store.documents import SIZE_LIMIT
from multicor_cli.store.errors import DamagedRun, DirectoryRefused
from multicor_cli.store.lock import RunLock, is_alive
from multicor_cli.studies.axes import Case, Values, digest_of
from multicor_cli.studies.study_file import Study

FILETYPE, VERSION = "multicor-study", 1
DOCUMENT, SOURCE, LOCK, CASES, FAILED, OBSERVED, LOGS, PAGES = (
    "study.json", "study.toml", "lock", "cases", "failed", "observed", "logs", "pages"
)  # fmt: skip


class CaseStatus(Enum):
    """How a case stands."""

    WAITING = "waiting"
    RUNNING = "running"
    STOPPED = "stopped"
    FINISHED = "finished"
    FAILED = "failed"


@dataclass(frozen=True)
class CaseState:
    """How a case stands.

    Attributes:
        reason: Why it failed or stopped; may be empty.
        step: Steps done, at its last checkpoint.
        share: Share of it that is done, while it runs; None if that is not known.
        remaining: Time left, while it runs [s]; None if that is not known.
        seconds: What it took, if it has finished in one session [s]; else None.
    """

    status: CaseStatus
    reason: str = ""
    step: int = 0
    share: float | None = None
    remaining: float | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class StudyDirectory:
    """Where a study is kept."""

    path: Path

    def case(self, name: str) -> Path:
        """Run directory of a case."""
        return self.path / CASES / name

    def failure(self, name: str) -> Path:
        """Where the reason is, if the case failed; `--retry` removes it."""
        return self.path / FAILED / f"{name}.json"

    def observed(self, name: str) -> Path:
        return self.path / OBSERVED / f"{name}.json"

    def page(self, name: str) -> Path:
        return self.path / PAGES / f"{name}.html"

    @property
    def exists(self) -> bool:
        return (self.path / DOCUMENT).is_file()

    def document(self) -> dict[str, Any]:
        """What ``study.json`` says.

        Raises:
            DirectoryRefused: There is no study.
            DamagedRun: It is damaged, or of a newer version.
        """
        file = self.path / DOCUMENT
        if not file.is_file():
            raise DirectoryRefused(f"{self.path}: holds no study")
        with storage_errors(file):
            try:
                found = json.loads(read_regular(file, SIZE_LIMIT))
            except (ValueError, RecursionError):
                raise DamagedRun(f"{file}: is damaged; restore it from a copy") from None
        said = found if isinstance(found, dict) else {}
        if (said.get("filetype"), said.get("format_version")) != (FILETYPE, VERSION):
            raise DamagedRun(f"{file}: is not a study of this version of the program")
        return said

    def cases(self) -> list[Case]:
        return [Case(name, values) for name, values in self.document()["cases"].items()]

    def as_named(self, cases: Sequence[Case]) -> list[Case]:
        """The same cases; those that are known have the names that they have here.

        Names are as short as the values of all cases allow, and there may be more by now.
        """
        known = self.cases() if self.exists else []
        names = {_key(case.values): case.name for case in known}
        taken = {case.name.casefold(): case.values.keys() for case in known}
        named = []
        for case in cases:
            name = names.get(_key(case.values))
            if name is None:
                name = case.name
                if taken.get(name.casefold()) == case.values.keys():
                    name = f"{name}_{digest_of(case.values)}"
            named.append(replace(case, name=name))
        return named

    def begin(self, study: Study, cases: Sequence[Case], resolved: str) -> None:
        """Write or renew ``study.json``; ``resolved`` is the scenario with all defaults, as TOML.

        Raises:
            ScenarioError: A case or the scenario is another than when the study began.
            DirectoryRefused: The directory holds something else.
        """
        known: dict[str, Any] = {}
        if self.exists:
            document = self.document()
            _refuse_changes(study, cases, document, resolved)
            known = document["cases"]
        else:
            self._refuse_foreign()
        for name in (CASES, FAILED, OBSERVED):
            make_directory(self.path / name)
        merged = {case.name: dict(case.values) for case in cases}
        if not self.exists or merged.keys() - known.keys():
            merged.update({name: values for name, values in known.items() if name not in merged})
            commit_bytes(self.path / SOURCE, "study source", study.sources.text.encode())
            document = {
                "filetype": FILETYPE, "format_version": VERSION, "name": study.name,
                "scenario": str(study.scenario.absolute()),
                "resolved": resolved, "cases": merged,
            }  # fmt: skip
            _commit(self.path / DOCUMENT, "study document", document)

    def _refuse_foreign(self) -> None:
        with storage_errors(self.path):
            if self.path.exists() and (
                not self.path.is_dir() or {entry.name for entry in self.path.iterdir()} - {LOCK}
            ):
                raise DirectoryRefused(
                    f"{self.path}: exists and holds no study; choose another directory with -o"
                )

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keep other clients away; raises `RunLocked`, which names the other, if one is at work.

        If the directory holds something else `DirectoryRefused`, before anything is written.
        """
        if not self.exists:
            self._refuse_foreign()
        make_directory(self.path)
        lock = RunLock(self.path / LOCK)
        try:
            yield
        finally:
            lock.release()

    def state(self, case: Case) -> CaseState:
        """How a case stands; reads only its ``run.json`` and what is beside it.

        On shared file systems a file may be there without its content.
        """
        failure = read_object(self.failure(case.name), SIZE_LIMIT)
        if failure:
            return CaseState(CaseStatus.FAILED, str(failure.get("reason", "")))
        run = self.case(case.name)
        found = read_object(run / layout.RUN, SIZE_LIMIT)
        if not found:
            return CaseState(CaseStatus.WAITING)
        step = int((found.get("summary") or {}).get("step", 0))
        if found.get("status") == "finished":
            is_whole = len(found.get("sessions") or ()) == 1
            took = (found.get("timings") or {}).get("wall") if is_whole else None
            return CaseState(CaseStatus.FINISHED, step=step, seconds=took)
        if is_alive(run / layout.LOCK):
            beat = read_object(run / layout.PROGRESS, SIZE_LIMIT)
            at, left = int(beat.get("step", step)), beat.get("remaining_seconds")
            return CaseState(CaseStatus.RUNNING, "", at, beat.get("progress"), left)
        has_failed, reason = found.get("status") == "failed", found.get("stop_reason")
        status = CaseStatus.FAILED if has_failed else CaseStatus.STOPPED
        return CaseState(status, str(reason or "interrupted"), step)

    def record_failure(self, name: str, reason: str, exit_code: int) -> None:
        data = {"case": name, "reason": reason, "exit_code": exit_code}
        _commit(self.failure(name), "failure of a case", data)


def _refuse_changes(
    study: Study, cases: Sequence[Case], document: dict[str, Any], resolved: str
) -> None:
    remedy, findings = "choose another directory with -o", []
    for path, before, after in find_differences(document["resolved"], resolved):
        key = ".".join(map(str, path))
        message = f"the scenario has {key} = {after}, it had {before} when the study began"
        findings.append(Refused(("study", "scenario"), message, remedy))
    for case in cases:
        known = document["cases"].get(case.name)
        if known is not None and known != dict(case.values):
            keys = {**known, **case.values}
            key = next(key for key in keys if known.get(key) != case.values.get(key))
            was, now = known.get(key), case.values.get(key)
            message = f"case {case.name} had {key} = {was!r}, now {now!r}"
            findings.append(Refused(("vary",), message, remedy))
    if findings:
        raise study.refuse(*findings[:10])


def _key(values: Values) -> str:
    return json.dumps(dict(values), sort_keys=True)


def _commit(file: Path, label: str, data: dict[str, Any]) -> None:
    commit_bytes(file, label, json.dumps(data, indent=1, ensure_ascii=False).encode())

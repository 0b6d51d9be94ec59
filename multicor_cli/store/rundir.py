"""A run directory, from the side of the run: create, resume, checkpoint, finish."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import tempfile
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal, cast

from multicor_cli.model import Model, State
from multicor_cli.model.books import Version
from multicor_cli.scenario.documents import steered_text
from multicor_cli.store import layout
from multicor_cli.store.atomic import (
    commit_bytes,
    described,
    is_regular,
    kill_point,
    make_directory,
    remove_own,
    require_own,
    storage_errors,
)
from multicor_cli.store.checkpoint import (
    START_AGAIN,
    Checkpoint,
    Identity,
    load_newest,
    prune,
    write_checkpoint,
)
from multicor_cli.store.documents import (
    CREATING,
    FILETYPE,
    Document,
    Origin,
    StageEnd,
    decisions_of,
    read_document,
    read_run_document,
    read_scenario,
    record_of,
    write_document,
)
from multicor_cli.store.errors import DamagedRun, DirectoryRefused, StoreError
from multicor_cli.store.extension import Extension, extend
from multicor_cli.store.hdf5 import Closing, Precision
from multicor_cli.store.lock import RunLock
from multicor_cli.store.provenance import new_session, now
from multicor_cli.store.results import load_model, model_digest, write_model, write_results
from multicor_cli.store.schema import FORMAT_VERSION
from multicor_cli.store.segments import FrameWriter, keep_segments
from multicor_cli.text import json_value

Status = Literal["finished", "stopped", "failed"]

# ---- Whether a run may begin in a directory, and what is there from its beginning

_MOST_BYTES, _MOST_BYTES_OF_PART = 4096, 255
"""Longest path, with the character that ends it, and longest name in it."""

_LONGEST_NAME = "checkpoints/step-00000000000.00.json.tmp"
"""A name in a run directory that is as long as any."""


def _require_room_for_names(path: Path) -> None:
    """Raise `DirectoryRefused` if a name there would be longer than system calls take."""
    parts, whole = path.parts, os.fsencode(path.absolute() / _LONGEST_NAME)
    is_short = len(whole) < _MOST_BYTES and all(
        len(os.fsencode(part)) <= _MOST_BYTES_OF_PART for part in parts
    )
    if not is_short or "\0" in str(path):
        limits = (
            f"at most {_MOST_BYTES_OF_PART} bytes between two slashes and "
            f"{_MOST_BYTES - len(_LONGEST_NAME) - 2} in all"
        )
        raise DirectoryRefused(
            f"{path}: no run can be in a directory of this name ({limits}); choose another with -o"
        )


def check_usable(path: Path, *, overwrite: bool) -> None:
    """Refuse a directory in which no run may begin; leaves nothing behind.

    Raises `DirectoryRefused` if it is no directory, or holds foreign files or a run to be kept, and
    `StorageError` if it cannot be read or written.
    """
    _require_room_for_names(path)
    with storage_errors(path):
        if not path.exists() and not path.is_symlink():
            nearest = next(parent for parent in path.absolute().parents if os.path.lexists(parent))
            if not nearest.is_dir():
                raise DirectoryRefused(
                    f"{path}: {nearest} is not a directory; choose another with -o"
                )
            # Now, not after grains are placed
            if not os.access(nearest, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), nearest)
            try:
                Path(tempfile.mkdtemp(prefix=".multicor-", dir=nearest)).rmdir()
            except FileNotFoundError:  # what the kernel says of its own file systems
                raise DirectoryRefused(
                    f"{path}: no directory can be made in {nearest}; choose another place with -o"
                ) from None
            return
        if not path.is_dir():
            raise DirectoryRefused(f"{path}: exists and is not a directory; choose another with -o")
        names = {entry.name for entry in path.iterdir()}
        _, foreign = layout.survey(path)
    if layout.RUN not in names:
        if names <= {layout.LOCK, layout.RUN + ".tmp"}:
            return
        raise DirectoryRefused(
            f"{path}: exists and is not a run directory; choose another with -o, or empty it"
        )
    if RunDirectory.is_run(path) and not overwrite:
        raise DirectoryRefused(
            f"{path}: holds a run; continue it, choose another directory with -o, or give "
            "--overwrite"
        )
    if foreign:
        listed = ", ".join(foreign[:5]) + (" …" if len(foreign) > 5 else "")
        raise DirectoryRefused(
            f"{path}: holds files that no run has made ({listed}); move them away before "
            "overwriting"
        )


# ---- The directory of a run that is being carried out


class RunDirectory(Closing):
    """The directory of one run, locked while its context lasts; made by `create` or `resume`.

    Attributes:
        run_id: Identity of the run, the same in all its files.
        precision: How datasets of type ``float`` are stored.
        version: Version of the file format in which the run was begun, and is continued.
    """

    def __init__(self, path: Path, lock: RunLock, document: Document) -> None:
        self.path, self.run_id = path, str(document["run_id"])
        self.precision: Precision = "single" if document["precision"] == "single" else "double"
        major, minor = document["format_version"]
        self.version: Version = min((major, minor), FORMAT_VERSION)
        self._lock = lock
        self._document = document
        self._checkpoint: Checkpoint | None = None
        self._is_loaded = False
        self._writer: FrameWriter | None = None
        self._model: Model | None = None
        self._model_digest = ""
        self._newest: tuple[str, int] | None = None
        self._has_news = False

    @staticmethod
    def is_run(path: Path) -> bool:
        """Whether ``path`` holds a run that can be resumed or is finished, not only a beginning."""
        path = Path(path)
        _require_room_for_names(path)
        if not is_regular(path / layout.RUN):
            return False
        try:
            return bool(read_document(path / layout.RUN).get("status") != CREATING)
        except DamagedRun:
            return True

    @classmethod
    def create(
        cls,
        path: Path,
        source_text: str | bytes,
        resolved_text: str,
        provenance: Mapping[str, Any],
        *,
        stages: Sequence[str] = (),
        precision: Precision = "double",
        overwrite: bool = False,
        origin: Origin | None = None,
        steering: Document | None = None,
    ) -> RunDirectory:
        """Begin a run in a new or empty directory, and lock it.

        Args:
            path: The directory; it is made, with its parents.
            source_text: The scenario file as given, kept byte by byte.
            resolved_text: The scenario with all defaults and overrides.
            provenance: See `collect_provenance`.
            stages: Names of the loading stages.
            precision: How datasets of type ``float`` are stored.
            overwrite: Remove the run that is there.
            origin: The moment of another run from which it goes on.
            steering: What is known of the program that steers it.

        Raises:
            DirectoryRefused: If there is something that is not a run, foreign files in a run, or a
                run and no ``overwrite``.
            RunLocked: If another process is running there.
            StorageError: If a file cannot be written; `StorageFull` if there is no space.
        """
        path = Path(path)
        check_usable(path, overwrite=overwrite)
        make_directory(path)
        lock = RunLock(path / layout.LOCK)
        try:
            check_usable(path, overwrite=overwrite)
            source = source_text.encode() if isinstance(source_text, str) else source_text
            resolved = resolved_text.encode()
            document: Document = {
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
                "resolved_sha256": hashlib.sha256(resolved).hexdigest(),
                "origin": None if origin is None else asdict(origin),
                "provenance": json_value(dict(provenance)),
                "extensions": [],
                "steering": steering,
                "sessions": [new_session()],
                "timings": {},
                "summary": None,
                "results": None,
            }
            # Status ``creating`` first, so that a crash leaves no run
            write_document(path / layout.RUN, "runjson", document)
            with storage_errors(path):
                for entry in layout.survey(path)[0]:
                    remove_own(entry)
            for name in (layout.SEGMENTS, layout.CHECKPOINTS):
                make_directory(path / name)
            commit_bytes(path / layout.SOURCE, "scenario", source)
            commit_bytes(path / layout.RESOLVED, "scenario", resolved)
            document["status"] = "running"
            write_document(path / layout.RUN, "runjson", document)
        except BaseException:
            lock.release()
            raise
        run = cls(path, lock, document)
        run._is_loaded = True
        return run

    @classmethod
    def resume(cls, path: Path, *, extension: Extension | None = None) -> RunDirectory:
        """Lock an existing run to continue it, or to find that it is finished.

        Args:
            path: The directory.
            extension: A scenario with more stages, with which it goes on from now on.

        Raises:
            DirectoryRefused: If there is no run.
            RunLocked: If another process is running there.
            DamagedRun: If ``run.json`` is damaged, or of an incompatible version.
            StorageError: If a file cannot be read or written.
        """
        path = Path(path)
        if not (path / layout.RUN).is_file():
            raise layout.no_run(path)
        lock = RunLock(path / layout.LOCK)
        try:
            document = read_run_document(path)
            # What interrupted commits have left goes, as far as possible; what is not ours stays
            with contextlib.suppress(OSError):
                for entry in layout.temporaries(path):
                    with contextlib.suppress(OSError):
                        remove_own(entry)
            if extension is not None:
                extend(path, document, extension)
            run = cls(path, lock, document)
            if run.is_finished:
                run._remove_segments()
            else:
                for name in (layout.SEGMENTS, layout.CHECKPOINTS):
                    make_directory(path / name)
                document |= {"status": "running", "stop_reason": "", "exit_code": None}
                document |= {"finished": "", "results": None}
                document["sessions"] = [*document["sessions"], new_session()]
                run._save()
        except BaseException:
            lock.release()
            raise
        return run

    def close(self) -> None:
        """Give the lock back. A run that has not ended by then counts as interrupted."""
        self._lock.release()

    @property
    def status(self) -> str:
        """``running``, ``finished``, ``stopped`` or ``failed``."""
        return str(self._document["status"])

    @property
    def is_finished(self) -> bool:
        return self.status == "finished"

    @property
    def stage_ends(self) -> tuple[StageEnd, ...]:
        """How the stages ended so far; of runs that an earlier version began, those since then."""
        return tuple(record_of(StageEnd, end) for end in self._document.get("stage_ends", []))

    @property
    def origin(self) -> Origin | None:
        """The moment of another run from which the run goes on; None if there is none."""
        origin = self._document.get("origin")
        return None if origin is None else record_of(Origin, origin)

    @property
    def steering(self) -> Document | None:
        """The steering program, its decisions and notes, or None; changes of it are kept."""
        return cast("Document | None", self._document.get("steering"))

    def rename_stages(self, names: Sequence[str]) -> None:
        """Note names of stages that a program changed, for ``run.json`` at the next checkpoint."""
        if list(names) != self._document["stages"]:
            self._document["stages"] = list(names)
            self._has_news = True

    @property
    def source_text(self) -> str:
        """The scenario file as given; raises `DamagedRun` if it was changed."""
        return read_scenario(self.path / layout.SOURCE, self._document["source_sha256"])

    @property
    def resolved_text(self) -> str:
        """The scenario with all defaults; raises `DamagedRun` if it was changed."""
        return read_scenario(self.path / layout.RESOLVED, self._document["resolved_sha256"])

    def load_model(self) -> Model | None:
        """The model of the run if it was stored; raises `DamagedRun` or `StorageError`."""
        path = self.path / layout.MODEL
        return load_model(path, self.run_id) if path.exists() else None

    def load_checkpoint(self) -> Checkpoint | None:
        """The newest whole checkpoint; output after it is set aside as ``*.orphan``, to be redone.

        Returns:
            ``None`` if none was ever written: the run starts from its beginning.

        Raises:
            DamagedRun: If there are checkpoints and none can be used.
            StorageError: If a file cannot be read or renamed.
        """
        if self._is_loaded:
            return self._checkpoint
        segments, checkpoints = self.path / layout.SEGMENTS, self.path / layout.CHECKPOINTS
        identity, needed = Identity.of(self._document), None if self.is_finished else segments
        newest = load_newest(checkpoints, identity, needed, self.load_model())
        if not self.is_finished:
            # Damaged checkpoints go first: the manifest may be no shorter than the newest one says.
            prune(checkpoints, newest.name if newest else None)
            keep_segments(segments, list(newest.segments) if newest else [])
            # Then run.json forgets what happened after the checkpoint: it will happen once more.
            self._document["summary"] = newest.summary if newest else None
            self._forget_stage_ends(newest.state.stage if newest else 0)
            if self.steering is not None:
                known = newest.steering if newest else None
                self.steering.update(known or {"decisions": [], "notes": {}})
            self._save()
        self._checkpoint, self._is_loaded = newest, True
        if newest:
            self._newest = (str(newest.summary["state_digest"]), len(newest.segments))
        return self._checkpoint

    def writer(self, model: Model) -> FrameWriter:
        """The writer of output after that of the checkpoint; stores the model the first time.

        Raises:
            DamagedRun: If the run goes on from a checkpoint made with another model.
            StorageError: If the model cannot be written.
        """
        checkpoint = self.load_checkpoint()
        digest = model_digest(model)
        if checkpoint and checkpoint.model_digest != digest:
            raise DamagedRun(f"{self.path}: the checkpoint belongs to another model; {START_AGAIN}")
        path = self.path / layout.MODEL
        if checkpoint is None or not path.exists():
            write_model(path, model, self.run_id)
            self._document.pop("model", None)
        if "model" not in self._document:
            self._document["model"] = described(path)
        self._model, self._model_digest = model, digest
        self._writer = FrameWriter(
            self.path / layout.SEGMENTS,
            self.run_id,
            model,
            precision=self.precision,
            version=self.version,
            committed=checkpoint.segments if checkpoint else (),
            last_steps=checkpoint.last_steps if checkpoint else (-1, -1),
        )
        return self._writer

    def stage_ended(self, end: StageEnd) -> None:
        """Note how a loading stage ended; ``run.json`` says so from the next checkpoint on."""
        self._forget_stage_ends(end.stage)
        self._document["stage_ends"].append(asdict(end))
        self._has_news = True

    def _forget_stage_ends(self, stage: int) -> None:
        """Keep the ends of the stages before this one only: the others are still to come."""
        ends = self._document.get("stage_ends", [])
        self._document["stage_ends"] = [end for end in ends if end["stage"] < stage]

    def checkpoint(self, state: State, writer: FrameWriter) -> None:
        """Commit what ``writer`` holds, then the state; the two newest checkpoints are kept.

        Does nothing if the newest checkpoint holds this state and all output already.

        Raises:
            StorageFull: If there is not enough space; what was committed before stays.
            StorageError: For any other error of the system.
            DamagedRun: If the checkpoint does not read back as written.
            RunLocked: If another process has taken the run over.
        """
        if self._model is None:
            raise ValueError("checkpoint before writer")
        self._lock.require()
        writer.flush()
        identity = (state.digest(), len(writer.segments))
        if identity == self._newest:
            return
        # Before the checkpoint: whatever is continued from it knows how the stages before it ended
        if self._has_news:
            self._save()
        self._document["summary"] = write_checkpoint(
            self.path / layout.CHECKPOINTS,
            state,
            self._model,
            Identity.of(self._document),
            model_digest=self._model_digest,
            segments=writer.segments,
            last_steps=(writer.last_frame_step, writer.last_series_step),
            steering=self.steering,
        )
        self._newest = identity
        self._save()

    def progress(self, values: Mapping[str, Any]) -> None:
        """Replace ``progress.json``, a heartbeat; a failure to write it does not matter."""
        data = (json.dumps(json_value({**values, "updated": now()}), indent=1) + "\n").encode()
        with contextlib.suppress(StoreError):
            commit_bytes(self.path / layout.PROGRESS, "progress", data, is_durable=False)

    def finish(
        self,
        status: Status,
        *,
        stop_reason: str = "",
        exit_code: int = 0,
        timings: Mapping[str, Any] | None = None,
    ) -> None:
        """Say how the run ended; ``finished`` makes ``results.h5``, then removes the segments.

        Call `checkpoint` with the last state before, except where that state is not to be trusted.

        Raises:
            StorageFull: If there is not enough space; the run can be resumed when there is.
            StorageError: For any other error of the system.
            DamagedRun: If a segment is damaged.
        """
        self._lock.require()
        self._document |= {"stop_reason": stop_reason, "exit_code": exit_code}
        self._document["timings"] = dict(timings or {})
        if status == "finished":
            self.consolidate()
        elif self._writer is not None:
            # Frames after the last checkpoint, to look at: they will be computed again if lost.
            with contextlib.suppress(StoreError):
                self._writer.flush()
        self._document |= {"status": status, "finished": now()}
        self._save()
        if status == "finished":
            self._remove_segments()

    def consolidate(self) -> Path:
        """Make ``results.h5`` of all segments, verified, unless done; raises as `finish`."""
        path = self.path / layout.RESULTS
        if self._document["results"]:
            return path
        checkpoint = self.load_checkpoint()
        model = self._model or self.load_model()
        if model is None:
            raise DamagedRun(f"{self.path / layout.MODEL}: missing")
        if self._writer is not None:
            self._writer.flush()
            segments = self._writer.segments
        else:
            segments = list(checkpoint.segments) if checkpoint else []
        resolved = steered_text(self.resolved_text, decisions_of(self._document))
        known = ("provenance", "started", "stop_reason", "summary", "stage_ends")
        attributes = {name: self._document.get(name, []) for name in known}
        for name in ("origin", "steering"):
            if self._document.get(name):
                attributes[name] = self._document[name]
        attributes |= {"status": "finished", "finished": now()}
        texts = {
            "source": [self.source_text],
            "resolved": [resolved],
            "stages": self._document["stages"],
        }
        self._document["results"] = write_results(
            path,
            self.path / layout.SEGMENTS,
            segments,
            model,
            {f"scenario/{name}": text for name, text in texts.items()},
            run_id=self.run_id,
            attributes=attributes,
            precision=self.precision,
            version=self.version,
        )
        self._save()
        return path

    def _save(self) -> None:
        self._document["updated"] = now()
        self._has_news = False
        write_document(self.path / layout.RUN, "runjson", self._document)

    def _remove_segments(self) -> None:
        """All is in ``results.h5`` by now; what a crash leaves of this goes at the next start.

        Files that others have put beside the segments stay, and so does what a link leads to.
        """
        kill_point("cleanup.before")
        directory = self.path / layout.SEGMENTS
        with storage_errors(directory):
            for entry in layout.own_files(self.path, layout.SEGMENTS):
                remove_own(entry)
                kill_point("cleanup.mid")
            require_own(directory)
            if not directory.is_symlink() and directory.is_dir() and not any(directory.iterdir()):
                directory.rmdir()
            remove_own(self.path / layout.MODEL)

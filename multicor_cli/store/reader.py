"""Reading a run: finished, running, or interrupted, through one class."""

from __future__ import annotations

import contextlib
import socket
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.heat.hertz import largest_deflection
from multicor_cli.files import open_regular, read_object
from multicor_cli.model import Model, State
from multicor_cli.model.cell import over_windows
from multicor_cli.model.columns import XX, YY
from multicor_cli.scenario.documents import steered_text
from multicor_cli.store import layout, schema
from multicor_cli.store.atomic import is_regular
from multicor_cli.store.checkpoint import Identity, committed_segments, load_newest
from multicor_cli.store.documents import Document, decisions_of, read_run_document, read_scenario
from multicor_cli.store.errors import (
    DamagedRun,
    DirectoryRefused,
    NothingStored,
    StorageError,
    StoreError,
)
from multicor_cli.store.frames import (
    Frames,
    GrainFacts,
    NamedColumn,
    Part,
    Parts,
    data_frame,
    results_part,
    split,
    split_cell,
)
from multicor_cli.store.hdf5 import CheckedFile, Closing
from multicor_cli.store.lock import is_alive, read_holder
from multicor_cli.store.results import FILETYPE as RESULTS_FILETYPE
from multicor_cli.store.results import load_model, read_description, read_model
from multicor_cli.store.schema import Dataset, read_only
from multicor_cli.store.segments import FILETYPE as SEGMENT_FILETYPE
from multicor_cli.store.segments import segment_dims
from multicor_cli.store.snapshot import empty_summary
from multicor_cli.text import choices, count_noun


class Series(Mapping[str, NDArray[Any]]):
    """The time series: an array per name of ``schema.SERIES``, one row per point; read when used.
    Arrays are read-only: copy what is to be changed.

    Names of heat are there in runs with heat only, and no names that are younger than the run.
    """

    def __init__(self, run: Run, parts: Parts) -> None:
        self._run, self._parts = run, parts
        self._loaded: dict[str, NDArray[Any]] = {}

    @cached_property
    def _specs(self) -> dict[str, Dataset]:
        return {spec.name: spec for spec in self._run.rows(schema.SERIES)}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._specs:
            raise KeyError(
                f"the time series has no '{name}'; {choices(str(name), list(self._specs))}"
            )
        if name not in self._loaded:
            # From segments all columns are read at once, so that each file is opened once.
            is_one_file = len(self._parts.parts) == 1
            wanted = [self._specs[name]] if is_one_file else list(self._specs.values())
            columns = self._parts.columns(wanted)
            self._loaded |= {spec.name: read_only(columns[spec.path]) for spec in wanted}
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._specs)

    def __len__(self) -> int:
        return len(self._specs)

    def to_pandas(self) -> Any:
        """The series as a DataFrame indexed by time [s]; ``attrs["units"]`` has the units.

        What belongs to a wall or an outlet has its name first, as ``top: force_x``.

        Raises:
            MissingLibrary: If pandas is not installed.
            DamagedRun: If the file is damaged.
        """
        return data_frame(self._run.series_columns, "time")

    def __repr__(self) -> str:
        return f"<Series: {count_noun(self.row_count, 'point')} of {len(self)} quantities>"

    @property
    def row_count(self) -> int:
        """Number of points."""
        return self._parts.series_count


class Run(Closing):
    """A run on disk, read lazily; made by `open_run`. Close it, or use it as a context manager.

    What a running run writes after it was opened is seen when it is opened again.

    Attributes:
        path: The run directory, or the ``results.h5`` that was opened.
        info: What ``run.json`` says: ``run_id, status, stop_reason, exit_code, started, finished,
            provenance, stages, summary`` …; of a ``results.h5`` alone, from its attributes.
        frames: The frames.
        series: The time series.
    """

    def __init__(self, path: Path, info: Document, results: Path | None) -> None:
        self.path, self.info = path, info
        # Wherever the process works later
        self._place, self._results = path.absolute(), results and results.absolute()
        self._parts = Parts(self._find_parts(), self.run_id, self._find_parts_again, self._lengths)
        self.frames: Frames = Frames(self._parts, lambda: self.model)
        self.series = Series(self, self._parts)

    def close(self) -> None:
        """Close the files."""
        self._parts.close()

    def __repr__(self) -> str:
        summary = self.info["summary"]
        what = "nothing stored yet"
        if summary:
            what = f"{count_noun(summary['grain_count'], 'grain')}, t = {summary['time']:.6g} s"
        return f"<Run {self.path}: {self.status}, {what}, {count_noun(len(self.frames), 'frame')}>"

    @property
    def series_columns(self) -> list[NamedColumn]:
        """The columns of the time series; those of walls and outlets are named ``top: force_x``.

        A cell has stresses, over its mean area in each window: ``cell: stress_xx``.
        """
        columns: list[NamedColumn] = []
        for spec in self.rows(schema.SERIES):
            values = self.series[spec.name]
            owners: Sequence[str] | None = self.wall_names if "wall" in spec.dims else None
            if "outlet" in spec.dims:
                owners = self.model.outlets or ()
            if owners is None:
                columns += split(spec, values)
                continue
            is_of_cell = "wall" in spec.dims and self.model.is_cell
            if is_of_cell and spec.name == "wall_force":
                sides = self.series["wall_position"][:, 0]
                area = over_windows(sides[:, XX] * sides[:, YY])
                values = values / area[:, np.newaxis, np.newaxis]
            for number, owner in enumerate(owners):
                columns += [
                    column._replace(name=f"{owner}: {column.name}")
                    for column in (split_cell if is_of_cell else split)(spec, values[:, number])
                ]
        return columns

    @cached_property
    def grains(self) -> GrainFacts:
        """What all grains of the run are, absent ones too: radius, mass, material, group."""
        return GrainFacts.of(self.model)

    @property
    def run_id(self) -> str:
        """Identity of the run."""
        return str(self.info["run_id"])

    @property
    def status(self) -> str:
        """``running, finished, stopped, failed``, or ``interrupted``: its process is gone."""
        status = str(self.info["status"])
        if status != "running" or is_alive(self._place / layout.LOCK):
            return status
        # it may have ended since it was opened
        status = str(read_run_document(self._place)["status"])
        return "interrupted" if status == "running" else status

    @cached_property
    def model(self) -> Model:
        """Grains, walls and laws; raises `DamagedRun`, or `NothingStored` if there are none yet."""
        if self._results is None:
            try:
                return load_model(self._place / layout.MODEL, self.run_id)
            except DamagedRun:
                if (self._place / layout.MODEL).exists():
                    raise
                if self._find_results() is None:
                    if self._parts.parts or self.info["summary"] is not None:
                        raise
                    raise NothingStored(self.path) from None
        assert self._results is not None
        with CheckedFile(self._results, RESULTS_FILETYPE, run_id=self.run_id) as file:
            return read_model(file)

    @property
    def features(self) -> frozenset[str]:
        """What the run has beyond every run, see ``schema.Feature``; empty if nothing is stored."""
        found = self._parts.features
        if found is not None:
            return found
        file = self._place / layout.MODEL
        was_there = file.exists()  # the run may write it, or put it into results.h5, while we look
        try:
            return schema.features_of(self.model)
        except DamagedRun:
            if was_there and file.exists():
                raise
            return frozenset()

    def rows(self, table: tuple[Dataset, ...]) -> tuple[Dataset, ...]:
        """The rows of a table of ``schema`` that the run has."""
        return schema.select(table, self.features, self._parts.version)

    @property
    def wall_names(self) -> tuple[str, ...]:
        """Names of the walls."""
        return self.model.walls.names

    @property
    def period(self) -> float:
        """Period in x [m]; 0 if the domain is not periodic. Of a cell the width at the start: its
        sides in a frame are ``frame.wall_position[0]``.
        """
        return self.model.period

    @property
    def stages(self) -> tuple[str, ...]:
        """Names of the loading stages."""
        return tuple(str(name) for name in self.info["stages"])

    @property
    def scenario_source(self) -> str:
        """The scenario file as given; raises `DamagedRun` if it was changed."""
        return self._scenario("source", layout.SOURCE)

    @property
    def scenario_resolved(self) -> str:
        """The scenario with all defaults, its stages as steered; raises `DamagedRun` if changed."""
        resolved = self._scenario("resolved", layout.RESOLVED)
        return steered_text(resolved, decisions_of(self.info)) if self._place.is_dir() else resolved

    def state(self) -> State | None:
        """The state of the newest whole checkpoint, exactly; ``None`` if there is none.

        Raises:
            DamagedRun: If there are checkpoints and none can be used.
            StorageError: If a file cannot be read.
        """
        directory = self._place / layout.CHECKPOINTS
        if not directory.is_dir():
            if not self._place.exists():
                raise StorageError(f"{self.path}: is not there any more")
            return None
        model = None
        with contextlib.suppress(DamagedRun):  # what belongs to the state is whole all the same
            model = self.model
        found = load_newest(directory, Identity.of(self.info), None, model)
        return found.state if found else None

    def _scenario(self, kind: str, name: str) -> str:
        if self._place.is_dir():
            return read_scenario(self._place / name, str(self.info[f"{kind}_sha256"]))
        with CheckedFile(self._place, RESULTS_FILETYPE) as file:
            return file.strings(schema.DATASETS[f"scenario/{kind}"])[0]

    def _find_parts(self) -> list[Part]:
        if self._results is not None:
            return [results_part(self._results, self.run_id)]
        directory = self._place / layout.SEGMENTS
        return [
            Part(directory / segment.name, SEGMENT_FILETYPE, segment_dims(segment))
            for segment in committed_segments(self._place)
        ]

    def _lengths(self) -> dict[str, int]:
        try:
            return {"wall": self.model.wall_count, "outlet": len(self.model.outlets or ())}
        except DamagedRun:
            return {}

    def _find_parts_again(self) -> list[Part]:
        """The files of a run that was finished, or resumed from a checkpoint, meanwhile."""
        self._find_results()
        return self._find_parts()

    def _find_results(self) -> Path | None:
        self.info = read_run_document(self._place)
        self._results = _results_of(self._place, self.info)
        return self._results


def open_run(path: Path | str) -> Run:
    """Open a run directory, or a ``results.h5`` on its own.

    Works on a finished run, a running one (what has been committed so far), and an interrupted one.

    Args:
        path: The directory, or the file.

    Raises:
        DirectoryRefused: If the directory holds no run, or the file is of another kind.
        DamagedRun: If a file is damaged; `UnsupportedVersion`: by an incompatible version.
        StorageError: If a file cannot be read.
    """
    path = Path(path)
    if is_regular(path):
        if path.suffix not in (".h5", ".hdf5", ".vtkhdf"):
            try:
                with open_regular(path) as file:
                    is_hdf5 = file.read(8) == b"\x89HDF\r\n\x1a\n"
            except OSError as error:
                raise StorageError(f"{path}: {error.strerror}") from error
            if not is_hdf5:
                raise DirectoryRefused(
                    f"{path}: is no run; give the run directory, or its {layout.RESULTS}"
                )
        return Run(path, _info_of_results(path), path)
    if not is_regular(path / layout.RUN) and is_regular(path / layout.RESULTS):
        return open_run(path / layout.RESULTS)
    for attempt in range(3):
        info = read_run_document(path)
        try:
            run = Run(path, info, _results_of(path, info))
        except DamagedRun:
            if attempt == 2:
                raise
            continue  # it may have been resumed or finished in between
        if info["results"] or not read_run_document(path)["results"]:
            return run
        run.close()  # the run was finished, and its segments removed, while it was opened
    raise DamagedRun(f"{path}: changes while it is opened; try again")


def _results_of(path: Path, info: Document) -> Path | None:
    """``results.h5`` if ``run.json`` says that it is complete."""
    results = info["results"]
    if not results:
        return None
    file = path / layout.RESULTS
    try:
        size, expected = file.stat().st_size, results["size"]
    except FileNotFoundError as error:
        raise DamagedRun(f"{file}: missing") from error
    if size != expected:
        raise DamagedRun(f"{file}: has {size} bytes instead of {expected}; it was cut or replaced")
    return file


def _info_of_results(path: Path) -> Document:
    with CheckedFile(path, RESULTS_FILETYPE) as file:
        described = read_description(file)
        texts = {
            name: file.text(name)
            for name in ("run_id", "stop_reason", "started", "finished", "precision")
        }
        stages = file.strings(schema.DATASETS["scenario/stages"])
        frames = int(file.dataset(schema.DATASETS["steps/step"]).shape[0])
        digest = file.text("data_digest")
    results = {"size": path.stat().st_size, "data_digest": digest, "frames": frames}
    more = {"stages": stages, "exit_code": 0, "timings": {}, "results": results}
    return {**texts, **described, **more}


# ---- What ``multicor info`` reports

_HEARTBEAT_LIMIT = 1 << 20
"""A longer ``progress.json`` is not read [bytes]."""


def run_info(path: Path | str) -> dict[str, Any]:
    """Status, size and quality of a run as JSON types.

    ``step, time, state_digest``, the books, the counters and the ends of stages are those of the
    newest checkpoint (the last state of a finished run); ``frame_count`` is what has been
    committed. Values that do not exist yet are ``None``.

    Returns:
        ``path, run_id, status, stop_reason, exit_code, grain_count, frame_count, series_count,
        step, time, stage, stages, stage_ends`` (how each stage ended that is over, see
        `multicor_cli.store.documents.StageEnd`), ``origin`` (the moment of another run from which
        it goes on, see `multicor_cli.store.documents.Origin`, or null), ``extensions`` (when stages
        were added to the run, see docs/reference/formats/run-directory.md), ``steering`` (the
        program that steers the run and what it decided, or null), ``walls, state_digest,
        energy_closure, heat_closure, max_overlap, solver.{sweeps_mean, residual_rms_max,
        residual_max_max, unconverged_steps}, books, heat, negative_loss_share, corrected_steps,
        max_contact_force, progress`` (``progress.json`` of a run that goes on: step, time, speed,
        seconds left …), ``pid`` (of its process, if that is on this host), ``worst_step.{step,
        time}`` (end of the row of the time series with the largest rms residual),
        ``hertz_deflection, started, finished, duration`` (from the first start to the last sign of
        life, s), ``timings, data_digest, provenance``.

    Raises:
        DirectoryRefused: If there is no run.
        DamagedRun: If a file that is needed is damaged.
        StorageError: If a file cannot be read.
    """
    with open_run(path) as run:
        info = run.info
        summary = {**empty_summary(), **(info["summary"] or {})}
        step, steering = summary["step"], info.get("steering")
        try:
            walls = list(run.wall_names)
        except DamagedRun:
            if info["summary"] is not None:
                raise
            walls = []
        return {
            "path": str(run.path),
            "run_id": run.run_id,
            "status": run.status,
            **{name: info[name] for name in ("stop_reason", "exit_code")},
            **summary,
            "frame_count": len(run.frames),
            "series_count": run.series.row_count,
            "stages": list(run.stages),
            "stage_ends": _kept(info.get("stage_ends", []), step),
            "origin": info.get("origin"),
            "extensions": info.get("extensions", []),
            "steering": steering and {**steering, "decisions": _kept(steering["decisions"], step)},
            "walls": walls,
            **_heartbeat(run),
            "worst_step": _worst_step(run),
            "hertz_deflection": hertz_deflection(run, summary["max_contact_force"]),
            "duration": _seconds(info["started"], info["finished"] or info.get("updated", "")),
            "data_digest": (info["results"] or {}).get("data_digest"),
            **{name: info[name] for name in ("started", "finished", "timings", "provenance")},
        }


def _kept(events: list[dict[str, Any]], step: int | None) -> list[dict[str, Any]]:
    """What had happened by the newest checkpoint: what came later is lost, and happens again."""
    return [event for event in events if event["step"] <= (step or 0)]


def _heartbeat(run: Run) -> dict[str, Any]:
    """What ``progress.json`` says, and which process to send signals to, if the run goes on."""
    if run.status != "running":
        return {"progress": None, "pid": None}
    holder = read_holder(run.path / layout.LOCK)
    pid = holder.get("pid") if holder.get("host") == socket.gethostname() else None
    beat = read_object(run.path / layout.PROGRESS, _HEARTBEAT_LIMIT)
    needed = ("step", "time", "progress")
    is_whole = all(isinstance(beat.get(name), int | float) for name in needed)
    return {"progress": beat if is_whole else None, "pid": pid}


def _worst_step(run: Run) -> dict[str, float] | None:
    """Where the contact solver was farthest from a solution; None if no step has been recorded."""
    residual = run.series["residual_rms"]
    if not residual.size or not residual.max() > 0.0:
        return None
    worst = int(residual.argmax())
    return {"step": int(run.series["step"][worst]), "time": float(run.series["time"][worst])}


def hertz_deflection(run: Run, force: float | None) -> float | None:
    """Elastic deflection that rigid grains neglect, over the diameter: δ/(2a) of the largest force.

    Two equal elastic spheres, δ = (3F/(4E* √a*))^⅔ with a* = a/2 and E* = E/(2(1−ν²)); the smallest
    grain of each material that has ``young`` and ``poisson``, and of these the largest value. Discs
    are treated as spheres of their radius. ``force`` F is the largest mean contact force of a step
    [N]. None if no grain is elastic or no force is known.
    """
    if force is None:
        return None
    try:
        materials = tomllib.loads(run.scenario_resolved)["materials"]
        elastic = {name: pair for name, each in materials.items() if (pair := _elastic(each))}
        return largest_deflection(run.model, force, elastic)
    # a file from elsewhere holds anything
    except (StoreError, ValueError, RecursionError, KeyError, AttributeError):
        return None


def _elastic(material: Any) -> tuple[float, float] | None:
    if not isinstance(material, dict):
        return None
    young, poisson = material.get("young"), material.get("poisson")
    if not isinstance(young, int | float) or not isinstance(poisson, int | float):
        return None
    return (float(young), float(poisson)) if young > 0.0 and -1.0 < poisson <= 0.5 else None


def _seconds(start: str, end: str) -> float | None:
    try:
        return (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()
    except (ValueError, TypeError):
        return None

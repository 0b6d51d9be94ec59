"""What a study file says (scenario, values, observables, computers), read as scenarios are."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from multicor_cli.scenario.base import Name, Table
from multicor_cli.scenario.load import parse_toml, read_text
from multicor_cli.scenario.problems import KeyPath, Refused, ScenarioError, Sources
from multicor_cli.scenario.region import AnyRegion
from multicor_cli.scenario.translate import translate

# ---- The tables

MAX_CASES = 100_000
"""Most cases of a study."""


def _check_scalar(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        raise Refused((), f"is {value}", "give a finite number")
    if isinstance(value, bool | int | float | str):
        return value
    what = "is a table" if isinstance(value, dict) else "is an array"
    remedy = 'give a number, true, false or a text; an entry of an array has a key: "domain.size.0"'
    raise Refused((), what, remedy)


Scalar = Annotated[bool | int | float | str, BeforeValidator(_check_scalar)]
"""A value of a key of a scenario that a study may give."""

Key = Annotated[str, Field(min_length=1, max_length=200)]


class Range(Table):
    """Evenly spaced numbers from one to another, both included."""

    from_: int | float = Field(alias="from", description="first number")
    to: int | float = Field(description="last number")
    count: int | None = Field(
        None, ge=1, le=MAX_CASES, description="how many; without a meaning where points are drawn"
    )
    spacing: Literal["linear", "log"] = Field(
        "linear", description="equal differences, or equal ratios"
    )

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        if self.from_ == self.to and self.count != 1:
            what = f"the range from {self.from_:g} to {self.to:g} has no length"
            raise Refused(("to",), what, "give two different ends, or a list")
        if self.spacing == "log" and min(self.from_, self.to) <= 0.0:
            what = "a range with spacing 'log' needs positive ends"
            raise Refused(("from",), what, 'use spacing = "linear"')
        return self


class Sampled(Table):
    """Points drawn from the box that the ranges of ``vary`` span."""

    kind: Literal["latin-hypercube", "sobol"] = Field(description="how points are drawn")
    count: int = Field(
        ge=1, le=MAX_CASES, description="number of points; for sobol a power of two is best"
    )
    seed: int = Field(1, ge=0, le=2**31 - 1, description="seed of the points")


Values = Annotated[tuple[Scalar, ...], Strict(False), Field(min_length=1, max_length=MAX_CASES)]


def _check_count(axis: Any, info: ValidationInfo) -> Any:
    """The values of a key of `Vary`, whose ranges say how many these are unless they are drawn."""
    is_drawn = info.data.get("sample", "wrong") is not None  # of a wrong table it is not known
    if isinstance(axis, Range) and axis.count is None and not is_drawn:
        remedy = "add count: how many values, or draw them with sample"
        raise Refused(("count",), "is missing", remedy)
    return axis


Axis = Annotated[
    Annotated[Values, Tag("<list>")] | Annotated[Range, Tag("<range>")],
    Discriminator(lambda value: "<range>" if isinstance(value, dict | Range) else "<list>"),
    AfterValidator(_check_count),
]
"""Values of one key."""


OF_TABLES = ("seed", "status", "verdict", "hours", "digest", "directory")
"""Columns of the table of any study."""

OPTIONS = ("zip", "file", "sample")
"""Keys of ``[vary]`` that are no keys of a scenario: those have a dot in them."""


def _flat(path: tuple[str, ...], data: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Values by dotted key: a table that is no range is part of a key without quotes."""
    for key, value in data.items():
        if isinstance(value, dict) and not value.keys() & {"from", "to", "count", "spacing"}:
            yield from _flat((*path, key), value)
        else:
            yield ".".join((*path, key)), value


class Vary(Table):
    """What is varied: keys of the scenario as for ``--set``, each with its values; all combinations
    are cases.

    Keys of the scenario are collected in ``keys``; the others say how they are combined.
    """

    zip: Annotated[
        tuple[Annotated[tuple[Key, ...], Strict(False), Field(min_length=2)], ...], Strict(False)
    ] = Field(
        (),
        description=(
            "groups of keys whose values go together, the first with the first, instead of being "
            "combined"
        ),
    )
    file: str | None = Field(
        None,
        min_length=1,
        description="CSV file: a column for each key, a row for each combination",
    )
    sample: Sampled | None = Field(
        None, description="draw points between the ends of all ranges instead of combining them"
    )
    keys: dict[Key, Axis] = Field(
        default_factory=dict, max_length=100, description="values of each key"
    )

    @model_validator(mode="before")
    @classmethod
    def _collect(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        own = {key: value for key, value in data.items() if key in OPTIONS}
        others = {key: value for key, value in data.items() if key not in own}
        return own | {"keys": dict(_flat((), others))}


class After(Table):
    """From when on an observable is averaged."""

    time: float | None = Field(None, ge=0.0, description="time [s]")
    strain: float | None = Field(None, ge=0.0, description="shear strain of the last stage")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.time is None) == (self.strain is None):
            raise Refused((), "either time or strain says from when on", "give one of them")
        return self


class Observable(Table):
    """One number, with its error, from every run."""

    name: Name = Field(description="its name in tables")
    label: str = Field(
        "", max_length=200, description="its name in figures; TeX between dollar signs"
    )
    post: (
        Literal[
            "rheology", "fabric", "lifetimes", "chains", "clusters", "conductivity", "heat-network",
            "wall-heat", "hot-spots", "diffusion", "structure", "correlation", "mixing",
            "residence", "avalanches", "region", "profile", "theta-eta", "map", "forces", "energy"
        ]
        | None
    ) = Field(None, description="command `multicor post` whose table it is taken from")  # fmt: skip
    info: str | None = Field(
        None, min_length=1, description="field of `multicor info --json`, as solver.sweeps_mean"
    )
    series: str | None = Field(
        None, min_length=1, description="column of the time series, averaged"
    )
    value: str | None = Field(None, min_length=1, description="quantity of the table")
    after: After | None = Field(
        None, description="from when on; default: the later half of the last stage"
    )
    at: float | None = Field(
        None, description="where in a profile: height above the lower wall [m]; in theta-eta: η"
    )
    bins: int | None = Field(
        None,
        ge=1,
        le=10_000,
        description="number of bins of a profile, theta-eta, structure, correlation",
    )
    column: str | None = Field(
        None, min_length=1, description="column of the time series whose drops are avalanches"
    )
    threshold: float | None = Field(
        None, gt=0.0, description="smallest drop of the column; default: its standard deviation"
    )
    inside: AnyRegion | None = Field(None, description="the region, as of a group of grains")
    statistic: Literal["mean", "min", "max", "std"] | None = Field(
        None, description="of the grains of a map; default: mean"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [name for name in ("post", "info", "series") if getattr(self, name) is not None]
        if len(given) != 1:
            what = "post, info or series says where an observable comes from"
            raise Refused((), what, "give one of them")
        if (self.post is None) != (self.value is None):
            remedy = 'give both: post = "rheology", value = "friction_walls"'
            raise Refused((), "post and value belong together", remedy)
        if self.info is not None and self.after is not None:
            raise Refused(("after",), "a field of info is no mean", "leave after out")
        for key, (needing, allowing) in _KEYS_OF_TABLES.items():
            is_given = getattr(self, key) is not None
            if is_given and self.post not in (*needing, *allowing):
                known = " or ".join(f'post = "{name}"' for name in (*needing, *allowing))
                raise Refused((key,), f"{key} belongs to {known}", f"leave {key} out")
            if not is_given and self.post in needing:
                raise Refused((), f'post = "{self.post}" needs {key}', _EXAMPLES[key])
        return self


_KEYS_OF_TABLES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "at": (("profile", "theta-eta"), ()),
    "bins": ((), ("profile", "theta-eta", "structure", "correlation")),
    "inside": (("region",), ()),
    "column": (("avalanches",), ()),
    "threshold": ((), ("avalanches",)),
    "statistic": ((), ("map",)),
}
"""Keys of an observable: the tables that need them, and those that may have them."""

_EXAMPLES = {
    "at": "say where: at = 0.5",
    "column": 'say which: column = "top: force_x"',
    "inside": 'say where: inside = { kind = "circle", center = [0.02, 0.01], radius = 0.005 }',
}


_UNITS = {"k": 3, "M": 6, "G": 9, "T": 12}


def parse_memory(text: str) -> float:
    """Bytes of a size as ``4GB`` or ``4GiB``."""
    number = text.rstrip("kMGTiB ")
    unit = text[len(number) :].strip()
    power = _UNITS[unit[0]]
    return float(number) * (1024.0 ** (power / 3) if unit[1:2] == "i" else 10.0**power)


class Queue(Table):
    """Jobs of a batch system; further keys are those of the class of dask-jobqueue."""

    model_config = Table.model_config | {"extra": "allow"}

    queue: str | None = Field(None, description="partition or queue")
    walltime: str = Field(
        "01:00:00", pattern=r"^\d+(-\d+)?:\d\d(:\d\d)?$", description="of a job, hh:mm:ss"
    )
    cores: int = Field(1, ge=1, le=4096, description="of a job")
    memory: str = Field("4GB", pattern=r"^\d+(\.\d+)? ?[kMGT]i?B$", description="of a job")
    jobs: int = Field(1, ge=1, le=10_000, description="number of jobs at a time")

    @property
    def seconds(self) -> float:
        """Walltime [s]."""
        days, _, clock = self.walltime.rpartition("-")
        parts = [int(part) for part in clock.split(":")]
        hours, minutes, seconds = parts if len(parts) == 3 else (parts[0], parts[1], 0)
        return 86400.0 * int(days or 0) + 3600.0 * hours + 60.0 * minutes + seconds


class Compute(Table):
    """Where cases are computed."""

    workers: int | None = Field(
        None,
        ge=1,
        le=1024,
        description="cases at a time on this machine; default: one for each core",
    )
    threads: int | None = Field(
        None, ge=1, le=1024, description="of a case; default: as many as it can use"
    )
    scheduler: str | None = Field(
        None, min_length=1, description="address of a Dask scheduler that runs, as tls://host:8786"
    )
    slurm: Queue | None = Field(None, description="jobs of SLURM")
    pbs: Queue | None = Field(None, description="jobs of PBS")
    sge: Queue | None = Field(None, description="jobs of SGE")
    lsf: Queue | None = Field(None, description="jobs of LSF")

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [name for name, value in self if name != "threads" and value is not None]
        if len(given) > 1:
            what = f"{' and '.join(given)} cannot be had together"
            raise Refused((given[1],), what, "give one of them")
        return self


class About(Table):
    """Name, scenario and seeds."""

    name: Name = Field(description="name of the study; runs go into studies/NAME")
    scenario: str = Field(min_length=1, description="path of the scenario, relative to this file")
    seeds: int | Annotated[tuple[int, ...], Strict(False), Field(min_length=1)] | None = Field(
        None,
        description=(
            "number of seeds, from that of the scenario on, or a list of them; default: that of "
            "the scenario"
        ),
    )
    description: str = Field("", max_length=1000, description="a line about the study")

    @model_validator(mode="after")
    def _different_seeds(self) -> Self:
        seeds = self.seeds
        if isinstance(seeds, int) and not 1 <= seeds <= MAX_CASES:
            remedy = f"give 1 to {MAX_CASES}, or a list of seeds"
            raise Refused(("seeds",), f"there cannot be {seeds} seeds", remedy)
        if isinstance(seeds, tuple) and len(set(seeds)) < len(seeds):
            raise Refused(("seeds",), "a seed comes twice", "give each seed once")
        return self


class StudyModel(Table):
    """A study file."""

    study: About = Field(description="name, scenario and seeds")
    set: dict[Key, Scalar] = Field(
        default_factory=dict, max_length=100, description="keys of the scenario set in all cases"
    )
    vary: Vary = Field(default_factory=Vary, description="what is varied")
    observe: Annotated[tuple[Observable, ...], Strict(False)] = Field(
        (), max_length=100, description="numbers taken from every run"
    )
    compute: Compute = Field(default_factory=Compute, description="where cases are computed")

    @field_validator("set", mode="before")
    @classmethod
    def _collect(cls, data: Any) -> Any:
        return dict(_flat((), data)) if isinstance(data, dict) else data

    @model_validator(mode="after")
    def _different_names(self) -> Self:
        for key in self.set:
            if key in self.vary.keys:
                raise Refused(("set",), f"{key} is set and varied", "leave one of them out")
        names = [observable.name for observable in self.observe]
        if len(set(names)) < len(names):
            raise Refused(("observe",), "two observables have the same name", "give each its own")
        columns = {f"{name}_{ending}" for name in names for ending in ("error", "between", "seeds")}
        for number, name in enumerate(names):
            if name in OF_TABLES or name in columns:
                what = f"tables have another column '{name}'"
                raise Refused(("observe", number, "name"), what, "give the observable another name")
        return self


# ---- Reading it


@dataclass(frozen=True)
class Study:
    """A study file that is right by itself: its model, path, text (for positions), and tables."""

    model: StudyModel
    path: Path
    sources: Sources
    document: dict[str, Any]

    @property
    def name(self) -> str:
        return self.model.study.name

    @property
    def scenario(self) -> Path:
        return self.path.parent / self.model.study.scenario

    @property
    def fixed(self) -> list[str]:
        """Arguments of ``--set`` for all cases."""
        return arguments(self.model.set)

    def refuse(self, *findings: Refused) -> ScenarioError:
        """The error that tells these findings, with their positions in the file."""
        return ScenarioError(
            self.sources.problems([place(self.document, finding) for finding in findings])
        )


def arguments(values: Mapping[str, Any]) -> list[str]:
    """Arguments of ``--set`` that give keys these values."""
    return [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]


def load_study(path: str | Path) -> Study:
    """Load and check a study file; `multicor_cli.studies.axes` looks at its scenario and cases.

    Raises:
        ScenarioError: The file is unreadable or wrong; its ``problems`` say all that is wrong.
    """
    path = Path(path)
    text = read_text(path, kind="study")
    document = parse_toml(text, str(path))
    sources = Sources(str(path), text)
    try:
        model = StudyModel.model_validate(document)
    except ValidationError as error:
        findings = translate(StudyModel, error.errors(include_url=False))
        raise ScenarioError(
            sources.problems([place(document, finding) for finding in findings])
        ) from None
    return Study(model, path, sources, document)


def place(document: dict[str, Any], finding: Refused) -> Refused:
    """A finding where it stands: for ``vary.keys.KEY`` ``vary."KEY"``, or tables without quotes."""
    path = finding.where
    if path[:2] == ("vary", "keys") and len(path) > 2:
        path = ("vary", *path[2:])
    elif path[:1] != ("set",) or len(path) < 2:
        return finding
    table, key, rest = str(path[0]), str(path[1]), path[2:]
    written: KeyPath = (key,) if key in document.get(table, {}) else tuple(key.split("."))
    return Refused((table, *written, *rest), finding.what, finding.remedy)

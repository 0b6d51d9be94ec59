"""What a study file says (scenario, values, observables, computers), read as scenarios are."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from multicor_cli.scenario.base import Array, Name, Table, optional, required
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

    from_: int | float = required("first number", alias="from")
    to: int | float = required("last number")
    count: int | None = optional(
        "how many; without a meaning where points are drawn", ge=1, le=MAX_CASES
    )
    spacing: Literal["linear", "log"] = optional("equal differences, or equal ratios", "linear")

    def faults(self) -> Iterator[Refused]:
        if self.from_ == self.to and self.count != 1:
            what = f"the range from {self.from_:g} to {self.to:g} has no length"
            yield Refused(("to",), what, "give two different ends, or a list")
        if self.spacing == "log" and min(self.from_, self.to) <= 0.0:
            what = "a range with spacing 'log' needs positive ends"
            yield Refused(("from",), what, 'use spacing = "linear"')


class Sampled(Table):
    """Points drawn from the box that the ranges of ``vary`` span."""

    kind: Literal["latin-hypercube", "sobol"] = required("how points are drawn")
    count: int = required("number of points; for sobol a power of two is best", ge=1, le=MAX_CASES)
    seed: int = optional("seed of the points", 1, ge=0, le=2**31 - 1)


Values = Annotated[Array[Scalar], Field(min_length=1, max_length=MAX_CASES)]


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

    zip: Array[Annotated[Array[Key], Field(min_length=2)]] = optional(
        "groups of keys whose values go together, the first with the first, instead of being "
        "combined",
        (),
    )
    file: str | None = optional(
        "CSV file: a column for each key, a row for each combination", min_length=1
    )
    sample: Sampled | None = optional(
        "draw points between the ends of all ranges instead of combining them"
    )
    keys: dict[Key, Axis] = optional("values of each key", default_factory=dict, max_length=100)

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

    time: float | None = optional("time [s]", ge=0.0)
    strain: float | None = optional("shear strain of the last stage", ge=0.0)

    def faults(self) -> Iterator[Refused]:
        if (self.time is None) == (self.strain is None):
            yield Refused((), "either time or strain says from when on", "give one of them")


class Observable(Table):
    """One number, with its error, from every run."""

    name: Name = required("its name in tables")
    label: str = optional("its name in figures; TeX between dollar signs", "", max_length=200)
    post: (
        Literal[
            "rheology", "fabric", "lifetimes", "chains", "clusters", "conductivity", "heat-network",
            "wall-heat", "hot-spots", "diffusion", "structure", "correlation", "mixing",
            "residence", "avalanches", "region", "profile", "theta-eta", "map", "forces", "energy"
        ]
        | None
    ) = optional("command `multicor post` whose table it is taken from")  # fmt: skip
    info: str | None = optional(
        "field of `multicor info --json`, as solver.sweeps_mean", min_length=1
    )
    series: str | None = optional("column of the time series, averaged", min_length=1)
    value: str | None = optional("quantity of the table", min_length=1)
    after: After | None = optional("from when on; default: the later half of the last stage")
    at: float | None = optional(
        "where in a profile: height above the lower wall [m]; in theta-eta: η"
    )
    bins: int | None = optional(
        "number of bins of a profile, theta-eta, structure, correlation", ge=1, le=10_000
    )
    column: str | None = optional(
        "column of the time series whose drops are avalanches", min_length=1
    )
    threshold: float | None = optional(
        "smallest drop of the column; default: its standard deviation", gt=0.0
    )
    inside: AnyRegion | None = optional("the region, as of a group of grains")
    statistic: Literal["mean", "min", "max", "std"] | None = optional(
        "of the grains of a map; default: mean"
    )

    def faults(self) -> Iterator[Refused]:
        given = [name for name in ("post", "info", "series") if getattr(self, name) is not None]
        if len(given) != 1:
            what = "post, info or series says where an observable comes from"
            yield Refused((), what, "give one of them")
        if (self.post is None) != (self.value is None):
            remedy = 'give both: post = "rheology", value = "friction_walls"'
            yield Refused((), "post and value belong together", remedy)
        if self.info is not None and self.after is not None:
            yield Refused(("after",), "a field of info is no mean", "leave after out")
        for key, (needing, allowing) in _KEYS_OF_TABLES.items():
            is_given = getattr(self, key) is not None
            if is_given and self.post not in (*needing, *allowing):
                known = " or ".join(f'post = "{name}"' for name in (*needing, *allowing))
                yield Refused((key,), f"{key} belongs to {known}", f"leave {key} out")
            if not is_given and self.post in needing:
                yield Refused((), f'post = "{self.post}" needs {key}', _EXAMPLES[key])


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

    queue: str | None = optional("partition or queue")
    walltime: str = optional("of a job, hh:mm:ss", "01:00:00", pattern=r"^\d+(-\d+)?:\d\d(:\d\d)?$")
    cores: int = optional("of a job", 1, ge=1, le=4096)
    memory: str = optional("of a job", "4GB", pattern=r"^\d+(\.\d+)? ?[kMGT]i?B$")
    jobs: int = optional("number of jobs at a time", 1, ge=1, le=10_000)

    @property
    def seconds(self) -> float:
        """Walltime [s]."""
        days, _, clock = self.walltime.rpartition("-")
        parts = [int(part) for part in clock.split(":")]
        hours, minutes, seconds = parts if len(parts) == 3 else (parts[0], parts[1], 0)
        return 86400.0 * int(days or 0) + 3600.0 * hours + 60.0 * minutes + seconds


class Compute(Table):
    """Where cases are computed."""

    workers: int | None = optional(
        "cases at a time on this machine; default: one for each core", ge=1, le=1024
    )
    threads: int | None = optional("of a case; default: as many as it can use", ge=1, le=1024)
    scheduler: str | None = optional(
        "address of a Dask scheduler that runs, as tls://host:8786", min_length=1
    )
    slurm: Queue | None = optional("jobs of SLURM")
    pbs: Queue | None = optional("jobs of PBS")
    sge: Queue | None = optional("jobs of SGE")
    lsf: Queue | None = optional("jobs of LSF")

    def faults(self) -> Iterator[Refused]:
        given = [name for name, value in self if name != "threads" and value is not None]
        if len(given) > 1:
            what = f"{' and '.join(given)} cannot be had together"
            yield Refused((given[1],), what, "give one of them")


class About(Table):
    """Name, scenario and seeds."""

    name: Name = required("name of the study; runs go into studies/NAME")
    scenario: str = required("path of the scenario, relative to this file", min_length=1)
    seeds: int | Annotated[Array[int], Field(min_length=1)] | None = optional(
        "number of seeds, from that of the scenario on, or a list of them; default: that of the "
        "scenario"
    )
    description: str = optional("a line about the study", "", max_length=1000)

    def faults(self) -> Iterator[Refused]:
        seeds = self.seeds
        if isinstance(seeds, int) and not 1 <= seeds <= MAX_CASES:
            remedy = f"give 1 to {MAX_CASES}, or a list of seeds"
            yield Refused(("seeds",), f"there cannot be {seeds} seeds", remedy)
        if isinstance(seeds, tuple) and len(set(seeds)) < len(seeds):
            yield Refused(("seeds",), "a seed comes twice", "give each seed once")


class StudyModel(Table):
    """A study file."""

    study: About = required("name, scenario and seeds")
    set: dict[Key, Scalar] = optional(
        "keys of the scenario set in all cases", default_factory=dict, max_length=100
    )
    vary: Vary = optional("what is varied", default_factory=Vary)
    observe: Array[Observable] = optional("numbers taken from every run", (), max_length=100)
    compute: Compute = optional("where cases are computed", default_factory=Compute)

    @field_validator("set", mode="before")
    @classmethod
    def _collect(cls, data: Any) -> Any:
        return dict(_flat((), data)) if isinstance(data, dict) else data

    def faults(self) -> Iterator[Refused]:
        for key in self.set:
            if key in self.vary.keys:
                yield Refused(("set",), f"{key} is set and varied", "leave one of them out")
        names = [observable.name for observable in self.observe]
        if len(set(names)) < len(names):
            yield Refused(("observe",), "two observables have the same name", "give each its own")
        columns = {f"{name}_{ending}" for name in names for ending in ("error", "between", "seeds")}
        for number, name in enumerate(names):
            if name in OF_TABLES or name in columns:
                what = f"tables have another column '{name}'"
                yield Refused(("observe", number, "name"), what, "give the observable another name")


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

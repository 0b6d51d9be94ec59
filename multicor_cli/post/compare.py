"""Two runs side by side: their scenarios, books, rheology and profiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.energy import energy
from multicor_cli.post.profile import ProfileTable, profile
from multicor_cli.post.rheology import rheology
from multicor_cli.post.source import PostError, Run, Selection
from multicor_cli.post.table import Column, Table, plain, with_unit


class Pair(NamedTuple):
    """A number of both runs.

    Attributes:
        name: Name in data.
        label: Name for people, with the unit.
        error: Standard error of their difference, √(e₁² + e₂²); nan if it is not known.
        note: That one of them drifts, or has an error guessed from too few frames; else empty.
    """

    name: str
    label: str
    first: float
    second: float
    error: float = np.nan
    note: str = ""

    @property
    def difference(self) -> float:
        """Second minus first."""
        return self.second - self.first

    @property
    def ratio(self) -> float:
        """The difference over its standard error; nan without one."""
        return self.difference / self.error if self.error > 0.0 else np.nan


@dataclass(frozen=True)
class ProfilePair:
    """A profile of both runs in the same number of bins, matched by y/H; ``b`` bins."""

    first: ProfileTable
    second: ProfileTable

    @property
    def y(self) -> Floats:
        """Centers of the bins over the height of each run, y/H, shape ``(b,)``."""
        return np.asarray(self.first.y / self.first.height)

    @property
    def error(self) -> Floats:
        """Standard errors of the differences, shape ``(b,)``."""
        return np.asarray(np.hypot(self.first.error, self.second.error))

    @property
    def ratio(self) -> Floats:
        """Second minus first over its standard error, shape ``(b,)``; nan where it is not known."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(
                self.error > 0.0, (self.second.value - self.first.value) / self.error, np.nan
            )

    @property
    def rms_ratio(self) -> float:
        """Root mean square of `ratio`: about 1 if runs differ by chance only; nan if unknown."""
        known = self.ratio[np.isfinite(self.ratio)]
        return float(np.sqrt((known**2).mean())) if known.size else np.nan

    @property
    def note(self) -> str:
        """Of how many bins the differences can be told, if not of all."""
        known = int(np.isfinite(self.ratio).sum())
        return "" if known == self.ratio.size else f"{known} of {self.ratio.size} bins"

    def columns(self) -> tuple[Column, ...]:
        """One row per bin, in the unit of the field."""
        first, second = self.first, self.second
        return (
            Column("field", "", [first.field.name] * len(first.y)),
            Column("y_over_height", "1", self.y, "y/H"),
            Column("first", "", first.value),
            Column("first_error", "", first.error, "error of first"),
            Column("second", "", second.value),
            Column("second_error", "", second.error, "error of second"),
            Column("difference_over_error", "1", self.ratio, "difference over its error"),
        )

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        _, y, *columns = self.columns()
        return {
            "unit": self.first.field.unit,
            y.name: y.values,
            "heights": [self.first.height, self.second.height],
            **{column.name: column.values for column in columns},
            "rms_difference_over_error": self.rms_ratio,
        }


class Comparison(Table):
    """What `compare` finds.

    Attributes:
        names: Names of the runs: a key with its value, ``friction = 0.3``, if one alone differs.
        keys: Scenario keys that differ: key, value of the first run, of the second; as texts.
        numbers: Sizes, books at the end, and the rheology if two walls shear both runs.
        profiles: Profiles by field.
    """


def compare(
    first: Run,
    second: Run,
    of: Sequence[str] = ("velocity",),
    selection: Selection | None = None,
    bins: int | None = None,
    *,
    names: tuple[str, str] = ("first", "second"),
) -> Comparison:
    """Compare two runs.

    Args:
        first: A run.
        second: Another run.
        of: Fields whose profiles are compared, each one of ``PROFILED``.
        selection: Which frames of each run; default: the later half of its last stage.
        bins: Number of bins; default: one per mean diameter of the first run.
        names: What the runs are called if several keys of their scenarios differ, or none.

    Raises:
        PostError: If a profile cannot be made of one of the runs.
        StoreError: If a run cannot be read.
    """
    from multicor_cli.running.differences import find_differences
    from multicor_cli.scenario.problems import format_key

    differences = find_differences(first.scenario_resolved, second.scenario_resolved)
    keys = tuple((format_key(d.path), d.before, d.after) for d in differences)
    called, names = names, _labels(keys, names)
    numbers = (*_sizes(first, second), *_books(first, second))
    numbers += (*_rheologies(first, second, selection),)
    profiles = {}
    for field in dict.fromkeys(of):
        one = _profile(first, called[0], field, selection, bins)
        two = _profile(second, called[1], field, selection, one.y.size)
        profiles[field] = ProfilePair(one, two)
    lines = [(p.label, p.first, p.second, p.difference, p.ratio, p.note) for p in numbers]
    # One line for each profile: the root mean square of its differences over their errors.
    nan = np.nan
    lines += [
        (f"profile of {name} (rms over bins)", nan, nan, nan, p.rms_ratio, p.note)
        for name, p in profiles.items()
    ]
    headings = {
        "quantity": "quantity", "one": names[0], "two": names[1], "difference": "difference",
        "ratio": "over its standard error", "note": "note",
    }  # fmt: skip
    columns = [
        Column(name, "", values, label, "")
        for (name, label), values in zip(headings.items(), zip(*lines, strict=True), strict=True)
    ]
    tables = [pair.columns() for pair in profiles.values()]
    details = [
        same[0]._replace(values=[value for column in same for value in plain(column.values)])
        for same in zip(*tables, strict=True)
    ]
    facts = {
        "runs": names,
        "scenario": [dict(zip(("key", "first", "second"), key, strict=True)) for key in keys],
        "numbers": {
            p.name: {key: getattr(p, key) for key in ("first", "second", "difference", "error")}
            for p in numbers
        },
        "profiles": {name: pair.as_dict() for name, pair in profiles.items()},
    }
    parts = {"numbers": numbers, "profiles": profiles, "names": names, "keys": keys}
    return Comparison(columns, facts, details, **parts)


_NAMELESS = ("scenario.name", "scenario.description", "scenario.seed")
"""Keys that tell runs apart, and not what they are about."""

_VAGUE = ("value", "kind", "min", "max", "count", "walls", "of", "x", "y")
"""Last words of keys that say nothing without the word before."""


def _labels(keys: Sequence[tuple[str, str, str]], names: tuple[str, str]) -> tuple[str, str]:
    """What the runs are called: the only key that differs with its values, or their names."""
    about = [key for key in keys if key[0] not in _NAMELESS] or list(keys)
    if len(about) != 1:
        return names
    key, first, second = about[0]
    words = [word for word in key.split(".") if not word.isdigit()]
    name = ".".join(words[-2:]) if len(words[-1]) == 1 or words[-1] in _VAGUE else words[-1]
    return f"{name} = {first}", f"{name} = {second}"


def _sizes(first: Run, second: Run) -> list[Pair]:
    one, two = (np.asarray(run.frames.time) for run in (first, second))
    grains = float(first.model.grain_count), float(second.model.grain_count)
    ends = float(one[-1:].sum()), float(two[-1:].sum())
    return [
        Pair("grain_count", "grains", grains[0], grains[1]),
        Pair("frame_count", "frames", float(one.size), float(two.size)),
        Pair("time", "time at the last frame [s]", ends[0], ends[1]),
    ]


def _books(first: Run, second: Run) -> list[Pair]:
    one, two = energy(first), energy(second)
    pairs = [
        Pair(e.name, with_unit(e.label, "J"), float(one.books[e.name][-1]), float(last[-1]))
        for e in one.entries
        if (last := two.books.get(e.name)) is not None
    ]
    for name, label, of in (
        ("energy_closure", "closure [1]", "closure"),
        ("heat_closure", "closure of heat [1]", "heat_closure"),
    ):
        begin, end = getattr(one, of), getattr(two, of)
        if begin is not None and end is not None:
            pairs.append(Pair(name, label, float(begin[-1]), float(end[-1])))
    return pairs


def _profile(
    run: Run, name: str, field: str, selection: Selection | None, bins: int | None
) -> ProfileTable:
    """A profile of one of the runs; what cannot be is said with the run's name."""
    try:
        return profile(run, field, selection, bins)
    except PostError as error:
        raise PostError(f"{name}: {error}") from None


def _rheologies(first: Run, second: Run, selection: Selection | None) -> list[Pair]:
    """Pairs of what both rheologies have; nothing if one of the runs has none."""
    try:
        one, two = rheology(first, selection), rheology(second, selection)
    except PostError:
        return []
    angles = [table.mean["fabric_direction"] for table in (one, two)]
    # Directions repeat every 180°.
    two.mean["fabric_direction"] = angles[0] + ((angles[1] - angles[0] + 90.0) % 180.0 - 90.0)
    pairs = []
    for q in one.quantities:
        if q.name in two.mean:
            notes = dict.fromkeys(filter(None, (t.spread[q.name].note() for t in (one, two))))
            error = float(np.hypot(one.error[q.name], two.error[q.name]))
            values = one.mean[q.name], two.mean[q.name]
            pairs.append(Pair(q.name, q.heading.strip(), *values, error, ", ".join(notes)))
    return pairs

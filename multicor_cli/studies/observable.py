"""Which observables of a study no run of it can have: found before the first one starts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from multicor_cli.scenario.loading import UntilStrain
from multicor_cli.scenario.problems import Finding, KeyPath
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.store.schema import SERIES
from multicor_cli.store.summary import empty_summary
from multicor_cli.studies.schema import Observable
from multicor_cli.studies.tables import SOURCES

_COLUMNS = {spec.path.removeprefix("series/"): spec for spec in SERIES if len(spec.dims) == 1}
_OF_RUN = ("grain_count", "step", "time", "stage", "frame_count", "series_count", "duration", "hertz_deflection")
"""Numbers that `multicor info` has beside those of the summary."""

_OPEN = ("books.", "timings.", "heat.", "exchange.")
"""Parts of info whose numbers depend on the run."""


def unknown(observables: Iterable[Observable]) -> Iterator[Finding]:
    """What no run of any scenario has."""
    for number, row in enumerate(observables):
        place: KeyPath = ("observe", number)
        if row.post is not None and row.value not in (names := SOURCES[row.post].names):
            known = did_you_mean(str(row.value), names) or f"it has {', '.join(names)}"
            yield Finding((*place, "value"), f"{row.post} has no {row.value}", known)
        if row.post is not None and row.after is not None and SOURCES[row.post].is_of_one_frame:
            yield Finding((*place, "after"), f"{row.post} is about the end of a run, no mean", "leave after out")
        if row.series is not None and row.series not in _COLUMNS:
            known = did_you_mean(row.series, list(_COLUMNS)) or f"it has {', '.join(_COLUMNS)}"
            yield Finding((*place, "series"), f"the time series has no {row.series}", known)
        if row.info is not None and not row.info.startswith(_OPEN):
            names = (*_OF_RUN, *_leaves("", empty_summary()))
            if row.info not in names:
                known = did_you_mean(row.info, names) or f"it has {', '.join(dict.fromkeys(names))}"
                yield Finding((*place, "info"), f"info has no number {row.info}", known)


def _leaves(prefix: str, node: Mapping[str, Any]) -> Iterator[str]:
    for name, value in node.items():
        if isinstance(value, Mapping):
            yield from _leaves(f"{prefix}{name}.", value)
        elif not isinstance(value, str):
            yield f"{prefix}{name}"


def missing(observables: Iterable[Observable], scenario: Scenario) -> Iterator[Finding]:
    """What a run of this scenario does not have."""
    for number, row in enumerate(observables):
        place: KeyPath = ("observe", number)
        if scenario.heat is None and _is_of_heat(row):
            key = "value" if row.post else "series" if row.series else "info"
            yield Finding((*place, key), f"{getattr(row, key)} needs heat", "give the scenario a table [heat]")
        if not scenario.is_open and row.info is not None and row.info.startswith("exchange."):
            yield Finding((*place, "info"), "no grain comes or goes in this scenario", "give it [[outlets]] or releases")
        if row.post is not None and SOURCES[row.post].needs_shear:
            if not scenario.domain.periodic:
                yield Finding((*place, "post"), "rheology needs a domain that is periodic in x", "use region or profile")
            elif len(scenario.walls) < 2:
                yield Finding((*place, "post"), "rheology needs a wall below and a wall above the grains", "use region or profile")
        if row.after is not None:
            yield from _after(row, place, scenario)


def _is_of_heat(row: Observable) -> bool:
    if row.series is not None:
        return row.series in _COLUMNS and _COLUMNS[row.series].only_with == "heat"
    if row.info is not None:
        return row.info.startswith("heat")
    return row.post is not None and row.value in SOURCES[row.post].of_heat


def _after(row: Observable, place: KeyPath, scenario: Scenario) -> Iterator[Finding]:
    """Means that would begin when the run has ended already."""
    assert row.after is not None
    last = scenario.loading[-1] if scenario.loading else None
    until = last.until if last is not None else None
    if row.after.strain is not None and isinstance(until, UntilStrain) and until.strain.value <= row.after.strain:
        message = f"the last stage ends at a strain of {until.strain.value:g}, the mean would begin at {row.after.strain:g}"
        yield Finding((*place, "after", "strain"), message, "begin earlier, or shear for longer")
    durations = [stage.duration for stage in scenario.loading]
    if row.after.time is not None and durations and None not in durations:
        total = sum(float(duration or 0.0) for duration in durations)
        if total <= row.after.time:
            message = f"the run ends at {total:g} s, the mean would begin at {row.after.time:g} s"
            yield Finding((*place, "after", "time"), message, "begin earlier, or run for longer")

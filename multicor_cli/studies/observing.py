"""Numbers from the runs of a study: which there are, from which table, with which error."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from multicor_cli.files import read_object
from multicor_cli.model.books import BOOK_NAMES, NAMES
from multicor_cli.model.cell import CELL
from multicor_cli.model.cell import COLUMNS as OF_CELL
from multicor_cli.model.model import Floats
from multicor_cli.post import forces
from multicor_cli.post.avalanches import EVENTS, avalanches
from multicor_cli.post.chains import OF_CHAINS, OF_CLUSTERS, chains, clusters
from multicor_cli.post.conductivity import FLUX_QUANTITIES, conductivity, mean_heat
from multicor_cli.post.conductivity import QUANTITIES as OF_CONDUCTIVITY
from multicor_cli.post.correlation import LENGTHS, correlation
from multicor_cli.post.crossings import residence
from multicor_cli.post.diffusion import diffusion
from multicor_cli.post.energy import HEAT, MECHANICAL, energy
from multicor_cli.post.fabric import OF_SHAPES as OF_FABRIC_OF_SHAPES
from multicor_cli.post.fabric import QUANTITIES as OF_FABRIC
from multicor_cli.post.fabric import fabric
from multicor_cli.post.grain_map import grain_map
from multicor_cli.post.heat import HEAT_SUMMARY, SPOT_QUANTITIES, heat_network, hot_spots
from multicor_cli.post.layer_conductivity import (
    FLOW_QUANTITIES,
    LAYER_QUANTITIES,
    layer_conductivity,
    layer_flow,
)
from multicor_cli.post.lifetimes import LIFETIMES, lifetimes
from multicor_cli.post.mixing import MIXING, mixing
from multicor_cli.post.profile import profile
from multicor_cli.post.quantities import MAPPED, PROFILED, QUANTITIES
from multicor_cli.post.region import QUANTITIES as IN_REGION
from multicor_cli.post.region import in_region
from multicor_cli.post.rheology import CELL_QUANTITIES, rheology
from multicor_cli.post.rheology import QUANTITIES as OF_RHEOLOGY
from multicor_cli.post.source import Selection
from multicor_cli.post.structure import pair_correlation
from multicor_cli.post.sums import Sums, average
from multicor_cli.post.table import TimeTable
from multicor_cli.post.theta_eta import theta_eta
from multicor_cli.post.voronoi import QUANTITIES as OF_CELLS
from multicor_cli.post.voronoi import voronoi
from multicor_cli.post.wall_heat import WALL_QUANTITIES, wall_heat
from multicor_cli.scenario.problems import KeyPath, Refused
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.stages import UntilStrain
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.store.atomic import commit_bytes
from multicor_cli.store.documents import SIZE_LIMIT
from multicor_cli.store.schema import SERIES
from multicor_cli.store.snapshot import empty_summary
from multicor_cli.studies.axes import Case
from multicor_cli.studies.directory import StudyDirectory
from multicor_cli.studies.study_file import After, Observable

if TYPE_CHECKING:
    from multicor_cli.store.reader import Run

# ---- Which tables of `multicor post` give a number of a run, and how


class Number(NamedTuple):
    """A number with its standard error; nan where it is not known."""

    value: float
    error: float = math.nan


class Unobservable(Exception):
    """An observable that a run does not have."""


@dataclass(frozen=True)
class Source:
    """A table that gives numbers.

    Attributes:
        names: Quantities that it has.
        take: The number of a quantity, from the frames after a time.
        of_heat: Those of them that only runs with heat have.
        is_of_one_frame: Whether it is about the last frame.
        needs_shear: Whether two walls have to shear the grains, or there is a cell.
    """

    names: tuple[str, ...]
    take: Callable[[Run, Observable, Selection], Number]
    of_heat: frozenset[str] = frozenset()
    is_of_one_frame: bool = False
    needs_shear: bool = False


def _mean(found: TimeTable, name: str, why: str) -> Number:
    if name not in found.mean:
        raise Unobservable(why)
    return Number(found.mean[name], found.error[name])


def _rheology(run: Run, row: Observable, selection: Selection) -> Number:
    found, name = rheology(run, selection), str(row.value)
    why = f"the rheology of this run has no {name}; it has {', '.join(found.mean)}"
    return _mean(found, name, why)


def _conductivity(run: Run, row: Observable, selection: Selection) -> Number:
    name = str(row.value)
    measure: Callable[[Run, Selection], TimeTable]
    if run.model.is_cell:
        measure = mean_heat if name in _OF_FLUX else conductivity
    else:
        measure = layer_flow if name in _THROUGH_LAYER else layer_conductivity
    found = measure(run, selection)
    why = "its grains are no discs of one thickness"
    if name.startswith("share_"):
        why = "an older version of the program began it"
    return _mean(found, name, f"the run has no {name}: {why}")


def _wall_heat(run: Run, row: Observable, selection: Selection) -> Number:
    found = wall_heat(run, selection)
    if len(found.walls) > 1:
        raise Unobservable(f"several walls have a temperature: {', '.join(found.walls)}")
    name = f"{found.walls[0]}: {row.value}"
    why = f"the run has no {row.value}: its grains have several conductivities"
    return _mean(found, name, why)


def _heat_network(run: Run, row: Observable, _selection: Selection) -> Number:
    return Number(float(heat_network(run).summary[str(row.value)]))


def _diffusion(run: Run, row: Observable, selection: Selection) -> Number:
    axis = "xy".index(str(row.value)[-1])
    found = diffusion(run, selection)
    return Number(found.diffusion[axis], found.diffusion_error[axis])


def _over_time(
    measure: Callable[[Run, Selection], TimeTable], why: str = "all its grains are discs"
) -> Callable[[Run, Observable, Selection], Number]:
    """A mean of frames; ``why`` there may be none."""

    def take(run: Run, row: Observable, selection: Selection) -> Number:
        found = measure(run, selection)
        return _mean(found, str(row.value), f"the run has no {row.value}: {why}")

    return take


def _lifetimes(run: Run, row: Observable, selection: Selection) -> Number:
    found, name = lifetimes(run, selection), str(row.value)
    return Number(getattr(found, name), getattr(found, f"{name}_error"))


def _structure(run: Run, row: Observable, selection: Selection) -> Number:
    if row.value in _OF_CELLS:
        cells = voronoi(run, selection, row.bins)
        return Number(cells.mean[row.value], cells.standard_error[row.value])
    found = pair_correlation(run, selection, bins=row.bins)
    if row.value == "first_peak":
        return Number(found.first_peak, found.first_peak_error)
    return Number(found.first_peak_distance)


def _correlation(run: Run, row: Observable, selection: Selection) -> Number:
    found, name = correlation(run, selection, bins=row.bins), str(row.value)
    if name not in LENGTHS:
        return Number(found.fluctuation)
    return Number(getattr(found, name), getattr(found, f"error_{name}"))


def _residence(run: Run, row: Observable, selection: Selection) -> Number:
    found = residence(run, Selection(frames=slice(None)) if row.after is None else selection)
    if row.value == "mean":
        return Number(float(found.mean[0]), float(found.error[0]))
    return Number(float(found.median[0]))


def _avalanches(run: Run, row: Observable, selection: Selection) -> Number:
    start, name = selection.start, str(row.value)
    if start is None:
        start = _later_half(run)
    found = avalanches(run, str(row.column), start, threshold=row.threshold)
    return Number(found.mean[name], found.error[name])


def _region(run: Run, row: Observable, selection: Selection) -> Number:
    assert row.inside is not None
    found = in_region(run, row.inside.area(), selection)
    return _mean(found, str(row.value), f"the run has no {row.value}")


def _profile(run: Run, row: Observable, selection: Selection) -> Number:
    found = profile(run, str(row.value), selection, row.bins)
    k = _bin(found.y, found.width, row)
    return Number(float(found.value[k]), float(found.error[k]))


def _theta(run: Run, row: Observable, _selection: Selection) -> Number:
    found = theta_eta(run, bins=row.bins)
    k = _bin(found.center, 1.0 / found.center.size, row)
    return Number(float(getattr(found, _THETA[str(row.value)])[k]))


def _bin(centers: Floats, width: float, row: Observable) -> int:
    assert row.at is not None
    k = int(np.abs(centers - row.at).argmin())
    if abs(float(centers[k]) - row.at) > 0.5001 * width:
        low, high = float(centers[0]) - 0.5 * width, float(centers[-1]) + 0.5 * width
        raise Unobservable(
            f"{row.at:g} lies outside of the profile, which goes from {low:.4g} to {high:.4g}"
        )
    return k


def _map(run: Run, row: Observable, _selection: Selection) -> Number:
    values = grain_map(run, str(row.value)).value
    values = values[np.isfinite(values)]
    if not values.size:
        raise Unobservable(f"no grain has a {row.value}")
    return Number(float(getattr(np, row.statistic or "mean")(values)))


def _forces(run: Run, row: Observable, selection: Selection) -> Number:
    name = str(row.value)
    if name in forces.SUMMARY:
        summary = forces.force_network(run).summary
        if name not in summary:
            raise Unobservable(f"the run has no {name}: all its grains are discs")
        return Number(float(summary[name]))
    return Number(forces.angular_distribution(run, selection).moments[name])


def _energy(run: Run, row: Observable, _selection: Selection) -> Number:
    found, name = energy(run).as_dict(), str(row.value)
    value = found[name] if name in _CLOSURES else found["end"].get(name)
    if value is None:
        raise Unobservable("the run has no heat")
    return Number(float(value))


_THETA = {"theta": "mean", "standard_deviation": "spread", "min": "lowest", "max": "highest"}
_CLOSURES = ("energy_closure", "heat_closure")
_AMOUNTS = tuple(name for name, quantity in MAPPED.items() if quantity.names_of is None)
_OF_NETWORK = tuple(quantity.name for quantity in OF_CONDUCTIVITY)
_OF_FLUX = tuple(quantity.name for quantity in FLUX_QUANTITIES)
_IN_LAYER = tuple(quantity.name for quantity in LAYER_QUANTITIES)
_THROUGH_LAYER = tuple(quantity.name for quantity in FLOW_QUANTITIES)
_OF_HEAT = tuple(dict.fromkeys((*_OF_NETWORK, *_OF_FLUX, *_IN_LAYER, *_THROUGH_LAYER)))
_AT_WALLS = tuple(quantity.name for quantity in WALL_QUANTITIES)
_OF_SPOTS = tuple(quantity.name for quantity in SPOT_QUANTITIES)
_OF_CELLS = tuple(quantity.name for quantity in OF_CELLS)
_HEAT_FIELDS = frozenset(name for name, quantity in QUANTITIES.items() if quantity.needs_heat)

SOURCES: dict[str, Source] = {
    "rheology": Source(
        tuple(dict.fromkeys(row.name for row in (*OF_RHEOLOGY, *CELL_QUANTITIES))), _rheology,
        needs_shear=True,
    ),
    "fabric": Source(tuple(q.name for q in (*OF_FABRIC, *OF_FABRIC_OF_SHAPES)), _over_time(fabric)),
    "lifetimes": Source(LIFETIMES, _lifetimes),
    "chains": Source(tuple(q.name for q in OF_CHAINS), _over_time(chains)),
    "clusters": Source(tuple(q.name for q in OF_CLUSTERS), _over_time(clusters)),
    "conductivity": Source(_OF_HEAT, _conductivity, frozenset(_OF_HEAT)),
    "heat-network": Source(
        HEAT_SUMMARY, _heat_network, frozenset(HEAT_SUMMARY), is_of_one_frame=True
    ),
    "wall-heat": Source(_AT_WALLS, _wall_heat, frozenset(_AT_WALLS)),
    "hot-spots": Source(
        _OF_SPOTS, _over_time(hot_spots, "no material has a temperature of ignition or melting"),
        frozenset(_OF_SPOTS),
    ),
    "diffusion": Source(("diffusion_x", "diffusion_y"), _diffusion, needs_shear=True),
    "structure": Source(("first_peak", "first_peak_distance", *_OF_CELLS), _structure),
    "correlation": Source((*LENGTHS, "fluctuation"), _correlation),
    "mixing": Source(
        tuple(row.name for row in MIXING),
        _over_time(mixing, "it has several groups, or is a cell"),
    ),
    "residence": Source(("mean", "median"), _residence),
    "avalanches": Source(tuple(row.name for row in EVENTS), _avalanches),
    "region": Source(tuple(row.name for row in IN_REGION), _region, frozenset({"temperature"})),
    "profile": Source(tuple(PROFILED), _profile, _HEAT_FIELDS),
    "theta-eta": Source(tuple(_THETA), _theta, frozenset(_THETA), is_of_one_frame=True),
    "map": Source(_AMOUNTS, _map, _HEAT_FIELDS, is_of_one_frame=True),
    "forces": Source((*forces.SUMMARY, *forces.MOMENTS), _forces),
    "energy": Source(
        (*(line.name for line in (*MECHANICAL, *HEAT)), *_CLOSURES), _energy,
        frozenset({*(line.name for line in HEAT), "heat_closure"}), is_of_one_frame=True,
    ),
}  # fmt: skip
"""By name of the command."""


# ---- Which observables of a study no run of it can have: found before the first one starts

_BOOKS = (*BOOK_NAMES, *NAMES["adhesion_books"], *NAMES["growth_books"])
_COLUMNS = {spec.path.removeprefix("series/"): spec for spec in SERIES if len(spec.dims) == 1}
_OF_RUN = (
    "grain_count",
    "step",
    "time",
    "stage",
    "frame_count",
    "series_count",
    "duration",
    "hertz_deflection",
)
"""Numbers that `multicor info` has beside those of the summary."""

_OF_CONTACTS = (
    "fabric", "lifetimes", "chains", "clusters", "heat-network", "wall-heat", "hot-spots",
    "forces",
)  # fmt: skip
_MAPS_OF_CONTACTS = ("heat-flux", "coordination", "force", "stress")
"""Tables and maps that frames without contacts do not have."""

_OWNED = ": "
"""Between the name of a wall or an outlet and that of its column of the time series."""

_OPEN = ("timings.", "heat.", "exchange.")
"""Parts of info whose numbers depend on the run."""


def unknown(observables: Iterable[Observable]) -> Iterator[Refused]:
    """What no run of any scenario has."""
    for number, row in enumerate(observables):
        place: KeyPath = ("observe", number)
        names: Sequence[str]
        if row.post is not None:
            names = SOURCES[row.post].names
            key, name, whose = "value", str(row.value), f"{row.post} has"
        elif row.series is not None and _OWNED not in row.series:  # of which nobody knows here
            key, name, names, whose = "series", row.series, [*_COLUMNS], "the time series has"
        elif row.info is not None and not row.info.startswith(_OPEN):
            known_books = (f"books.{name}" for name in _BOOKS)
            names = list(dict.fromkeys((*_OF_RUN, *_leaves("", empty_summary()), *known_books)))
            key, name, whose = "info", row.info, "info has"
        else:
            continue
        if name not in names:
            known = did_you_mean(name, names) or f"it has {', '.join(names)}"
            noun = "number " if key == "info" else ""
            yield Refused((*place, key), f"{whose} no {noun}{name}", known)
        if row.post is not None and row.after is not None and SOURCES[row.post].is_of_one_frame:
            what = f"{row.post} is about the end of a run, no mean"
            yield Refused((*place, "after"), what, "leave after out")
        if row.column is not None and _OWNED not in row.column and row.column not in _COLUMNS:
            known = did_you_mean(row.column, _COLUMNS) or f"it has {', '.join(_COLUMNS)}"
            yield Refused((*place, "column"), f"the time series has no {row.column}", known)
        if row.post == "theta-eta" and not 0.0 <= (row.at or 0.0) <= 1.0:
            what = f"η goes from 0 at the lower wall to 1, at is {row.at:g}"
            yield Refused((*place, "at"), what, "give at as a share of the height")


def _leaves(prefix: str, node: Mapping[str, Any]) -> Iterator[str]:
    for name, value in node.items():
        if isinstance(value, Mapping):
            yield from _leaves(f"{prefix}{name}.", value)
        elif not isinstance(value, str):
            yield f"{prefix}{name}"


def missing(observables: Iterable[Observable], scenario: Scenario) -> Iterator[Refused]:
    """What a run of this scenario does not have."""
    for number, row in enumerate(observables):
        place: KeyPath = ("observe", number)
        yield from _about_heat(row, place, scenario)
        yield from _about_owner(row, place, scenario)
        if not scenario.is_open and row.info is not None and row.info.startswith("exchange."):
            what = "no grain comes or goes in this scenario"
            yield Refused((*place, "info"), what, "give it [[outlets]] or releases")
        yield from _about_contacts(row, place, scenario)
        is_cell = scenario.domain.is_cell
        if row.post == "residence" and not scenario.is_open:
            what = "no grain comes or goes in this scenario"
            yield Refused((*place, "post"), what, "give it [[outlets]] and releases")
        if row.post == "mixing" and len(scenario.particles) < 2:
            what = "mixing needs two groups of grains"
            yield Refused((*place, "post"), what, "give the scenario two [[particles]]")
        own = [q.name for q in (CELL_QUANTITIES if is_cell else OF_RHEOLOGY)]
        if row.post == "rheology" and row.value not in own:
            kind = "a cell" if is_cell else "a layer between walls"
            what = f"the rheology of {kind} has no {row.value}"
            yield Refused((*place, "value"), what, f"it has {', '.join(own)}")
        if is_cell and row.post in ("region", "theta-eta", "wall-heat"):
            yield Refused((*place, "post"), f"a cell has no {row.post}", "use rheology or profile")
        if row.post is not None and SOURCES[row.post].needs_shear and not is_cell:
            what = ""
            if not scenario.domain.is_periodic:
                what = "a domain that is periodic in x"
            elif len(scenario.walls) < 2:
                what = "a wall below and a wall above the grains"
            if what:
                what = f"{row.post} needs {what}"
                yield Refused((*place, "post"), what, "use region or profile")
        if row.after is not None:
            yield from _after(row, place, scenario)


def _about_owner(row: Observable, place: KeyPath, scenario: Scenario) -> Iterator[Refused]:
    """Columns of walls, outlets and cells that there are not."""
    known = dict.fromkeys([wall.name for wall in scenario.walls], _of_owners("wall", {}))
    known |= dict.fromkeys([outlet.name for outlet in scenario.outlets], _of_owners("outlet", {}))
    if scenario.domain.is_cell:
        known = {CELL: _of_owners("wall", OF_CELL)}
    for key, column in (("series", row.series), ("column", row.column)):
        owner, _, name = (column or "").rpartition(_OWNED)
        if owner and owner not in known:
            what = f"the time series has no columns of {owner}"
            remedy = f"it has those of {', '.join(known) or 'nothing'}"
            yield Refused((*place, key), what, remedy)
        elif owner and name not in known[owner]:
            remedy = did_you_mean(name, known[owner]) or f"it has {', '.join(known[owner])}"
            yield Refused((*place, key), f"the time series has no {name} of {owner}", remedy)


def _of_owners(dim: str, others: Mapping[str, tuple[tuple[str, ...], str]]) -> list[str]:
    """Columns of the time series of a wall or an outlet; ``others``: what a cell has instead."""
    found: list[str] = []
    for spec in SERIES:
        if dim in spec.dims:
            names, _ = others.get(spec.name.removeprefix("wall_"), ((), ""))
            found += names or spec.columns or (spec.name,)
    return found


def _about_heat(row: Observable, place: KeyPath, scenario: Scenario) -> Iterator[Refused]:
    if scenario.heat is None and _is_of_heat(row):
        key = "value" if row.post else "series" if row.series else "info"
        what = f"{getattr(row, key)} needs heat"
        yield Refused((*place, key), what, "give the scenario a table [heat]")
    if row.post == "conductivity":
        yield from _about_conductivity(row, place, scenario)


def _about_conductivity(row: Observable, place: KeyPath, scenario: Scenario) -> Iterator[Refused]:
    is_cell = scenario.domain.is_cell
    own = (*_OF_NETWORK, *_OF_FLUX) if is_cell else (*_IN_LAYER, *_THROUGH_LAYER)
    if not is_cell and len(scenario.walls) < 2:
        what = "conductivity needs a cell, or a wall below and a wall above the grains"
        yield Refused((*place, "post"), what, 'give [domain] periodic = ["x", "y"], or walls')
    elif row.value not in own:
        kind = "a cell" if is_cell else "a layer between walls"
        what = f"the conductivity of {kind} has no {row.value}"
        yield Refused((*place, "value"), what, f"it has {', '.join(own)}")
    has_gradient = scenario.heat is None or scenario.heat.gradient is not None
    if is_cell and row.value in _OF_FLUX and not has_gradient:
        what = f"{row.value} needs a mean gradient of temperature"
        yield Refused((*place, "value"), what, "give [heat] one, as gradient = [0.0, 1000.0]")


def _is_of_heat(row: Observable) -> bool:
    if row.series is not None:
        return row.series in _COLUMNS and _COLUMNS[row.series].only_with == "heat"
    if row.info is not None:
        return row.info.startswith("heat")
    return row.post is not None and row.value in SOURCES[row.post].of_heat


def _about_contacts(row: Observable, place: KeyPath, scenario: Scenario) -> Iterator[Refused]:
    if row.post == "profile":
        reads = row.value in QUANTITIES and QUANTITIES[row.value].needs_contacts
    elif row.post == "conductivity":
        reads = row.value not in (_OF_FLUX if scenario.domain.is_cell else _THROUGH_LAYER)
    else:
        reads = row.post in _OF_CONTACTS or (row.post == "map" and row.value in _MAPS_OF_CONTACTS)
    if reads and not scenario.output.contacts:
        what = f"{row.value} of {row.post} needs the contacts of frames"
        yield Refused((*place, "value"), what, "set contacts = true in [output]")


def _after(row: Observable, place: KeyPath, scenario: Scenario) -> Iterator[Refused]:
    """Means that would begin when the run has ended already."""
    assert row.after is not None
    until, begins = scenario.loading[-1].until if scenario.loading else None, row.after.strain
    if begins is not None and isinstance(until, UntilStrain) and until.strain.value <= begins:
        end = f"the last stage ends at a strain of {until.strain.value:g}"
        message = f"{end}, the mean would begin at {begins:g}"
        yield Refused((*place, "after", "strain"), message, "begin earlier, or shear for longer")
    durations = [stage.duration for stage in scenario.loading]
    total = sum(float(duration or 0.0) for duration in durations)
    if durations and None not in durations and (begins := row.after.time or 0.0) >= total:
        message = f"the run ends at {total:g} s, the mean would begin at {begins:g} s"
        yield Refused((*place, "after", "time"), message, "begin earlier, or run for longer")


# ---- Taking and keeping them


def observe(
    directory: StudyDirectory, case: Case, observables: Sequence[Observable]
) -> dict[str, Any]:
    """Numbers, digest and worst verdict of a finished case; known ones from ``observed/NAME.json``.

    Returns:
        ``values`` (name: ``[value, error]``), ``problems`` (name: why it could not be taken),
        ``verdict``, ``digest``, ``hours``.
    """
    file = directory.observed(case.name)
    kept = read_object(file, SIZE_LIMIT)
    kept = kept if isinstance(kept.get("numbers"), dict) else {}
    wanted = {row.name: _digest(row) for row in observables}
    new = [row for row in observables if wanted[row.name] not in kept.get("numbers", {})]
    if new or not kept:
        kept = _take(directory.case(case.name), new, kept)
        commit_bytes(file, "observed numbers", json.dumps(kept).encode())
    found = {name: kept["numbers"][digest] for name, digest in wanted.items()}
    return {
        **{name: kept[name] for name in ("verdict", "digest", "hours")},
        "values": {name: number for name, number in found.items() if not isinstance(number, str)},
        "problems": {name: number for name, number in found.items() if isinstance(number, str)},
    }


def _digest(row: Observable) -> str:
    """What is observed, whatever it is called."""
    text = json.dumps(row.model_dump(exclude={"name", "label"}), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _take(path: Path, observables: Sequence[Observable], kept: dict[str, Any]) -> dict[str, Any]:
    """What is kept of a case, with these: ``[value, error]``, or in words why there is none."""
    import multicor_cli as multicor
    from multicor_cli.checks import worst_verdict
    from multicor_cli.store import run_info

    info = run_info(path)
    numbers = dict(kept.get("numbers", {}))
    for row in observables:
        try:
            numbers[_digest(row)] = list(take_one(path, row, info))
        # Whatever a run lacks is told in the table; others are still taken
        except Exception as error:
            numbers[_digest(row)] = str(error) or type(error).__name__
    if kept:
        return {**kept, "numbers": numbers}
    verdict = worst_verdict(multicor.check_run(path)).value
    hours = float((info["timings"] or {}).get("wall", math.nan)) / 3600.0
    return {"numbers": numbers, "verdict": verdict, "digest": info["state_digest"], "hours": hours}


def take_one(path: Path, row: Observable, info: dict[str, Any]) -> Number:
    """One observable of a run.

    Raises:
        Unobservable: The run does not have it.
        PostError: It has too few frames.
    """
    import multicor_cli as multicor

    if row.info is not None:
        return Number(_field(info, row.info))
    with multicor.open_run(path) as run:
        start = _start(run, row.after)
        if row.series is not None:
            return _mean_of_series(run, row.series, start)
        assert row.post is not None
        return SOURCES[row.post].take(run, row, Selection(start=start))


def _field(info: dict[str, Any], name: str) -> float:
    node: Any = info
    for part in name.split("."):
        if not isinstance(node, dict) or part not in node:
            known = ", ".join(sorted(node)) if isinstance(node, dict) else "nothing"
            raise Unobservable(f"info has no {name}; there is {known}")
        node = node[part]
    if isinstance(node, bool) or not isinstance(node, int | float):
        raise Unobservable(f"{name} of info is no number")
    return float(node)


def _start(run: Any, after: After | None) -> float | None:
    """Time from which on is averaged; None: the default of `multicor post`."""
    if after is None:
        return None
    if after.time is not None:
        return after.time
    stage, strain = np.asarray(run.series["stage"]), np.asarray(run.series["strain"])
    reached = np.flatnonzero((stage == stage.max()) & (strain >= float(after.strain or 0.0)))
    if not reached.size:
        raise Unobservable(
            f"the strain of the last stage ends at {strain[stage == stage.max()].max():.3g}, "
            f"before {after.strain:g}"
        )
    return float(run.series["time"][reached[0]])


def _later_half(run: Any) -> float:
    """Time in the middle of the rows of the last stage [s]."""
    time, stage = np.asarray(run.series["time"]), np.asarray(run.series["stage"])
    own = time[stage == stage.max()]
    return 0.5 * float(own[0] + own[-1])


def _mean_of_series(run: Any, name: str, start: float | None) -> Number:
    """Mean of a column, weighted by the windows, with its error; see `multicor_cli.post.sums`."""
    if _OWNED in name:
        columns = {column.name: column.values for column in run.series_columns}
    else:
        columns = run.series
    if name not in columns:
        raise Unobservable(f"the time series has no {name}; it has {', '.join(columns)}")
    column = np.asarray(columns[name], float)
    if column.ndim != 1:
        raise Unobservable(f"{name} of the time series has several columns for each row")
    time = np.asarray(run.series["time"])
    start = _later_half(run) if start is None else start
    duration = np.asarray(run.series["window_duration"])
    rows = (time >= start) & (duration > 0.0)
    if not rows.any():
        raise Unobservable(f"the time series has no row after {start:g} s")
    weight = duration[rows]
    value, error = average(
        Sums((column[rows] * weight)[:, np.newaxis], weight[:, np.newaxis], weight)
    )
    return Number(float(value[0]), float(error[0]))

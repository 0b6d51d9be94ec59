"""How far friction is mobilized: tangential forces over the largest that contacts can carry."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import ContactLaws, Floats, Model
from multicor_cli.post.contacts import (
    LoadedContacts,
    loaded_contacts,
    shape_temperatures,
    with_forces,
)
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bin_count,
    chosen_frames,
    frames_of,
    frames_told,
)
from multicor_cli.post.sums import Sums, average, scatter
from multicor_cli.post.table import Column, Table

BINS = 20
"""Bins of the distribution, unless told otherwise."""

_NOISE = 1e-6
"""Part of the forces of a contact below which what presses it together is rounding."""

# ---- μ of each contact: as `engine.contact.contacts.friction_between`, over arrays. Reading a run
#      loads no kernels.


def laws_over_time(source: Run) -> Callable[[Frame], ContactLaws]:
    """The contact laws of a frame: those of the run, with the friction that its stage has."""
    own = source.model.laws.with_ranges(source.model.mean_diameter)
    stages = tomllib.loads(getattr(source, "scenario_resolved", "")).get("loading", [])
    if not any(isinstance(stage, Mapping) and stage.get("contacts") for stage in stages):
        return lambda _frame: own
    # Of few runs: packing and scenario take a while to load.
    from multicor_cli.packing.materials import stage_laws
    from multicor_cli.scenario import parse_scenario

    found = stage_laws(parse_scenario(source.scenario_resolved, source.path), source.model)
    return lambda frame: found[int(frame.stage)] or own


def mobilized(
    contacts: LoadedContacts,
    sliding: NDArray[np.bool_],
    laws: ContactLaws,
    model: Model,
    frame: Frame,
) -> Floats:
    """|f_t|/(μ (f_n + F)) of each contact, 0 … 1; nan without friction or pressure, ``(c,)``.

    F is the attraction of the pair (theory §3.1), at the gap of the contact; 0 without adhesion.
    Contacts that slide have 1, as the solver has found them. Of the others μ is that at the slip
    and temperatures of the frame, where the solver took those before the step. Contacts at several
    points have |Σ f_t|/Σ μ (f_n + F): how points of a side share what holds it is not determined.

    Args:
        contacts: The contacts.
        sliding: Which of them slide, shape ``(c,)``.
        laws: The contact laws of the frame.
        model: Its model.
        frame: The frame.
    """
    points, of = contacts.points
    normal, tangential = np.abs(points.force[:, 0]), np.abs(contacts.force[:, 1])
    pair = model.material[points.i], model.material[points.j]
    mu, pull = _friction(laws, pair, points, model, frame), np.zeros(normal.size)
    if laws.adhesion.size:
        gap = np.asarray(frame.contacts.gap, np.float64)[points.row]
        reach = laws.adhesion_range[pair]
        share = 1.0 - gap / np.where(reach > 0.0, reach, 1.0)
        # Whatever is wet and carries a force within the range has a bridge
        bridge = (share > 0.0).astype(np.float64)
        pull = laws.adhesion[pair] * np.where(laws.is_wet[pair] > 0, bridge, np.clip(share, 0, 1))
    pressing = points.force[:, 0] + pull
    can_bear = (mu > 0.0) & (pressing > _NOISE * (normal + pull))
    bound = np.where(can_bear, mu * pressing, np.nan)
    if contacts.shaped is not None:
        total = np.bincount(of, np.where(can_bear, bound, 0.0), tangential.size)
        can_bear = total > 0.0
        bound = np.where(can_bear, total, np.nan)
    part = np.minimum(tangential / bound, 1.0)
    return np.asarray(np.where(sliding & can_bear, 1.0, part))


_Pairs = tuple[NDArray[Any], NDArray[Any]]


def _friction(
    laws: ContactLaws, pair: _Pairs, contacts: LoadedContacts, model: Model, frame: Frame
) -> Floats:
    """μ of each contact; what it does not depend on is not read."""
    mu = laws.friction[pair]
    slip = temperature = np.full(mu.size, np.nan)
    if laws.table_speed.size or laws.flash_speed.size:
        slip = np.abs(np.asarray(frame.contacts.slip, np.float64)[contacts.row])
    if laws.depends_on_temperature:
        of_all = shape_temperatures(frame, model)
        first, second = of_all[contacts.i], of_all[contacts.j]
        # that of the grain where a wall has none
        temperature = np.where(np.isnan(second), first, 0.5 * (first + second))
    if laws.table_speed.size:
        mu = _of_speed(laws, pair, mu, slip)
    if laws.softening_rate.size:
        mu = _softened(laws, pair, mu, temperature)
    if laws.flash_speed.size:
        mu = _weakened(laws, pair, mu, temperature, slip)
    return mu


def _of_speed(laws: ContactLaws, pair: _Pairs, mu: Floats, speed: Floats) -> Floats:
    """μ at sliding speeds [m/s] of the pairs that have a table, linear in it."""
    mu, table = mu.copy(), laws.table[pair]
    for number in np.unique(table[table >= 0]).tolist():
        rows, here = slice(*laws.table_start[number : number + 2].tolist()), table == number
        mu[here] = np.interp(speed[here], laws.table_speed[rows], laws.table_friction[rows])
    return mu


def _softened(laws: ContactLaws, pair: _Pairs, mu: Floats, temperature: Floats) -> Floats:
    """μ at temperatures [K] of the pairs whose friction depends on it."""
    rate, rise = laws.softening_rate[pair], temperature - laws.softening_start[pair]
    lowest, highest = laws.softening_lowest[pair], laws.softening_highest[pair]
    soft = np.clip(mu * (1.0 - rate * rise), lowest, highest)
    return np.asarray(np.where(rate == 0.0, mu, soft))


def _weakened(
    laws: ContactLaws, pair: _Pairs, mu: Floats, temperature: Floats, slip: Floats
) -> Floats:
    """μ that flash heating leaves at temperatures [K] and sliding speeds [m/s]: Rice (2006)."""
    speed, limit = laws.flash_speed[pair], laws.flash_limit[pair]
    falls = np.isfinite(limit)
    room = np.maximum(limit - temperature, 0.0)[falls]
    speed[falls] *= (room / (limit - laws.flash_reference[pair])[falls]) ** 2
    fast, weak = slip > speed, laws.flash_weakened[pair]
    part = np.ones(mu.size)
    part[fast] = speed[fast] / slip[fast]
    return np.where(fast, weak + (mu - weak) * part, mu)


# ---- Its distribution


class Mobilization(Table):
    """Distribution of the friction that contacts between grains mobilize; ``b`` bins from 0 to 1.

    |f_t|/(μ f_n), with μ (f_n + F) where contacts attract each other with F; see `mobilized`.
    Contacts without friction do not count. Those that slide are in the last bin.

    Attributes:
        edges: Edges of the bins, ``b + 1`` of them.
        center: Their centers, shape ``(b,)``.
        density: Probability density, shape ``(b,)``; ``density_scatter``: standard deviation from
            frame to frame, nan with one.
        count: Contacts in each bin, shape ``(b,)``.
        mean: Mean over the contacts; ``mean_error``: its standard error.
        sliding: Share of sliding contacts; ``sliding_error``: its standard error.
        contacts: Number of contacts.
    """


def mobilization(source: Run, selection: Selection | None = None, bins: int = BINS) -> Mobilization:
    """Distribution of the mobilized friction of contacts between grains.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        bins: Number of bins.

    Raises:
        PostError: If these frames have no contact forces, or none between grains with friction.
        StoreError: If the run cannot be read.
    """
    chosen = with_forces(source, chosen_frames(source, selection))
    laws, edges = laws_over_time(source), np.linspace(0.0, 1.0, bin_count(bins) + 1)
    counts, sums = [], []
    for frame in frames_of(source, chosen):
        model = frame.model
        contacts = loaded_contacts(frame, model)
        sliding = contacts.sliding
        part = mobilized(contacts, sliding, laws(frame), model, frame)
        counted = ~contacts.is_wall & np.isfinite(part)
        counts.append(np.histogram(part[counted], edges)[0])
        sums.append((part[counted].sum(), sliding[counted].sum(), counted.sum()))
    count = np.array(counts)
    total, rows = int(count.sum()), np.array(sums, np.float64)
    if not total:
        raise PostError(
            "no contact between grains has friction and carries a force in these frames"
        )
    weight = np.repeat(rows[:, 2:], 2, axis=1)
    (mean, sliding_share), error = average(Sums(rows[:, :2], weight, weight))
    with np.errstate(invalid="ignore"):
        single = count * bins / count.sum(axis=1, keepdims=True)
    facts = {
        **frames_told(source, chosen), "contacts": total, "edges": edges,
        "mean": float(mean), "mean_error": float(error[0]),
        "sliding": float(sliding_share), "sliding_error": float(error[1]),
    }  # fmt: skip
    columns = [
        Column("low", "1", edges[:-1], "f_t/(μ f_n) from", ""),
        Column("high", "1", edges[1:], "to", ""),
        Column("density", "1", count.sum(axis=0) * bins / total, "P"),
        Column("density_scatter", "1", scatter(single), "scatter of P"),
        Column("count", "", count.sum(axis=0), "contacts"),
    ]
    center = 0.5 * (edges[1:] + edges[:-1])
    return Mobilization(columns, facts, frames=chosen, center=center)

"""How long contacts live: which of a frame are still there in those after it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between
from multicor_cli.post.bulk import Bulk, find_bulk
from multicor_cli.post.contacts import loaded_contacts, with_forces
from multicor_cli.post.diffusion import lags_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    frames_told,
    need_two,
    times_of,
)
from multicor_cli.post.sums import Sums, average
from multicor_cli.post.table import Column, Table, average_ratios

KINDS = ("contacts", "strong", "sliding")
"""Which contacts: all that carry a force, those with f_n > ⟨f_n⟩, those that slide."""

LIFETIMES = ("lifetime", "lifetime_strong", "lifetime_sliding")
"""Mean lifetimes of `KINDS`, as `Lifetimes` calls them."""


class Lifetimes(Table):
    """Survival of contacts against the time lag; ``l`` lags.

    C(τ) is the share of the contacts of a frame that carry a force in every frame from it to that a
    lag later. For strong contacts, f_n > ⟨f_n⟩ in their frame, and sliding ones it is the share
    that stay strong, or slide on. ``again`` is the share of the contacts of a frame that carry a
    force a lag later, whatever they did between. Contacts are those of two grains, whatever their
    images, or of a grain and a shape of a wall; they begin in the bulk and count to their end
    wherever they go. One ends where a grain leaves. Frames see a step each: a contact that opens
    and closes again between two of them has lived on, one that closes and opens is not known of. So
    frames should be so close that C falls by little between two.

    The mean lifetime is −Δ/ln s with the mean interval Δ of the frames and the share s of contacts
    that live from one frame to the next: that of contacts which end at a constant rate, also where
    many live for less than Δ; otherwise the inverse of the mean rate at which contacts end.

    Attributes:
        lag: Time lags [s], shape ``(l,)``.
        strain: Strain of the mean flow in them, on average; nan where there is no one strain.
        contacts, strong, sliding: C of these; ``error_contacts`` …, standard errors, nan where the
            lags that begin at different frames are too few.
        again, error_again: Share of the contacts that are there a lag later, and its error.
        origins: How many lags begin at a frame.
        lifetime, lifetime_strong, lifetime_sliding: Mean lifetimes [s], nan where none ends or none
            lives from one frame to the next; ``lifetime_error`` …, standard errors.
        contacts_per_frame: Contacts of a frame, on average.
        interval: Mean interval of the frames [s].
        shear_rate: Of the mean flow [1/s]; nan where there is no one rate.
        margin: What is left out next to the surface of each wall [m]; 0 if nothing is.
    """


def lifetimes(
    source: Run,
    selection: Selection | None = None,
    *,
    margin: float | None = None,
    between: Between | None = None,
) -> Lifetimes:
    """How long contacts live, in a cell, in the bulk of a layer, or everywhere.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        margin: As `multicor_cli.post.rheology.rheology`.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If fewer than two of these frames have contact forces, or none has a contact; or
            as `multicor_cli.post.bulk.find_bulk`.
        StoreError: If the run cannot be read.
    """
    chosen = with_forces(source, chosen_frames(source, selection))
    need_two(chosen, "lifetimes need two frames with contact forces")
    bulk = find_bulk(source, chosen, margin, between)
    times = times_of(source, chosen)
    strain = np.concatenate([[0.0], np.cumsum(bulk.strains(source, chosen))])
    lags = lags_of(chosen.size)
    found = [_contacts(source, bulk, frame) for frame in frames_of(source, chosen)]
    everyone = np.unique(np.concatenate([own.key for own in found]))
    if not everyone.size:
        raise PostError("there is no contact in these frames: choose others")
    histories = [_History.of(found, kind, everyone) for kind in range(len(KINDS))]
    counts = {kind: history.survivors(lags) for kind, history in zip(KINDS, histories, strict=True)}
    columns = [Column("lag", "s", _over(times, lags)), Column("strain", "1", _over(strain, lags))]
    for name in (KINDS[0], "again", *KINDS[1:]):
        kept, began = counts[KINDS[0] if name == "again" else name]
        mean, error = _average(kept[1 if name == "again" else 0], began, lags)
        label = "there again" if name == "again" else f"C of {name}".replace("of contacts", "")
        columns += [Column(name, "1", mean, label.strip()),
            Column(f"error_{name}", "1", error, "standard error")]  # fmt: skip
    columns.append(Column("origins", "", times.size - lags))
    interval = float(np.diff(times).mean())

    def derive(sums: Floats) -> dict[str, Floats]:
        share = sums[:, 0] / sums[:, 1]
        return {"it": np.where(share > 0.0, -interval / np.log(share), np.nan)}

    facts: dict[str, Any] = {}
    for name, (kept, began) in zip(LIFETIMES, counts.values(), strict=True):
        rows = np.column_stack([kept[0, 0, :-1], began[:-1]]).astype(np.float64)
        ended = average_ratios(derive, rows, times)
        facts |= {name: ended.mean["it"], f"{name}_error": float(ended.spread["it"].error)}
    facts |= {
        "contacts_per_frame": float(np.mean(counts[KINDS[0]][1])), "interval": interval,
        "shear_rate": float(strain[-1] / (times[-1] - times[0])), "margin": bulk.margin,
        **frames_told(source, chosen),
    }  # fmt: skip
    return Lifetimes(columns, facts, frames=chosen)


def _over(values: Floats, lags: NDArray[np.int64]) -> Floats:
    """What values grow by over lags, on average."""
    return np.array([float((values[lag:] - values[:-lag]).mean()) for lag in lags.tolist()])


def _average(
    kept: NDArray[np.int64], began: NDArray[np.int64], lags: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Shares over the lags and their errors, from all frames with a frame a lag later."""
    found = []
    for row, lag in zip(kept, lags.tolist(), strict=True):
        value, weight = (each[:-lag, np.newaxis].astype(np.float64) for each in (row, began))
        found.append(np.concatenate(average(Sums(value, weight, weight))))
    mean, error = np.array(found).T
    return mean, error


# ---- Which contacts there are in each frame


class _Contacts(NamedTuple):
    """Contacts of a frame, each once; what they are in columns as `KINDS`.

    Attributes:
        key: Which bodies they join, ascending, shape ``(c,)``.
        begins: Whether they are in the bulk, shape ``(c,)``.
        kinds: Which are of each kind, shape ``(3, c)``.
    """

    key: NDArray[np.int64]
    begins: NDArray[np.bool_]
    kinds: NDArray[np.bool_]


def _contacts(source: Run, bulk: Bulk, frame: Frame) -> _Contacts:
    contacts, whole = loaded_contacts(frame, frame.model), source.model
    n = whole.grain_count
    body = np.concatenate([frame.number, n + np.arange(whole.shape_count)])
    ends = np.sort([body[contacts.i], body[contacts.j]], axis=0)
    is_inside, force = bulk.holds(frame, contacts), contacts.force[:, 0]
    pressing = force[is_inside & (force > 0.0)]
    strong = force > (pressing.mean() if pressing.size else np.inf)
    # Two grains may touch through two images: one contact, of every kind that either is.
    key, which = np.unique(ends[0] * (n + whole.shape_count) + ends[1], return_inverse=True)
    flags = np.zeros((3, key.size), np.bool_)
    for own, flag in zip(flags, (is_inside, strong, contacts.sliding), strict=True):
        own[which[flag]] = True
    return _Contacts(key, flags[0], np.stack([np.ones(key.size, np.bool_), *flags[1:]]))


class _History(NamedTuple):
    """Contacts of one kind over time.

    Attributes:
        there: Numbers of those of each frame.
        since: From which frame on each has been there in all.
        begins: Numbers of those of each frame that lags begin with.
        number: How many there ever are.
    """

    there: list[NDArray[np.int64]]
    since: list[NDArray[np.int64]]
    begins: list[NDArray[np.int64]]
    number: int

    @classmethod
    def of(cls, frames: list[_Contacts], kind: int, everyone: NDArray[np.int64]) -> _History:
        there, since, begins = [], [], []
        last, first = (np.full(everyone.size, -2) for _ in range(2))
        for k, own in enumerate(frames):
            number, counted = np.searchsorted(everyone, own.key), own.kinds[kind]
            now = number[counted]
            new = now[last[now] != k - 1]
            first[new], last[now] = k, k
            there.append(now)
            since.append(first[now])
            begins.append(number[counted & own.begins])
        return cls(there, since, begins, everyone.size)

    def survivors(self, lags: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """How many there were throughout and at the end of each lag, of those of each frame.

        Returns:
            Numbers by throughout or at the end, lag and frame, shape ``(2, l, f)``; and numbers
            with which lags begin, shape ``(f,)``.
        """
        count = len(self.there)
        found, marked = np.zeros((2, lags.size, count), np.int64), np.zeros(self.number, np.bool_)
        for k, begins in enumerate(self.begins):
            marked[begins] = True
            for row, lag in enumerate(lags[lags < count - k].tolist()):
                is_there = marked[self.there[k + lag]]
                found[0, row, k] = np.count_nonzero(is_there & (self.since[k + lag] <= k))
                found[1, row, k] = np.count_nonzero(is_there)
            marked[begins] = False
        return found, np.array([begins.size for begins in self.begins])

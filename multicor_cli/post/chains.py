"""Force chains: grains that bear more than the mean, joined along their major principal stress."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.clusters import components
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts, with_forces
from multicor_cli.post.rheology_sums import average_rows
from multicor_cli.post.source import (
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    model_of,
    need_grains,
)
from multicor_cli.post.table import Quantity, TimeTable

ANGLE = 45.0
"""Largest angle [°] between a branch and the major principal stress of its grains, by default."""

LEAST = 3
"""Grains that a chain has at least."""

_ROUNDING = 1e-9

QUANTITIES = (
    Quantity("chains", "chains per 1000 grains"),
    Quantity("share", "share of the grains in chains"),
    Quantity("mean_length", "mean length (grains)"),
    Quantity("longest", "longest chain (grains)"),
    Quantity("decay_length", "decay length of P(l) (grains)"),
    Quantity("direction", "mean direction of the links", unit="deg"),
    Quantity("order", "nematic order of the links"),
)
"""What `chains` measures, in the order of the table."""

# ---- The chains of a frame


@dataclass(frozen=True)
class FoundChains:
    """Chains of a frame with ``n`` grains.

    Attributes:
        of_grain: Number of the chain of each grain, from the longest on; −1: in none, ``(n,)``.
        length: Grains of each chain, descending, shape ``(k,)``.
        link: Which loaded contacts are links of chains, ascending.
        stress: Major principal stress of each grain [N/m], shape ``(n,)``.
        direction: Its direction [rad], shape ``(n,)``.
    """

    of_grain: NDArray[np.int64]
    length: NDArray[np.int64]
    link: NDArray[np.int64]
    stress: Floats
    direction: Floats


def find_chains(contacts: LoadedContacts, model: Model, angle: float = ANGLE) -> FoundChains:
    """The force chains of the contacts of a frame; see `Chains`.

    Raises:
        MissingLibrary: If SciPy is not installed.
    """
    stress, direction = _principal(contacts, model)
    n, i, j = contacts.grain_count, contacts.i, contacts.j
    bears = stress > stress.mean()
    along = np.column_stack([np.cos(direction), np.sin(direction)])
    can = np.flatnonzero(~contacts.is_wall & (contacts.force[:, 0] > 0.0))
    can = can[bears[i[can]] & bears[j[can]]]
    for end in (i, j):
        cosine = np.abs((contacts.normal[can] * along[end[can]]).sum(axis=1))
        can = can[cosine >= np.cos(np.radians(angle)) - _ROUNDING]
    cluster = components(i[can], j[can], n)
    size = np.bincount(cluster)
    order = np.argsort(-size, kind="stable")
    order = order[size[order] >= LEAST]
    number = np.full(size.size, -1)
    number[order] = np.arange(order.size)
    of_grain = number[cluster]
    return FoundChains(of_grain, size[order], can[of_grain[i[can]] >= 0], stress, direction)


def _principal(contacts: LoadedContacts, model: Model) -> tuple[Floats, Floats]:
    """Major principal stress of each grain [N/m] and its direction [rad], shapes ``(n,)``.

    Σ f⊗r/(π a²) over its contacts, with r from each to its center; compression is positive.
    """
    n, radius = contacts.grain_count, model.grains.radius
    between = ~contacts.is_wall
    # The force on j and the way to its center have both the other sign.
    grain = np.concatenate([contacts.i, contacts.j[between]])
    dyad = np.einsum("ca,cb->cab", contacts.vector, contacts.normal).reshape(-1, 4)
    dyads = np.concatenate([dyad, dyad[between]]) / (np.pi * radius[grain])[:, np.newaxis]
    xx, xy, yx, yy = (np.bincount(grain, own, minlength=n) for own in dyads.T)
    deviator = 0.5 * (xx - yy) + 0.5j * (xy + yx)
    major = 0.5 * (xx + yy) + np.abs(deviator)
    return np.asarray(major, np.float64), np.asarray(0.5 * np.angle(deviator), np.float64)


def decay_length(mean: Any) -> Any:
    """Decay length l₀ of lengths l ≥ 3 with P(l) ∝ exp(−l/l₀), of greatest likelihood.

    Lengths are whole numbers: e^{−1/l₀} = (⟨l⟩ − 3)/(⟨l⟩ − 2), a geometric distribution.
    """
    beyond = np.asarray(mean, np.float64) - LEAST
    with np.errstate(divide="ignore", invalid="ignore"):
        return 1.0 / np.log1p(1.0 / beyond)


# ---- Over time


class Chains(TimeTable):
    """Force chains over time; ``f`` frames.

    A grain bears a chain if the major principal stress of its contacts, those with walls included,
    is above the mean over all grains. Two that do and press on each other are linked if the branch
    is within an angle (45°) of the directions of major principal stress of both. Chains are what is
    linked, of three grains or more (Peters, Muthuswamy, Wibowo & Tordesillas, Phys. Rev. E 72,
    041307, 2005); they may branch. The length of a chain is the number of its grains.

    Means are those over all frames: of lengths over all chains, of directions over all links. The
    nematic order of n links is |Σ e^{2iθ}|/n: 1 if all are parallel, about 1/√n by chance.

    Attributes:
        time: Times of the frames [s], shape ``(f,)``.
        values: Each of `QUANTITIES` by name, nan where not known, shape ``(f,)``.
        angle: Largest angle [°].
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "angle", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


def chains(source: Run, selection: Selection | None = None, *, angle: float = ANGLE) -> Chains:
    """The force chains of frames.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        angle: Largest angle between a branch and the major principal stress of both grains [°].

    Raises:
        PostError: If these frames have no contact forces or one has no grain, or ``angle`` is none
            between 0 and 90°.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    chosen, found = find_all(source, selection, angle)
    rows = []
    for contacts, own in found:
        x, y = contacts.normal[own.link].T
        rows.append((
            1.0, contacts.grain_count, own.length.size, own.length.sum(),
            own.length.max(initial=0), own.link.size, (x * x - y * y).sum(), (2.0 * x * y).sum(),
        ))  # fmt: skip
    times = np.asarray(source.frames.time, np.float64)[chosen]
    averages = average_rows(_derive, np.array(rows, np.float64), times)
    quantities = [q.over_time(averages.values[q.name]) for q in QUANTITIES]
    parts: dict[str, Any] = {"mean": averages.mean, "spread": averages.spread, "frames": chosen}
    facts = {"angle": angle, **frames_told(source, chosen)}
    return Chains(times, quantities, facts, **parts)


def _derive(sums: Floats) -> dict[str, Floats]:
    frames, grains, number, length, longest, links, cosine, sine = sums.T
    mean = length / number
    return {
        "chains": 1e3 * number / grains, "share": length / grains, "mean_length": mean,
        "longest": longest / frames, "decay_length": decay_length(mean),
        "direction": np.degrees(0.5 * np.arctan2(sine, cosine)) % 180.0,
        "order": np.hypot(cosine, sine) / links,
    }  # fmt: skip


def find_all(
    source: Run, selection: Selection | None, angle: float
) -> tuple[NDArray[np.int64], Iterator[tuple[LoadedContacts, FoundChains]]]:
    """The frames that have forces, and the contacts and chains of each, one after the other."""
    if not 0.0 < angle < 90.0:
        raise PostError(f"the angle {angle:g} of chains must be between 0 and 90 degrees")
    chosen = with_forces(source, (selection or Selection()).indices(source.frames))
    need_grains(source, chosen)

    def found() -> Iterator[tuple[LoadedContacts, FoundChains]]:
        for frame in frames_of(source, chosen):
            model = model_of(source, frame)
            contacts = loaded_contacts(frame, model)
            yield contacts, find_chains(contacts, model, angle)

    return chosen, found()

"""What contacts join: clusters of sliding ones, and force chains.

Force chains are grains that bear more than the mean, joined along their major principal stress.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.optional import library
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts, own_stress, with_forces
from multicor_cli.post.forces import force_network
from multicor_cli.post.source import (
    PostError,
    Run,
    Selection,
    chosen_frames,
    frame_index,
    frames_of,
    frames_told,
    need_grains,
    times_of,
)
from multicor_cli.post.sums import Sums, average
from multicor_cli.post.table import (
    Column,
    Quantity,
    Table,
    TimeTable,
    average_rows,
    values_of_quantities,
)

# ---- Clusters of sliding contacts

OF_CLUSTERS = (
    Quantity("sliding", "share of sliding contacts"),
    Quantity("clusters", "clusters per 1000 grains"),
    Quantity("mean_size", "mean size, by number (contacts)"),
    Quantity("weight_size", "mean size, by weight (contacts)"),
    Quantity("largest", "largest cluster (contacts)"),
    Quantity("largest_share", "its share of the sliding contacts"),
)
"""What `clusters` measures, in the order of the table."""


def components(i: NDArray[Any], j: NDArray[Any], nodes: int) -> NDArray[np.int64]:
    """Number of the connected component of each of ``nodes`` nodes, linked ``i`` to ``j``.

    Raises:
        MissingLibrary: If SciPy is not installed.
    """
    links = library("scipy.sparse").coo_array((np.ones(i.size), (i, j)), shape=(nodes, nodes))
    _, found = library("scipy.sparse.csgraph").connected_components(links, directed=False)
    return np.asarray(found, np.int64)


class Clusters(TimeTable):
    """Clusters of sliding contacts between grains; ``f`` frames, which count alike in means.

    Two sliding contacts are in one cluster if they have a grain in common (Staron, Vilotte &
    Radjai, Phys. Rev. Lett. 89, 204302, 2002). The size s of a cluster is the number of its
    contacts; its mean by weight, Σs²/Σs, is that of the cluster in which a sliding contact is.
    Contacts with walls do not count: a wall would join all that slide on it.

    Attributes:
        values: Each of `OF_CLUSTERS` by name, nan where nothing slides, shape ``(f,)``.
    """


def clusters(source: Run, selection: Selection | None = None) -> Clusters:
    """The clusters of sliding contacts in frames.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.

    Raises:
        PostError: If these frames have no contact forces, or one has no grain.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    chosen = with_forces(source, chosen_frames(source, selection))
    need_grains(source, chosen)
    rows = []
    for frame in frames_of(source, chosen):
        contacts = loaded_contacts(frame, frame.model)
        between = ~contacts.is_wall
        slides = between & contacts.sliding
        i, j = contacts.i[slides], contacts.j[slides]
        size = np.bincount(components(i, j, contacts.grain_count)[i]) if i.size else np.zeros(0)
        rows.append(_sizes(size[size > 0], contacts.grain_count, int(between.sum())))
    values = dict(zip((q.name for q in OF_CLUSTERS), np.array(rows).T, strict=True))
    return Clusters.of_frames(source, chosen, OF_CLUSTERS, values)


def _sizes(size: NDArray[Any], grains: int, contacts: int) -> tuple[float, ...]:
    """`OF_CLUSTERS` of clusters of these sizes, shape ``(k,)``."""
    total, number = float(size.sum()), 1e3 * size.size / grains
    share = total / contacts if contacts else np.nan
    if not total:
        return share, number, np.nan, np.nan, 0.0, np.nan
    largest = float(size.max())
    return (
        share, number, float(size.mean()), float((size**2).sum()) / total, largest, largest / total
    )  # fmt: skip


# ---- The chains of a frame

ANGLE = 45.0
"""Largest angle [°] between a branch and the major principal stress of its grains, by default."""

LEAST = 3
"""Grains that a chain has at least."""

_ROUNDING = 1e-9

OF_CHAINS = (
    Quantity("chains", "chains per 1000 grains"),
    Quantity("share", "share of the grains in chains"),
    Quantity("mean_length", "mean length (grains)"),
    Quantity("longest", "longest chain (grains)"),
    Quantity("decay_length", "decay length of P(l) (grains)"),
    Quantity("direction", "mean direction of the links", unit="deg"),
    Quantity("order", "nematic order of the links"),
)
"""What `chains` measures, in the order of the table."""


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
    xx, xy, yx, yy = own_stress(contacts, model).T
    deviator = 0.5 * (xx - yy) + 0.5j * (xy + yx)
    stress = np.asarray(0.5 * (xx + yy) + np.abs(deviator), np.float64)
    direction = np.asarray(0.5 * np.angle(deviator), np.float64)
    branch = contacts.along
    n, i, j = contacts.grain_count, contacts.i, contacts.j
    bears = stress > stress.mean()
    along = np.column_stack([np.cos(direction), np.sin(direction)])
    can = np.flatnonzero(~contacts.is_wall & (contacts.force[:, 0] > 0.0))
    can = can[bears[i[can]] & bears[j[can]]]
    for end in (i, j):
        cosine = np.abs((branch[can] * along[end[can]]).sum(axis=1))
        can = can[cosine >= np.cos(np.radians(angle)) - _ROUNDING]
    cluster = components(i[can], j[can], n)
    size = np.bincount(cluster)
    order = np.argsort(-size, kind="stable")
    order = order[size[order] >= LEAST]
    number = np.full(size.size, -1)
    number[order] = np.arange(order.size)
    of_grain = number[cluster]
    return FoundChains(of_grain, size[order], can[of_grain[i[can]] >= 0], stress, direction)


def decay_length(mean: Any) -> Any:
    """Decay length l₀ of lengths l ≥ 3 with P(l) ∝ exp(−l/l₀), of greatest likelihood.

    Lengths are whole numbers: e^{−1/l₀} = (⟨l⟩ − 3)/(⟨l⟩ − 2), a geometric distribution.
    """
    beyond = np.asarray(mean, np.float64) - LEAST
    with np.errstate(divide="ignore", invalid="ignore"):
        return 1.0 / np.log1p(1.0 / beyond)


# ---- Chains over time


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
        values: Each of `OF_CHAINS` by name, nan where not known, shape ``(f,)``.
        angle: Largest angle [°].
    """


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
        x, y = contacts.along[own.link].T
        rows.append((
            1.0, contacts.grain_count, own.length.size, own.length.sum(),
            own.length.max(initial=0), own.link.size, (x * x - y * y).sum(), (2.0 * x * y).sum(),
        ))  # fmt: skip
    averages = average_rows(_derive, np.array(rows, np.float64), times_of(source, chosen))
    return Chains.of_frames(source, chosen, OF_CHAINS, averages, angle=angle)


def _derive(sums: Floats) -> dict[str, Floats]:
    frames, grains, number, length, longest, links, cosine, sine = sums.T
    mean = length / number
    direction = np.degrees(0.5 * np.arctan2(sine, cosine)) % 180.0
    return {
        "chains": 1e3 * number / grains, "share": length / grains, "mean_length": mean,
        "longest": longest / frames, "decay_length": decay_length(mean),
        "direction": np.where(links > 0.0, direction, np.nan),
        "order": np.hypot(cosine, sine) / links,
    }  # fmt: skip


def find_all(
    source: Run, selection: Selection | None, angle: float
) -> tuple[NDArray[np.int64], Iterator[tuple[LoadedContacts, FoundChains]]]:
    """The frames that have forces, and the contacts and chains of each, one after the other."""
    if not 0.0 < angle < 90.0:
        raise PostError(f"the angle {angle:g} of chains must be between 0 and 90 degrees")
    chosen = with_forces(source, chosen_frames(source, selection))
    need_grains(source, chosen)

    def found() -> Iterator[tuple[LoadedContacts, FoundChains]]:
        for frame in frames_of(source, chosen):
            model = frame.model
            contacts = loaded_contacts(frame, model)
            yield contacts, find_chains(contacts, model, angle)

    return chosen, found()


# ---- How long chains are


class ChainLengths(Table):
    """Distribution of the lengths of force chains; a row for each of ``r`` lengths from 3 on.

    Attributes:
        length: Lengths l in grains, shape ``(r,)``.
        P: Share of the chains of all frames, shape ``(r,)``; ``error``: standard errors.
        count: Chains in all frames, shape ``(r,)``.
        decay_length: l₀ of P(l) ∝ exp(−l/l₀) of greatest likelihood; ``decay_length_error``.
        angle: Largest angle of `Chains` [°].
    """


def chain_lengths(
    source: Run, selection: Selection | None = None, *, angle: float = ANGLE
) -> ChainLengths:
    """How long force chains are.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        angle: As `chains`.

    Raises:
        PostError: As `chains`, or if there is no chain in these frames.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    chosen, found = find_all(source, selection, angle)
    lengths = [own.length for _, own in found]
    longest = max(int(own.max(initial=0)) for own in lengths)
    if not longest:
        raise PostError("there is no force chain in these frames: choose others, or raise --angle")
    count = np.array([np.bincount(own, minlength=longest + 1)[LEAST:] for own in lengths])
    number = count.sum(axis=1, dtype=np.float64)
    weight = np.repeat(number[:, np.newaxis], count.shape[1], axis=1)
    share, error = average(Sums(count.astype(np.float64), weight, weight))
    sums = np.column_stack([[own.sum() for own in lengths], number])
    decay = average_rows(
        lambda rows: {"it": decay_length(rows[:, 0] / rows[:, 1])}, sums, times_of(source, chosen)
    )
    columns = [
        Column("length", "", np.arange(LEAST, longest + 1), "grains"),
        Column("P", "1", share),
        Column("error", "1", error, "standard error", "standard_error"),
        Column("count", "", count.sum(axis=0), "chains"),
    ]
    facts = {
        "decay_length": decay.mean["it"], "decay_length_error": float(decay.spread["it"].error),
        "angle": angle, **frames_told(source, chosen),
    }  # fmt: skip
    return ChainLengths(columns, facts, frames=chosen)


# ---- The chains of one frame


class ChainMap(Table):
    """The force chains of one frame: numbers of them as rows, the grains in chains as details.

    Attributes:
        chain: Number of the chain, from the longest on, of each grain in one, shape ``(g,)``.
        grain: These grains, shape ``(g,)``.
        stress: Their major principal stress [N/m], shape ``(g,)``.
        degrees: Its direction, shape ``(g,)``.
        network: The force network of the frame.
        link: Which of its contacts are links of chains.
        frame: Index of the frame.
        time: Time of the frame [s].
    """


def chain_map(source: Run, frame: int = -1, *, angle: float = ANGLE) -> ChainMap:
    """The force chains of one frame.

    Args:
        source: The run.
        frame: Index of the frame; negative counts from the last one.
        angle: As `chains`.

    Raises:
        PostError: If there is no such frame, or as `chains`.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    selection = Selection(frames=slice(index, index + 1))
    found = chains(source, selection, angle=angle)
    [(_, own)] = find_all(source, selection, angle)[1]
    network = force_network(source, index)
    in_chain = np.flatnonzero(own.of_grain >= 0)
    grain = in_chain[np.argsort(own.of_grain[in_chain], kind="stable")]
    degrees = np.degrees(own.direction[grain]) % 180.0
    x, y = network.scene.center[grain].T
    details = [
        Column("chain", "", own.of_grain[grain]), Column("grain", "", grain),
        Column("x", "m", x), Column("y", "m", y),
        Column("stress", "N/m", own.stress[grain], "major principal stress"),
        Column("degrees", "deg", degrees, "its direction"),
    ]  # fmt: skip
    rows = [(column.heading, found.mean[column.name]) for column in found.quantities]
    facts = {"frame": index, "time": network.time, "angle": angle, **found.mean}
    return ChainMap(values_of_quantities(rows), facts, details, network=network, link=own.link)

"""Clusters of sliding contacts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.optional import library
from multicor_cli.post.contacts import loaded_contacts, with_forces
from multicor_cli.post.source import (
    Run,
    Selection,
    frames_of,
    frames_told,
    model_of,
    need_grains,
)
from multicor_cli.post.table import Quantity, TimeTable

QUANTITIES = (
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
        time: Times of the frames [s], shape ``(f,)``.
        values: Each of `QUANTITIES` by name, nan where nothing slides, shape ``(f,)``.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


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
    chosen = with_forces(source, (selection or Selection()).indices(source.frames))
    need_grains(source, chosen)
    rows = []
    for frame in frames_of(source, chosen):
        contacts = loaded_contacts(frame, model_of(source, frame))
        between = ~contacts.is_wall
        slides = between & np.asarray(frame.contacts.sliding, np.bool_)[contacts.row]
        i, j = contacts.i[slides], contacts.j[slides]
        size = np.bincount(components(i, j, contacts.grain_count)[i]) if i.size else np.zeros(0)
        rows.append(_measure(size[size > 0], contacts.grain_count, int(between.sum())))
    values = np.array(rows).T
    quantities = [q.over_time(own) for q, own in zip(QUANTITIES, values, strict=True)]
    times = np.asarray(source.frames.time, np.float64)[chosen]
    return Clusters(times, quantities, frames_told(source, chosen), frames=chosen)


def _measure(size: NDArray[Any], grains: int, contacts: int) -> tuple[float, ...]:
    """`QUANTITIES` of clusters of these sizes, shape ``(k,)``."""
    total, number = float(size.sum()), 1e3 * size.size / grains
    share = total / contacts if contacts else np.nan
    if not total:
        return share, number, np.nan, np.nan, 0.0, np.nan
    largest = float(size.max())
    return (
        share, number, float(size.mean()), float((size**2).sum()) / total, largest, largest / total
    )  # fmt: skip

"""Contacts out of the neighbour list."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.kernels.contacts import (
    Contacts,
    Laws,
    Scene,
    WarmStart,
    count_contacts,
    fill_contacts,
    kernel_laws,
)
from multicor_cli.kernels.jit import chunks_for
from multicor_cli.solver.neighbour_list import NeighbourList
from multicor_cli.state.model import ContactLaws, Floats

_NOTHING = np.zeros((1, 1))
_NO_LAWS = kernel_laws(
    ContactLaws(_NOTHING, _NOTHING, np.full((1, 1), -1, np.int32), np.zeros(1, np.int32), np.empty(0), np.empty(0)), np.empty(0)
)


def gather_contacts(
    scene: Scene,
    lists: NeighbourList,
    gap: Floats,
    margin: float,
    laws: Laws,
    start: Floats,
    dt: float,
    warm: WarmStart,
    ratio: float,
) -> tuple[Contacts, Floats]:
    """Contacts with a gap up to ``margin`` [m], sorted by key; arguments as `multicor_cli.kernels.contacts.fill_contacts`.

    Also returns the sum of min(u_n⁻, 0)² over closing contacts [m²/s²] and their number, shape ``(2,)``.
    """
    kept = count_contacts(lists.row, gap, margin)
    count = int(kept[-1])
    contacts = Contacts(
        np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 5)), np.empty((count, 2)),
        np.empty((count, 2)), np.empty((count, 2)),
    )  # fmt: skip
    closing = chunks_for(lists.row.size - 1, 2)
    fill_contacts(scene, laws, lists.row, lists.partner, gap, margin, kept, start, dt, warm, ratio, contacts, closing)
    return contacts, closing.sum(axis=0)


def gather_still_contacts(scene: Scene, lists: NeighbourList, gap: Floats, near: float, still: Floats) -> Contacts:
    """Frictionless contacts with a ``gap`` up to ``near`` [m] between bodies at rest, ``still`` of shape ``(bodies, 4)``."""
    rows: NDArray[np.int64] = np.zeros(lists.row.size, np.int64)
    nothing = WarmStart(rows, np.empty(0, np.int32), np.empty((0, 2)))
    alike = scene._replace(material=np.zeros_like(scene.material))
    return gather_contacts(alike, lists, gap, near, _NO_LAWS, still, 1.0, nothing, 0.0)[0]

"""Contacts out of the neighbor list."""

from __future__ import annotations

import numpy as np

from multicor_cli.arithmetic.sums import column_totals
from multicor_cli.engine.contact.adhesion import attractions
from multicor_cli.engine.contact.detection import StepContacts, WarmStart, count_contacts, fill_contacts
from multicor_cli.engine.contact.rolling import rolling_of_contacts
from multicor_cli.engine.geometry.neighbor_list import NeighborList
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import chunks_for
from multicor_cli.model.model import ContactLaws, Floats


def gather_contacts(
    scene: Scene,
    lists: NeighborList,
    margin: float,
    laws: ContactLaws,
    start: Floats,
    dt: float,
    warm: WarmStart,
    ratio: float,
) -> tuple[StepContacts, Floats]:
    """Contacts with a gap up to ``margin`` [m], sorted by key; arguments as `multicor_cli.engine.contact.detection.fill_contacts`.

    Also returns the sum of min(u_n⁻, 0)² over closing contacts [m²/s²] and their number, and the sum of |u_t⁻| over the contacts
    of two grains that carried an impulse [m/s] and their number, shape ``(4,)``.
    """
    kept = count_contacts(lists.row, lists.gap, margin)
    count = int(kept[-1])
    contacts = StepContacts(
        np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 5)), np.empty((count, 2)),
        np.empty((count, 2)), np.empty((count, 2)),
    )  # fmt: skip
    speeds = chunks_for(lists.row.size - 1, 4)
    fill_contacts(
        scene, laws, lists.row, lists.partner, lists.gap, lists.normal, margin, kept, start, dt, warm, ratio, contacts, speeds
    )
    if laws.adhesion.size:
        contacts = contacts._replace(attraction=attractions(scene, laws, contacts, start, warm, dt))
    if laws.rolling.size:
        contacts = contacts._replace(rolling=rolling_of_contacts(scene, laws, contacts, start, warm, ratio))
    return contacts, column_totals(speeds)

"""From the contacts of a step, as the solver has them, to a table that can be stored or looked at."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.adhesion import net_impulses
from multicor_cli.engine.contact.detection import StepContacts, contact_after
from multicor_cli.engine.contact.rolling import couples_of_contacts
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import GAP, MU, NX, NY
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import Floats


@kernel
def _slips(scene: Scene, contacts: StepContacts, after: Floats) -> Floats:
    slip = np.empty(contacts.i.size)
    for c in range(contacts.i.size):
        slip[c] = contact_after(c, scene, contacts, after)[1]
    return slip


def tabulate_contacts(scene: Scene | None, contacts: StepContacts | None, after: Floats) -> ContactTable:
    """Make the table; empty if there has been no step."""
    if scene is None or contacts is None:
        return ContactTable.empty()
    q_n, p_t = contacts.impulse.T
    # The local solve cuts p_t to ±μ q_n exactly, so equality means sliding; only a rounding of the product is allowed for.
    sliding = (q_n > 0.0) & (np.abs(p_t) >= contacts.frame[:, MU] * q_n * (1.0 - 1e-12))
    return ContactTable(
        contacts.i,
        contacts.j,
        contacts.frame[:, [NX, NY]],
        contacts.frame[:, GAP].copy(),
        net_impulses(contacts.impulse, contacts.attraction),
        _slips(scene, contacts, after),
        sliding,
        couple=couples_of_contacts(contacts) if contacts.rolling.size else None,
    )

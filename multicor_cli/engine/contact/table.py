"""The contacts of a step as a table that can be stored or looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.detection import Contacts, contact_after
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import GAP, MU
from multicor_cli.model.model import Floats, Ints


@dataclass(frozen=True)
class ContactTable:
    """Contacts of one step, sorted by (i, j); ``c`` rows.

    Attributes:
        i: Grain, shape ``(c,)``.
        j: Grain or wall shape (``>= n``), shape ``(c,)``.
        normal: Unit normal from j to i at mid-step, shape ``(c, 2)``.
        gap: Gap at mid-step [m], shape ``(c,)``.
        impulse: p_n, p_t of j on i [N s], shape ``(c, 2)``.
        slip: Tangential velocity u_t⁺ of i relative to j [m/s], shape ``(c,)``.
        sliding: Whether |p_t| has reached μ p_n > 0, shape ``(c,)``.
        heat: Heat generated in the contact in the step [J], shape ``(c,)``; None if no heat was computed.
        conductance: Conductance of the contact in the step [W/K], shape ``(c,)``; None if no heat was computed.
    """

    i: Ints
    j: Ints
    normal: Floats
    gap: Floats
    impulse: Floats
    slip: Floats
    sliding: NDArray[np.bool_]
    heat: Floats | None = None
    conductance: Floats | None = None


@kernel
def _slips(scene: Scene, contacts: Contacts, after: Floats) -> Floats:
    slip = np.empty(contacts.i.size)
    for c in range(contacts.i.size):
        slip[c] = contact_after(c, scene, contacts, after)[1]
    return slip


def tabulate_contacts(scene: Scene | None, contacts: Contacts | None, after: Floats) -> ContactTable:
    """Make the table; empty if there has been no step."""
    if scene is None or contacts is None:
        none = np.zeros(0, np.int32)
        return ContactTable(none, none, np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0, np.bool_))
    p_n, p_t = contacts.impulse.T
    # The local solve cuts p_t to ±μ p_n exactly, so equality means sliding; only a rounding of the product is allowed for.
    sliding = (p_n > 0.0) & (np.abs(p_t) >= contacts.frame[:, MU] * p_n * (1.0 - 1e-12))
    return ContactTable(
        contacts.i,
        contacts.j,
        contacts.frame[:, :2].copy(),
        contacts.frame[:, GAP].copy(),
        contacts.impulse,
        _slips(scene, contacts, after),
        sliding,
    )

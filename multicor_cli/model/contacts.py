"""The contacts of one step: what is stored of them, and looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

    @classmethod
    def empty(cls) -> ContactTable:
        """No contacts."""
        none, nothing = np.zeros(0, np.int32), np.zeros(0)
        return cls(none, none, np.zeros((0, 2)), nothing, np.zeros((0, 2)), nothing, np.zeros(0, np.bool_))

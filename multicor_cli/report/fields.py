"""What the grains on the page can be colored by."""

from __future__ import annotations

from multicor_cli.model.model import Floats
from multicor_cli.post import QUANTITIES, PostError, Quantity
from multicor_cli.report.quantize import Spacing
from multicor_cli.store import Run

SPACINGS: dict[str, Spacing] = {
    "speed": "square",
    "velocity": "signed",
    "velocity-y": "signed",
    "spin": "signed",
    "temperature": "even",
    "heat": "square",
    "force": "square",
}
"""How the values of each quantity are stored; the page has these quantities, in this order."""


def fields_of(run: Run) -> tuple[Quantity, ...]:
    """The quantities that a run can have."""
    return tuple(QUANTITIES[name] for name in SPACINGS if run.model.thermal is not None or not QUANTITIES[name].needs_heat)


def values_of(quantity: Quantity, run: Run, frame: int) -> Floats | None:
    """Values of the grains of a frame, shape ``(n,)``, or None where the frame has none."""
    assert quantity.of_grain is not None
    try:
        return quantity.of_grain(run, frame)
    except PostError:
        return None

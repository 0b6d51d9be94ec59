"""What users must be told about heat: the limits of one temperature per grain, and heat that reached no grain."""

from __future__ import annotations

BIOT_LIMIT = 0.1
"""Largest Biot number of a contact up to which a grain may be said to have one temperature (theory §11.1)."""


def biot_warning(biot: float) -> str | None:
    """What to say about the largest Biot number of a contact; None if there is nothing to say."""
    if biot <= BIOT_LIMIT:
        return None
    return f"one temperature per grain is questionable: Bi = H/(λ a) = {biot:.2g} > {BIOT_LIMIT:g}"


def undelivered_warning(heat: float) -> str | None:
    """What to say about the heat [J] of walls of prescribed flow that touched no grain; None if there is none."""
    if heat == 0.0:
        return None
    return f"{heat:.3g} J of the prescribed heat flow reached no grain, since nothing touched the wall"

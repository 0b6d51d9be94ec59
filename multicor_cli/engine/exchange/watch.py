"""What users must be told about grains that got lost, and about releases that fall behind."""

from __future__ import annotations


def stray_warnings(fallen: int, lost: int, behind: int) -> list[str]:
    """What to say, if anything.

    Args:
        fallen: Grains below all walls, see `multicor_cli.model.fallen`.
        lost: Grains that were removed beyond the domain.
        behind: Releases that are due and found no room.
    """
    found = []
    if fallen:
        remedy = 'close the walls, or give [domain] lost = "stop" or "remove", or [[outlets]]'
        found.append(f"{_grains(fallen)} fallen below all walls, and will fall for ever: {remedy}")
    if lost:
        found.append(f"{_grains(lost)} been removed beyond the domain")
    if behind:
        found.append(f"{_grains(behind)} not found room to be released when due: lower the rate, or enlarge the release region")
    return found


def _grains(count: int) -> str:
    return "1 grain has" if count == 1 else f"{count} grains have"

"""The recorded problem: its two solutions, and how far the family of one of them goes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from family import undetermined
from law import approach_velocity, contact_velocity, pushed, violations
from one_problem import CHANGED, WORST

from multicor_cli.engine import ContactProblem
from multicor_cli.model.model import Floats

FILE = Path(__file__).parents[2] / "tests" / "data" / "two-solutions.npz"
_STEPS = 1000


@dataclass(frozen=True)
class Recorded:
    """What is in the file.

    Attributes:
        grains: Number of bodies that move.
        contacts: Number of contacts.
        worst: Largest violation of the laws by each solution, over the largest approach velocity.
        changed: Contacts whose velocities differ by more than 1 % of it.
        largest: Largest difference over it.
        families: Of each solution, for each undetermined direction: how far one may go either way,
            in changes of the velocity at the contact that changes most, over it.
    """

    grains: int
    contacts: int
    worst: list[float]
    changed: int
    largest: float
    families: list[list[tuple[float, float]]]


def examine(path: Path = FILE) -> Recorded:
    """Check a file written by `one_problem.record`."""
    problem = ContactProblem.load(path)
    with np.load(path, allow_pickle=False) as stored:
        pairs = [(stored[f"impulse{k}"], stored[f"velocity{k}"]) for k in (0, 1)]
    one, other = (
        contact_velocity(problem, velocity) / approach_velocity(problem) for _, velocity in pairs
    )
    apart = np.linalg.norm(one - other, axis=1)
    return Recorded(
        int((problem.inverse_mass[:, 0] > 0.0).sum()),
        len(problem.pair),
        [violations(problem, impulse, velocity).worst for impulse, velocity in pairs],
        int((apart > CHANGED).sum()),
        float(apart.max()),
        [
            [_extent(problem, impulse, change) for change in undetermined(problem, impulse)]
            for impulse, _ in pairs
        ],
    )


def _extent(problem: ContactProblem, impulse: Floats, change: Floats) -> tuple[float, float]:
    """How far impulses may go along a change, either way: the last step of 0.001, up to 1, at which
    they are a solution.
    """
    ends = []
    for sign in (-1.0, 1.0):
        end = 0.0
        for step in sign * np.arange(1, _STEPS + 1) / _STEPS:
            moved = impulse + step * change
            if violations(problem, moved, pushed(problem, moved)).worst > WORST:
                break
            end = float(step)
        ends.append(end)
    return ends[0], ends[1]


def as_text(found: Recorded) -> str:
    """A few lines."""
    worst = " and ".join(f"{value:.0e}" for value in found.worst)
    head = (
        f"Recorded problem: {found.grains} grains, {found.contacts} contacts; two solutions, "
        f"worst violations {worst}; "
    )
    lines = [f"{head}{found.changed} contacts differ by more than 1 %, one by {found.largest:.3f}"]
    for number, family in enumerate(found.families, 1):
        for low, high in family:
            lines.append(
                f"Solution {number} is one of a family: velocities may change by {low:+.3f} to "
                f"{high:+.3f} along a line"
            )
    return "\n".join(lines)

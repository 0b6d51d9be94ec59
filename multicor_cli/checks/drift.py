"""Whether what is averaged over the last stage is steady."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.recorded import Recorded
from multicor_cli.model.model import Floats

_BLOCKS = 5
"""Blocks of a quarter, whose means tell how much its mean scatters."""

_SURE = 3.0
"""A drift counts from this many standard errors on."""

_SMALL = 1e-6
"""Kinetic energy over the sum of the works up to which the grains rest."""


def relative_drift(values: Floats) -> float | None:
    """Change of the mean from the third to the fourth quarter of a series, over the larger of the two.

    Returns:
        0 if the change is within three standard errors (of the means of five blocks of a quarter); None for fewer than 40 values.
    """
    length = len(values) // (4 * _BLOCKS)
    if length < 2:
        return None
    blocks = values[len(values) - 2 * _BLOCKS * length :].reshape(2, _BLOCKS, length).mean(axis=2)
    third, fourth = blocks.mean(axis=1)
    error = math.sqrt(float(blocks.var(axis=1, ddof=1).sum()) / _BLOCKS)
    change, size = abs(float(fourth - third)), max(abs(float(third)), abs(float(fourth)))
    return 0.0 if size == 0.0 or change <= _SURE * error else change / size


def _drifts(run: Recorded) -> Iterator[Measured]:
    stage = run.info["stage"]
    if stage is None or not run.run.stages:
        return
    rows = run.rows(min(int(stage), len(run.run.stages) - 1))
    if not rows.size:
        return
    for name, values in _averaged(run, rows):
        change = relative_drift(values)
        if change is not None:
            yield Measured(change, name)


def _averaged(run: Recorded, rows: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Iterator[tuple[str, Floats]]:
    kinetic = run.series("kinetic")[rows]
    if kinetic[-1] > _SMALL * run.book("terms"):
        yield "kinetic energy", kinetic
    force, at = run.series("wall_force")[rows], run.series("wall_position")[rows]
    scale = float(np.abs(force[..., :2]).mean(axis=0).max(initial=0.0)) if force.size else 0.0
    for w, name in enumerate(run.run.wall_names):
        for axis, letter in enumerate("xy"):
            if np.abs(force[:, w, axis]).mean() > 0.1 * scale:
                yield f"force in {letter} on wall {name}", force[:, w, axis]
    heights = at[:, :, 1]
    rests = np.ptp(heights, axis=0) == 0.0
    base = float(heights[0, rests].min()) if rests.any() else 0.0
    for w in run.lifted_walls:
        if not rests[w]:
            yield f"height of wall {run.run.wall_names[w]}", heights[:, w] - base


RULES: tuple[Rule[Recorded], ...] = (
    Rule(
        "drift", _drifts, warning=0.1,
        meaning="Change of the mean from the third to the fourth quarter of the last stage, over the larger of them: of the "
        "kinetic energy, of forces on walls, of heights of walls; 0 where it is within three standard errors. Means over the "
        "later half of a stage, the default of multicor post, are those of a steady state only if nothing drifts.",
        remedy="Let the stage go on for longer, or choose frames with --from and --to; in a transient flow (a collapse), nothing.",
    ),
)  # fmt: skip
"""What is checked of averages."""

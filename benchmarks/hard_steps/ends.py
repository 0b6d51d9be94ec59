"""Where runs end, with the default tolerances and with tight ones: weight, heat, run-out, piles and
angles.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

import multicor_cli
from multicor_cli.store.reader import Run

TIGHT = ["solver.tolerance_rms=2e-4", "solver.tolerance_energy=1e-3"]
"""A tenth of the defaults."""

REST = 1
"""Stage of configs/heated-bed.toml in which the bed rests."""

Measures = dict[str, float]


def _bed(run: Run) -> Measures:
    """What floor and side walls carry over the weight, in the second half of the rest: mean, and
    the window that is worst.
    """
    mass, series = run.model.grains.mass, run.series
    resting = np.flatnonzero(series["stage"] == REST)
    carried = np.abs(series["wall_force"][resting[resting.size // 2 :], :, 1].sum(axis=1))
    share = carried / (mass.sum() * abs(run.model.gravity[1]))
    frame = run.frames[-1]
    warm = frame.temperature - float(np.asarray(frame.temperature).min())
    eta = frame.position[:, 1]
    near = (eta > 3.5e-3) & (eta < 6.5e-3)
    return {
        "weight carried": float(share.mean()),
        "worst window, less 1": float(np.abs(share - 1.0).max()),
        "heating 5 mm above the floor [K]": float(warm[near].mean()),
        "heat received [J]": float(series["heat_stored"][-1]),
    }


def _center(run: Run, frame: int) -> tuple[float, float]:
    """Center of mass of the grains in a frame [m]."""
    mass, position = run.model.grains.mass, run.frames[frame].position
    x, y = (mass[:, None] * position[:, :2]).sum(axis=0) / mass.sum()
    return float(x), float(y)


def _collapse(run: Run) -> Measures:
    x, y = _center(run, -1)
    reach = float(np.percentile(run.frames[-1].position[:, 0], 98.0))
    return {
        "98 % of the grains within [mm]": 1e3 * reach,
        "center of mass, x [mm]": 1e3 * x,
        "y [mm]": 1e3 * y,
    }


def _hopper(run: Run) -> Measures:
    position = run.frames[-1].position
    return {
        "center of mass, y [mm]": 1e3 * _center(run, -1)[1],
        "98 % of the grains below [mm]": 1e3 * float(np.percentile(position[:, 1], 98.0)),
        "standard deviation of x [mm]": 1e3 * float(position[:, 0].std()),
    }


def _drum(run: Run) -> Measures:
    """Angle of the center of mass from the vertical through the axis, second half of the frames."""
    axis = run.frames[-1].wall_position[0, :2]
    centers = np.array([_center(run, k) for k in range(len(run.frames) // 2, len(run.frames))])
    return {
        "angle [°]": float(
            np.degrees(np.arctan2(centers[:, 0] - axis[0], axis[1] - centers[:, 1])).mean()
        )
    }


MEASURES: dict[str, Callable[[Run], Measures]] = {
    "heated-bed": _bed,
    "column-collapse": _collapse,
    "hopper": _hopper,
    "drum": _drum,
}


def end_of(config: Path, seed: int, overrides: list[str], directory: Path) -> tuple[Measures, int]:
    """Run a shipped scenario into ``directory``; returns what is measured at its end and the number
    of unconverged steps.
    """
    outcome = multicor_cli.run(
        config, directory, overrides=[f"scenario.seed={seed}", *overrides], threads=1
    )
    with multicor_cli.open_run(directory) as run:
        return MEASURES[config.stem](run), outcome.unconverged_steps

"""What the automatic step keeps of flows: of plane shear at other frictions and speeds and of a
mixture, a chute, a collapse, a drum and a shaken bed. ``python benchmarks/time_step/others.py``.

Each runs with the automatic step, *normal*, and with a quarter of it, at the default tolerances.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from multicor_cli import load_scenario, open_run
from multicor_cli import run as run_scenario
from multicor_cli.post import Selection, rheology
from multicor_cli.store import Run

CONFIGS = Path(__file__).parents[2] / "configs"
ACCURACIES = 1.0, 0.25
AUTOMATIC = 'solver.dt="auto"'
_UNSAFE = re.compile(r"[^A-Za-z0-9.]+")


class Flow(NamedTuple):
    """A flow, and what is measured of it.

    Attributes:
        config: Name of a shipped scenario.
        overrides: What is changed in it.
        names: What is measured.
        measure: These numbers of a finished run.
    """

    config: str
    overrides: tuple[str, ...]
    names: tuple[str, ...]
    measure: Callable[[Run], tuple[float, ...]]


def _sheared(run: Run) -> tuple[float, ...]:
    series = run.series
    began = series["time"][np.argmax(series["strain"] > 4.0)]
    mean = rheology(run, Selection(start=began), margin=8.0).mean
    return mean["friction_walls"], mean["solid_fraction"]


def _chute(run: Run) -> tuple[float, ...]:
    """Mean velocity of the layer over √(g d̄), and height of its center over d̄, later part."""
    model, frames = run.model, run.frames
    mass, diameter = model.grains.mass, model.mean_diameter
    late = [frames[k] for k in range(int(0.6 * len(frames)), len(frames))]
    speed = np.mean([np.average(frame.velocity[:, 0], weights=mass) for frame in late])
    height = np.mean([np.average(frame.position[:, 1], weights=mass) for frame in late])
    return float(speed) / float(np.sqrt(9.81 * diameter)), float(height) / diameter


def _center(run: Run) -> tuple[float, ...]:
    """Where the mass is at the end [mm]."""
    mass, position = run.model.grains.mass, run.frames[-1].position
    x, y = (float(np.average(position[:, d], weights=mass)) for d in range(2))
    return 1e3 * x, 1e3 * y


def _drum(run: Run) -> tuple[float, ...]:
    """Angle of the center of mass from the vertical through the axis, later half [degrees]."""
    mass, frames = run.model.grains.mass, run.frames
    axis = frames[-1].wall_position[0, :2]
    lever = np.mean(
        [
            np.average(frames[k].position[:, :2], axis=0, weights=mass) - axis
            for k in range(len(frames) // 2, len(frames))
        ],
        axis=0,
    )
    return (float(np.degrees(np.arctan2(abs(lever[0]), -lever[1]))),)


def _shaken(run: Run) -> tuple[float, ...]:
    """Energy of spin over M g d̄, and height of the center over d̄, after a quarter of the time."""
    grains, frames, diameter = run.grains, run.frames, run.model.mean_diameter
    late = [frames[k] for k in range(len(frames) // 4, len(frames))]
    spun = np.mean([np.sum(0.5 * grains.inertia * frame.spin**2) for frame in late])
    height = np.mean([np.average(frame.position[:, 1], weights=grains.mass) for frame in late])
    return float(spun / (grains.mass.sum() * 9.81 * diameter)), float(height) / diameter


_SHAKEN = (
    "variables.layers=10",
    "variables.Gamma=6.4",
    "variables.f=63",
    "variables.cycles=80",
    "output.frame_interval== 1 / (10 * f)",
    "output.series_interval== 1 / (10 * f)",
)
_MIXTURE = (
    'particles.0.sizes={kind="list",radii=[0.25e-3,0.5e-3,0.75e-3],by="mass"}',
    "particles.0.count=2207",  # whose area is that of the shipped ones
)
_SHEARS = (0.5, 0.1), (0.6, 0.1), (0.8, 0.1), (0.5, 0.03), (0.8, 0.03)
"""μ, I."""

FLOWS = {
    **{
        f"shear, μ = {friction}, I = {inertial}": Flow(
            "shear-gravity-free",
            (f"contacts.0.friction={friction}", f"variables.I={inertial}"),
            ("μ*", "ν"),
            _sheared,
        )
        for friction, inertial in _SHEARS
    },
    "shear, 1-2-3 mixture": Flow("shear-gravity-free", _MIXTURE, ("μ*", "ν"), _sheared),
    "chute, 24°": Flow("chute", (), ("v/√(g d̄)", "height of the center/d̄"), _chute),
    "collapse": Flow("column-collapse", (), ("center x [mm]", "center y [mm]"), _center),
    "drum": Flow("drum", (), ("angle of the center [°]",), _drum),
    **{
        f"shaken bed, e = {bounce}": Flow(
            "vibrated-bed",
            (*_SHAKEN, f"contacts.0.restitution={bounce}"),
            ("energy of spin/(M g d̄)", "height of the center/d̄"),
            _shaken,
        )
        for bounce in (0.3, 0.8)
    },
}


def main() -> int:
    """Run what is missing and print the table; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/time_step/others.py",
        description="What the automatic step keeps of flows.",
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--flows", nargs="+", choices=FLOWS, default=list(FLOWS))
    parser.add_argument("--runs", type=Path, metavar="DIR", default=Path("runs/time-step-others"))
    options = parser.parse_args()
    for name in options.flows:
        flow = FLOWS[name]
        found = [
            [
                _measured(flow, accuracy, seed, options.runs / _UNSAFE.sub("-", name))
                for seed in options.seeds
            ]
            for accuracy in ACCURACIES
        ]
        mean = np.mean(found, axis=1)
        error = np.std(found, axis=1, ddof=1) / np.sqrt(len(options.seeds))
        for k, what in enumerate(flow.names):
            change = mean[0, k] - mean[1, k]
            print(
                f"{name:24s} {what:26s} {mean[0, k]:9.4f} ±{error[0, k]:.4f}"
                f"  {mean[1, k]:9.4f} ±{error[1, k]:.4f}"
                f"  {change:+.4f} ±{np.hypot(*error[:, k]):.4f}",
                flush=True,
            )
    return 0


def _measured(flow: Flow, accuracy: float, seed: int, runs: Path) -> tuple[float, ...]:
    directory = runs / f"{accuracy:g}-{seed}"
    if not directory.exists():
        print(directory, file=sys.stderr, flush=True)
        changes = [AUTOMATIC, f"solver.accuracy={accuracy}", f"scenario.seed={seed}"]
        scenario = load_scenario(
            CONFIGS / f"{flow.config}.toml", overrides=[*flow.overrides, *changes]
        )
        run_scenario(scenario, directory, threads=1)
    with open_run(directory) as run:
        return flow.measure(run)


if __name__ == "__main__":
    sys.exit(main())

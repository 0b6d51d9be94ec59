"""How long contacts last, and how soon they come back: what a longer step cannot tell apart.

    python benchmarks/time_step/spells.py                  # I = 0.1 and 0.03, μ = 0.8; five minutes

Plane shear as in `cases`, with a step of 0.0125 τ. A *spell* is a time in which a pair of grains
carries an impulse in every step.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from cases import CONFIG, LOAD, SPEEDS, TAU, Case

from multicor_cli import load_scenario
from multicor_cli.engine import Engine, Orders, Settings
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.packing import build

STEP, TOLERANCE = 0.0125, 1e-2
TIMES = (0.025, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Durations that are looked at, over τ."""


@dataclass
class Spells:
    """Spells that have ended: their lengths in steps, normal impulses [N s], and the steps the pair
    had been open before (inf).
    """

    length: list[int]
    impulse: list[float]
    pause: list[float]


def watch(inertial: float, friction: float, settle: float, strain: float) -> tuple[Spells, float]:
    """Spells of a flow; ``strain`` follows after ``settle``. Also returns the duration over τ times
    the number of grains.
    """
    case = Case(inertial, STEP, TOLERANCE, 1, strain, friction)
    model, state = build(load_scenario(CONFIG, overrides=case.overrides()))
    engine = Engine(model, state, threads=1)
    top = WallDrive(
        x=DofDrive(velocity=Constant(SPEEDS[inertial])), y=DofDrive(force=Constant(-LOAD))
    )
    engine.begin(Orders([WallDrive(), top], _settings()))
    dt = STEP * TAU
    height = float(state.wall_position[1, 1] - state.wall_position[0, 1])
    steps = [round(part * height / SPEEDS[inertial] / dt) for part in (settle, strain)]
    spells, count = Spells([], [], []), model.grain_count
    began: dict[int, tuple[int, float]] = {}  # of each spell: first step, impulse so far
    ended: dict[int, int] = {}  # of each pair: the step after its last spell
    before: dict[int, float] = {}  # of each spell: the steps the pair had been open
    for k in range(sum(steps)):
        engine.step(dt, k * dt)
        if k < steps[0]:
            continue
        inner = state.contact_j < count
        keys = (state.contact_i[inner].astype(np.int64) * count + state.contact_j[inner]).tolist()
        now = dict(zip(keys, state.contact_impulse[inner, 0].tolist(), strict=True))
        for key in [key for key in began if key not in now]:
            first, impulse = began.pop(key)
            spells.length.append(k - first)
            spells.impulse.append(impulse)
            spells.pause.append(before.pop(key))
            ended[key] = k
        for key, impulse in now.items():
            if key in began:
                first, so_far = began[key]
                began[key] = (first, so_far + impulse)
            else:
                began[key] = (k, impulse)
                before[key] = k - ended[key] if key in ended else np.inf
    return spells, steps[1] * STEP * count


def _settings() -> Settings:
    return Settings(
        tolerance_rms=TOLERANCE,
        tolerance_max=min(1.0, 50.0 * TOLERANCE),
        tolerance_energy=10.0 * TOLERANCE,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/time_step/spells.py", description="How long contacts last."
    )
    parser.add_argument(
        "--inertial",
        type=float,
        nargs="+",
        choices=SPEEDS,
        default=[0.1, 0.03],
        help="inertial numbers",
    )
    parser.add_argument(
        "--friction",
        type=float,
        default=0.8,
        metavar="MU",
        help="coefficient of friction of the discs",
    )
    parser.add_argument(
        "--strain", type=float, default=2.0, help="strain that is watched, after one of 3"
    )
    options = parser.parse_args()
    for inertial in options.inertial:
        spells, time = watch(inertial, options.friction, 3.0, options.strain)
        length, impulse, pause = (
            np.array(part) for part in (spells.length, spells.impulse, spells.pause)
        )
        print(
            f"I = {inertial:g}, μ = {options.friction:g}: {2.0 * length.size / time:.2f} new "
            "contacts per grain and τ"
        )
        print(
            f"{'T/τ':>6} {'impulse in spells up to T':>26} {'spells up to T':>15} "
            f"{'open for up to T before':>24}"
        )
        for limit in TIMES:
            short, back = length * STEP <= limit * 1.0001, pause * STEP <= limit * 1.0001
            print(
                (
                    f"{limit:6g} {impulse[short].sum() / impulse.sum():26.2f} "
                    f"{short.mean():15.2f} {back.mean():24.2f}"
                ),
                flush=True,
            )


if __name__ == "__main__":
    main()

"""A dense bed on a floor that vibrates, against an event-driven program: ``python
benchmarks/gases/shaken.py``.

The bed of `benchmarks/time_step/others.py`: 190 discs in ten layers, periodic in x, and a floor
with accelerations of up to 6.4 g. The reference takes one impact after the other, each as
`reference.py` does; where a grain has hit the same thing a time ago that is shorter than that of a
contact (``--contact``), the impact is elastic, or beds at rest would have infinitely many (the TC
model of Luding & McNamara 1998).
"""

from __future__ import annotations

import argparse
import os
import tempfile
from math import cos, floor, inf, pi, sin, sqrt
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from numba import njit
from reference import strike

from multicor_cli import Scenario, load_scenario, open_run
from multicor_cli import run as run_scenario

BED = Path(__file__).parents[2] / "configs" / "vibrated-bed.toml"
GRAVITY, FREQUENCY, PEAK = 9.81, 63.0, 6.4
DISC = 2.0
"""m a²/I."""

SHRUNK = 1.0 - 1e-4
"""Radii of the reference over those of the bed, which touch."""


@njit
def _floor_time(y, v, radius, now, end):
    """How long a disc falls to the floor [s]: from below, by a bound of the acceleration."""
    omega = 2.0 * pi * FREQUENCY
    amplitude, t = PEAK * GRAVITY / omega**2, 0.0
    while t < end:
        level, speed = (
            amplitude * sin(omega * (now + t)),
            amplitude * omega * cos(omega * (now + t)),
        )
        gap, rate = y + t * (v - 0.5 * t * GRAVITY) - radius - level, v - GRAVITY * t - speed
        if gap <= 1e-13 * radius and rate < 0.0:
            return t
        room, falls = max(gap, 0.0), (1.0 + PEAK) * GRAVITY
        root = sqrt(rate * rate + 2.0 * falls * room)
        t += max(2.0 * room / (root - rate) if rate < 0.0 else (rate + root) / falls, 1e-16)
    return inf


@njit
def _next_event(place, velocity, radius, period, i, now, end):
    """When and with whom disc i meets next: another disc, or the floor, n."""
    n = radius.size
    best, partner = _floor_time(place[i, 1], velocity[i, 1], radius[i], now, end - now), n
    for j in range(n):
        dx, dy = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1]
        dx -= period * floor(dx / period + 0.5)
        u, v = velocity[i, 0] - velocity[j, 0], velocity[i, 1] - velocity[j, 1]
        along, reach = dx * u + dy * v, radius[i] + radius[j]
        if j == i or along >= 0.0:
            continue
        room = max(dx * dx + dy * dy - reach * reach, 0.0)
        square = along * along - (u * u + v * v) * room
        if square > 0.0 and room / (sqrt(square) - along) < best:
            best, partner = room / (sqrt(square) - along), j
    return now + best, partner


@njit
def _collide(place, velocity, surface, mass, period, e, mu, i, j, now):
    """The impact of disc i on another, or on the floor."""
    omega, nx, ny = 2.0 * pi * FREQUENCY, 0.0, 1.0
    if j < mass.size:
        dx, dy = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1]
        dx -= period * floor(dx / period + 0.5)
        nx, ny = dx / sqrt(dx * dx + dy * dy), dy / sqrt(dx * dx + dy * dy)
    speed = PEAK * GRAVITY / omega * cos(omega * now)
    strike(velocity, surface, mass, e, mu, DISC, i, j, nx, ny, speed)


@njit
def simulate(place, velocity, surface, radius, mass, period, e, mu, contact, last, now, end):
    """Let discs fly from a time to the ``end`` [s], in which none goes far; returns impacts.

    ``last`` are times of the last impact of each pair, shape ``(n, n + 1)``; it and the first three
    are **modified**.
    """
    n, impacts = radius.size, 0
    time, partner = np.empty(n), np.empty(n, np.int64)
    for i in range(n):
        time[i], partner[i] = _next_event(place, velocity, radius, period, i, now, end)
    while True:
        i = np.argmin(time)
        step = min(time[i], end) - now
        for k in range(n):
            place[k, 0] += step * velocity[k, 0]
            place[k, 1] += step * (velocity[k, 1] - 0.5 * step * GRAVITY)
            velocity[k, 1] -= step * GRAVITY
        now += step
        if time[i] >= end:
            return impacts
        j = partner[i]
        a, b = (i, j) if j == n else (max(i, j), min(i, j))
        lasts = now - last[a, b] < contact
        last[a, b] = now
        _collide(place, velocity, surface, mass, period, 1.0 if lasts else e, mu, i, j, now)
        impacts += 1
        for k in range(n):
            if k in (i, j) or partner[k] == i or (j < n and partner[k] == j):
                time[k], partner[k] = _next_event(place, velocity, radius, period, k, now, end)
                m = partner[k]
                if m < n and time[k] < time[m]:
                    time[m], partner[m] = time[k], k


def bed_of(
    cycles: int, restitution: float, friction: float, seed: int, accuracy: float
) -> Scenario:
    """The scenario of the program; ten frames in a cycle."""
    return load_scenario(
        BED,
        overrides=[
            "variables.layers=10", f"variables.Gamma={PEAK}", f"variables.f={FREQUENCY}",
            f"variables.cycles={cycles}", f"contacts.0.restitution={restitution}",
            f"contacts.0.friction={friction}", f"scenario.seed={seed}", 'solver.dt="auto"',
            f"solver.accuracy={accuracy}", "output.frame_interval== 1 / (10 * f)",
            "output.series_interval== 1 / (10 * f)",
        ],
    )  # fmt: skip


def numbers(mass, diameter, place, velocity, spun):
    """Energies of spin and of motion about the mean over M g d̄, height of the center over d̄."""
    u = velocity - np.average(velocity, axis=0, weights=mass)
    scale = mass.sum() * GRAVITY * diameter
    x, y = 0.5 * mass @ u**2 / scale
    return np.array([spun / scale, x, y, np.average(place[:, 1], weights=mass) / diameter])


def of_program(scenario: Scenario) -> tuple[np.ndarray, tuple]:
    """These numbers after a quarter of the time, and with what the reference begins."""
    with tempfile.TemporaryDirectory() as folder:
        run_scenario(scenario, Path(folder) / "run", threads=1)
        with open_run(Path(folder) / "run") as run:
            grains, frames, diameter = run.grains, run.frames, run.model.mean_diameter
            found = [
                numbers(
                    grains.mass, diameter, frame.position[:, :2], frame.velocity[:, :2],
                    0.5 * grains.inertia @ frame.spin**2,
                )
                for frame in (frames[k] for k in range(len(frames) // 4, len(frames)))
            ]  # fmt: skip
            place = np.array(frames[0].position[:, :2])
            start = place, np.array(grains.radius), np.array(grains.mass), run.model.period
    return np.mean(found, axis=0), (*start, diameter)


def of_reference(
    start: tuple, cycles: int, restitution: float, friction: float, contact: float
) -> np.ndarray:
    place, radius, mass, period, diameter = start
    place, velocity, surface = place.copy(), np.zeros_like(place), np.zeros(radius.size)
    last, found = np.full((radius.size, radius.size + 1), -inf), []
    for k in range(10 * cycles):
        begin, end = (step / (10.0 * FREQUENCY) for step in (k, k + 1))
        simulate(
            place, velocity, surface, SHRUNK * radius, mass, period, restitution, friction, contact,
            last, begin, end,
        )  # fmt: skip
        found.append(numbers(mass, diameter, place, velocity, 0.5 * mass @ surface**2 / DISC))
    return np.mean(found[len(found) // 4 :], axis=0)


def main() -> int:
    """Compare and print; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/gases/shaken.py",
        description="Energies and height of a shaken bed, against an event-driven reference.",
    )
    parser.add_argument("--restitution", type=float, nargs="+", default=[0.8], metavar="E")
    parser.add_argument("--friction", type=float, default=0.4, help="[%(default)s]")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3], help="[%(default)s]")
    parser.add_argument("--cycles", type=int, default=80, help="of the floor [%(default)s]")
    parser.add_argument(
        "--accuracies", type=float, nargs="*", default=[4.0, 1.0, 0.25],
        help="of the automatic step [%(default)s]",
    )  # fmt: skip
    parser.add_argument(
        "--contact", type=float, nargs="*", default=[1e-5, 5e-5],
        help="times of a contact in the reference [s] [%(default)s]",
    )  # fmt: skip
    options = parser.parse_args()
    print("e | what | energy of spin | of x | of y, over M g d̄ | height of the center over d̄")
    for restitution in options.restitution:
        case, found = (options.cycles, restitution, options.friction), {}
        for seed in options.seeds:
            for accuracy in options.accuracies:
                of_it, start = of_program(bed_of(*case, seed, accuracy))
                found.setdefault(f"accuracy {accuracy:g}", []).append(of_it)
            for contact in options.contact:
                of_it = of_reference(start, *case, contact)
                found.setdefault(f"reference, {contact:g} s", []).append(of_it)
        for name, rows in found.items():
            mean = np.mean(rows, axis=0)
            error = np.std(rows, axis=0, ddof=min(1, len(rows) - 1)) / np.sqrt(len(rows))
            cells = (f"{value:.4f} ± {more:.4f}" for value, more in zip(mean, error, strict=True))
            print(f"{restitution:g} | {name} | {' | '.join(cells)}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Time and memory of every ``multicor post`` command on a large made-up run.

    python benchmarks/post_speed.py [--grains 10000] [--frames 200] [--keep DIR]

The run is written through the store, as a real one is: a periodic layer of discs on a lattice
between two rough walls, sheared, with heat, with six neighbors per grain of which five carry a
force. Every command runs in a process of its own; memory is its peak.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from multicor_cli.model import (
    HEAT_BOOK_NAMES,
    ContactLaws,
    Grains,
    Model,
    ShapeKind,
    State,
    Thermal,
    Walls,
    WallShapes,
)
from multicor_cli.model.contacts import ContactTable
from multicor_cli.store import RunDirectory, Snapshot

ROOT = Path(__file__).parents[1]
RADIUS = 0.5e-3
INTERVAL = 1e-3
SPEED = 1.0
ROWS_PER_FRAME = 10
MEMORY_LIMIT = 1.0  # GB

COMMANDS: list[tuple[list[str], float]] = [
    (["profile", "--frames", ":", "--of", of], 10.0)
    for of in (
        "velocity",
        "heat",
        "solid-fraction",
        "granular-temperature",
        "coordination",
        "stress",
        "kinetic-stress",
        "d2min",
    )
] + [
    (["theta-eta", "--wall", "top"], 10.0),
    *(
        (["map", "--of", of, "--plot", f"{of}.png"], 10.0)
        for of in ("temperature", "fluctuation", "heat-flux", "stress")
    ),
    (["forces", "--plot", "forces.png"], 10.0),
    (["forces", "--distribution", "--frames", ":", "--plot", "distribution.png"], 10.0),
    (["forces", "--angles", "--frames", ":", "--plot", "angles.png"], 10.0),
    (["rheology", "--plot", "rheology.png"], 10.0),
    (["forces", "--mobilization", "--frames", ":", "--plot", "mobilization.png"], 10.0),
    (["fabric", "--frames", ":", "--plot", "fabric.png"], 10.0),
    (["lifetimes", "--frames", ":", "--plot", "lifetimes.png"], 10.0),
    (["chains", "--frames", ":", "--plot", "chains.png"], 10.0),
    (["clusters", "--frames", ":", "--plot", "clusters.png"], 10.0),
    (["conductivity", "--network", "--frames", ":", "--plot", "conductivity.png"], 12.0),
    (["heat-network", "--plot", "heat.png"], 10.0),
    (["wall-heat", "--frames", ":", "--plot", "walls.png"], 10.0),
    (["hot-spots", "--frames", ":", "--plot", "spots.png"], 10.0),
    (["diffusion", "--frames", ":", "--plot", "diffusion.png"], 10.0),
    (["structure", "--frames", ":", "--plot", "structure.png"], 10.0),
    (["mixing", "--plot", "mixing.png"], 10.0),
    (["mixing", "--profile", "share", "--plot", "segregation.png"], 10.0),
    (["avalanches", "--of", "kinetic", "--plot", "drops.png"], 10.0),
    (["structure", "--voronoi", "--frames", ":", "--plot", "cells.png"], 15.0),
    (["correlation", "--frames", ":", "--plot", "correlation.png"], 15.0),
    (["fields", "--frames", ":", "--plot", "fields.png"], 36.0),
    (["energy", "--plot", "energy.png"], 10.0),
    (["compare", "DIR"], 10.0),
]
"""Commands with the seconds that they may take of 10⁴ grains and 200 frames: one and a half times
what they take on one quiet core or twice, ten at least."""


SCENARIO = """
[scenario]
name = "made-up"
[materials.steel]
density = 7500.0
young = 193e9
poisson = 0.29
conductivity = 15.0
heat_capacity = 500.0
"""


def lattice(grains: int) -> tuple[np.ndarray, int, int]:
    """Centers of a hexagonal lattice, columns and rows."""
    columns = round(np.sqrt(grains))
    rows = -(-grains // columns)
    k = np.arange(columns * rows)
    x = (k % columns + 0.5 * (k // columns % 2) + 0.25) * 2.0 * RADIUS
    y = 2.0 * RADIUS + (k // columns) * np.sqrt(3.0) * RADIUS
    return np.column_stack([x, y]), columns, rows


def make_model(columns: int, rows: int) -> Model:
    n = columns * rows
    radius, zeros = np.full(n, RADIUS), np.zeros(n, np.int32)
    mass = 1000.0 * np.pi * radius**2
    height = 4.0 * RADIUS + (rows - 1) * np.sqrt(3.0) * RADIUS
    glued = np.array(
        [[2.0 * RADIUS * (k + 0.5), y, RADIUS, 0.0] for y in (0.0, height) for k in range(columns)]
    )
    return Model(
        grains=Grains(
            radius, mass, 0.5 * mass * radius**2, zeros, np.arange(n, dtype=np.int32) % 2
        ),
        shapes=WallShapes(
            np.full(2 * columns, ShapeKind.DISC, np.int32),
            np.repeat(np.array([0, 1], np.int32), columns),
            glued,
            np.zeros(2 * columns, np.int32),
        ),
        walls=Walls(
            ("bottom", "top"),
            np.full(2, np.nan),
            np.full(2, np.nan),
            np.zeros(2, np.bool_),
            np.ones(2),
        ),
        laws=ContactLaws(
            np.full((1, 1), 0.5),
            np.zeros((1, 1)),
            np.full((1, 1), -1, np.int32),
            np.zeros(1, np.int32),
            np.zeros(0),
            np.zeros(0),
        ),
        materials=("steel",),
        groups=("even", "odd"),
        period=2.0 * RADIUS * columns,
        gravity=np.zeros(2),
        shape_factor=2.0,
        thermal=Thermal(np.full(n, 1e-3), np.full(n, 300.0), np.full(n, 1e-6)),
    )


def contact_pairs(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbors of the lattice in x and in the row above, and the walls: i, j and normal from j to
    i.
    """
    n = columns * rows
    k = np.arange(n)
    row, column = k // columns, k % columns
    right = row * columns + (column + 1) % columns
    # The centers of odd rows are shifted to the right by a radius.
    up = [(row + 1) * columns + (column + row % 2 - 1 + side) % columns for side in (0, 1)]
    inner = row < rows - 1
    half, root = 0.5, np.sqrt(0.75)
    first = [
        (k, right, (-1.0, 0.0)),
        (k[inner], up[0][inner], (half, -root)),
        (k[inner], up[1][inner], (-half, -root)),
    ]
    parts = []
    for i, j, normal in first:
        sign = np.where(i < j, 1.0, -1.0)
        parts.append((np.minimum(i, j), np.maximum(i, j), sign[:, np.newaxis] * np.array(normal)))
    low, high = k[row == 0], k[row == rows - 1]
    parts.append((low, n + low % columns, np.tile([0.0, 1.0], (low.size, 1))))
    parts.append((high, n + columns + high % columns, np.tile([0.0, -1.0], (high.size, 1))))
    i, j, normal = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((j, i))
    return i[order].astype(np.int32), j[order].astype(np.int32), normal[order]


def write_run(path: Path, grains: int, frames: int) -> None:
    rng = np.random.default_rng(1)
    centers, columns, rows = lattice(grains)
    model = make_model(columns, rows)
    i, j, normal = contact_pairs(columns, rows)
    n, c = model.grain_count, i.size
    height = float(centers[-1, 1]) + 2.0 * RADIUS
    scenario = SCENARIO
    with RunDirectory.create(path, scenario, scenario, {"seed": 1}, stages=("shear",)) as run:
        writer = run.writer(model)
        state = State.at_rest(model, centers)
        state.wall_temperature[:] = 300.0, 320.0
        flow = SPEED * centers[:, 1] / height
        for frame in range(frames):
            for _ in range(ROWS_PER_FRAME if frame else 1):
                if frame:
                    _advance(state)
                writer.series_row(Snapshot(state, model))
            moved = centers[:, 0] + flow * state.time
            state.image = np.floor(moved / model.period).astype(np.int64)
            state.position[:, 0] = moved - state.image * model.period
            state.velocity[:, 0] = flow + 0.05 * rng.standard_normal(n)
            state.velocity[:, 1] = 0.05 * rng.standard_normal(n)
            state.velocity[:, 2] = -0.5 * SPEED / height
            state.position[:, 2] -= 0.5 * SPEED / height * INTERVAL
            state.wall_velocity[1, 0] = SPEED
            state.heat += 1e-6 * rng.random(n)
            state.generated += 1e-6 * rng.random(n)
            force = rng.exponential(1.0, (c, 2)) * [1.0, 0.2] * (rng.random((c, 1)) < 5.0 / 6.0)
            none, slip = np.zeros(c), 0.1 * rng.standard_normal(c)
            conductance = 1e-3 * np.cbrt(force[:, 0])
            contacts = ContactTable(
                i,
                j,
                normal,
                none,
                force * state.last_dt,
                slip,
                force[:, 1] > 0.3,
                none,
                conductance,
            )
            writer.frame(Snapshot(state, model, contacts if frame else None))
            if frame % 10 == 9 or frame == frames - 1:
                run.checkpoint(state, writer)
        run.finish("finished")


def _advance(state: State) -> None:
    state.step += 1
    state.time = state.step * INTERVAL / ROWS_PER_FRAME
    state.last_dt = INTERVAL / ROWS_PER_FRAME
    state.window[:2] = state.last_dt, 1.0
    state.window_wall_impulse[:] = np.array([[0.3, -1.0, 0.0], [-0.3, 1.0, 0.0]]) * state.last_dt
    state.books += 1e-3
    state.books[0] = 1e-3 * (state.step // ROWS_PER_FRAME % 7)  # kinetic energy, which drops
    state.heat_books[HEAT_BOOK_NAMES.index("stored")] += 1e-3


def measure(arguments: list[str], run: Path, where: Path) -> tuple[float, float, float, str]:
    """Wall time [s], processor time [s], peak memory [GB] and what went wrong of one command."""
    words = [
        str(run) if word == "DIR" else str(where / word) if word.endswith(".png") else word
        for word in arguments
    ]
    command = [sys.executable, "-m", "multicor_cli", "post", words[0], str(run), *words[1:]]
    began = time.perf_counter()
    with (where / "stderr").open("w+") as errors:
        process = subprocess.Popen(
            command,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        took = time.perf_counter() - began
        errors.seek(0)
        message = errors.read().strip() if process.returncode else ""
    return took, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024.0 / 1e9, message


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=10_000)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--keep", type=Path, help="where the run is or is to be kept")
    parser.add_argument("--only", help="only commands that contain this word")
    options = parser.parse_args()
    too_slow = 0
    with tempfile.TemporaryDirectory() as scratch:
        run = options.keep or Path(scratch) / "run"
        if not run.exists():
            began = time.perf_counter()
            write_run(run, options.grains, options.frames)
            size = (run / "results.h5").stat().st_size / 1e9
            print(
                f"wrote {options.grains} grains x {options.frames} frames, {size:.2f} GB, "
                f"{time.perf_counter() - began:.0f} s"
            )
        print(f"{'command':<60} {'time':>8} {'limit':>8} {'processor':>9} {'memory':>9}")
        for arguments, limit in COMMANDS:
            name = " ".join(arguments)
            if options.only and options.only not in name:
                continue
            took, worked, memory, message = measure(arguments, run, Path(scratch))
            is_over = took > limit or memory > MEMORY_LIMIT or message
            too_slow += bool(is_over)
            print(
                (
                    f"{name:<60} {took:6.1f} s {limit:6.0f} s {worked:7.1f} s {memory:6.2f} "
                    f"GB{'  over' if is_over else ''} {message}"
                ),
                flush=True,
            )
    return 1 if too_slow else 0


if __name__ == "__main__":
    sys.exit(main())

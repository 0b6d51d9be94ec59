"""The sheared layer in LAMMPS and LIGGGHTS."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from case import FlowPlan, Frames, Layer, SoftContact, sphere_mass
from gran import (
    Bodies,
    Dialect,
    Tuning,
    begin_lines,
    candidates,
    choose,
    read_averages,
    read_dump,
    run_script,
    write_bodies,
)

_TRIAL_STEPS = 4_000
_SAMPLED_EVERY = 10  # steps between two samples of the force on the wall


@dataclass(frozen=True)
class GranRun:
    """What a run took.

    Attributes:
        seconds: Time of the measured steps [s].
        steps: Number of measured steps.
        dt: Time step [s].
        frames: What was seen at equal strains.
    """

    seconds: float
    steps: int
    dt: float
    frames: Frames


@dataclass(frozen=True)
class GranShear:
    """One of the two programs in front of the sheared layer.

    Attributes:
        dialect: Which program.
        program: Path of it.
        cores: Number of MPI ranks.
        substeps: Time steps in a collision of the two smallest grains.
    """

    dialect: Dialect
    program: str
    cores: int
    substeps: float

    def tune(self, layer: Layer, contact: SoftContact, folder: Path) -> Tuning:
        """Try the candidates on the first steps; returns the best choice of each kind."""
        dt = contact.collision / self.substeps
        trials = {}
        for tuning in candidates(self.dialect, self.cores):
            write_layer(folder / "grains.data", layer)
            lines = [
                *layer_lines(self.dialect, layer, contact, tuning, dt),
                f"run {_TRIAL_STEPS}",
                f"run {_TRIAL_STEPS}",
            ]
            trials[tuning] = run_script(self.dialect, self.program, lines, folder, self.cores)[
                -1
            ].seconds
        return choose(trials)

    def flow(
        self, layer: Layer, contact: SoftContact, tuning: Tuning, plan: FlowPlan, folder: Path
    ) -> GranRun:
        """Let the layer flow, then measure it."""
        duration = layer.duration(plan.between)
        every = (
            math.ceil(duration * self.substeps / contact.collision / _SAMPLED_EVERY)
            * _SAMPLED_EVERY
        )
        dt = duration / every
        write_layer(folder / "grains.data", layer)
        lines = layer_lines(self.dialect, layer, contact, tuning, dt)
        if plan.settle > 0.0:
            lines.append(f"run {round(plan.settle / plan.between) * every}")
        lines += [*_output_lines(self.dialect, every), f"run {plan.frames * every}"]
        loop = run_script(self.dialect, self.program, lines, folder, self.cores)[-1]
        return GranRun(loop.seconds, loop.steps, dt, read_frames(folder, layer))


def write_layer(path: Path, layer: Layer) -> None:
    """Write flowing grains, lower and upper wall; the upper wall's grains share its mass evenly."""
    top = len(layer.top.radius)
    count = len(layer.radius) + len(layer.bottom.radius)
    share = layer.wall_mass / top
    density = np.concatenate(
        [np.full(count, layer.density), share / sphere_mass(layer.top.radius, 1.0)]
    )
    velocity = np.zeros((count + top, 3))
    velocity[: len(layer.radius)] = layer.velocity
    velocity[count:, 0], velocity[count:, 1] = layer.speed, layer.rise
    position = np.concatenate([layer.position, layer.bottom.position, layer.top.position])
    position[:, 0] = np.mod(position[:, 0], layer.period)
    low, high = float(position[:, 1].min()), float(position[:, 1].max())
    room = 0.1 * (high - low)
    write_bodies(
        path,
        Bodies(
            position,
            velocity,
            layer.all_radius,
            density,
            (0.0, low - room),
            (layer.period, high + room),
        ),
    )


def layer_lines(
    dialect: Dialect, layer: Layer, contact: SoftContact, tuning: Tuning, dt: float
) -> list[str]:
    """The script up to its first ``run``.

    The upper wall moves as one: the forces along y on its grains are averaged, the load's share is
    added, and those along x are dropped. Its damper is ``fix viscous``, which also acts along x,
    where its force is known: `read_frames` takes it out.
    """
    n, k, top = len(layer.radius), len(layer.bottom.radius), len(layer.top.radius)
    return [
        *begin_lines(dialect, contact, tuning, float(layer.radius.max())),
        f"group flow id 1:{n}", f"group bottom id {n + 1}:{n + k}",
        f"group top id {n + k + 1}:{n + k + top}",
        "neigh_modify exclude group bottom bottom", "neigh_modify exclude group top top",
        f"timestep {dt!r}",
        "fix move flow nve/sphere", "fix carry top nve", "fix hold bottom freeze",
        f"fix damper top viscous {layer.wall_damping / top!r}",
        f"fix load top aveforce NULL {-layer.load / top!r} NULL",
        "fix drive top setforce 0.0 NULL 0.0",
        "thermo 1000000",
    ]  # fmt: skip


def _output_lines(dialect: Dialect, every: int) -> list[str]:
    return [
        f"dump seen all custom {every} seen.txt id x y vx",
        f"dump_modify seen first no {dialect.dump_format(3)}",
        (
            f"fix force all ave/time {_SAMPLED_EVERY} {every // _SAMPLED_EVERY} {every} "
            "f_drive[1] f_load[2] file force.txt"
        ),
    ]


def read_frames(folder: Path, layer: Layer) -> Frames:
    """Frames of a run; the first of them, at the start of the measurement, is left out."""
    seen = read_dump(folder / "seen.txt", 3)
    force = read_averages(folder / "force.txt")
    count = min(len(seen), len(force))
    seen, force = seen[-count:], force[-count:]
    drag = np.array([layer.wall_damping * layer.speed, 0.0])  # what the damper adds along x
    return Frames(seen[:, :, :2], seen[:, : len(layer.radius), 2], force + drag)

"""Simple shear in a cell that is periodic in both directions, beside soft grains in LAMMPS.

``python benchmarks/cell``: both at the same solid fraction and rate, from the same packing; soft
grains with two restitutions, rigid ones with two time steps.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from multicor_cli.engine import Engine, Orders
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import Model
from multicor_cli.model.state import State
from multicor_cli.packing import build
from multicor_cli.running.time_step import Scales
from multicor_cli.scenario import parse_scenario

COUNT, KAPPA, RESTITUTIONS, SHARES = 900, 1e4, (0.1, 0.02), (1.0, 0.5)
"""κ; e of the soft grains (0 of rigid ones); time steps of rigid ones over the automatic one."""
ROWS = (
    (0.4, 0.1, 0.7805), (0.4, 0.2, 0.752), (0.5, 0.1, 0.776), (0.5, 0.3, 0.714), (0.8, 0.1, 0.760),
)  # fmt: skip
"""μ, γ̇ √(m/P₀) and ν, so that P is about P₀."""

_SCENARIO = """
[scenario]
name = "cell"
seed = {seed}
[domain]
size = [37.0, 37.0]
periodic = ["x", "y"]
gravity = [0.0, 0.0]
[materials.stuff]
density = {density}
[[contacts]]
pair = ["*", "*"]
friction = {friction}
[[particles]]
name = "discs"
material = "stuff"
shape = "disc"
thickness = 1.0
sizes = {{ kind = "uniform", min = 0.4, max = 0.6 }}
count = {count}
packing = {{ kind = "random" }}
[[loading]]
duration = 1.0
cell = {{ xx = {{ stress = 1.0 }}, yy = {{ stress = 1.0 }} }}
[output]
frame_interval = 1.0
"""
"""Discs of mean diameter 1, of which one has the mass 1."""


def main() -> int:
    """Compare and print; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python benchmarks/cell", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="packings [%(default)s]")
    parser.add_argument("--row", type=int, help="one of the rows alone, from 0 on")
    parser.add_argument("--lammps", default="lmp", help="its program [%(default)s]")
    options = parser.parse_args()
    program = shutil.which(options.lammps)
    if program is None:
        print(f"there is no program {options.lammps}: install LAMMPS, or name it with --lammps")
        return 1
    soft = [f"LAMMPS, e = {e}" for e in RESTITUTIONS]
    rigid = ["here", *(f"{share} of the step" for share in SHARES[1:])]
    print("| μ | ν | | " + " | ".join([*soft, *rigid]) + " |\n|---" + "|---" * 6 + "|")
    for friction, rate, solid in ROWS if options.row is None else ROWS[options.row :][:1]:
        found = []
        for seed in range(1, options.seeds + 1):
            model, state = _packing(friction, rate, solid, seed)
            found.append(
                [
                    *(_of_lammps(program, model, state, friction, rate, e) for e in RESTITUTIONS),
                    *(_of_multicor(model, state, friction, rate, share) for share in SHARES),
                ]
            )
        mean = np.mean(found, axis=0)
        error = np.std(found, axis=0, ddof=1) / math.sqrt(options.seeds)
        for k, name in enumerate(("I", "μ*")):
            cells = (f"{a:.4f} ± {b:.4f}" for a, b in zip(mean[:, k], error[:, k], strict=True))
            print(f"| {friction} | {solid} | {name} | " + " | ".join(cells) + " |", flush=True)
    return 0


def _flow(
    model: Model, state: State, drives: tuple[DofDrive, ...], duration: float, dt: float
) -> np.ndarray:
    """Advance by a time; returns the mean stress, xx, yy and xy."""
    engine = Engine(model, state, threads=1)
    engine.begin(Orders(drives=[WallDrive(*drives)]))
    state.window_wall_impulse[:] = 0.0
    for k in range(round(duration / dt)):
        engine.step(dt, k * dt)
    width, height, _ = state.wall_position[0]
    return state.window_wall_impulse[0] / (round(duration / dt) * dt * width * height)


def _rate(value: float) -> DofDrive:
    return DofDrive(velocity=Constant(value))


def _solid(model: Model, state: State) -> float:
    return float(math.pi * (model.grains.radius**2).sum() / np.prod(state.wall_position[0, :2]))


def _packing(friction: float, rate: float, solid: float, seed: int) -> tuple[Model, State]:
    """A packing that has been compressed, sheared by 2, and brought to a solid fraction."""
    text = _SCENARIO.format(seed=seed, friction=friction, count=COUNT, density=4.0 / math.pi)
    model, state = build(parse_scenario(text, "cell.toml"))
    pressure, dt = DofDrive(stress=Constant(1.0)), min(0.05, 0.005 / rate)
    _flow(model, state, (pressure, pressure, DofDrive()), 20.0, dt)
    _flow(model, state, (DofDrive(), pressure, _rate(rate)), 2.0 / rate, dt)
    shrink = 0.25 * math.log(_solid(model, state) / solid)
    _flow(model, state, (_rate(shrink), _rate(shrink), _rate(rate)), 2.0, 0.5 * dt)
    return model, state


Found = tuple[float, float]
"""I = γ̇ √(m/σ_yy) and μ* = |σ_xy|/σ_yy."""


def _numbers(stress: np.ndarray, rate: float) -> Found:
    return rate / math.sqrt(stress[1]), abs(stress[2]) / stress[1]


def _of_multicor(model: Model, start: State, friction: float, rate: float, share: float) -> Found:
    state = State.from_dict({name: np.array(value) for name, value in start.as_dict().items()})
    drives = DofDrive(), DofDrive(), _rate(rate)
    dt = share * Scales(1.0, 1.0 / rate, math.inf, friction).limit
    _flow(model, state, drives, 3.0 / rate, dt)
    return _numbers(_flow(model, state, drives, 10.0 / rate, dt), rate)


def _damping(stiffness: float, restitution: float) -> float:
    """γ_n of a linear contact of two discs of mass 1 with a restitution."""
    log = math.log(restitution)
    return 2.0 * math.sqrt(stiffness / 0.5) * -log / math.sqrt(math.pi**2 + log**2)


def _of_lammps(
    program: str, model: Model, state: State, friction: float, rate: float, restitution: float
) -> Found:
    """Linear springs with k = κ P₀, k_t = k/2; strains from 3 to 13."""
    damping = _damping(KAPPA, restitution)
    dt = math.pi / math.sqrt(KAPPA / 0.5 - 0.25 * damping**2) / 60.0
    width, height, tilt = state.wall_position[0].tolist()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = "\n".join(
            f"{k + 1} 1 {2.0 * r:.17g} 1 {x:.17g} {y:.17g} 0"
            for k, (r, (x, y)) in enumerate(
                zip(model.grains.radius.tolist(), state.position[:, :2].tolist(), strict=True)
            )
        )
        (folder / "grains.data").write_text(
            f"grains\n\n{COUNT} atoms\n1 atom types\n"
            f"0 {width:.17g} xlo xhi\n0 {height:.17g} ylo yhi\n"
            f"-0.5 0.5 zlo zhi\n{tilt:.17g} 0 0 xy xz yz\n\nAtoms\n\n{rows}\n"
        )
        (folder / "in.shear").write_text(f"""
units lj
dimension 2
atom_style sphere
boundary p p p
newton off
comm_modify vel yes
read_data grains.data
set type 1 density/disc {4.0 / math.pi:.17g}
neighbor 0.1 bin
pair_style gran/hooke/history {KAPPA} {0.5 * KAPPA} {damping} {0.5 * damping} {friction} 1
pair_coeff * *
timestep {dt:.17g}
velocity all ramp vx 0 {rate * height:.17g} y 0 {height:.17g} sum yes
fix 1 all nve/sphere disc
fix 2 all enforce2d
fix 3 all deform 1 xy erate {rate} remap v
compute beside all temp/deform
compute stress all pressure beside
fix 4 all ave/time 10 100 1000 c_stress[1] c_stress[2] c_stress[4] file stress.txt
thermo 1000000
run {round(13.0 / rate / dt)}
""")
        subprocess.run(
            [program, "-in", "in.shear"], cwd=folder, check=True, stdout=subprocess.DEVNULL
        )
        found = np.loadtxt(folder / "stress.txt")
    return _numbers(found[found[:, 0] > 3.0 / rate / dt, 1:].mean(axis=0), rate)


if __name__ == "__main__":
    sys.exit(main())

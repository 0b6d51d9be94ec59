"""The drum of ``configs/drum.toml`` beside soft spheres in LAMMPS, from the same starts.

``python benchmarks/drum``: where the center of mass is while the drum turns.
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

from multicor_cli import open_run
from multicor_cli import run as run_scenario
from multicor_cli.model import ShapeKind
from multicor_cli.packing import build
from multicor_cli.scenario import Scenario, load_scenario

CONFIG = Path(__file__).parents[2] / "configs" / "drum.toml"
KAPPA, LAYERS, TANGENTIAL, SUBSTEPS = 1e4, 20, 2.0 / 7.0, 25
"""k_n over m g/d of a column of so many layers; k_t over k_n; steps in a collision."""

SETTLED, BEGUN, END = 0.3, 1.0, 2.2
"""When the drum begins to turn, and from when until when the center is looked at [s]."""

Place = tuple[float, float]
"""Of the center of mass from the axis, over the radius of the drum; the drum turns towards +x."""


def main() -> int:
    """Compare and print; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python benchmarks/drum", description=__doc__)
    parser.add_argument("--seeds", type=int, default=4, help="starts [%(default)s]")
    parser.add_argument("--speeds", type=float, nargs="+", default=[3.0, 6.0], help="in rad/s")
    parser.add_argument("--friction", type=float, nargs="+", default=[0.5])
    parser.add_argument("--lammps", default="lmp", help="its program [%(default)s]")
    options = parser.parse_args()
    program = shutil.which(options.lammps)
    if program is None:
        print(f"there is no program {options.lammps}: install LAMMPS, or name it with --lammps")
        return 1
    print("| μ | ω [rad/s] | | LAMMPS | here | 0.25 of the errors |\n|---|---|---|---|---|---|")
    for friction in options.friction:
        for speed in options.speeds:
            found = []
            for seed in range(1, options.seeds + 1):
                changes = [f"scenario.seed={seed}", f"contacts.0.friction={friction}"]
                turning = f"loading.1.drives.drum.spin.velocity.ramp.1={speed}"
                ours = [*changes, turning, "output.frame_interval=0.005"]
                soft = _of_lammps(program, load_scenario(CONFIG, changes), friction, speed)
                found.append([soft, _of_multicor(ours), _of_multicor(ours, accuracy=0.25)])
            mean, error = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)
            for k, name in enumerate(("x/R", "y/R")):
                pairs = zip(mean[:, k], error[:, k] / math.sqrt(options.seeds), strict=True)
                cells = " | ".join(f"{a:.4f} ± {b:.4f}" for a, b in pairs)
                print(f"| {friction} | {speed} | {name} | {cells} |", flush=True)
    return 0


def _of_multicor(changes: list[str], accuracy: float = 1.0) -> Place:
    scenario = load_scenario(CONFIG, [*changes, f"solver.accuracy={accuracy}"])
    with tempfile.TemporaryDirectory() as folder:
        run_scenario(scenario, Path(folder) / "run", threads=1)
        with open_run(Path(folder) / "run") as run:
            mass, times = run.model.grains.mass, np.asarray(run.frames.time)
            late = np.flatnonzero((times >= BEGUN) & (times <= END)).tolist()
            places = [np.average(run.frames[k].position[:, :2], axis=0, weights=mass) for k in late]
    return _over_radius(np.mean(places, axis=0) - 0.5 * np.array(scenario.domain.size), scenario)


def _over_radius(center: np.ndarray, scenario: Scenario) -> Place:
    x, y = (center / (0.5 * scenario.domain.size[0])).tolist()
    return x, y


def _of_lammps(program: str, scenario: Scenario, friction: float, speed: float) -> Place:
    """Hooke's contact with tangential history; the grains glued to the drum turn with it."""
    model, state = build(scenario)
    gravity, restitution = abs(model.gravity[1]), scenario.contacts[0].restitution
    density = next(iter(scenario.materials.values())).density
    middle = 0.5 * np.array(scenario.domain.size)
    glued = model.shapes.geometry[model.shapes.kind == ShapeKind.DISC]
    diameter = model.mean_diameter
    mass = density * math.pi / 6.0 * diameter**3
    stiffness = KAPPA * LAYERS * mass * gravity / diameter
    log = math.log(restitution)
    damping = 2.0 * math.sqrt(stiffness / (0.5 * mass)) * -log / math.hypot(math.pi, log)
    dt = math.pi * math.sqrt(0.5 * model.grains.mass.min() / stiffness) / SUBSTEPS
    rows = [
        *((1, r, x, y) for r, (x, y) in zip(
            model.grains.radius.tolist(), (state.position[:, :2] - middle).tolist(), strict=True)),
        *((2, r, x, y) for x, y, r, _ in glued.tolist()),  # from the axis
    ]  # fmt: skip
    atoms = "\n".join(
        f"{k} {kind} {2.0 * r:.17g} {density:.17g} {x:.17g} {y:.17g} 0"
        for k, (kind, r, x, y) in enumerate(rows, 1)
    )
    springs = f"{stiffness} {TANGENTIAL * stiffness}"
    box = f"{-1.2 * middle[0]:.17g} {1.2 * middle[0]:.17g}"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "grains.data").write_text(
            f"grains\n\n{len(rows)} atoms\n2 atom types\n{box} xlo xhi\n{box} ylo yhi\n"
            f"{-diameter:.17g} {diameter:.17g} zlo zhi\n\nAtoms\n\n{atoms}\n"
        )
        (folder / "in.drum").write_text(f"""
units si
dimension 2
atom_style sphere
boundary f f p
newton off
comm_modify vel yes
read_data grains.data
neighbor {0.3 * diameter:.17g} bin
neigh_modify delay 0
group grains type 1
group drum type 2
neigh_modify exclude group drum drum
pair_style gran/hooke/history {springs} {damping} {0.5 * damping} {friction} 1
pair_coeff * *
timestep {dt:.17g}
compute center grains com
fix 1 grains nve/sphere
fix 2 all enforce2d
fix 3 grains gravity {gravity} vector 0 -1 0
fix 4 drum freeze
thermo 1000000
run {round(SETTLED / dt)}
fix 5 drum move rotate 0 0 0 0 0 1 {2.0 * math.pi / speed:.17g}
run {round((BEGUN - SETTLED) / dt)}
fix 6 all ave/time 100 1 100 c_center[1] c_center[2] file center.txt
run {round((END - BEGUN) / dt)}
""")
        subprocess.run(
            [program, "-in", "in.drum"], cwd=folder, check=True, stdout=subprocess.DEVNULL
        )
        center = np.loadtxt(folder / "center.txt")[:, 1:].mean(axis=0)
    return _over_radius(center, scenario)


if __name__ == "__main__":
    sys.exit(main())

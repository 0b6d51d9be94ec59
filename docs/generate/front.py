"""The picture on the first page: ``python docs/generate/front.py`` runs a sheared layer on a hot
floor and draws it (a minute).

Grains are colored by temperature; lines between them are as wide as the normal force is large.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from PIL import Image

import multicor_cli as multicor
from multicor_cli import post
from multicor_cli.plots.forces import segments
from multicor_cli.plots.grain_map import draw_grains, draw_walls

TARGET = Path(__file__).parents[1] / "pictures" / "front.png"
SCENARIO = """
[scenario]
name = "front"
seed = 3

[domain]
size = [0.06, 0.04]
periodic = true
gravity = [0.0, 0.0]

[materials.glass]
density = 2500.0
young = 70e9
poisson = 0.22
conductivity = 1.0
heat_capacity = 840.0

[[contacts]]
pair = ["*", "*"]
friction = 0.4

[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.35e-3, max = 0.75e-3 }
fill = 0.45
region = { min = [0.0, 0.001], max = [0.06, 0.039] }
packing = { kind = "random" }

[[walls]]
name = "bottom"
material = "glass"
geometry = { kind = "rough", from = [0.0, 0.0], to = [0.06, 0.0], side = "left" }
thermal = { temperature = 393.15 }

[[walls]]
name = "top"
material = "glass"
geometry = { kind = "rough", from = [0.0, 0.04], to = [0.06, 0.04], side = "right" }

[[loading]]
name = "compress"
duration = 1.0
until = { kinetic_energy_ratio = 1e-4 }
heat = false
drives.top = { y = { force = -0.03, damping = 0.02 } }

[[loading]]
name = "shear"
duration = 2.0
until = { strain = { walls = ["bottom", "top"], value = 1.0 } }
heat = false
drives.top = { x = { velocity = { ramp = [0.0, 0.1], duration = 0.02 } } }

[[loading]]
name = "conduct"
duration = 30_000.0
dt = 500.0
frozen = true

[heat]
temperature = 293.15

[output]
frame_interval = 1000.0
series_interval = 0.1
"""


def main() -> None:
    """Run the scenario and draw its end."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "front.toml"
        file.write_text(SCENARIO, encoding="utf-8")
        multicor.run(file, Path(folder) / "run")
        with multicor.open_run(Path(folder) / "run") as run:
            heat, network = post.grain_map(run, "temperature"), post.force_network(run)
    figure, axes = plt.subplots(figsize=(8.0, 3.6))
    figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)
    draw_grains(
        axes,
        heat.scene,
        value=heat.value,
        cmap="inferno",
        norm=plt.Normalize(285.0, 393.15),
        edgecolors="none",
    )
    lines, which = segments(network)
    force = np.abs(network.force[:, 0])
    axes.add_collection(
        LineCollection(
            list(lines), linewidths=0.9 * (force / force.mean())[which], colors="white", alpha=0.75
        )
    )
    draw_walls(axes, heat.scene)
    axes.set_axis_off()
    TARGET.parent.mkdir(exist_ok=True)
    figure.savefig(TARGET, dpi=110, transparent=True)
    with Image.open(TARGET) as image:
        image.quantize(64).save(TARGET, optimize=True)
    print(f"wrote {TARGET}: {TARGET.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()

"""The slope of the heap of `configs/heap.toml`."""

import math
from pathlib import Path

import numpy as np

import multicor_cli as multicor

# Its width, its distance from the left end of the domain, and its height [m]
PLATE, DROP = 30e-3, 14e-3

STRIP = 2e-3  # [m]


def slope(directory: Path) -> float:
    """Angle of the triangle on the plate that has the area of the heap at the end [degrees].

    Adhesive heaps have steps and cliffs, to which no straight line fits; the area is that under the
    highest points of strips.
    """
    with multicor.open_run(directory) as run:
        x, y, radius = *run.frames[-1].unwrapped.T, run.model.grains.radius
        speed = np.hypot(*run.frames[-1].velocity[:, :2].T)
    # At rest, but for what hangs over the edges, which swings without loss. A fall by half a
    # diameter has √(g d).
    is_inside = (y > DROP) & (np.abs(x - 1.5 * PLATE) < 0.5 * PLATE - STRIP)
    assert speed[is_inside].mean() < 0.01 * math.sqrt(9.81 * 1e-3)
    strip = np.floor((x - PLATE) / STRIP)
    tops = [
        np.max((y + radius)[(y > DROP) & (strip == k)], initial=DROP) - DROP
        for k in range(round(PLATE / STRIP))
    ]
    return math.degrees(math.atan(4.0 * float(np.mean(tops)) / PLATE))

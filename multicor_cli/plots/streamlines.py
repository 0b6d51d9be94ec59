"""Streamlines of the vectors of grains, averaged over a few diameters so that vortices are seen."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.grain_map import GrainMap

_CELL = 1.0  # cell of the grid over the mean diameter, for few grains
_FINEST = 250  # cells along the longer side at most
_SMOOTH = 2.0  # standard deviation of the average over the mean diameter
_COARSE = 60.0  # an average spans at least this part of the longer side, or lines of many grains cannot be told apart
_DENSITY = 1.3  # of the lines along the longer side, as matplotlib counts
_EMPTY = 0.5  # share of the plane that grains must fill for lines to pass, over its mean


def draw_streamlines(axes: Any, table: GrainMap) -> None:
    """Draw streamlines of the local mean of the vectors over the grains of a map."""
    from matplotlib.patheffects import Normal, Stroke

    x, y, field = smooth_field(table)
    if not np.isfinite(field).any() or not np.nanmax(np.abs(field)) > 0.0:
        return
    across, upwards = (table.scene.box[1] - table.scene.box[0]).tolist()
    longest = max(across, upwards)
    density = (across / longest, upwards / longest)
    drawn = axes.streamplot(
        x,
        y,
        np.ma.masked_invalid(field[..., 0]),
        np.ma.masked_invalid(field[..., 1]),
        density=tuple(max(_DENSITY * part, 0.3) for part in density),
        color="white",
        linewidth=0.8,
        arrowsize=0.8,
        arrowstyle="-|>",
        zorder=3,
    )
    outline = [Stroke(linewidth=1.8, foreground="0.1"), Normal()]  # readable on light grains and between them
    drawn.lines.set_path_effects(outline)
    for patch in axes.patches:
        patch.set_path_effects(outline)


def smooth_field(table: GrainMap) -> tuple[Floats, Floats, Floats]:
    """Mean of the vectors around the points of a grid, weighted by the area of the grains and a Gaussian of the distance.

    Returns:
        x and y of the points [m], shapes ``(p,)`` and ``(q,)``, and the field, shape ``(q, p, 2)``; nan where there are no grains.
    """
    scene, vector = table.scene, table.vector
    assert vector is not None
    low, size = scene.box[0], scene.box[1] - scene.box[0]
    diameter = 2.0 * float(scene.radius.mean())
    cell = max(_CELL * diameter, float(size.max()) / _FINEST)
    sigma = max(_SMOOTH * diameter, float(size.max()) / _COARSE)
    number = np.maximum(np.ceil(size / cell).astype(np.int64), 4)
    step = size / number
    column, row = np.clip(((scene.center - low) / step).astype(np.int64), 0, number - 1).T
    place, area = row * number[0] + column, scene.radius**2
    sums = [np.bincount(place, area * weight, minlength=int(number.prod())) for weight in (1.0, *vector.T)]
    grids = [_blur(found.reshape(number[::-1]), sigma / step, is_periodic=scene.period > 0.0) for found in sums]
    filled = grids[0] > _EMPTY * float(area.sum() / number.prod())
    mean = [np.where(filled, grid / np.where(filled, grids[0], 1.0), np.nan) for grid in grids[1:]]
    x, y = (low[k] + (np.arange(number[k]) + 0.5) * step[k] for k in (0, 1))
    return x, y, np.stack(mean, axis=-1)


def _blur(grid: Floats, sigma: Floats, *, is_periodic: bool) -> Floats:
    """Convolve with a Gaussian of ``sigma`` (x, y) cells; around the ends in x if periodic, with nothing beyond otherwise."""
    rows, columns = grid.shape
    pad = (int(4 * sigma[1]) + 1, 0 if is_periodic else int(4 * sigma[0]) + 1)
    wide = np.pad(grid, ((0, pad[0]), (0, pad[1])))
    frequency = [np.fft.fftfreq(wide.shape[0]), np.fft.rfftfreq(wide.shape[1])]
    decay = [np.exp(-2.0 * (np.pi * s * f) ** 2) for s, f in zip(sigma[::-1], frequency, strict=True)]
    found = np.fft.irfft2(np.fft.rfft2(wide) * np.outer(*decay), wide.shape)
    return np.asarray(np.maximum(found, 0.0) if grid.min() >= 0.0 else found)[:rows, :columns]

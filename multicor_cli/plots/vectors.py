"""Vectors of grains on a map: streamlines of their local mean, or arrows with a key."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import TITLE
from multicor_cli.post.grain_map import GrainMap
from multicor_cli.text import unit_sign

# ---- Streamlines of the vectors of grains, averaged over a few diameters so that vortices are seen

_CELL = 1.0  # cell of the grid over the mean diameter, for few grains
_FINEST = 250  # cells along the longer side at most
_SMOOTH = 2.0  # standard deviation of the average over the mean diameter
# an average spans at least this part of the longer side, or lines cannot be told apart
_COARSE = 60.0
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
    look: dict[str, Any] = {"color": "white", "linewidth": 0.8, "arrowsize": 0.8, "zorder": 3}
    u, v = (np.ma.masked_invalid(field[..., axis]) for axis in (0, 1))
    spacing = tuple(max(_DENSITY * part, 0.3) for part in density)
    drawn = axes.streamplot(x, y, u, v, density=spacing, arrowstyle="-|>", **look)
    # Readable on light grains and between them
    outline = [Stroke(linewidth=1.8, foreground="0.1"), Normal()]
    drawn.lines.set_path_effects(outline)
    for patch in axes.patches:
        patch.set_path_effects(outline)


def smooth_field(table: GrainMap) -> tuple[Floats, Floats, Floats]:
    """Means of vectors on a grid, weighted by area and a Gaussian; nan where there are no grains.

    Returns:
        x ``(p,)`` and y ``(q,)`` of the points [m], and the field, shape ``(q, p, 2)``.
    """
    scene, vector = table.scene, table.vector
    assert vector is not None
    low, size = scene.box[0], scene.box[1] - scene.box[0]
    diameter = 2.0 * float(scene.radius.mean())
    cell = max(_CELL * diameter, float(size.max()) / _FINEST)
    sigma = max(_SMOOTH * diameter, float(size.max()) / _COARSE)
    number = np.maximum(np.ceil(size / cell).astype(np.int64), 4)
    step = size / number
    at, which, is_cell = scene.center, np.arange(scene.radius.size), scene.lattice.height > 0.0
    if is_cell:  # the whole box is filled with images
        which, shift = scene.lattice.images(at, np.full(at.shape[0], scene.lattice.span))
        at = at[which] + shift
        is_near = ((at >= low) & (at <= scene.box[1])).all(axis=1)
        at, which = at[is_near], which[is_near]
    column, row = np.clip(((at - low) / step).astype(np.int64), 0, number - 1).T
    area = scene.radius**2 if scene.rings is None else scene.rings.area / np.pi
    place, area = row * number[0] + column, area[which]
    sums = [
        np.bincount(place, area * weight, minlength=int(number.prod()))
        for weight in (1.0, *vector[which].T)
    ]
    is_periodic = scene.lattice.width > 0.0 and not is_cell
    grids = [
        _blur(found.reshape(number[::-1]), sigma / step, is_periodic=is_periodic) for found in sums
    ]
    filled = grids[0] > _EMPTY * float(area.sum() / number.prod())
    mean = [np.where(filled, grid / np.where(filled, grids[0], 1.0), np.nan) for grid in grids[1:]]
    x, y = (low[k] + (np.arange(number[k]) + 0.5) * step[k] for k in (0, 1))
    field = np.stack(mean, axis=-1)
    if is_cell:
        right, up = np.meshgrid(x, y)
        along = right - scene.lattice.slant * up
        is_out = (along < 0.0) | (along > scene.lattice.width)
        field[is_out | (up < 0.0) | (up > scene.lattice.height)] = np.nan
    return x, y, field


def _blur(grid: Floats, sigma: Floats, *, is_periodic: bool) -> Floats:
    """Convolve with a Gaussian of ``sigma`` (x, y) cells; around the ends in x if periodic."""
    rows, columns = grid.shape
    pad = (int(4 * sigma[1]) + 1, 0 if is_periodic else int(4 * sigma[0]) + 1)
    wide = np.pad(grid, ((0, pad[0]), (0, pad[1])))
    frequency = [np.fft.fftfreq(wide.shape[0]), np.fft.rfftfreq(wide.shape[1])]
    decay = [
        np.exp(-2.0 * (np.pi * s * f) ** 2) for s, f in zip(sigma[::-1], frequency, strict=True)
    ]
    found = np.fft.irfft2(np.fft.rfft2(wide) * np.outer(*decay), wide.shape)
    return np.asarray(np.maximum(found, 0.0) if grid.min() >= 0.0 else found)[:rows, :columns]


# ---- Arrows, as long as the grains are fast

KEY = 0.2
"""Room above the time for the key of arrows [inch]."""
_ARROWS = 1500  # at most this many arrows, or they cannot be told apart
# This part of the arrows are as long as their velocity says; longer ones are cut to this length
_LONG = 0.95
_LENGTH = 2.0  # length of the longest arrow over the mean distance of arrows


def draw_arrows(axes: Any, table: GrainMap) -> None:
    """Arrows on grains, or on some, with a key; the few longest are cut, colors say how fast."""
    from matplotlib.patheffects import Normal, Stroke

    scene, vector = table.scene, table.vector
    assert vector is not None
    step = max(1, -(-scene.radius.size // _ARROWS))
    # The numbering may go row by row: arrows in its order would line up with the grains.
    order = np.random.default_rng(0).permutation(scene.radius.size)[::step]
    spacing = float(np.sqrt(np.prod(scene.box[1] - scene.box[0]) / order.size))
    longest = float(np.quantile(table.value, _LONG)) or 1.0
    cut = np.minimum(1.0, longest / np.maximum(table.value, longest))
    arrows = (*scene.center[order].T, *(vector * cut[:, np.newaxis])[order].T)
    size = {"scale": longest / (_LENGTH * spacing), "width": 0.09 * spacing}
    kind = {"angles": "xy", "scale_units": "xy", "units": "xy", "pivot": "middle"}
    drawn = axes.quiver(*arrows, **size, **kind, color="white", zorder=3)
    # Readable on any color: white in black
    outline = [Stroke(linewidth=1.2, foreground="black"), Normal()]
    drawn.set_path_effects(outline)
    shown, place = round_below(longest), axes.get_position()
    tip = shown / size["scale"] / float(scene.box[1, 0] - scene.box[0, 0])
    above = 1.0 + (TITLE + 0.4 * KEY) / (place.height * axes.figure.get_figheight())
    text = f"{shown:g} {unit_sign(table.field.unit)}"
    key = axes.quiverkey(drawn, tip, above, shown, text, labelpos="E", labelsep=0.05)
    key.vector.set_path_effects(outline)


def round_below(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= value) * power)

"""A small packing repeated over a region."""

from __future__ import annotations

import numpy as np

from multicor_cli.model.columns import X, Y
from multicor_cli.packing.errors import PackingError
from multicor_cli.packing.initial_grains import InitialGrains
from multicor_cli.packing.region import PackingRegion

_SLACK = 1e-9


def repeat_tile(tile: InitialGrains, size: tuple[float, float], repeat: tuple[int, int], region: PackingRegion) -> InitialGrains:
    """Copies of a tile side by side, from the lower left corner of ``region``.

    Grains may stick out of a tile: they reach into the next one. Where there is no next one, because the tiles do not close the
    period or the region ends, grains that stick out of the region are left out.

    Args:
        tile: Grains with centers in [0, width) x [0, height).
        size: Width and height of the tile [m].
        repeat: Number of copies in x and y.
        region: Where they go.

    Raises:
        PackingError: The copies do not fit into the region.
    """
    width, height = repeat[0] * size[0], repeat[1] * size[1]
    if width > region.width * (1.0 + _SLACK) or height > region.height * (1.0 + _SLACK):
        text = f"{repeat[0]} x {repeat[1]} tiles cover {width:g} m x {height:g} m, more than the region"
        raise PackingError(text, "use fewer tiles or enlarge the region", ("packing", "repeat"))
    row, column = np.divmod(np.arange(repeat[0] * repeat[1]), repeat[0])
    shift = np.column_stack([region.left + column * size[0], region.bottom + row * size[1], np.zeros(row.size)])
    position = (tile.position[None, :, :] + shift[:, None, :]).reshape(-1, 3)
    radius, velocity = np.tile(tile.radius, row.size), np.tile(tile.velocity, (row.size, 1))
    closes = region.is_periodic and abs(width - region.width) <= _SLACK * region.width
    reach = radius * (1.0 - _SLACK)
    x, y = position[:, X], position[:, Y]
    keep = (y - reach >= region.bottom) & (y + reach <= region.top)
    if not closes:
        keep &= (x - reach >= region.left) & (x + reach <= region.right)
    return InitialGrains(radius[keep], position[keep], velocity[keep])

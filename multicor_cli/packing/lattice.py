"""Triangular and square lattices, filled in rows from the bottom up; a small packing repeated.

The bottom row stands on the bottom of the region (the largest grain touches it) and the rows are
centered between its sides. In a region that spans the period, a row holds the largest whole number
of grains that fits and its spacing is opened to close the period exactly; the distance to the
neighbors in the rows above and below stays the one asked for. In a region that spans a cell rows
are opened likewise, an even number of them if they are triangular. Opening is preferred to refusing
because a period is rarely a multiple of a diameter, and to narrowing because touching grains would
then overlap.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from multicor_cli.engine.jit import arrays
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Room
from multicor_cli.packing.initial_grains import InitialGrains, PackingRegion
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import OPEN
from multicor_cli.scenario.problems import Refused

LatticeKind = Literal["triangular", "square"]

_SLACK = 1e-9  # share of a spacing by which rounding may miss a whole number of spacings


class _Row(NamedTuple):
    """First x, from the left side of the region [m], and number of sites of a row."""

    first: float
    sites: int


class Lattice(NamedTuple):
    """A lattice in its region.

    Neighbors are ``step`` [m] apart, ``pitch`` in a row and ``rise`` from row to row; ``margin``
    [m] is the distance of the outermost sites from closed sides, ``lowest`` that of the first row
    from the bottom. ``even`` are the rows 0, 2, ….
    ``most`` are the sites in the region, of which those in ``room`` count.
    """

    kind: LatticeKind
    largest: float
    region: PackingRegion
    room: Room
    jitter: float
    step: float
    margin: float
    lowest: float
    pitch: float
    rise: float
    even: _Row
    odd: _Row
    most: int

    @property
    def extent(self) -> str:
        return f"{self.region.width:g} m x {self.region.height:g} m"

    def capacity(self) -> int:
        """Number of sites; `Refused` if there is none."""
        capacity = self.most if self.room.is_open else len(self._first(self.most))
        if capacity == 0:
            text = (
                f"the region of {self.extent} holds no site of a {self.kind} lattice for grains of "
                f"radius {self.largest:g} m"
            )
            raise Refused((), text, "enlarge the region")
        return capacity

    def sites(self, count: int, rng: Stream) -> Floats:
        """The first sites, moved at random [m], shape ``(count, 2)``; `Refused` if there are fewer.

        Discs stay inside the region.
        """
        sites = self._first(min(count, self.most) if self.room.is_open else self.most)
        if count > len(sites):
            capacity = self.most if self.room.is_open else len(sites)
            text = (
                f"{count} grains on a {self.kind} lattice of spacing {self.step:g} m do not fit "
                f"into the region of {self.extent}: it holds {capacity}"
            )
            raise Refused((), text, "enlarge the region or ask for fewer grains")
        sites = sites[:count]
        if self.jitter > 0.0:  # uniform in a disc
            distance = self.jitter * self.step * np.sqrt(rng.random(count))
            angle = 2.0 * math.pi * rng.random(count)
            away = [distance * arrays.cos(angle), distance * arrays.sin(angle)]
            sites += np.column_stack(away)
        return sites

    def _first(self, count: int) -> Floats:
        """Those of the first sites whose grains lie wholly in the room [m], shape ``(n, 2)``."""
        even, odd = self.even, self.odd
        pair, place = np.divmod(np.arange(count), max(even.sites + odd.sites, 1))
        is_odd = place >= even.sites
        column = np.where(is_odd, place - even.sites, place)
        x = np.where(is_odd, odd.first, even.first) + column * self.pitch
        sites = np.column_stack([x, (2 * pair + is_odd) * self.rise])
        sites += (self.region.left, self.region.bottom + self.lowest)
        if self.room.is_open:
            return sites
        return sites[self.room.clearance(sites) >= self.margin * (1.0 - _SLACK)]


def lay_out(
    largest: float,
    region: PackingRegion,
    kind: LatticeKind,
    spacing: float | None,
    jitter: float,
    room: Room = OPEN,
) -> Lattice:
    """A lattice whose neighbors are ``spacing`` [m] apart, by default the ``largest`` diameter.

    Equal grains then touch; centers move at random by up to ``jitter`` of the spacing. Sites
    outside of ``room``, which solid bodies and other regions leave, are left out. `Refused` if
    jittered neighbors could overlap.
    """
    diameter = 2.0 * largest
    step = diameter if spacing is None else spacing
    _check_room(step, diameter, jitter)
    margin, pitch, rise = largest + jitter * step, step, step
    if region.is_periodic:
        pitch = region.width / max(1, _whole(region.width / step) - 1)
    if kind == "triangular" and pitch < 1.9 * step:
        # A stretched row lies lower between the grains of the row below, so that the distance
        # across rows stays `step`.
        rise = math.sqrt(step * step - 0.25 * pitch * pitch)
    even, odd = _rows(kind, region, margin, pitch)
    height, lowest = region.height - 2.0 * margin, margin
    levels = _whole(height / rise) if height >= -_SLACK * region.height else 0
    if region.is_periodic_in_y:
        levels = _whole(region.height / rise) - 1
        levels -= levels % 2 if kind == "triangular" else 0
        rise = region.height / max(levels, 1)
        lowest = 0.5 * rise
    most = (levels + 1) // 2 * even.sites + levels // 2 * odd.sites
    sides = (step, margin, lowest, pitch, rise)
    return Lattice(kind, largest, region, room, jitter, *sides, even, odd, most)


def _check_room(step: float, diameter: float, jitter: float) -> None:
    if step < diameter * (1.0 - _SLACK):
        text = f"{step:g} m is less than the largest diameter, {diameter:g} m: grains would overlap"
        raise Refused(("packing", "spacing"), text, "leave it out or make it at least the diameter")
    if jitter > 0.0 and step * (1.0 - 2.0 * jitter) < diameter * (1.0 - _SLACK):
        text = (
            f"{jitter:g} lets neighbors overlap, their spacing is {step:g} m and the largest "
            f"diameter {diameter:g} m"
        )
        remedy = f"make it at most {max(0.0, 0.5 * (1.0 - diameter / step)):.3g}"
        if jitter < 0.5:
            remedy += f" or make the spacing at least {diameter / (1.0 - 2.0 * jitter):.4g} m"
        raise Refused(("packing", "jitter"), text, remedy)


def _whole(steps: float) -> int:
    """Number of sites in a row that is ``steps`` spacings long."""
    return max(0, math.floor(steps + _SLACK) + 1)


def _rows(
    kind: LatticeKind, region: PackingRegion, margin: float, pitch: float
) -> tuple[_Row, _Row]:
    offset = 0.5 * pitch if kind == "triangular" else 0.0
    if region.is_periodic:
        count = round(region.width / pitch) if region.width >= 2.0 * margin * (1.0 - _SLACK) else 0
        return _Row(0.5 * pitch, count), _Row(0.5 * pitch + offset, count)
    inner = region.width - 2.0 * margin
    even, odd = _whole(inner / pitch), _whole((inner - offset) / pitch)
    used = max((even - 1) * pitch, (odd - 1) * pitch + offset)
    first = margin + max(0.0, 0.5 * (inner - used))
    return _Row(first, even), _Row(first + offset, odd)


# ---- A small packing repeated over a region


def repeat_tile(
    tile: InitialGrains, size: tuple[float, float], repeat: tuple[int, int], region: PackingRegion
) -> InitialGrains:
    """Copies of a tile side by side, from the lower left corner of ``region``.

    Centers of a tile lie in [0, width) x [0, height), its ``size`` [m], but grains may stick out:
    they reach into the next one. Where there is no next one, because the tiles do not close the
    period or the region ends, grains that stick out of the region are left out. ``repeat`` counts
    copies in x and y; `Refused` if they do not fit into the region.
    """
    width, height = repeat[0] * size[0], repeat[1] * size[1]
    if width > region.width * (1.0 + _SLACK) or height > region.height * (1.0 + _SLACK):
        tiles = f"{repeat[0]} x {repeat[1]} tiles cover {width:g} m x {height:g} m"
        text = f"{tiles}, more than the region"
        raise Refused(("packing", "repeat"), text, "use fewer tiles or enlarge the region")
    row, column = np.divmod(np.arange(repeat[0] * repeat[1]), repeat[0])
    shift = np.column_stack(
        [region.left + column * size[0], region.bottom + row * size[1], np.zeros(row.size)]
    )
    position = (tile.position[None, :, :] + shift[:, None, :]).reshape(-1, 3)
    radius, velocity = np.tile(tile.radius, row.size), np.tile(tile.velocity, (row.size, 1))
    closes = region.is_periodic and abs(width - region.width) <= _SLACK * region.width
    closes_in_y = region.is_periodic_in_y and abs(height - region.height) <= _SLACK * region.height
    reach = radius * (1.0 - _SLACK)
    x, y = position[:, X], position[:, Y]
    keep = closes_in_y | ((y - reach >= region.bottom) & (y + reach <= region.top))
    if not closes:
        keep &= (x - reach >= region.left) & (x + reach <= region.right)
    forms = tile.forms
    if forms is not None:
        forms = forms.of_grains(np.flatnonzero(keep) % tile.radius.size)
    return InitialGrains(radius[keep], position[keep], velocity[keep], forms=forms)

"""Sorts the links of a network by what is at their other end: a grain or a body, a wall of known temperature, or of known flow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.model import Floats, Ints

INSULATED, KNOWN, FLOW, BODY = 0, 1, 2, 3
"""Kinds of walls."""


class Ends(NamedTuple):
    """Links by what is at their other end; attributes as in `multicor_cli.engine.heat.rates.Network`."""

    i: Ints
    j: Ints
    conductance: Floats
    area: Floats
    wall_i: Ints
    wall: Ints
    wall_conductance: Floats
    wall_area: Floats
    flow_i: Ints
    flow_wall: Ints
    flow_share: Floats


@kernel
def split_links(
    grains: int, i: Ints, j: Ints, conductance: Floats, area: Floats, wall: Ints, kind: Ints, node: Ints
) -> Ends:  # fmt: skip
    """Split links. Those to insulated walls are left out; a prescribed flow is shared by conductance; bodies are like grains.

    Args:
        grains: Number of grains.
        i: Grain of each link, shape ``(e,)``.
        j: Grain or wall shape, shape ``(e,)``.
        conductance: H [W/K], shape ``(e,)``.
        area: Area factor of radiation [m²], shape ``(e,)`` or of size 0.
        wall: Wall of each wall shape, shape ``(m,)``.
        kind: Kind of each wall, shape ``(w,)``.
        node: Node of each wall that is a body, shape ``(w,)``; not used of others.
    """
    count = np.zeros(3, np.int64)  # of links to grains and bodies, and to walls by kind
    total = np.zeros(kind.size)
    for k in range(j.size):
        if j[k] < grains:
            count[INSULATED] += 1
        else:
            w = wall[j[k] - grains]
            if kind[w] == KNOWN:
                count[KNOWN] += 1
            elif kind[w] == BODY:
                count[INSULATED] += 1
            elif kind[w] == FLOW and conductance[k] > 0.0:
                count[FLOW] += 1
                total[w] += conductance[k]
    between, known, flowing = count
    has_area = min(area.size, 1)
    ends = Ends(
        np.empty(between, np.int32), np.empty(between, np.int32), np.empty(between), np.empty(has_area * between),
        np.empty(known, np.int32), np.empty(known, np.int32), np.empty(known), np.empty(has_area * known),
        np.empty(flowing, np.int32), np.empty(flowing, np.int32), np.empty(flowing),
    )  # fmt: skip
    count[:] = 0
    for k in range(j.size):
        is_grain = j[k] < grains
        if is_grain or kind[wall[j[k] - grains]] == BODY:
            at = count[INSULATED]
            ends.i[at], ends.j[at], ends.conductance[at] = i[k], j[k] if is_grain else node[wall[j[k] - grains]], conductance[k]
            if has_area:
                ends.area[at] = area[k]
            count[INSULATED] += 1
            continue
        w = wall[j[k] - grains]
        if kind[w] == KNOWN:
            at = count[KNOWN]
            ends.wall_i[at], ends.wall[at], ends.wall_conductance[at] = i[k], w, conductance[k]
            if has_area:
                ends.wall_area[at] = area[k]
            count[KNOWN] += 1
        elif kind[w] == FLOW and conductance[k] > 0.0:
            at = count[FLOW]
            ends.flow_i[at], ends.flow_wall[at], ends.flow_share[at] = i[k], w, conductance[k] / total[w]
            count[FLOW] += 1
    return ends

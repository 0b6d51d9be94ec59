"""Layers of discs between two planes, by hand: square lattices that conduct heat."""

from dataclasses import replace

import numpy as np
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import make_model

from multicor_cli.model import ShapeKind, Thermal

THICKNESS, SOLID = 0.25, 2.0
"""Of the discs, and what they are made of conducts."""

MATERIALS = f"""
[materials.steel]
conductivity = {SOLID}
density = 8.0
heat_capacity = 0.5
young = 100.0
poisson = 0.0
"""


def layer_model(columns, rows, *, specific=1.0, shape="disc", thickness=THICKNESS):
    """Discs of diameter 1 in rows between the planes "floor" and "lid"; the width is the period."""
    planes = [
        (ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0)),
        (ShapeKind.PLANE, 1, (0.0, float(rows), 0.0, -1.0)),
    ]
    n = columns * rows
    model = make_model(np.full(n, 0.5), planes, ("floor", "lid"), period=columns, shape=shape)
    surface = np.full(n, np.pi * thickness)
    return replace(model, thermal=Thermal(np.full(n, specific), np.full(n, 300.0), surface))


def lattice_contacts(columns, rows, inside, wall):
    """Contacts of each disc with its four neighbors, H = ``inside``, and the planes, ``wall``."""
    place = np.arange(columns * rows).reshape(rows, columns)
    links = []
    for row in range(rows):
        for column in range(columns):
            here, right = place[row, column], place[row, (column + 1) % columns]
            across = 1.0 if right < here else -1.0
            links.append((min(here, right), max(here, right), across, 0.0, inside))
            if row + 1 < rows:
                links.append((here, place[row + 1, column], 0.0, -1.0, inside))
    for column in range(columns):
        links.append((place[0, column], place.size, 0.0, 1.0, wall))
        links.append((place[-1, column], place.size + 1, 0.0, -1.0, wall))
    i, j, x, y, conductance = np.array(links, float).T
    contacts = contacts_of(i, j, np.column_stack([x, y]), (1.0, 0.0))
    contacts.i, contacts.j = i.astype(int), j.astype(int)
    contacts.conductance = conductance
    contacts.slip = np.zeros(i.size)
    return contacts


def steady(columns, rows, inside, wall, hot, cold):
    """Steady temperatures between a floor at ``hot`` and a lid at ``cold``; heat flow of a column."""
    flow = (hot - cold) / (2.0 / wall + (rows - 1) / inside)
    by_row = hot - flow * (1.0 / wall + np.arange(rows) / inside)
    return np.repeat(by_row, columns), flow


def layer(
    columns=4, rows=6, inside=0.3, wall=0.5, *, hot=310.0, cold=290.0, frames=3, stored=0.0,
    lapse=2.0, model=None,
):  # fmt: skip
    """A steady layer, but for what its floor gives more than its lid takes, ``stored`` [W]."""
    model = layer_model(columns, rows) if model is None else model
    place = np.arange(columns * rows)
    position = np.column_stack([place % columns + 0.5, place // columns + 0.5])
    temperature, flow = steady(columns, rows, inside, wall, hot, cold)
    made = []
    for k in range(frames):
        time, through = lapse * k, columns * flow
        made.append(frame_of(
            position, temperature=temperature, wall_temperature=np.array([hot, cold]), step=k + 1,
            wall_heat=time * np.array([[through + 0.5 * stored, 0.0], [-through + 0.5 * stored, 0.0]]),
            contacts=lattice_contacts(columns, rows, inside, wall), unwrapped=position,
        ))  # fmt: skip
    return source_of(model, made, lapse * np.arange(frames), scenario_resolved=MATERIALS)

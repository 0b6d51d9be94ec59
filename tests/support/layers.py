"""Made-up runs with heat: square lattices of discs between two planes, spheres that slide."""

from dataclasses import replace

import numpy as np
from heat_parts import with_heat
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import floor_and_lid, make_model

from multicor_cli.model import ShapeKind, Thermal
from multicor_cli.post.conductivity import WAYS

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
    walls, radius = ("floor", "lid"), np.full(columns * rows, 0.5)
    model = make_model(radius, floor_and_lid(rows), walls, period=columns, shape=shape)
    return with_heat(model, capacity=specific, thickness=thickness)


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
    times = lapse * np.arange(frames)
    return source_of(model, made, times, scenario_resolved=MATERIALS, series={})


def with_ways(source, ways, axis="y"):
    """The run with a time series: what has gone each way grows by ``ways`` in a time of 1 [W m]."""
    time = np.asarray(source.frames.time)
    series = {"time": time}
    for k, way in enumerate(WAYS):
        for a in "xy":
            rate = np.asarray(ways)[..., k] if a == axis else 7.0
            series[f"heat_way_by_{way}_{a}"] = np.cumsum(rate * np.diff(time, prepend=time[0]))
    source.series = series
    return source


# --- spheres of steel that slide on each other

STEEL = """
[materials.steel]
density = 7500.0
young = 193e9
poisson = 0.29
conductivity = 15.0
heat_capacity = 500.0
"""
SPHERE = 1.5e-3
"""Their radius."""
PLANE = (ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0))


def sliding(contacts, *, floor=np.nan, scenario=STEEL, shape=PLANE, dt=1e-3):
    """Frames of three steel spheres at 300, 310 and 320 K.

    ``contacts`` of each frame are rows of i, j (3: the floor), normal force, tangential force and
    slip.
    """
    model = make_model(np.full(3, SPHERE), [shape], shape="sphere", density=7500.0)
    model = replace(model, thermal=Thermal(np.ones(3), np.full(3, 300.0), np.ones(3)))
    frames = []
    for rows in contacts:
        i, j, normal, tangential, slip = np.array(rows, float).reshape(-1, 5).T
        made = contacts_of(i, j, (0.0, 1.0), np.column_stack([normal, tangential]))
        made.slip, made.sliding = slip, slip != 0.0
        frames.append(frame_of(
            [(0.0, SPHERE), (0.0, 3 * SPHERE), (0.0, 5 * SPHERE)], walls=1, contacts=made, dt=dt,
            temperature=np.array([300.0, 310.0, 320.0]), wall_temperature=np.array([floor]),
        ))  # fmt: skip
    return source_of(model, frames, scenario_resolved=scenario)

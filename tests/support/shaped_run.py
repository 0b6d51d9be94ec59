"""A run directory of known content: grains of all kinds of shapes on a floor."""

from dataclasses import replace

import numpy as np
from scene_parts import FLOOR, make_model
from shapes import POINT, regular, rod

from multicor_cli.model import State, Thermal
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.outlines import Outlines
from multicor_cli.store import RunDirectory, Snapshot

PERIOD = 2.0
DISC, ROD, PENTAGON, LOWER, UPPER, TRIANGLE, ANGLE, FRAME, DUMBBELL = range(9)
"""The grains. The two squares ``LOWER`` and ``UPPER`` lie flush on each other, the first of them on
the floor; ``DUMBBELL`` crosses the ends of the period."""

PLACES = np.array([
    [0.3, 0.1], [0.6, 0.05], [0.8, 0.3], [1.0, 0.08], [1.0, 0.24], [0.3, 0.5], [1.3, 0.11],
    [1.6, 0.3], [1.98, 0.6],
])  # fmt: skip
"""Centers at the start [m]."""

TURN = 0.1
"""What all but the squares turn by from frame to frame [rad]."""

GROWING = [PENTAGON, UPPER]
"""Grains that may grow."""


def box(left, bottom, right, top):
    """Corners of a rectangle."""
    return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def measures(corners, rounding):
    """Area [m²] and perimeter [m] of a convex core widened by a radius (Steiner's formula)."""
    (x, y), (u, v) = corners.T, np.roll(corners, -1, axis=0).T
    area, around = 0.5 * np.sum(x * v - u * y), np.hypot(u - x, v - y).sum()
    area += around * rounding + np.pi * rounding**2
    return float(area), float(around + 2.0 * np.pi * rounding)


def make_outlines():
    """Outlines of the nine grains."""
    square = box(-0.08, -0.08, 0.08, 0.08)
    simple = [
        (POINT, 0.1), (rod(0.2), 0.05), (regular(5, 0.09), 0.02),
        (square, 0.0), (square, 0.0), (regular(3, 0.1, 0.5 * np.pi), 0.0),
    ]  # fmt: skip
    # Side by side, so that they share a line
    angle = [box(0.0, 0.0, 0.1, 0.3), box(0.1, 0.0, 0.3, 0.1)]
    frame = [
        box(0.0, 0.0, 0.3, 0.1), box(0.0, 0.2, 0.3, 0.3), box(0.0, 0.0, 0.1, 0.3),
        box(0.2, 0.0, 0.3, 0.3),
    ]  # fmt: skip
    ends = [(np.array([[x, 0.0]]), 0.06) for x in (-0.05, 0.05)]
    half = np.arccos(0.05 / 0.06)  # angle of half the lens that the discs share
    lens = 2.0 * 0.06**2 * half - 0.05 * np.sqrt(4.0 * 0.06**2 - 0.1**2)
    two_discs = 2.0 * np.pi * 0.06**2 - lens, 4.0 * (np.pi - half) * 0.06
    grains = [[piece] for piece in simple]
    grains += [[(corners - 0.11, 0.0) for corners in angle]]
    grains += [[(corners - 0.15, 0.0) for corners in frame], ends]
    known = [*(measures(*piece) for piece in simple), (0.05, 1.2), (0.08, 1.6), two_discs]
    return Outlines.of(grains, *np.array(known).T)


def shaped_model(*, heat=False):
    """The model of the nine grains, as heavy as their areas."""
    outlines = make_outlines()
    model = make_model(outlines.radius, FLOOR, period=PERIOD)
    inertia = 0.3 * outlines.area * outlines.radius**2
    grains = replace(model.grains, mass=outlines.area, inertia=inertia)
    ones = np.ones(len(PLACES))
    thermal = Thermal(ones, 300.0 * ones, ones) if heat else None
    return replace(model, grains=grains, outlines=outlines, thermal=thermal)


def contact_rows(state):
    """The squares touch each other and the floor at two points each, the angle the floor at one."""
    n = len(PLACES)
    i = np.array([LOWER, LOWER, LOWER, LOWER, ANGLE], np.int32)
    j = np.array([UPPER, UPPER, n, n, n], np.int32)
    normal = np.array([[0.0, -1.0]] * 2 + [[0.0, 1.0]] * 3)
    arm = 0.08 * np.array([[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [0.0, -1.375]])
    force = np.array([[1.0, 0.1], [2.0, 0.2], [3.0, 0.3], [4.0, 0.4], [5.0, 0.5]])
    heat = (1e-6 * force[:, 0], force[:, 0]) if state.heat.size else (None, None)
    return ContactTable(
        i, j, normal, np.zeros(5), force * state.last_dt, np.zeros(5), i == ANGLE, *heat, arm
    )


def advance(state):
    """From a frame to the next: a step."""
    state.step += 1
    state.stage_step += 1
    state.time += 0.5
    state.last_dt = 0.1
    state.position[:, 2] += TURN
    state.position[[LOWER, UPPER], 2] = 0.0
    state.velocity[:, 0] = np.arange(len(PLACES))
    rows = contact_rows(state)
    state.contact_i, state.contact_j, state.contact_impulse = rows.i, rows.j, rows.impulse
    state.contact_point = np.arange(5, dtype=np.int32) + state.step
    if state.heat.size:
        state.heat += np.arange(len(PLACES))


def write_shaped_run(
    path, *, frames=3, heat=False, model=None, recorded=True, finish=True, growth=0.0, **options
):
    """Write a run of these grains, a step from frame to frame; gives the last state.

    Two of them grow by the part ``growth`` of their sizes at the start in each.
    """
    model = model or shaped_model(heat=heat)
    if growth:
        model = replace(model, expansion=np.ones(len(model.materials)))
    state = State.at_rest(model, PLACES)
    with RunDirectory.create(path, "", "", {"seed": 1}, stages=("shear",), **options) as run:
        writer = run.writer(model)
        for frame in range(frames):
            if frame:
                advance(state)
            if growth:
                state.radius[GROWING] = (1.0 + growth * frame) * model.grains.radius[GROWING]
            writer.frame(Snapshot(state, model, contact_rows(state) if recorded else None))
            writer.series_row(Snapshot(state, model))
        run.checkpoint(state, writer)
        if finish:
            run.finish("finished")
    return state

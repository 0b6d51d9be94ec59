"""A run directory of known content: a column of equal grains between two planes."""

from dataclasses import replace

import numpy as np
from scene_parts import between_planes

from multicor_cli.model import HEAT_BOOK_NAMES, State, Thermal
from multicor_cli.model.contacts import ContactTable
from multicor_cli.store import RunDirectory, Snapshot

GRAINS = 10
RADIUS = 0.05
"""Ten grains of this radius fill the height of 1 m."""

INTERVAL = 0.5
"""Time between frames [s]."""

RATES = 1e-3 * (1.0 + np.arange(GRAINS))
"""Heat of friction that each grain receives per time [W]."""

GRADIENT = 20.0
"""T = 300 K + GRADIENT y."""

SHEAR = 2.0
"""v_x = SHEAR y, spin −SHEAR/2."""


def heated_model(*, heat=True):
    """The model; the grains have different heat capacities."""
    model = between_planes([RADIUS] * GRAINS)
    capacity = 1.0 + np.arange(GRAINS)
    return replace(
        model,
        thermal=Thermal(capacity, np.full(GRAINS, 300.0), np.full(GRAINS, 0.3)) if heat else None,
    )


def column(model):
    """The grains on top of each other, at rest."""
    return State.at_rest(
        model, np.column_stack([np.full(GRAINS, 2.0), RADIUS + 2.0 * RADIUS * np.arange(GRAINS)])
    )


def write_frames(run, model, advance, frames, *, contacts=True):
    """Write frames of a column, with rows of the series; ``advance`` leads from one to the next."""
    writer, state = run.writer(model), column(model)
    for frame in range(frames):
        if frame:
            advance(state)
        writer.frame(Snapshot(state, model, contact_rows(state) if contacts else None))
        writer.series_row(Snapshot(state, model))
    run.checkpoint(state, writer)


def write_heated_run(path, *, heat=True, frames=5, walls=(300.0, 320.0), contacts=True):
    """Write a finished run: frame 0 before any step at 300 K; ``walls``: bottom and top [K]."""
    model = heated_model(heat=heat)
    with RunDirectory.create(path, "", "", {"seed": 1}, stages=("shear",)) as run:
        write_frames(
            run, model, lambda state: _advance(state, model, walls), frames, contacts=contacts
        )
        run.finish("finished")
    return model


def _advance(state, model, walls):
    state.step += 1
    state.time += INTERVAL
    state.last_dt = 0.1
    y = state.position[:, 1]
    state.velocity[:, 0], state.velocity[:, 2] = SHEAR * y, -0.5 * SHEAR
    state.wall_velocity[1, 0] = SHEAR
    if model.thermal is None:
        return
    state.heat = model.thermal.capacity * GRADIENT * y
    state.generated = RATES * state.time
    state.wall_temperature[:] = walls
    books = {
        "stored": float(state.heat.sum()), "closure": 1e-15, "sub_steps": 7.0, "max_biot": 0.23,
    }  # fmt: skip
    for name, value in books.items():
        state.heat_books[HEAT_BOOK_NAMES.index(name)] = value


def contact_rows(state):
    """Each grain on the next with 1, 2, … N, the last on the top plane; every third slides."""
    i = np.arange(GRAINS, dtype=np.int32)
    j = i + np.int32(1)
    j[-1] = GRAINS + 1
    force = np.column_stack([1.0 + i, -0.1 * (1.0 + i)])
    heat = (1e-6 * force[:, 0], force[:, 0]) if state.heat.size else (None, None)
    return ContactTable(
        i, j, np.tile([0.0, -1.0], (GRAINS, 1)), np.zeros(GRAINS), force * state.last_dt,
        np.zeros(GRAINS), i % 3 == 0, *heat,
    )  # fmt: skip

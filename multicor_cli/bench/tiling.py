"""A periodic scene repeated side by side, with everything that moves in it: the copies go on as the original would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Grains, Model, ShapeKind, State, Thermal, WallShapes
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import TAIL, Tail


def repeat_scene(model: Model, state: State, copies: int) -> tuple[Model, State]:
    """A model and a state of ``copies`` periods, at step 0 with the warm start of the last step.

    Loads on walls, and their masses where a wall has one, are not repeated: the caller's scenario knows them.

    Args:
        model: A periodic model. Its walls are level planes and rough walls.
        state: A state of it.
        copies: Number of copies, at least 1.

    Raises:
        ValueError: If the model is not periodic.
    """
    if not model.period > 0.0:
        raise ValueError("only a periodic scene can be repeated")
    shape_copies = np.where(model.shapes.kind == ShapeKind.PLANE, 1, copies)
    wide = replace(
        model,
        grains=_repeat_grains(model.grains, copies),
        shapes=_repeat_shapes(model, shape_copies),
        walls=replace(model.walls, mass=model.walls.mass * copies, length=model.walls.length * copies),
        period=model.period * copies,
        thermal=None if model.thermal is None else _repeat_thermal(model.thermal, copies),
    )
    return wide, _repeat_state(model, wide, state, shape_copies, copies)


def _repeat_grains(grains: Grains, copies: int) -> Grains:
    material, group = np.tile(grains.material, copies), np.tile(grains.group, copies)
    return Grains(np.tile(grains.radius, copies), np.tile(grains.mass, copies), np.tile(grains.inertia, copies), material, group)


def _repeat_thermal(thermal: Thermal, copies: int) -> Thermal:
    return Thermal(*(np.tile(values, copies) for values in (thermal.capacity, thermal.start, thermal.surface)))


def _repeat_shapes(model: Model, shape_copies: NDArray[np.int64]) -> WallShapes:
    """Shapes of the walls, the copies of each side by side in the list."""
    shapes = model.shapes
    geometry = np.repeat(shapes.geometry, shape_copies, axis=0)
    shift = np.concatenate([np.arange(k) for k in shape_copies] or [np.zeros(0)]) * model.period
    geometry[:, 0] += shift
    has_end = np.repeat(TAIL[shapes.kind] == Tail.POINT, shape_copies)
    geometry[has_end, 2] += shift[has_end]
    kind, wall, material = (np.repeat(values, shape_copies) for values in (shapes.kind, shapes.wall, shapes.material))
    return WallShapes(kind, wall, geometry, material)


def _repeat_state(model: Model, wide: Model, state: State, shape_copies: NDArray[np.int64], copies: int) -> State:
    position = np.tile(state.position, (copies, 1))
    position[:, 0] += np.repeat(np.arange(copies), model.grain_count) * model.period
    result = State.at_rest(wide, position)
    result.velocity[:] = np.tile(state.velocity, (copies, 1))
    result.wall_position, result.wall_velocity = state.wall_position.copy(), state.wall_velocity.copy()
    result.contact_i, result.contact_j, result.contact_impulse = _repeat_contacts(model, state, shape_copies, copies)
    result.last_dt = state.last_dt
    if wide.thermal is not None:
        result.heat = np.tile(state.heat, copies)
        result.wall_temperature = state.wall_temperature.copy()
    return result


def _repeat_contacts(model: Model, state: State, shape_copies: NDArray[np.int64], copies: int) -> tuple[Ints, Ints, Floats]:
    """Contacts of all copies, sorted; those across the ends of the period join neighboring copies."""
    n, period = model.grain_count, model.period
    i, j = state.contact_i.astype(np.int64), state.contact_j.astype(np.int64)
    is_wall = j >= n
    shape = np.where(is_wall, j - n, 0)
    x = np.concatenate([state.position[:, 0], model.shapes.geometry[:, 0] + state.wall_position[model.shapes.wall, 0]])
    across = np.rint((x[i] - x[j]) / period).astype(np.int64)
    first_copy = np.concatenate([[0], np.cumsum(shape_copies)])[:-1]
    rows = []
    for copy in range(copies):
        other = (copy + across) % copies
        wall_shape = n * copies + first_copy[shape] + np.where(shape_copies[shape] > 1, other, 0) if shape_copies.size else j
        a, b = i + copy * n, np.where(is_wall, wall_shape, j + other * n)
        rows.append(np.column_stack([np.minimum(a, b), np.maximum(a, b)]))  # exchanging the two keeps p_n and p_t
    pairs = np.concatenate(rows)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    impulse = np.tile(state.contact_impulse, (copies, 1))[order]
    return pairs[order, 0].astype(np.int32), pairs[order, 1].astype(np.int32), impulse

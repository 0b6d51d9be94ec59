"""Light contacts in plain rows, one after the other, and in the batches of a `System`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.batches import make_batches
from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.jit.chunks import aligned
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import MASS
from multicor_cli.model.model import Floats, Ints


class OneByOne(NamedTuple):
    """Light contacts in the order of the sweep, ``k`` rows.

    Attributes:
        pair: Rows of their bodies, shape ``(k, 2)``.
        frame: n_x, n_y, 1/W_nn [kg], bias b [m/s], μ, shape ``(k, 5)``.
        impulse: p_n, p_t [N s], shape ``(k, 2)``.
    """

    pair: Ints
    frame: Floats
    impulse: Floats


class Batches(NamedTuple):
    """The part of a `System` that light contacts take; fields as there."""

    velocity: Floats
    slot: Ints
    pair: Ints
    frame: Floats
    impulse: Floats
    tile_start: NDArray[np.int64]


def flatten(system: System) -> OneByOne:
    """The light contacts of a system, in an order of which its batches make the same sweep. Copies."""
    has = system.slot.reshape(-1) >= 0
    pair, frame, impulse = (_rows(blocks)[has] for blocks in (system.pair, system.frame, system.impulse))
    return OneByOne(np.ascontiguousarray(pair // 4), np.ascontiguousarray(frame), np.ascontiguousarray(impulse))


def batch(contacts: OneByOne, velocity: Floats) -> Batches:
    """Contacts in batches, as one tile; ``slot`` names them by their rows.

    Args:
        contacts: In the order of the sweep.
        velocity: Bodies as in `System`, shape ``(b, 4)``.
    """
    bodies = velocity.shape[0]
    slot, start = make_batches(contacts.pair, np.array([0, len(contacts.pair)]), bodies)
    has = slot.reshape(-1) >= 0
    rows = slot.reshape(-1)[has]
    pair, frame, impulse = np.empty((has.size, 2), np.int32), np.zeros((has.size, 5)), np.zeros((has.size, 2))
    pair[:] = bodies, bodies + 1  # of the lanes without contact: nothing moves them
    frame[:, MASS] = 1.0
    pair[has], frame[has], impulse[has] = contacts.pair[rows], contacts.frame[rows], contacts.impulse[rows]
    full = aligned((bodies + 2, 4))
    full[:bodies], full[bodies:] = velocity, 0.0
    return Batches(full, slot, _blocks(4 * pair), _blocks(frame), _blocks(impulse), start)


def by_slot(slot: Ints, impulse: Floats, count: int) -> Floats:
    """Impulses of ``count`` contacts, as ``slot`` numbers them, from their batches; shape ``(count, 2)``."""
    has = slot.reshape(-1) >= 0
    result = np.zeros((count, 2))
    result[slot.reshape(-1)[has]] = _rows(impulse)[has]
    return result


def _rows(blocks: NDArray[Any]) -> NDArray[Any]:
    """A row for each lane from blocks of shape ``(q, columns, 4)``."""
    return blocks.transpose(0, 2, 1).reshape(-1, blocks.shape[1])


def _blocks(rows: NDArray[Any]) -> NDArray[Any]:
    """The reverse of `_rows`."""
    columns = rows.shape[1]
    blocks = aligned((rows.shape[0] // LANES, columns, LANES), rows.dtype.type)
    blocks[:] = rows.reshape(-1, LANES, columns).transpose(0, 2, 1)
    return blocks

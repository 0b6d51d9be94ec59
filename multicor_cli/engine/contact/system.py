"""Puts the contacts of a step into the order and the arrays of the sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.batches import make_batches
from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.contact.ordering import classify_contacts, number_bodies, order_contacts
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.contact.transfer import pack_bodies, pack_contacts, pack_general, unpack
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import aligned
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import INVERSE_MASS, SPIN, X, Y
from multicor_cli.model.model import Floats, Ints

TILE = 16.0  # width of a tile in mean diameters: a few hundred contacts


@dataclass(frozen=True)
class OrderedSystem:
    """A `System`, and where its contacts come from.

    Attributes:
        system: What the sweep works on; ``slot`` names contacts by their rank by key.
        general: Contact behind each general one.
        place: Row of each grain in the velocities of the system; walls follow the grains.
    """

    system: System
    general: Ints
    place: Ints

    def collect(self, contacts: StepContacts) -> Floats:
        """Write the impulses back into ``contacts``; returns the velocities of grains and walls, shape ``(n + w, 4)``."""
        system = self.system
        after = np.empty((system.inverse.shape[0], 4))
        unpack(system.slot, system.impulse, self.place, system.velocity, contacts.impulse, after)
        contacts.impulse[self.general] = system.general_impulse
        return after


def assemble(
    scene: Scene,
    contacts: StepContacts,
    free: Floats,
    wall_inverse: Floats,
    wall_is_free: NDArray[np.bool_],
    mean_diameter: float,
    spin_factor: float,
) -> OrderedSystem:
    """Order the contacts and build the arrays of the sweep.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key, with the warm start in ``impulse``.
        free: Free velocities of grains and walls, shape ``(n + w, 4)``.
        wall_inverse: Inverse mass per degree of freedom of the walls, shape ``(w, 3)``.
        wall_is_free: Walls with a driven degree of freedom, shape ``(w,)``.
        mean_diameter: d̄ [m].
        spin_factor: β = m a²/I.
    """
    classes, span, sizes = classify_contacts(scene, contacts, wall_is_free)
    columns, rows, corner, width, height = _tiles(scene, max(TILE * mean_diameter, 2.2 * span))
    order, general, tile_start, color_start = order_contacts(scene, contacts, classes, sizes, columns, rows, corner, width, height)
    bodies = free.shape[0]
    place, pairs, count = number_bodies(scene, contacts, order, general, bodies - scene.radius.size)
    slot, batch_start = make_batches(pairs, tile_start, count)
    batches, tiles = slot.shape[0], tile_start.size - 1
    velocity = aligned((count + 2 * tiles, 4))
    velocity[count:] = 0.0
    pair, frame, impulse = aligned((batches, 2, LANES), np.int32), aligned((batches, 5, LANES)), aligned((batches, 2, LANES))
    pack_bodies(free, place, velocity)
    pack_contacts(scene, contacts, order, pairs, count, batch_start, slot, velocity, pair, frame, impulse)
    inverse = np.zeros((bodies, 3))
    if general.size:
        n = scene.radius.size
        inverse[:n, X] = inverse[:n, Y] = velocity[:n, INVERSE_MASS]
        inverse[:n, SPIN] = spin_factor * velocity[:n, INVERSE_MASS]
        inverse[n:] = wall_inverse
    system = System(
        velocity, inverse, slot, pair, frame, impulse, batch_start, color_start,
        *pack_general(scene, contacts, place, general, inverse), spin_factor, contacts.i.size,
    )  # fmt: skip
    add_impulses(system)
    return OrderedSystem(system, general, place)


def _tiles(scene: Scene, width: float) -> tuple[int, int, Floats, float, float]:
    """Numbers of columns and rows, the corner and the size of the tiles; at least ``width`` wide and high."""
    x, y = scene.position[:, X], scene.position[:, Y]  # one by one: numpy is slow along the short axis
    low = np.array([x.min(), y.min()])
    size = np.array([x.max(), y.max()]) - low
    if scene.period > 0.0:
        low[X], size[X] = 0.0, scene.period
    limit = max(4, scene.radius.size)  # grains that fly far away must not make the grid large
    rows = min(max(1, int(size[Y] / width)), limit)
    columns = min(max(1, int(size[X] / width)), limit)
    while rows * columns > limit:
        rows, columns = max(1, rows // 2), max(1, columns // 2)
    if scene.period > 0.0 and columns > 1:
        columns -= columns % 2
    return columns, rows, low, max(size[X], width) / columns, max(size[Y], width) / rows

"""Puts the contacts of a step into the arrays of the sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.contact.rolling import pack_couples
from multicor_cli.engine.contact.schedule import Schedule
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.contact.transfer import pack_bodies, pack_contacts, pack_general, unpack
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import aligned
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import BELT, COUPLE, INVERSE_MASS, SPIN, X, Y
from multicor_cli.model.model import Floats, Ints


@dataclass(frozen=True)
class OrderedSystem:
    """A `System`, and where its contacts come from.

    Attributes:
        system: What the sweep works on; ``slot`` names contacts by their rank by key.
        general: Contact behind each general one.
        place: Row of each grain in the velocities of the system; walls follow the grains.
        belt: Speed of the surface of each wall, column `BELT` of the bodies [m/s], shape ``(w,)``.
    """

    system: System
    general: Ints
    place: Ints
    belt: Floats

    def collect(self, contacts: StepContacts) -> Floats:
        """Write impulses and couples back into ``contacts``; returns the velocities of grains and walls, shape ``(n + w, 4)``."""
        system = self.system
        after = np.empty((system.inverse.shape[0], 4))
        unpack(system.slot, system.impulse, self.place, system.velocity, contacts.impulse, after)
        after[self.place.size :, BELT] = self.belt
        contacts.impulse[self.general] = system.general_impulse
        if system.couples.impulse.size:
            contacts.rolling[system.couples.contact, COUPLE] = system.couples.impulse
        return after


def assemble(
    scene: Scene, contacts: StepContacts, schedule: Schedule, free: Floats, wall_inverse: Floats, spin_factor: float
) -> OrderedSystem:
    """Build the arrays of the sweep.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key, with the warm start in ``impulse`` and ``rolling``.
        schedule: Their order.
        free: Free velocities of grains and walls, shape ``(n + w, 4)``.
        wall_inverse: Inverse mass per degree of freedom of the walls, shape ``(w, 3)``.
        spin_factor: β = m a²/I.
    """
    slot, pair, tile_start, color_start, general, place, rows = schedule
    bodies, batches = free.shape[0], slot.shape[0]
    belt = free[place.size :, BELT].copy()
    velocity = aligned((rows + 2 * (tile_start.size - 1), 4))
    velocity[rows:] = 0.0
    frame, impulse = aligned((batches, 5, LANES)), aligned((batches, 2, LANES))
    pack_bodies(free, place, velocity)
    pack_contacts(scene, contacts, belt, slot, pair, velocity, frame, impulse)
    inverse = np.zeros((bodies, 3))
    if general.size or contacts.rolling.size:
        n = scene.radius.size
        inverse[:n, X] = inverse[:n, Y] = velocity[:n, INVERSE_MASS]
        inverse[:n, SPIN] = spin_factor * velocity[:n, INVERSE_MASS]
        inverse[n:] = wall_inverse
    system = System(
        velocity, inverse, slot, pair, frame, impulse, tile_start, color_start,
        *pack_general(scene, contacts, belt, place, general, inverse), spin_factor, contacts.i.size,
        pack_couples(scene, contacts, belt, slot, general, place, inverse),
    )  # fmt: skip
    add_impulses(system)
    return OrderedSystem(system, general, place, belt)

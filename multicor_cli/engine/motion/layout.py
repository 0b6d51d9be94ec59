"""What the steps of an engine work on, with grains whose sizes change."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.contacts import Contacts, Speeds
from multicor_cli.engine.contact.selection import Selection
from multicor_cli.engine.contact.solve import ThreadChoice
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.pieces import pieces_of, resize_grains
from multicor_cli.engine.jit.threads import PARALLEL_GRAINS
from multicor_cli.engine.motion.growth import (
    Lanes,
    grow,
    push,
    push_points,
    shed,
    turn_slower,
    work_at_points,
    work_of_growth,
    worn_sizes,
)
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.state import State

MOST_WORN = 0.5
"""Largest part of its volume that a grain may lose."""


class Growth(NamedTuple):
    """Grains that expand or shrink in a step.

    Attributes:
        rate: Rates at which their radii grow [m/s], shape ``(n,)``.
        velocity: Velocities of the grains with these radii, which turn slower or faster.
        spun: Kinetic energy that their spins gain [J].
    """

    rate: Floats
    velocity: Floats
    spun: float


class Layout:
    """What a step works on, made for the grains that are present: rebuilt when one comes or goes.

    No result depends on how long a layout has been in use.

    Attributes:
        newcomers: Grains that have had no step yet.
        threads: Number of threads that may be used; ``threading`` says how many of them pay.
        mass: Mass of all these grains [kg].
        middle: q_m, shape ``(n, 3)``.
        before: Bodies (v_x, v_y, a ω, 1/m) at the start of the step, shape ``(n + w, 4)``.
        free: The same with their free velocities.
        unworn: The model with the grains as they were at the start of the run; those in ``model``
            have other radii and masses where they expand or wear.
        worn: Part of their volume that they have lost, shape ``(n,)``.
        marked: Work space of the position correction, shape ``(n,)``.
        pieces: Pieces of grains that are no discs, and of the walls, at angle 0; or None.
    """

    def __init__(
        self, model: Model, state: State, newcomers: NDArray[np.int64], threads: int
    ) -> None:
        n, w = model.grain_count, model.wall_count
        self.model, self.state, self.newcomers = model, state, newcomers
        self.threads = threads if n >= PARALLEL_GRAINS else 1
        self.threading = ThreadChoice(self.threads)
        self.unworn, self.worn = model, np.zeros(0)
        if state.radius.size:  # of their own: they follow the temperatures
            self.worn = model.worn_share(state.wear)
            self.model = model.with_radius(state.radius.copy(), self.worn)
            self.model.__dict__["mean_diameter"] = model.mean_diameter  # lengths that stay
        self.mass = total(self.model.grains.mass)
        self.middle = np.empty((n, 3))
        self.before, self.free = np.zeros((n + w, 4)), np.zeros((n + w, 4))
        self.marked = np.zeros(n, np.bool_)
        self.pieces = pieces_of(model)
        self._at_start = self.pieces
        if self.pieces is not None and state.radius.size:
            corner, rounding, spin = (
                part.copy() for part in (self.pieces.corner, self.pieces.rounding, self.pieces.spin)
            )
            self.pieces = self.pieces._replace(corner=corner, rounding=rounding, spin=spin)
            self.model.__dict__["spin_radius"] = spin
            self._note_radii()

    @cached_property
    def pairs(self) -> NeighborList:
        return NeighborList(self.model)

    @cached_property
    def selection(self) -> Selection:
        """Contacts, and what lasts with them."""
        return Selection(self.model, self.pairs, self.pieces)

    # ---- Grains that expand with temperature or shrink as they wear

    def _note_radii(self) -> None:
        """Let outlines follow the radii of the model, which have changed."""
        initial, radius = self.unworn.grains.radius, self.model.grains.radius
        if self.pieces is not None and self._at_start is not None:
            resize_grains(self._at_start, initial, radius, self.pieces)
            self.model.__dict__["disc_radius"] = np.where(
                self.pieces.is_face, self.unworn.disc_radius * (radius / initial), radius
            )

    def grow(self, dt: float) -> Growth:
        """Radii of the grains at their temperatures, into the model."""
        state, model = self.state, self.model
        grains, thermal = model.grains, model.thermal
        assert thermal is not None
        initial = self.unworn.grains.radius
        if model.sheds:
            initial = initial * worn_sizes(self.worn, model.dimension)
        radius, rate = grains.radius, np.empty(initial.size)
        rise = model.expansion[grains.material] * (state.heat / thermal.capacity)
        grow(initial, rise, state.radius, radius, dt, rate)
        self.pairs.note_radii(radius)
        self._note_radii()
        velocity, spun = turn_slower(
            state.velocity, grains.mass, state.radius, radius, model.spin_radius,
            model.shape_factor,
        )  # fmt: skip
        return Growth(rate, velocity, spun)

    def push(self, rate: Floats, dt: float, contacts: Contacts) -> Speeds:
        """Let closed contacts open at the rates at which their grains grow; as `growth.push`."""
        selection = self.selection
        opening = push(rate, dt, selection.i, selection.j, Lanes.of(selection.lanes), contacts)
        if self.pieces is None or not selection.faces.first.size:
            return opening
        of_points = push_points(
            rate, self.model.grains.radius, self.pieces.spin, dt, selection.faces, contacts
        )
        return Speeds(*map(sum, zip(opening, of_points, strict=True)))

    def work_of_growth(self, rate: Floats, dt: float, contacts: Contacts) -> float:
        """Work of grains that grow on all their contacts [J]."""
        selection = self.selection
        work = work_of_growth(
            rate, dt, selection.i, selection.j, Lanes.of(selection.lanes), contacts
        )
        if self.pieces is not None:
            work += work_at_points(
                rate, self.model.grains.radius, self.pieces.spin, dt, selection.faces, contacts
            )
        return work

    def shed(self) -> float:
        """Grains lose what has worn off in the step, and with it mass, size and motion.

        Returns the kinetic energy that goes [J].

        Raises:
            PhysicsError: If a grain has lost more than `MOST_WORN` of its volume.
        """
        state, model = self.state, self.model
        share = self.unworn.worn_share(state.wear)
        if (share > MOST_WORN).any():
            k = int(np.argmax(share))
            what = f"{model.name_of(k)} has lost {100.0 * share[k]:.3g} % of its volume by wear"
            raise PhysicsError(state.step, f"{what}; lower wear, or let it keep its size")
        smaller = worn_sizes(share, model.dimension) / worn_sizes(self.worn, model.dimension)
        lost = shed(
            state.velocity, self.unworn.grains.mass, share, smaller, model.grains.mass,
            state.radius, model.spin_radius.copy(), model.shape_factor,
        )  # fmt: skip
        model.grains.radius[:] = state.radius
        self._note_radii()
        self.worn, self.mass = share, total(model.grains.mass)
        return lost

"""Most steps of discs, in two calls: what precedes the solve, and what follows it.

Between some thirty kernels Python takes longer than they do where grains are few. The two here do
what `multicor_cli.engine.mechanics` does with the same kernels, so that bits are the same, where no
grain grows and no law acts but friction and restitution. They say when a list or contacts have to
be sought, which is done there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import Contacts, Speeds, begin_walls
from multicor_cli.engine.contact.flight import leave_flights_out
from multicor_cli.engine.contact.impacts import COLUMNS, Impacts, are_contacts, enter_impacts
from multicor_cli.engine.contact.selection import AHEAD, deepest_overlap, find_closing
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.contact.system import (
    begin_grains,
    carried,
    inverse_masses,
    pack_bodies,
    pack_general,
    place_walls,
    unpack_bodies,
    unpack_walls,
)
from multicor_cli.engine.energy.account import ContactSums, account_contacts, account_grains
from multicor_cli.engine.geometry.drift import Box, approach_of_displacements, cutoff_of_velocities
from multicor_cli.engine.geometry.scene import Scene, place_shapes
from multicor_cli.engine.jit.addresses import call, serial, table
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.motion.layout import Layout
from multicor_cli.engine.motion.moves import move
from multicor_cli.engine.motion.prediction import Prediction
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.model import ContactLaws, Floats, Ints

_KERNELS = (
    account_contacts, account_grains, add_impulses, approach_of_displacements, begin_grains,
    begin_walls, carried, cutoff_of_velocities, deepest_overlap, find_closing, inverse_masses, move,
    pack_bodies, pack_general, place_shapes, place_walls, unpack_bodies, unpack_walls,
)  # fmt: skip
_OF_FLIGHTS = enter_impacts, leave_flights_out
_account_grains, _approach, _begin_grains, _cutoff, _find_closing, _move, _pack, _unpack = map(
    serial,
    (
        account_grains, approach_of_displacements, begin_grains, cutoff_of_velocities, find_closing,
        move, pack_bodies, unpack_bodies,
    ),
)  # fmt: skip

_NO_TEMPERATURE, _NOBODY, _NOTHING = np.empty(0), np.empty(0, np.bool_), np.zeros(6)
_NO_IMPACTS = Impacts(np.empty(0, np.int32), np.empty(0, np.int32), np.empty((0, COLUMNS)))
# Of what `_begin` leaves: gap up to which the list is complete, sums, if there is what to solve
_COMPLETE, _SPEEDS, _IS_SOLVED = 0, 1, 7
# What `_begin` says: contacts are ready, another pair closes, or the list may lack one that does
_READY, _CLOSES, _UNKNOWN = range(3)
# Of what `_end` leaves
_IS_DONE, _CUTOFF, _FASTEST, _KINETIC, _GRAVITY_WORK, _BESIDE, _ADHESION_WORK = range(7)


@kernel
def _begin(
    kernels: NDArray[np.int64], s: System, scene: Scene, laws: ContactLaws, place: Ints,
    start: Floats, middle: Floats, about: Floats, before: Floats, gap: Floats, branch: Floats,
    of_walls: Ints, walls: Ints, lane: Ints, general: Ints, contacts: Contacts, bodies: Floats,
    free: Floats, i: Ints, j: Ints, beside_i: Ints, beside_j: Ints, reference: Floats,
    world: Floats, extent: float, distance: float, listed: float, belt: Floats,
    is_free: NDArray[np.bool_], wall_inverse: Floats, cutoff: float, dt: float, ratio: float,
    is_loaded: bool, are_sought: bool, flying: NDArray[np.bool_] | None, more: Floats,
    result: Floats,
) -> int:  # fmt: skip
    """The contacts (i, j), ready to be solved, unless others may be needed: one of the three above.

    That is not looked at where they have just been sought; (beside_i, beside_j) are the listed
    pairs beside them. Arrays as in `Schedule` and `System`, which are **modified**. Impacts have
    added ``more`` to the sums, if grains may be ``flying``.
    """
    if not are_sought:
        box = Box(scene.period, 0.0, 0.0, 0.0, 0.0, 0.0)
        complete = listed - call(
            _approach, kernels,
            (scene.kind, scene.position, reference, box, world, scene.world, extent, distance),
        )  # fmt: skip
        result[_COMPLETE] = complete
        pairs, ahead = (scene, None, beside_i, beside_j), AHEAD * dt
        if complete < cutoff:
            return _UNKNOWN
        if call(_find_closing, kernels, (*pairs, bodies, free, cutoff, ahead, 0.0))[0]:
            return _CLOSES
    call(_pack, kernels, (scene, bodies, free, place, s.velocity, start, middle))
    grains = call(
        _begin_grains, kernels,
        (middle, start, s.pair, about, s.frame, s.impulse, before, gap, branch, dt, ratio,
         scene.period, 0.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    at_walls = call(begin_walls, kernels, (scene, laws, bodies, dt, ratio, of_walls, contacts))
    for k in range(len(grains)):
        result[_SPEEDS + k] = grains[k] + at_walls[k] + more[k]
    squares, closing, shear, loaded = result[1], result[2], result[3], result[4]
    moves = (closing > 0.0 and squares / closing > 0.0) or (loaded > 0.0 and shear / loaded > 0.0)
    left = 1
    if flying is None:  # a branch of its own: Numba leaves out what follows
        pass
    elif flying.size:
        left = call(
            leave_flights_out, kernels,
            (scene, flying, is_free, i, j, lane, s.frame, before, contacts, free),
        )  # fmt: skip
    result[_IS_SOLVED] = left > 0 and (is_loaded or moves)
    if not result[_IS_SOLVED]:
        # Nothing closes and nothing pushes: the last impulses must not act once more
        flat = s.impulse.reshape(-1)
        for k in range(flat.size):
            flat[k] = 0.0
        for k in range(of_walls.size):
            contacts[of_walls[k]].p_n, contacts[of_walls[k]].p_t = 0.0, 0.0
    call(inverse_masses, kernels, (s.velocity, wall_inverse, s.spin_factor, s.inverse))
    call(
        place_walls, kernels,
        (scene, contacts, belt, walls, lane, s.pair, s.velocity, s.frame, s.impulse),
    )  # fmt: skip
    call(
        pack_general, kernels,
        (scene, contacts, belt, place, general, s.inverse, s.general_pair, s.general_frame,
         s.general_lever, s.general_impulse),
    )  # fmt: skip
    call(add_impulses, kernels, (s,))
    return _READY


@kernel
def _end(
    kernels: NDArray[np.int64], s: System, scene: Scene, place: Ints, middle: Floats, about: Floats,
    before: Floats, gap: Floats, branch: Floats, depth: Floats, of_walls: Ints, walls: Ints,
    lane: Ints, general: Ints, contacts: Contacts, bodies: Floats, free: Floats, i: Ints, j: Ints,
    beside_i: Ints, beside_j: Ints, wall_i: Ints, wall_j: Ints, belt: Floats, extent: Floats,
    driven: NDArray[np.bool_], local: Floats, mass: Floats, reach: Floats, gravity: Floats,
    spin_factor: float, largest: float, complete: float, dt: float, is_enough: bool,
    position: Floats, velocity: Floats, wall_position: Floats, wall_velocity: Floats, world: Floats,
    impacts: Impacts | None, result: Floats,
) -> tuple[Floats, Ints, Ints, Floats, Floats, Floats, Floats, Ints, Floats]:  # fmt: skip
    """Motion with the solved velocities, and what contacts carry and have lost.

    Arrays as in `Schedule` and `System`; (i, j) are the contacts, (beside_i, beside_j) the pairs
    beside them, (wall_i, wall_j) those of these with walls. **Modifies** places and velocities of
    grains and walls, and wall shapes; not unless the solve ``is_enough``, nor if ``result`` says
    that the list is to reach farther, or another pair closes.

    Returns v⁺; shapes and impulses of contacts that carry one; the first three of `ContactSums`;
    contacts that have had impacts, and what they carry without these.
    """
    rows, held = i[:0], np.empty((0, 2))
    grains, count = place.size, belt.size
    call(unpack_walls, kernels, (walls, general, lane, s.impulse, s.general_impulse, contacts))
    after = call(_unpack, kernels, (s.velocity, place, belt, count))
    ends = after[grains:, :3].copy()
    cutoff = call(_cutoff, kernels, (scene, after, np.zeros(2), ends, ends, extent, dt, largest))
    result[_CUTOFF], result[_FASTEST], closes = cutoff, 0.0, cutoff > complete
    if not closes:
        pairs = scene, None, beside_i, beside_j
        closes, result[_FASTEST] = call(
            _find_closing, kernels, (*pairs, after, after, cutoff, dt, -np.inf)
        )
    result[_IS_DONE] = is_enough and not closes
    if not result[_IS_DONE]:
        nothing = np.empty(0)
        return after, i[:0], j[:0], held, nothing, ends[:0], nothing, rows, held
    kinetic, gravity_work = call(
        _move, kernels,
        (scene.position, bodies, after, reach, mass, gravity, spin_factor, dt, position, velocity),
    )  # fmt: skip
    for w in range(count):
        for d in range(3):
            wall_velocity[w, d] = ends[w, d] if driven[w, d] else free[grains + w, d]
            wall_position[w, d] = scene.wall_position[w, d] + 0.5 * dt * wall_velocity[w, d]
    call(place_shapes, kernels, (scene.kind, scene.wall, local, wall_position, world))
    end = Scene(
        position, scene.radius, scene.material, scene.kind, scene.wall, world, wall_position,
        scene.period, np.empty(0), 0.0, 0.0,
    )  # fmt: skip
    first, second, known = call(carried, kernels, (grains, i, j, lane, s.impulse, contacts))
    if impacts is None:  # a branch of its own: Numba leaves out what follows
        pass
    elif impacts.i.size:
        rows, held, _ = call(
            enter_impacts, kernels,
            (scene, impacts, i, j, after, lane, s.frame, s.impulse, before, gap, branch, contacts),
        )  # fmt: skip
    sums = call(
        _account_grains, kernels,
        (middle, s.velocity, s.pair, about, s.frame, s.impulse, before, gap, branch, depth, dt,
         scene.period, 0.0, 0.0, 0.0),
    )  # fmt: skip
    of_walls_too = call(account_contacts, kernels, (scene, end, contacts, after, of_walls, sums))
    result[_BESIDE] = call(deepest_overlap, kernels, (end, None, wall_i, wall_j))
    result[_KINETIC], result[_GRAVITY_WORK] = kinetic, gravity_work
    result[_ADHESION_WORK] = of_walls_too.adhesion_work
    return (
        after, first, second, known, of_walls_too.total, of_walls_too.wall_impulse,
        of_walls_too.belt_impulse, rows, held,
    )  # fmt: skip


# ---- Their arguments, from where a step has them


class Ended(NamedTuple):
    """A step with the solved velocities, but for the correction of positions and the books.

    Attributes:
        after: v⁺ of all bodies, shape ``(n + w, 4)``.
        cutoff: A gap that no pair has closed [m].
        kinetic: Energy of the grains at the end of the step; ``gravity_work`` is that on it [J].
        beside: Largest overlap of pairs that are no contacts, over the radius.
        end: Shapes at q⁺.
        sums: What contacts have lost, and exert.
    """

    after: Floats
    cutoff: float
    kinetic: float
    gravity_work: float
    beside: float
    end: Scene
    sums: ContactSums


class PlainSteps:
    """Takes steps with kernels that a step with Python between them has called before."""

    def __init__(self) -> None:
        self._kernels, self._has_flights = np.empty((0, 2), np.int64), False

    def knows(self, *, rebounds: bool) -> bool:
        """Whether there has been a step to `learn` from, of grains that may rebound or do not."""
        return self._kernels.size > 0 and (self._has_flights or not rebounds)

    def learn(
        self, layout: Layout, step: Prediction, motion: WallMotion, *, rebounds: bool
    ) -> None:
        """Find out where the kernels are that a step has called, once."""
        if self.knows(rebounds=rebounds):
            return
        # What this step may not have called, so that it changes nothing
        scene, selection = step.scene, layout.selection
        layout.pairs.update(scene, 0.0)
        if rebounds:
            lanes, pairs, contacts = selection.lanes, (selection.i, selection.j), selection.contacts
            nobody = np.zeros(layout.model.grain_count, np.bool_)
            leave_flights_out(
                scene, nobody, motion.is_free, *pairs, lanes.lane, lanes.frame, lanes.before,
                contacts, layout.free,
            )  # fmt: skip
            enter_impacts(
                scene, _NO_IMPACTS, *pairs, layout.free, lanes.lane, lanes.frame, lanes.impulse,
                lanes.before, lanes.gap, lanes.branch, contacts,
            )  # fmt: skip
        self._kernels = table((*_KERNELS, *_OF_FLIGHTS))
        self._has_flights = rebounds

    def begin(
        self, layout: Layout, step: Prediction, motion: WallMotion, laws: ContactLaws, *,
        is_loaded: bool, are_sought: bool = False,
    ) -> tuple[tuple[Speeds, bool] | None, bool]:  # fmt: skip
        """Make `Selection.system` the problem of a step.

        Returns sums over its contacts, and whether there is anything to solve; None if contacts are
        to be sought first. Then whether another pair is known to close. ``is_loaded`` says whether
        anything pushes grains together.
        """
        selection, state, flight = layout.selection, layout.state, step.flight
        flying, more = (_NOBODY if self._has_flights else None), _NOTHING
        if flight is not None:
            flying, more = flight.flying, np.array(flight.speeds)
            if not are_contacts(flight.impacts, selection.i, selection.j):
                return None, False
        if not (are_sought or selection.go_on(state, laws, motion.is_free)):
            return None, False
        lanes, result = selection.lanes, np.empty(8)
        ratio = step.dt / state.last_dt if state.last_dt > 0.0 else 0.0
        reference, world, extent, distance, listed = layout.pairs.made_at
        how = _begin(
            self._kernels, selection.system(layout.model.shape_factor), step.scene, laws,
            lanes.place, lanes.start, lanes.middle, lanes.about, lanes.before, lanes.gap,
            lanes.branch, lanes.of_walls, lanes.walls, lanes.lane, lanes.general,
            selection.contacts, layout.before, layout.free, selection.i, selection.j,
            *selection.beside, reference, world, extent, distance, listed, motion.belt,
            motion.is_free, motion.inverse, step.cutoff, step.dt, ratio, is_loaded, are_sought,
            flying, more, result,
        )  # fmt: skip
        complete, *speeds, is_solved = result.tolist()
        if not are_sought:
            layout.pairs.complete = complete
        if how == _READY:
            return (Speeds(*speeds), bool(is_solved)), False
        selection.wait(state)
        return None, how == _CLOSES

    def end(
        self, layout: Layout, step: Prediction, motion: WallMotion, *, is_enough: bool
    ) -> tuple[Ended | None, float]:
        """Move on with the solved velocities, if the solve ``is_enough`` and no other pair closes.

        Returns the largest speed of approach of those that do [m/s], too, or 0: nothing has been
        moved then.
        """
        state, model, selection, pairs = (
            layout.state, layout.model, layout.selection, layout.pairs,
        )  # fmt: skip
        lanes, walls, shapes = selection.lanes, model.wall_count, model.shapes
        wall_position, wall_velocity = np.empty((walls, 3)), np.empty((walls, 3))
        world, result = np.empty((model.shape_count, 4)), np.empty(7)
        impacts = _NO_IMPACTS if self._has_flights else None
        if step.flight is not None:
            impacts = step.flight.impacts
        while True:
            after, first, second, known, *sums, rows, held = _end(
                self._kernels, selection.system(model.shape_factor), step.scene, lanes.place,
                lanes.middle, lanes.about, lanes.before, lanes.gap, lanes.branch, lanes.depth,
                lanes.of_walls, lanes.walls, lanes.lane, lanes.general, selection.contacts,
                layout.before, layout.free, selection.i, selection.j, *selection.beside,
                *selection.walls_beside, motion.belt, motion.extent, motion.driven,
                shapes.geometry, model.grains.mass,
                model.spin_radius, step.gravity, model.shape_factor, pairs.largest, pairs.complete,
                step.dt, is_enough, state.position, state.velocity, wall_position, wall_velocity,
                world, impacts, result,
            )  # fmt: skip
            is_done, cutoff, fastest, kinetic, gravity_work, beside, adhesion_work = result.tolist()
            if cutoff <= pairs.complete:
                break
            pairs.update(step.scene, cutoff)
        if not is_done:
            return None, fastest
        state.wall_position, state.wall_velocity = wall_position, wall_velocity
        selection.enter_carried(state, first, second, known)
        if rows.size:
            selection.note_impacts(rows, held)
        end = step.scene._replace(
            position=state.position, world=world, wall_position=wall_position,
            temperature=_NO_TEMPERATURE,
        )  # fmt: skip
        total, wall_impulse, belt_impulse = sums
        of_contacts = ContactSums(total, wall_impulse, belt_impulse, adhesion_work)
        return Ended(after, cutoff, kinetic, gravity_work, beside, end, of_contacts), 0.0

"""Compiles the kernels of a step, for a second process, while a first run compiles them too.

A run needs its kernels in the order of the phases of a step. This process takes them in another:
the longest first, then those that come last, so that the two seldom compile the same. Whatever is
in the cache when a run asks for it is loaded. The kernels are called with one grain and no contact,
on one thread as in small problems: what is compiled depends on the kinds of the arguments and on
nothing else. Kernels that are given outlines are others than those of discs. What calls the others
by their addresses comes last, with two steps of that grain.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.acceleration import (
    NEVER,
    Momentum,
    begin_again,
    is_converged,
    iterate,
    start_loop,
    start_momentum,
    step_back,
)
from multicor_cli.engine.contact.contacts import (
    CONTACT,
    Contacts,
    begin_walls,
    fix_lanes,
    recall_impulses,
    tabulate,
)
from multicor_cli.engine.contact.face_sweep import FaceBatches
from multicor_cli.engine.contact.faces import (
    NO_FACES,
    begin_faces,
    blocks_for,
    carried_points,
    closed_beyond,
    recall_points,
    unpack_points,
)
from multicor_cli.engine.contact.late import (
    closing_soon,
    contacts_with_walls,
    make_rows,
    merge_late,
    place_late,
)
from multicor_cli.engine.contact.ordering import Schedule, lay_tiles, schedule_contacts, span_of
from multicor_cli.engine.contact.patches import (
    choose_patch,
    has_clusters,
    hold,
    keep_in_mind,
    nothing_met,
    release,
    solve_patch,
)
from multicor_cli.engine.contact.selection import (
    deep_pairs,
    deepest_overlap,
    find_closing,
    leave_out,
    look_at_pairs,
    near_pairs,
    points_up_to,
)
from multicor_cli.engine.contact.solve import Outcome
from multicor_cli.engine.contact.sweep import EXACT, NO_CELL, System
from multicor_cli.engine.contact.system import (
    Moved,
    assemble,
    begin_grains,
    carried,
    pack_bodies,
    tabulate_contacts,
)
from multicor_cli.engine.energy.account import (
    account_contacts,
    account_faces,
    account_grains,
    book_step,
)
from multicor_cli.engine.geometry.neighbors import both_ways
from multicor_cli.engine.geometry.pieces import Pieces, pieces_of
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.settings import HeatSettings, heat_laws
from multicor_cli.engine.heat.step import HeatStep
from multicor_cli.engine.jit.arrays import aligned
from multicor_cli.engine.jit.threads import use_threads
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.engine.motion.correction import Correction, push_apart
from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.engine.motion.moves import move, wrap
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.step import Engine
from multicor_cli.model.columns import MASS
from multicor_cli.model.model import ContactLaws, Floats, Grains, Model, Thermal, Walls, WallShapes
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.state import State

_NOBODY = np.empty(0, np.int32)
_NO_ROWS = np.zeros(2, np.int64)


def precompile(*, has_shapes: bool = False, has_heat: bool = True) -> None:
    """Compile a step from its solve on, then what prepares the solve, then what hard steps need.

    For grains some of which are no discs, and with or without heat.
    """
    use_threads(1)
    model = _one_grain(has_shapes=has_shapes)
    state = State.at_rest(model, np.zeros((1, 2)))
    scene = Scene(
        state.position, model.grains.radius, model.material, model.shapes.kind, model.shapes.wall,
        np.zeros((1, 4)),
        state.wall_position, model.period,
    )  # fmt: skip
    contacts, pieces = np.zeros(0, CONTACT), pieces_of(model)
    bodies = np.zeros((2, 4))
    system = _without_contacts(has_shapes=has_shapes)
    memory, momentum = start_loop(0), start_momentum(system)
    iterate(system, momentum, EXACT, True, False, 0, False, NEVER, memory, np.empty((1, 2)))
    strayed = np.zeros((1, 2))
    nobody = _NOBODY, _NOBODY, _NOBODY, _NOBODY, _NOBODY
    moved = Moved(scene, contacts, bodies, *nobody, strayed, np.zeros((1, 3)), None)
    if has_heat:
        _heat(model, state, moved)
    _finish(model, state, moved, pieces)
    _prepare(model, scene, contacts, bodies, pieces)
    _unstick(system, momentum, memory)
    if not has_shapes:
        _between(model)


def _between(model: Model) -> None:
    """What calls the others: in a second step, which knows them from the first."""
    engine = Engine(model, State.at_rest(model, np.zeros((1, 2))), threads=1)
    for step in range(2):
        engine.step(1.0, float(step))


def _without_contacts(*, has_shapes: bool) -> System:
    frame, slot = aligned((1, 5, LANES)), np.full((1, LANES), -1, np.int32)
    frame[:] = 0.0
    frame[:, MASS] = 1.0
    impulse, pair = aligned((1, 2, LANES)), aligned((1, 2, LANES), np.int32)
    impulse[:], pair[:] = 0.0, 0
    velocity = aligned((1, 4))
    velocity[:] = 0.0
    faces = FaceBatches(*blocks_for(0), NO_CELL.branch, _NO_ROWS, 0) if has_shapes else None
    return System(
        velocity, np.zeros((1, 3)), slot, pair, frame, impulse, _NO_ROWS, _NO_ROWS,
        np.empty((0, 2), np.int32), np.empty((0, 8)),
        np.empty((0, 2, 2)), np.empty((0, 2)), 2.0, 0, faces=faces,
    )  # fmt: skip


def _heat(model: Model, state: State, moved: Moved) -> None:
    material = dict.fromkeys(("density", "heat_capacity", "conductivity", "young", "poisson"), 0.1)
    HeatStep(
        model, state, HeatSettings(heat_laws([material], "effusivity", np.zeros((1, 1))))
    ).flow(moved, _schedule(model, moved.scene), 1.0, 0.0, is_plain=True)


def _finish(model: Model, state: State, moved: Moved, pieces: Pieces | None) -> None:
    """What follows the solve, the last first."""
    scene, contacts, bodies, *_ = moved
    lanes = _schedule(model, scene)
    tabulate_contacts(moved, has_couples=False, has_faces=pieces is not None)
    tabulate(
        1, _NOBODY, _NOBODY, lanes.lane, lanes.frame, lanes.impulse, lanes.before, lanes.gap,
        lanes.branch, contacts,
    )  # fmt: skip
    if pieces is None:
        carried(1, _NOBODY, _NOBODY, lanes.lane, lanes.impulse, contacts)
    else:
        carried_points(_NOBODY, _NOBODY, lanes.lane, lanes.impulse, contacts)
    wrap(state.position, state.image, model.period)
    mass = model.grains.mass
    push_apart(
        scene, pieces, model.shapes.geometry, _NOBODY, _NOBODY, both_ways(_NO_ROWS, _NOBODY),
        mass, mass, np.zeros((1, 3)), 1.0, 0.0, np.zeros(1, np.bool_),
    )  # fmt: skip
    deepest_overlap(scene, pieces, _NOBODY, _NOBODY)
    deep_pairs(lanes.depth, lanes.slot, lanes.of_walls, _NOBODY, _NOBODY, 1.0)
    sums = account_grains(
        lanes.middle, lanes.velocity, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
        lanes.before, lanes.gap, lanes.branch, lanes.depth, 1.0, model.period, 0.0, 0.0, 0.0,
    )  # fmt: skip
    of_contacts = account_contacts(scene, scene, contacts, bodies, _NOBODY, sums)
    if pieces is not None:
        account_faces(
            scene, scene, pieces, contacts, bodies, NO_FACES, of_contacts.total,
            of_contacts.wall_impulse, of_contacts.belt_impulse, np.zeros(0),
        )  # fmt: skip
    motion = WallMotion(model, [WallDrive()])
    nothing = Correction(0.0, 0.0, 0.0, 0), Outcome(0.0, True, 0.0, 0.0, 0.0)
    book_step(state, motion, of_contacts, 0.0, 0.0, *nothing, 1.0)
    move(
        state.position.copy(), bodies, bodies, model.grains.radius, mass, model.gravity,
        model.shape_factor, 1.0, state.position,
        state.velocity,
    )  # fmt: skip
    if pieces is not None:
        closed_beyond(scene, pieces, bodies, bodies, 1.0, NO_FACES, np.empty(0))
    find_closing(scene, pieces, _NOBODY, _NOBODY, bodies, bodies, 1.0, 1.0, 1.0)


def _schedule(model: Model, scene: Scene) -> Schedule:
    tile = lay_tiles(scene, 0.0, model.mean_diameter)
    return schedule_contacts(scene, _NOBODY, _NOBODY, tile, np.zeros(1, np.bool_)).cut()


def _prepare(
    model: Model, scene: Scene, contacts: Contacts, bodies: Floats, pieces: Pieces | None
) -> None:
    """What precedes the solve, the last first."""
    lanes = _schedule(model, scene)
    assemble(
        scene, contacts, lanes, np.zeros(1), np.zeros((1, 3)), model.shape_factor,
        has_couples=False, has_faces=pieces is not None,
    ).collect(contacts)  # fmt: skip
    if pieces is not None:
        unpack_points(_NOBODY, np.empty((0, 2)), contacts)
        begin_faces(
            scene, pieces, model.laws, bodies, bodies, 1.0, 1.0, 1.0, 1.0, NO_FACES,
            np.zeros(0, np.bool_), contacts,
        )  # fmt: skip
    begin_walls(scene, model.laws, bodies, 1.0, 1.0, lanes.of_walls, contacts)
    begin_grains(
        lanes.middle, lanes.start, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
        lanes.before, lanes.gap, lanes.branch, 1.0, 1.0, model.period, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip
    pack_bodies(scene, bodies, bodies, lanes.place, lanes.velocity, lanes.start, lanes.middle)
    known = _NOBODY, _NOBODY, np.empty((0, 2))
    recall_impulses(*known, 1, _NOBODY, _NOBODY, lanes.lane, lanes.impulse, contacts)
    if pieces is not None:
        recall_points(*known, _NOBODY, NO_FACES, contacts)
    fix_lanes(scene, model.laws, bodies, _NOBODY, _NOBODY, lanes.slot, lanes.about, lanes.frame)
    leave_out(_NO_ROWS, _NOBODY, _NOBODY, _NOBODY)
    if pieces is None:
        _come_late(scene, contacts, bodies, lanes)
        near_pairs(scene, _NO_ROWS, _NOBODY, np.empty(0))
    else:
        span_of(scene, _NOBODY, _NOBODY)
        points_up_to(scene, pieces, _NO_ROWS, _NOBODY, 1.0)
    look_at_pairs(scene, pieces, _NO_ROWS, _NOBODY, bodies, bodies, 1.0, 1.0, 1.0, np.empty(0))


def _come_late(scene: Scene, contacts: Contacts, bodies: Floats, lanes: Schedule) -> None:
    """What pairs of discs need that close between two searches."""
    closing_soon(scene, _NOBODY, _NOBODY, bodies, bodies, 1.0, 1.0, 1.0)
    merge_late(_NOBODY, _NOBODY, _NOBODY, _NOBODY, _NOBODY, lanes.lane, lanes.slot)
    place_late(
        _NOBODY, _NOBODY, _NOBODY, lanes.place, np.zeros(1, np.bool_), lanes.velocity.shape[0],
        *lanes.room, lanes.slot, lanes.pair, lanes.lane,
    )  # fmt: skip
    make_rows(contacts, contacts, _NOBODY, _NOBODY, _NOBODY, _NOBODY, 1)
    contacts_with_walls(_NOBODY, lanes.lane, 1, 0)


def _unstick(system: System, momentum: Momentum, memory: NDArray[np.void]) -> None:
    """What only steps need in which the sweeps are stuck, the last first."""
    contact = np.zeros(1, np.int64)
    step_back(system, momentum)
    release(system, contact, hold(system, contact))
    is_converged(system, NEVER, memory[0], False)
    begin_again(system, momentum, True, memory[0])
    solve_patch(system, contact)
    met = nothing_met(system)
    keep_in_mind(system, met)
    choose_patch(system, 1, met)
    has_clusters(system)


def _one_grain(*, has_shapes: bool) -> Model:
    one, zero, index = np.ones(1), np.zeros(1), np.zeros(1, np.int32)
    triangle = np.array([[1.0, 0.0], [-0.5, 0.5], [-0.5, -0.5]])
    return Model(
        grains=Grains(one, one, one, index, index),
        shapes=WallShapes(index, index, np.ones((1, 4)), index),
        walls=Walls(("wall",), one, one, np.zeros(1, np.bool_), one),
        laws=ContactLaws(zero[None], zero[None], index[None] - 1, index, np.empty(0), np.empty(0)),
        materials=("stuff",), groups=("grains",), period=100.0, gravity=np.zeros(2),
        shape_factor=2.0, thermal=Thermal(one, one, one),
        outlines=Outlines.of([[(triangle, 0.0)]], one, one) if has_shapes else None,
    )  # fmt: skip

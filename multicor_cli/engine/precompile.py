"""Compiles the kernels of a step without taking one: for a second process, while a first run
compiles them too.

A run needs its kernels in the order of the phases of a step. This process takes them in another:
the longest first, then those that come last, so that the two seldom compile the same. Whatever is
in the cache when a run asks for it is loaded. The kernels are called with one grain and no contact,
on one thread as in small problems: what is compiled depends on the kinds of the arguments and on
nothing else.
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
    WarmStart,
    refresh_contacts,
)
from multicor_cli.engine.contact.ordering import lay_tiles, schedule_contacts
from multicor_cli.engine.contact.patches import (
    choose_patch,
    has_clusters,
    hold,
    release,
    solve_patch,
)
from multicor_cli.engine.contact.selection import (
    deepest_overlap,
    find_closing,
    leave_out,
    measure_pairs,
)
from multicor_cli.engine.contact.solve import Outcome
from multicor_cli.engine.contact.sweep import EXACT, System
from multicor_cli.engine.contact.system import Moved, assemble, tabulate_contacts
from multicor_cli.engine.energy.account import account_contacts, book_step, warm_start_of
from multicor_cli.engine.geometry.neighbors import pairs_within
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.settings import HeatSettings, heat_laws
from multicor_cli.engine.heat.step import HeatStep
from multicor_cli.engine.jit.chunks import aligned, chunks_for
from multicor_cli.engine.jit.threads import use_threads
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.engine.motion.moves import move, wrap
from multicor_cli.engine.motion.separation import (
    Correction,
    measure_overlaps,
    separate,
    surround,
)
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.columns import MASS
from multicor_cli.model.model import ContactLaws, Floats, Grains, Model, Thermal, Walls, WallShapes
from multicor_cli.model.state import State

_NOBODY = np.empty(0, np.int32)
_NO_ROWS = np.zeros(2, np.int64)


def precompile() -> None:
    """Compile a step from its solve on, then what prepares the solve, then what hard steps need."""
    use_threads(1)
    model = _one_grain()
    state = State.at_rest(model, np.zeros((1, 2)))
    scene = Scene(
        state.position, model.grains.radius, model.material, model.shapes.kind, model.shapes.wall,
        np.zeros((1, 4)),
        state.wall_position, model.period,
    )  # fmt: skip
    contacts = np.zeros(0, CONTACT)
    bodies = np.zeros((2, 4))
    system = _without_contacts()
    memory, momentum = start_loop(0), start_momentum(system)
    iterate(system, momentum, EXACT, True, False, 0, False, NEVER, memory, np.empty(1))
    moved = Moved(scene, contacts, bodies, _NOBODY, _NOBODY, _NOBODY, _NOBODY)
    _heat(model, state, moved)
    _finish(model, state, moved)
    _prepare(model, scene, contacts, bodies)
    _unstick(system, momentum, memory)


def _without_contacts() -> System:
    frame, slot = aligned((1, 5, LANES)), np.full((1, LANES), -1, np.int32)
    frame[:] = 0.0
    frame[:, MASS] = 1.0
    impulse, pair = aligned((1, 2, LANES)), aligned((1, 2, LANES), np.int32)
    impulse[:], pair[:] = 0.0, 0
    velocity = aligned((1, 4))
    velocity[:] = 0.0
    return System(
        velocity, np.zeros((1, 3)), slot, pair, frame, impulse, _NO_ROWS, _NO_ROWS,
        np.empty((0, 2), np.int32), np.empty((0, 8)),
        np.empty((0, 2, 2)), np.empty((0, 2)), 2.0, 0,
    )  # fmt: skip


def _heat(model: Model, state: State, moved: Moved) -> None:
    material = dict.fromkeys(("density", "heat_capacity", "conductivity", "young", "poisson"), 0.1)
    HeatStep(
        model, state, HeatSettings(heat_laws([material], "effusivity", np.zeros((1, 1))))
    ).flow(moved, 1.0, 0.0)


def _finish(model: Model, state: State, moved: Moved) -> None:
    """What follows the solve, the last first."""
    scene, contacts, bodies, *_ = moved
    tabulate_contacts(moved, has_couples=False)
    warm_start_of(contacts, has_couples=False)
    wrap(state.position, state.image, model.period)
    gap, marked, mass = np.empty(0), np.zeros(1, np.bool_), model.grains.mass
    separate(scene, _NOBODY, _NOBODY, marked, mass, np.zeros((1, 2)), 1.0, 1.0, 1.0, 1)
    surround(_NOBODY, _NOBODY, 1, marked)
    measure_overlaps(scene, _NO_ROWS, _NOBODY, 1.0, gap, marked, chunks_for(1, 2))
    deepest_overlap(scene, _NOBODY, _NOBODY)
    move(
        state.position.copy(), bodies, bodies, model.grains.radius, mass, model.gravity,
        model.shape_factor, 1.0, state.position,
        state.velocity,
    )  # fmt: skip
    sums = account_contacts(scene, scene, contacts, bodies)
    motion = WallMotion(model, [WallDrive()])
    nothing = Correction(0.0, 0.0, 0.0, 0), Outcome(0.0, True, 0.0, 0.0, 0.0)
    book_step(state, motion, sums, 0.0, 0.0, *nothing, 1.0)
    find_closing(scene, _NOBODY, _NOBODY, bodies, bodies, 1.0, 1.0, 1.0)


def _prepare(model: Model, scene: Scene, contacts: Contacts, bodies: Floats) -> None:
    """What precedes the solve, the last first."""
    tile = lay_tiles(scene, _NOBODY, _NOBODY, model.mean_diameter)
    schedule = schedule_contacts(scene, _NOBODY, _NOBODY, tile, np.zeros(1, np.bool_))
    assemble(
        scene, contacts, schedule, bodies, np.zeros((1, 3)), model.shape_factor, has_couples=False
    ).collect(contacts)
    warm = WarmStart(_NO_ROWS, _NOBODY, np.empty((0, 2)), np.empty(0))
    refresh_contacts(scene, model.laws, bodies, 1.0, warm, 1.0, contacts)
    leave_out(_NO_ROWS, _NOBODY, _NOBODY, _NOBODY)
    pairs_within(_NO_ROWS, _NOBODY, np.empty(0), 1.0)
    measure_pairs(scene, _NO_ROWS, _NOBODY, bodies, bodies, 1.0, np.empty(0), chunks_for(1))


def _unstick(system: System, momentum: Momentum, memory: NDArray[np.void]) -> None:
    """What only steps need in which the sweeps are stuck, the last first."""
    contact = np.zeros(1, np.int64)
    step_back(system, momentum)
    release(system, contact, hold(system, contact))
    is_converged(system, NEVER, memory[0], False)
    begin_again(system, momentum, True, memory[0])
    solve_patch(system, contact)
    choose_patch(system, 1)
    has_clusters(system)


def _one_grain() -> Model:
    one, zero, index = np.ones(1), np.zeros(1), np.zeros(1, np.int32)
    return Model(
        grains=Grains(one, one, one, index, index),
        shapes=WallShapes(index, index, np.ones((1, 4)), index),
        walls=Walls(("wall",), one, one, np.zeros(1, np.bool_), one),
        laws=ContactLaws(zero[None], zero[None], index[None] - 1, index, np.empty(0), np.empty(0)),
        materials=("stuff",),
        groups=("grains",),
        period=100.0,
        gravity=np.zeros(2),
        shape_factor=2.0,
        thermal=Thermal(one, one, one),
    )

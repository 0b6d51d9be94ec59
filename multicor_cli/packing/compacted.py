"""Packings compacted by the engine between a floor and a loaded lid.

A random packing is pressed by a lid without gravity until everything is at rest. Impacts are
perfectly inelastic, and a background damping takes the energy out of grains that no contact holds.
The lid approaches at a speed that is slow against that of a grain pushed by the load (an inertial
number of about 0.03), so that the result depends on the friction, not on how it was made.

Grains with little or no friction never quite come to rest: they creep and rearrange as long as one
waits. If the energy has not fallen far enough some time after the lid has found its place, the
coefficient of friction is raised to hold the grains there.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ContactLaws, Grains, Model, ShapeKind, State, WallBody
from multicor_cli.model.columns import NORMAL, SPIN, X, Y
from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.packing.initial_grains import InitialGrains, PackingRegion, Shape, inertias
from multicor_cli.packing.walls import join_shapes, join_walls
from multicor_cli.scenario.problems import Refused

_STEP = 0.1  # of √(m/P), the time in which the load moves a grain by its size
_APPROACH = 0.03  # speed of the unhindered lid over H/√(m/P)
_DAMPING = 0.05  # share of the velocity that a grain loses per step
_BALANCE = 0.02  # the lid carries its load to this share
_MOST_STEPS = 20_000
_PATIENCE = 600  # steps of creep before the grains are held
_HOLDING_FRICTION = 0.5
_LID = 1  # index of the lid; the floor is wall 0
_UP, _DOWN = (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, -1.0)  # planes


def compact(
    grains: InitialGrains,
    region: PackingRegion,
    *,
    mass: Floats,
    shape: Shape,
    pressure: float,
    friction: float,
    kinetic_energy_ratio: float,
) -> Floats:
    """Press a packing without overlaps together: new centers [m], shape ``(n, 2)``.

    Grains that are no discs turn meanwhile, and their angles follow, shape ``(n, 3)``.
    ``region``'s bottom is the floor, its top where the lid starts; it has sides unless it is
    periodic. Masses [kg] have shape ``(n,)``; the load on the lid per length is ``pressure`` [N/m];
    ``friction`` is that of all bodies meanwhile. The packing is at rest when its kinetic energy has
    fallen to ``kinetic_energy_ratio`` of its largest value; if it does not come to rest, or the
    engine fails, it is `Refused`.
    """
    from multicor_cli.engine import PhysicsError

    model, state = _press(grains, mass, region, shape, friction)
    beat = math.sqrt(mean(mass) / pressure)
    load = pressure * region.width
    drag = load * beat / (_APPROACH * region.height)
    lid = WallDrive(y=DofDrive(force=Constant(-load), damping=drag))
    press, at_rest = _Press(model, state, lid, load, _STEP * beat), kinetic_energy_ratio
    try:
        # The lid comes down until the grains carry it and most of the motion is over
        press.advance(_MOST_STEPS, motion=0.02, imbalance=0.2)
        if not press.advance(_PATIENCE, motion=at_rest, imbalance=_BALANCE):
            press.hold()
            if not press.advance(_MOST_STEPS, motion=at_rest, imbalance=_BALANCE):
                what = f"the packing has not come to rest within {press.steps} steps of compaction"
                key = ("packing", "kinetic_energy_ratio")
                raise Refused(key, what, "raise kinetic_energy_ratio")
    except PhysicsError as error:
        remedy = "start from a lower fill or a larger region"
        raise Refused(("packing",), f"the compaction failed: {error}", remedy) from error
    return state.position[:, : 2 if grains.forms is None else 3].copy()


class _Press:
    """The engine at work on one packing."""

    def __init__(self, model: Model, state: State, lid: WallDrive, load: float, dt: float) -> None:
        self.model, self.state, self.load, self.dt = model, state, load, dt
        self.lid = model.grain_count + int(np.flatnonzero(model.shapes.wall == _LID)[0])
        self.steps = 0
        self._drives = [WallDrive(), lid, *[WallDrive()] * (model.wall_count - 2)]
        self._peak = 0.0
        self._start(model)

    def _start(self, model: Model) -> None:
        from multicor_cli.engine import Engine, Orders, Settings

        # The result is a place to start from, not a measurement: a step that needs very many sweeps
        # may stay inexact.
        settings = Settings(
            tolerance_rms=3e-4, tolerance_max=5e-3, tolerance_energy=5e-3, max_sweeps=300
        )
        self._engine = Engine(model, self.state)
        self._engine.begin(Orders(self._drives, settings))

    def advance(self, most: int, *, motion: float, imbalance: float) -> bool:
        """Step until both have fallen so far; False if they have not after ``most`` steps.

        ``motion`` is the kinetic energy over its peak, ``imbalance`` |lid's force − load| over the
        load.
        """
        state = self.state
        for _ in range(most):
            self._engine.step(self.dt, self.steps * self.dt)
            self.steps += 1
            kinetic = self._kinetic()
            self._peak = max(self._peak, kinetic)
            state.velocity *= 1.0 - _DAMPING
            left = kinetic / self._peak if self._peak > 0.0 else 0.0
            held = total(state.contact_impulse[state.contact_j == self.lid, NORMAL]) / state.last_dt
            if left <= motion and abs(held / self.load - 1.0) <= imbalance:
                return True
        return False

    def _kinetic(self) -> float:
        """Kinetic energy of the grains and of the lid [J]."""
        v, grains = self.state.velocity, self.model.grains
        square = grains.mass * (v[:, X] * v[:, X] + v[:, Y] * v[:, Y])
        square += grains.inertia * (v[:, SPIN] * v[:, SPIN])
        lid = float(self.state.wall_velocity[_LID, 1])
        return 0.5 * total(square) + 0.5 * float(self.model.walls.mass[_LID]) * lid * lid

    def hold(self) -> None:
        laws = self.model.laws
        higher = laws._replace(friction=np.maximum(laws.friction, _HOLDING_FRICTION))
        self._start(replace(self.model, laws=higher))


def _press(
    grains: InitialGrains, mass: Floats, region: PackingRegion, shape: Shape, friction: float
) -> tuple[Model, State]:
    """Grains between a floor and a lid, with sides unless the region is periodic."""
    names = ["floor", "lid"]
    bodies = [
        WallBody.empty((region.left, height), region.width).with_shapes(ShapeKind.PLANE, [plane])
        for height, plane in ((region.bottom, _UP), (region.top, _DOWN))
    ]
    if not region.is_periodic:
        half = 0.5 * region.width
        middle = 0.5 * (region.left + region.right), 0.5 * (region.bottom + region.top)
        sides = [(-half, 0.0, 1.0, 0.0), (half, 0.0, -1.0, 0.0)]
        both = WallBody.empty(middle, 2.0 * region.height).with_shapes(ShapeKind.PLANE, sides)
        bodies.append(both)
        names.append("sides")
    radius, forms = grains.radius, grains.forms
    # As heavy as one layer of grains: it neither rattles nor drags.
    lid_mass = mean(mass) * region.width / (2.0 * mean(radius))
    inertia = [(lid_mass if k == _LID else math.nan, math.nan) for k in range(len(bodies))]
    one, none = np.full((1, 1), friction), np.zeros(0)
    laws = ContactLaws(
        one, np.zeros((1, 1)), np.full((1, 1), -1, np.int32), np.zeros(1, np.int32), none, none
    )
    index = np.zeros(radius.size, np.int32)
    model = Model(
        grains=Grains(radius, mass, inertias(radius, mass, shape, forms), index, index),
        shapes=join_shapes(bodies, [0] * len(bodies)),
        walls=join_walls(names, bodies, inertia, [False] * len(bodies)),
        laws=laws,
        materials=("grain",),
        groups=("grains",),
        period=region.period,
        gravity=np.zeros(2),
        shape_factor=SHAPE_FACTOR[shape],
        outlines=None if forms is None else forms.outlines,
    )
    state = State.at_rest(model, grains.position)
    state.wall_position[:, :2] = [body.origin for body in bodies]
    return model, state

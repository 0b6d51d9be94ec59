"""Motion of the walls in a step: prescribed velocities, and degrees of freedom driven by a force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.geometry.affine import shape_velocities
from multicor_cli.engine.geometry.drift import Closing, Drift, bound_closing
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.model.columns import RADIUS, SPIN
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import TAIL, ShapeKind, Tail


class WallMotion:
    """The drives of one stage, evaluated step by step.

    Conventions (theory §2): V⁻ is the wall's velocity at the end of the previous step, V⁺ = V(t + Δt); loads act at
    t + ½Δt; damping acts at the mid-step velocity, so that the effective mass is M + ½cΔt.

    Attributes:
        driven: Which degrees of freedom a force drives, shape ``(w, 3)``.
        is_free: Which walls have at least one such degree of freedom, shape ``(w,)``.
        mass: Mass or inertia of the driven degrees of freedom, 0 elsewhere, shape ``(w, 3)``.
        damping: Damping coefficients of driven degrees of freedom, shape ``(w, 3)``.
        load: Applied forces and torques at mid-step, gravity left out, shape ``(w, 3)``; set by `predict`.
        weight: Weights of the driven degrees of freedom, shape ``(w, 3)``; set by `predict`.
        mobility: Inverse masses, 0 where not driven, shape ``(w, 3)``.
        inverse: Inverse effective masses of the step, 0 where not driven, shape ``(w, 3)``; set by `predict`.
    """

    def __init__(self, model: Model, drives: list[WallDrive]) -> None:
        if len(drives) != model.wall_count:
            message = f"{model.wall_count} walls need as many drives, not {len(drives)}"
            raise ValueError(message)
        w = model.wall_count
        dofs = [drive.dofs() for drive in drives]
        self._drives = [(wall, d, drive) for wall, of_wall in enumerate(dofs) for d, drive in enumerate(of_wall)]
        self.driven: NDArray[np.bool_] = np.array([drive.force is not None for _, _, drive in self._drives], bool).reshape(w, 3)
        self.is_free: NDArray[np.bool_] = np.asarray(self.driven.any(axis=1))
        masses = np.column_stack([model.walls.mass, model.walls.mass, model.walls.inertia]).reshape(w, 3)
        if np.isnan(masses[self.driven]).any():
            message = "a wall driven by a force needs a mass, and one driven by a torque an inertia"
            raise ValueError(message)
        self.mass: Floats = np.where(self.driven, masses, 0.0)
        self.damping: Floats = np.array([drive.damping for _, _, drive in self._drives]).reshape(w, 3)
        self.weight: Floats = np.zeros((w, 3))
        self._is_heavy: NDArray[np.bool_] = self.driven & model.walls.has_gravity[:, None]
        self._pushed = np.argwhere(self.driven).tolist()
        self.mobility: Floats = _inverse_where(self.driven, self.mass)
        self.load: Floats = np.zeros((w, 3))
        self.inverse: Floats = np.zeros((w, 3))
        self._length = model.walls.length
        self._extent = _extents(model)

    def predict(self, velocity: Floats, gravity: Floats, t: float, dt: float) -> Floats:
        """Velocities V⁺ of the prescribed degrees of freedom and free velocities of the driven ones, shape ``(w, 3)``.

        Args:
            velocity: V⁻, shape ``(w, 3)``.
            gravity: Acceleration of gravity at mid-step [m/s²], shape ``(2,)``.
            t: Time since the start of the stage at the beginning of the step [s].
            dt: Time step [s].
        """
        after = np.zeros_like(velocity)
        self.load[:] = 0.0
        for w, d, drive in self._drives:
            if drive.force is not None:
                self.load[w, d] = drive.force.value(t + 0.5 * dt)
            elif drive.velocity is not None:
                after[w, d] = drive.velocity.value(t + dt)
        driven = self.driven
        if not self._pushed:
            return after
        self.weight = np.where(self._is_heavy, self.mass * np.append(gravity, 0.0), 0.0)
        half = 0.5 * dt * self.damping
        self.inverse = _inverse_where(driven, self.mass + half)
        free = ((self.mass - half) * velocity + dt * (self.load + self.weight)) * self.inverse
        after[driven] = free[driven]
        return after

    def pressure(self) -> float:
        """Largest load per length of a wall [N/m]."""
        forces = (abs(self.load[w, d] + self.weight[w, d]) / self._length[w] for w, d in self._pushed if d < SPIN)
        return float(max(forces, default=0.0))

    def kinetic(self, velocity: Floats) -> float:
        """Kinetic energy of the driven degrees of freedom [J]."""
        return total(0.5 * self.mass * velocity * velocity)

    def closing(self, drift: Drift, scene: Scene, *velocities: Floats) -> Closing:
        """Bounds on how fast shapes come closer [m/s], given velocities of the grains and one or more of the walls ``(w, 3)``."""
        vectors, turn = np.empty((len(scene.world), 2)), np.empty(len(scene.world))
        closing = Closing(0.0, 0.0, 0.0, 0.0)
        for velocity in velocities:
            shape_velocities(scene.kind, scene.wall, scene.world, scene.wall_position, velocity, self._extent, vectors, turn)
            closing = closing.or_faster(bound_closing(scene.kind, drift, scene.world, vectors, turn))
        return closing


def _inverse_where(chosen: NDArray[np.bool_], values: Floats) -> Floats:
    """1/value where chosen, 0 elsewhere."""
    return np.where(chosen, 1.0 / np.where(chosen, values, 1.0), 0.0)


def _extents(model: Model) -> Floats:
    """How far the shapes of each wall reach from its reference point; planes reach across all grains and are given 1 m."""
    extent = np.zeros(model.wall_count)
    for kind, wall, g in zip(model.shapes.kind, model.shapes.wall, model.shapes.geometry, strict=True):
        reach, tail = hypot(*g[:2].tolist()), hypot(*g[2:].tolist())
        if TAIL[kind] == Tail.POINT:
            reach = max(reach, tail)
        elif TAIL[kind] == Tail.DIRECTION:
            reach += tail
        elif kind == ShapeKind.DISC:
            reach += float(g[RADIUS])
        extent[wall] = max(extent[wall], reach)
    return extent

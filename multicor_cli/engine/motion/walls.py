"""Motion of walls in a step: prescribed, or driven by loads and springs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.motion.cell import sides_at_middle
from multicor_cli.engine.motion.drives import DofDrive, Signal, Spacing, WallDrive
from multicor_cli.model.columns import RADIUS, SPIN, X, Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import TAIL, ShapeKind, Tail
from multicor_cli.model.state import State


class WallMotion:
    """The drives of one stage, evaluated step by step.

    Conventions (theory §2): V⁻ is the wall's velocity at the end of the previous step, V⁺ = V(t +
    Δt); where the position is prescribed, both follow from it. Loads act at t + ½Δt, damping and
    springs at the mean velocity and displacement of the step, so that the effective mass is M +
    ½cΔt + ¼kΔt².

    Arrays are of shape ``(w, 3)``, those after ``extent`` are set by `predict`.

    Attributes:
        driven: Which degrees of freedom loads or springs drive; other arrays are 0 elsewhere.
        is_free: Which walls have at least one such degree of freedom, shape ``(w,)``.
        mass: Masses or inertias; ``damping`` and ``stiffness`` are of dampers and springs.
        mobility: Inverse masses.
        extent: How far the shapes of each wall reach from its reference point [m], planes 1 m,
            shape ``(w,)``.
        before: V⁻, of all degrees of freedom.
        jumps: Whether one of these is not the velocity with which the step before has ended.
        load: Forces and torques at mid-step without gravity; of springs at the start of the step.
        weight: Weights.
        inverse: Inverse effective masses of the step.
        belt_before: −V_s⁻, as in column `BELT` of the bodies, shape ``(w,)``; ``belt`` is −V_s⁺.
    """

    def __init__(self, model: Model, drives: list[WallDrive]) -> None:
        if len(drives) != model.wall_count:
            message = f"{model.wall_count} walls need as many drives, not {len(drives)}"
            raise ValueError(message)
        w = model.wall_count
        dofs = [drive.dofs() for drive in drives]
        self._drives = [
            (wall, d, drive) for wall, of_wall in enumerate(dofs) for d, drive in enumerate(of_wall)
        ]
        self._acting = [
            (wall, d, drive)
            for wall, d, drive in self._drives
            if drive.is_driven or drive.position is not None or drive.velocity is not None
        ]
        self.driven: NDArray[np.bool_] = np.array(
            [drive.is_driven for _, _, drive in self._drives], bool
        ).reshape(w, 3)
        self.is_free: NDArray[np.bool_] = np.asarray(self.driven.any(axis=1))
        masses = np.column_stack([model.walls.mass, model.walls.mass, model.walls.inertia]).reshape(
            w, 3
        )
        if np.isnan(masses[self.driven]).any():
            message = "a wall driven by a force needs a mass, and one driven by a torque an inertia"
            raise ValueError(message)
        self.mass: Floats = np.where(self.driven, masses, 0.0)
        self.damping: Floats = np.array([drive.damping for _, _, drive in self._drives]).reshape(
            w, 3
        )
        springs = [
            0.0 if drive.spring is None else drive.spring.stiffness for _, _, drive in self._drives
        ]
        self.stiffness: Floats = np.array(springs).reshape(w, 3)
        self.weight: Floats = np.zeros((w, 3))
        self._is_heavy: NDArray[np.bool_] = self.driven & model.walls.has_gravity[:, None]
        self._pushed = np.argwhere(self.driven).tolist()
        self.mobility: Floats = np.where(
            self.driven, 1.0 / np.where(self.driven, self.mass, 1.0), 0.0
        )
        self.before: Floats = np.zeros((w, 3))
        self.jumps = False
        self.load: Floats = np.zeros((w, 3))
        self.inverse: Floats = np.zeros((w, 3))
        self.belt_before: Floats = np.zeros(w)
        self.belt: Floats = np.zeros(w)
        self._surfaces = [
            (wall, drive.surface) for wall, drive in enumerate(drives) if drive.surface is not None
        ]
        self._start: Floats = np.zeros((w, 3))
        self._length: Floats = np.repeat(model.walls.length[:, None], 3, axis=1)
        self._spacings = _spacings(model, self._drives)
        self._is_cell = model.is_cell
        self.extent: Floats = _extents(model)

    def origins(self, state: State) -> Floats:
        """`State.wall_origin` from the start of the stage on; drives that are kept keep theirs."""
        if not any(drive.has_origin for _, _, drive in self._drives):
            return np.empty((0, 3))
        origin = state.wall_position.copy()
        for w, d, drive in self._drives:
            if drive.is_kept:
                origin[w, d] = state.wall_origin[w, d]
        return origin

    def predict(self, state: State, gravity: Floats, t: float, dt: float) -> Floats:
        """V⁺ of prescribed degrees of freedom and free velocities of driven ones, shape ``(w, 3)``.

        ``gravity`` is that at mid-step [m/s²], ``t`` the time from the start of the stage to that
        of the step [s].
        """
        self.before, after = state.wall_velocity.copy(), np.zeros(state.wall_velocity.shape)
        self.jumps = False
        self.load[:] = 0.0
        for (w, d), spacing in self._spacings.items():
            self._length[w, d] = abs(spacing.of(state))
        if self._is_cell:  # pressures push it together, a shear stress shears it
            width, height, _ = sides_at_middle(
                state.wall_position[0], state.wall_velocity[0], 0.5 * dt
            ).tolist()
            self._length[0] = width * height * np.array([-1.0, -1.0, 1.0])
        for w, d, drive in self._acting:
            u = (
                float(state.wall_position[w, d] - state.wall_origin[w, d])
                if drive.has_origin
                else 0.0
            )
            if drive.is_driven:
                self.load[w, d] = _load(drive, float(self._length[w, d]), u, t + 0.5 * dt)
            elif drive.position is not None:
                self.before[w, d], after[w, d] = follow(drive.position, u, t, dt)
                self.jumps |= bool(self.before[w, d] != state.wall_velocity[w, d])
            elif drive.velocity is not None:
                after[w, d] = drive.velocity.value(t + dt)
        if state.wall_surface.size:
            self.belt_before = 0.0 - state.wall_surface
        for w, surface in self._surfaces:
            self.belt[w] = 0.0 - surface.value(t + dt)
        if self._pushed:
            self._set_free(after, gravity, dt)
            self._start = state.wall_position
        return after

    def _set_free(self, after: Floats, gravity: Floats, dt: float) -> None:
        """(M + h) V⁺ = (M − h) V⁻ + Δt F with h = ½cΔt + ¼kΔt², of what is driven."""
        for w, d in self._pushed:
            mass = float(self.mass[w, d])
            is_pulled = d < SPIN and self._is_heavy[w, d]
            weight = mass * float(gravity[d]) if is_pulled else 0.0
            half = 0.5 * dt * float(self.damping[w, d])
            half += 0.25 * dt * dt * float(self.stiffness[w, d])
            inverse, before = 1.0 / (mass + half), float(self.before[w, d])
            force = float(self.load[w, d]) + weight
            self.weight[w, d], self.inverse[w, d] = weight, inverse
            after[w, d] = ((mass - half) * before + dt * force) * inverse

    def surface_after(self, state: State) -> Floats:
        """`State.wall_surface` after the step: V_s⁺, or nothing if no surface has ever run."""
        return 0.0 - self.belt if self._surfaces or state.wall_surface.size else state.wall_surface

    def pressure(self) -> float:
        """Largest load per length of a wall, or stress of a cell [N/m]."""
        loads = (
            (abs(self.load[w, d] + self.weight[w, d]), abs(self._length[w, d]))
            for w, d in self._pushed
            if d < SPIN
        )
        return float(max((force / length for force, length in loads if length > 0.0), default=0.0))

    def shift_work(self, end: Floats, shift: Floats) -> float:
        """Work of loads and springs on a ``shift`` from ``end``, where the step has led [J]."""
        return total((self.load - self.stiffness * (end - self._start + 0.5 * shift)) * shift)

    def kinetic(self, velocity: Floats) -> float:
        return total(0.5 * self.mass * velocity * velocity)


def follow(position: Signal, u: float, t: float, dt: float) -> tuple[float, float]:
    """V⁻ and V⁺ of a step that leads by ½Δt (V⁻ + V⁺) to the signal s (derived; theory §2).

    V⁺ = [s(t + 2Δt) − s(t)]/2Δt, the velocity at t + Δt to second order, depends on the signal
    alone, so that no oscillation can build up, and adds up to the displacement over many steps. V⁻
    makes good what is left. ``u`` is the displacement at ``t``, as that of the signal [m] or [rad].
    """
    after = (position.value(t + 2.0 * dt) - position.value(t)) / (2.0 * dt)
    return 2.0 * (position.value(t + dt) - u) / dt - after, after


def _load(drive: DofDrive, length: float, u: float, t: float) -> float:
    """Force or torque on a driven degree of freedom with displacement ``u`` at the time ``t``."""
    load = 0.0 if drive.force is None else drive.force.value(t)
    if drive.stress is not None:
        load += drive.stress.value(t) * length
    if drive.spring is not None:
        load -= drive.spring.stiffness * (u - drive.spring.anchor.value(t))
    return load


def _spacings(
    model: Model, drives: list[tuple[int, int, DofDrive]]
) -> dict[tuple[int, int], Spacing]:
    return {
        (w, d): Spacing.between(model, *drive.between, Y if d == X else X)
        for w, d, drive in drives
        if drive.between
    }


def _extents(model: Model) -> Floats:
    """How far shapes reach from a wall's reference point [m]; planes, which reach anywhere, 1 m."""
    kind, (x, y, u, v) = model.shapes.kind, model.shapes.geometry.T
    head, tail = np.sqrt(x * x + y * y), np.sqrt(u * u + v * v)
    outermost = np.where(TAIL[kind] == Tail.POINT, np.maximum(head, tail), head)
    outermost = np.where(TAIL[kind] == Tail.DIRECTION, head + tail, outermost)
    outermost = np.where(kind == ShapeKind.DISC, head + model.shapes.geometry[:, RADIUS], outermost)
    extent = np.zeros(model.wall_count)
    np.maximum.at(extent, model.shapes.wall, outermost)
    return extent

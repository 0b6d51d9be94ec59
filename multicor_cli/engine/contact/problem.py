"""One contact problem on its own: solve it, save it, load it, compare solvers on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.contact.detection import Contacts, Scene
from multicor_cli.engine.contact.settings import Settings
from multicor_cli.engine.contact.solve import Scale, solve_system
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.pace import Pace
from multicor_cli.model.model import Floats, Ints

_SHAPES = {
    "inverse_mass": ("b", 3),
    "velocity": ("b", 3),
    "pair": ("c", 2),
    "normal": ("c", 2),
    "lever": ("c", 2, 2),
    "bias": ("c",),
    "friction": ("c",),
}


@dataclass(frozen=True)
class ContactProblem:
    """Find impulses p with ``u = u_free + W p``, ``0 ≤ p_n ⟂ u_n + b ≥ 0``, ``|p_t| ≤ μ p_n`` opposing slip.

    ``b`` bodies, ``c`` contacts. A body that cannot be moved has inverse masses 0 (and may have a velocity).

    Attributes:
        inverse_mass: 1/m in x and y [1/kg] and 1/I [1/(kg m²)], shape ``(b, 3)``.
        velocity: Free velocities v_x, v_y [m/s], ω [rad/s], shape ``(b, 3)``.
        pair: Bodies i and j of each contact, shape ``(c, 2)``.
        normal: Unit normal from j to i, shape ``(c, 2)``.
        lever: From the center of body i, and of body j, to the contact [m], shape ``(c, 2, 2)``.
        bias: b, the term added to u_n [m/s], shape ``(c,)``.
        friction: Coefficients of friction μ, shape ``(c,)``.
    """

    inverse_mass: Floats
    velocity: Floats
    pair: Ints
    normal: Floats
    lever: Floats
    bias: Floats
    friction: Floats

    def __post_init__(self) -> None:
        """Check shapes, ranges and finiteness; raises `ValueError` naming the array."""
        sizes = {"b": len(self.inverse_mass), "c": len(self.pair)}
        for name, symbols in _SHAPES.items():
            expected = tuple(sizes[s] if isinstance(s, str) else s for s in symbols)
            array = getattr(self, name)
            if array.shape != expected:
                message = f"{name} has shape {array.shape}, not {expected}"
                raise ValueError(message)
            if not np.isfinite(array).all():
                message = f"{name} holds a value that is not finite"
                raise ValueError(message)
        if self.pair.size and not 0 <= self.pair.min() <= self.pair.max() < sizes["b"]:
            message = f"pair names a body outside 0 … {sizes['b'] - 1}"
            raise ValueError(message)
        if (self.inverse_mass < 0.0).any() or (self.friction < 0.0).any():
            message = "inverse masses and friction must not be negative"
            raise ValueError(message)
        if not (self.delassus()[:, 0] > 0.0).all():
            message = "a contact joins two bodies that cannot be moved along its normal"
            raise ValueError(message)

    def levers(self) -> Floats:
        """What ω_i adds to u_n and u_t, and what ω_j takes from them [m], shape ``(c, 4)``."""
        nx, ny = self.normal[:, 0], self.normal[:, 1]
        columns = []
        for side in (0, 1):
            lx, ly = self.lever[:, side, 0], self.lever[:, side, 1]
            columns += [lx * ny - ly * nx, lx * nx + ly * ny]
        return np.column_stack(columns) if len(self.pair) else np.empty((0, 4))

    def delassus(self) -> Floats:
        """W_nn, W_nt, W_tt of each contact [1/kg], shape ``(c, 3)``."""
        return delassus(self.pair, self.normal, self.levers(), self.inverse_mass)

    def save(self, path: str | Path) -> None:
        """Write the problem as ``.npz``."""
        np.savez_compressed(path, **{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> ContactProblem:
        """Read a problem written by `save`; raises `ValueError` or `KeyError` for anything else."""
        with np.load(path, allow_pickle=False) as data:
            arrays = {f.name: np.asarray(data[f.name]) for f in fields(cls)}
        pair = arrays.pop("pair").astype(np.int32)
        return cls(pair=pair, **{name: array.astype(np.float64) for name, array in arrays.items()})


@dataclass(frozen=True)
class ContactSolution:
    """Result of `solve_contacts`.

    Attributes:
        impulse: p_n, p_t of j on i [N s], shape ``(c, 2)``.
        velocity: Velocities of the bodies after the contacts, shape ``(b, 3)``.
        converged: Whether all tolerances were met.
        sweeps: Sweep-equivalents: sweeps plus evaluations of the residual.
        rms: rms of the velocity correction e_c over the reference velocity.
        maximum: Largest e_c over the reference velocity.
        energy: Energy residual G.
    """

    impulse: Floats
    velocity: Floats
    converged: bool
    sweeps: float
    rms: float
    maximum: float
    energy: float


def solve_contacts(
    problem: ContactProblem,
    settings: Settings | None = None,
    *,
    reference_velocity: float | None = None,
    start: Floats | None = None,
) -> ContactSolution:
    """Solve one contact problem with the solver of the engine, on one thread, in the given order of contacts.

    Args:
        problem: The problem.
        settings: Methods, tolerances and cap; default `Settings()`.
        reference_velocity: u_ref, what residuals are measured against [m/s]; default the rms of ``min(u_n + b, 0)`` over the
            contacts where the free velocity violates the law.
        start: Impulses to start from, shape ``(c, 2)``; default zero.

    Raises:
        ValueError: If ``start`` has another shape.
    """
    settings = settings or Settings()
    impulse = np.zeros((len(problem.pair), 2)) if start is None else np.array(start, np.float64)
    if impulse.shape != (len(problem.pair), 2):
        message = f"start has shape {impulse.shape}, not {(len(problem.pair), 2)}"
        raise ValueError(message)
    system, arm = _disc_system(problem, impulse) or (_general_system(problem, impulse), None)
    if reference_velocity is None:
        reference_velocity = _closing_velocity(problem)
    movable = problem.inverse_mass[:, 0] > 0.0
    energy = 0.5 * total(1.0 / problem.inverse_mass[movable, 0]) * (reference_velocity * reference_velocity)
    add_impulses(system)
    outcome = solve_system(system, Scale(reference_velocity, energy), settings, Pace())
    velocity = system.velocity[: len(problem.velocity), :3].copy()
    if arm is not None:
        velocity[:, 2] = np.where(arm > 0.0, velocity[:, 2] / np.where(arm > 0.0, arm, 1.0), problem.velocity[:, 2])
    result = system.impulse if arm is not None else system.general_impulse
    return ContactSolution(result.copy(), velocity, outcome.converged, outcome.sweeps, outcome.rms, outcome.maximum, outcome.energy)


def free_velocity(problem: ContactProblem) -> Floats:
    """u_n and u_t of the free velocities [m/s], shape ``(c, 2)``."""
    vi, vj = problem.velocity[problem.pair[:, 0]], problem.velocity[problem.pair[:, 1]]
    nx, ny = problem.normal[:, 0], problem.normal[:, 1]
    dx, dy = vi[:, 0] - vj[:, 0], vi[:, 1] - vj[:, 1]
    lever = problem.levers()
    u_n = dx * nx + dy * ny + vi[:, 2] * lever[:, 0] - vj[:, 2] * lever[:, 2]
    u_t = dy * nx - dx * ny + vi[:, 2] * lever[:, 1] - vj[:, 2] * lever[:, 3]
    return np.column_stack([u_n, u_t])


def _closing_velocity(problem: ContactProblem) -> float:
    violation = np.minimum(free_velocity(problem)[:, 0] + problem.bias, 0.0)
    violated = violation < 0.0
    return math.sqrt(mean(violation[violated] * violation[violated])) if violated.any() else 0.0


def _general_system(problem: ContactProblem, impulse: Floats) -> System:
    """All contacts with their full 2×2 matrices."""
    frame = np.empty((len(problem.pair), 7))
    frame[:, :2] = problem.normal
    frame[:, 2], frame[:, 3] = problem.bias, problem.friction
    frame[:, 4:] = problem.delassus()
    velocity = np.zeros((len(problem.velocity), 4))
    velocity[:, :3] = problem.velocity
    no_pair, none = np.empty((0, 2), np.int32), np.empty((0, 2))
    return System(
        velocity, problem.inverse_mass.copy(), no_pair, np.empty((0, 5)), none, np.zeros(2, np.int64), np.array([0, 1]),
        problem.pair.astype(np.int32), frame, problem.levers(), impulse, 1.0,
    )  # fmt: skip


def _disc_system(problem: ContactProblem, impulse: Floats) -> tuple[System, Floats] | None:
    """The light form, if every movable body is a disc or sphere of one kind and levers lie along the normals; else None.

    Also returns the radius of each body (0 for bodies that cannot be moved): the third velocity is a ω.
    """
    inverse, lever = problem.inverse_mass, problem.levers()
    movable = np.asarray(inverse.any(axis=1))
    # Signed levers: a disc's u_t gets −a ω_i and +(−a) ω_j with normals from j to i.
    arm = np.zeros(len(inverse))
    np.maximum.at(arm, problem.pair[:, 0], -lever[:, 1])
    np.maximum.at(arm, problem.pair[:, 1], lever[:, 3])
    arm[~movable] = 0.0
    if not movable.any() or (arm[movable] <= 0.0).any() or (inverse[movable, 0] == 0.0).any():
        return None
    expected = np.zeros_like(lever)
    expected[:, 1], expected[:, 3] = -arm[problem.pair[:, 0]], arm[problem.pair[:, 1]]
    fixed_j = ~movable[problem.pair[:, 1]]
    relevant = np.ones_like(lever, bool)
    relevant[fixed_j, 2:] = False
    beta = inverse[movable, 2] * (arm[movable] * arm[movable]) / inverse[movable, 0]
    tolerance = 1e-9 * arm.max()
    if (
        not movable[problem.pair[:, 0]].all()
        or (np.abs(lever - expected)[relevant] > tolerance).any()
        or not np.allclose(inverse[movable, 0], inverse[movable, 1], rtol=1e-12)
        or not np.allclose(beta, beta[0], rtol=1e-9)
    ):
        return None
    bodies, anchors = len(inverse), int(np.count_nonzero(fixed_j))
    velocity = np.zeros((bodies + anchors, 4))
    velocity[:bodies, :2] = problem.velocity[:, :2]
    velocity[:bodies, 2] = arm * problem.velocity[:, 2]
    velocity[:bodies, 3] = inverse[:, 0]
    pair = problem.pair.astype(np.int32)
    pair[fixed_j, 1] = bodies + np.arange(anchors)
    wall, reach = problem.velocity[problem.pair[fixed_j, 1]], problem.lever[fixed_j, 1]
    velocity[bodies:, 0] = wall[:, 0] - wall[:, 2] * reach[:, 1]
    velocity[bodies:, 1] = wall[:, 1] + wall[:, 2] * reach[:, 0]
    frame = np.empty((len(pair), 5))
    frame[:, :2] = problem.normal
    frame[:, 2] = 1.0 / (velocity[pair[:, 0], 3] + velocity[pair[:, 1], 3])
    frame[:, 3], frame[:, 4] = problem.bias, problem.friction
    nothing = np.empty((0, 2), np.int32)
    system = System(
        velocity, np.zeros((bodies, 3)), pair, frame, impulse, np.array([0, len(pair)]), np.array([0, 1]),
        nothing, np.empty((0, 7)), np.empty((0, 4)), np.empty((0, 2)), float(beta[0]),
    )  # fmt: skip
    return system, arm


def problem_of_step(scene: Scene, contacts: Contacts, free: Floats, wall_inverse: Floats, spin_factor: float) -> ContactProblem:
    """The contact problem of a step of the engine, in physical velocities; bodies are the grains, then the walls.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key.
        free: Free velocities (v_x, v_y, a ω or Ω, 1/m), shape ``(n + w, 4)``.
        wall_inverse: Inverse masses of the walls, shape ``(w, 3)``.
        spin_factor: β = m a²/I.
    """
    n = scene.radius.size
    velocity = free[:, :3].copy()
    velocity[:n, 2] /= scene.radius
    inverse = np.empty((len(free), 3))
    inverse[:n, 0] = inverse[:n, 1] = free[:n, 3]
    inverse[:n, 2] = spin_factor * free[:n, 3] / (scene.radius * scene.radius)
    inverse[n:] = wall_inverse
    i, j = contacts.i, contacts.j
    is_wall = j >= n
    body = j.copy()
    body[is_wall] = n + scene.wall[j[is_wall] - n]
    normal = contacts.frame[:, :2].copy()
    lever = np.empty((i.size, 2, 2))
    lever[:, 0] = -scene.radius[i][:, None] * normal
    lever[:, 1] = contacts.lever
    lever[~is_wall, 1] = scene.radius[j[~is_wall]][:, None] * normal[~is_wall]
    return ContactProblem(
        inverse, velocity, np.column_stack([i, body]), normal, lever, contacts.frame[:, 3].copy(), contacts.frame[:, 4].copy()
    )


def delassus(pair: Ints, normal: Floats, lever: Floats, inverse: Floats) -> Floats:
    """W_nn, W_nt, W_tt of contacts between bodies with an inverse mass per degree of freedom, shape ``(g, 3)`` [1/kg]."""
    nx, ny = normal[:, 0], normal[:, 1]
    result = np.zeros((len(pair), 3))
    for side in (0, 1):
        m = inverse[pair[:, side]]
        l_n, l_t = lever[:, 2 * side], lever[:, 2 * side + 1]
        result[:, 0] += m[:, 0] * (nx * nx) + m[:, 1] * (ny * ny) + m[:, 2] * (l_n * l_n)
        result[:, 1] += (m[:, 1] - m[:, 0]) * nx * ny + m[:, 2] * l_n * l_t
        result[:, 2] += m[:, 0] * (ny * ny) + m[:, 1] * (nx * nx) + m[:, 2] * (l_t * l_t)
    return result

"""One contact problem on its own: solve it, save it, load it, compare solvers on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.contact.contacts import Contacts
from multicor_cli.engine.contact.solve import ResidualScale, ThreadChoice, solve_system
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.contact.system import OneByOne, by_slot, one_tile
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.orders import Settings
from multicor_cli.model.columns import (
    BELT,
    BIAS,
    FIRST,
    INVERSE_MASS,
    MASS,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SLIDE,
    SPIN,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    X,
    Y,
)
from multicor_cli.model.model import Floats, Ints

_SHAPES = {
    "inverse_mass": ("b", 3),
    "velocity": ("b", 3),
    "pair": ("c", 2),
    "normal": ("c", 2),
    "lever": ("c", 2, 2),
    "bias": ("c",),
    "friction": ("c",),
    "slide": ("c",),
}


@dataclass(frozen=True)
class ContactProblem:
    """Find impulses p with ``u = u_free + W p``, ``0 ≤ p_n ⟂ u_n + b ≥ 0``, ``|p_t| ≤ μ p_n``.

    p_t opposes slip: u_t, that of the bodies less ``slide``, by which the surface of j runs ahead
    of it along t (n turned by +90°). ``b`` bodies, ``c`` contacts. A body that cannot be moved has
    inverse masses 0 (and may have a velocity).

    Attributes:
        inverse_mass: 1/m in x and y [1/kg] and 1/I [1/(kg m²)], shape ``(b, 3)``.
        velocity: Free velocities v_x, v_y [m/s], ω [rad/s], shape ``(b, 3)``.
        pair: Bodies i and j of each contact, shape ``(c, 2)``.
        normal: Unit normal from j to i, shape ``(c, 2)``.
        lever: From the center of body i, and of body j, to the contact [m], shape ``(c, 2, 2)``.
        bias: b, the term added to u_n [m/s], shape ``(c,)``.
        friction: Coefficients of friction μ, shape ``(c,)``.
        slide: What is taken from u_t: the speed along t with which the surface of body j runs over
            it [m/s], shape ``(c,)``; default: 0.
    """

    inverse_mass: Floats
    velocity: Floats
    pair: Ints
    normal: Floats
    lever: Floats
    bias: Floats
    friction: Floats
    slide: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Check shapes, ranges and finiteness; raises `ValueError` naming the array."""
        if not self.slide.size:
            object.__setattr__(self, "slide", np.zeros(len(self.pair)))
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
        w_nn, _, _ = self.delassus().T
        if not (w_nn > 0.0).all():
            message = "a contact joins two bodies that cannot be moved along its normal"
            raise ValueError(message)

    def levers(self) -> Floats:
        """What ω_i adds to u_n and u_t, and what ω_j takes from them [m], shape ``(c, 2, 2)``."""
        (nx, ny), levers = self.normal.T, np.empty((len(self.pair), 2, 2))
        for side in (FIRST, SECOND):
            lx, ly = self.lever[:, side].T
            levers[:, side, NORMAL] = lx * ny - ly * nx
            levers[:, side, TANGENTIAL] = lx * nx + ly * ny
        return levers

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
            arrays = {
                f.name: np.asarray(data[f.name])
                for f in fields(cls)
                if f.name in data or f.name != "slide"
            }
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
    """Solve one contact problem as the engine does, on one thread, in the given order of contacts.

    Args:
        problem: The problem.
        settings: Methods, tolerances and cap; default `Settings()`.
        reference_velocity: u_ref, what residuals are measured against [m/s]; default the rms of
            ``min(u_n + b, 0)`` over the contacts where the free velocity violates the law.
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
        violation = np.minimum(free_velocity(problem)[:, NORMAL] + problem.bias, 0.0)
        violation = violation[violation < 0.0]
        reference_velocity = math.sqrt(mean(violation * violation)) if violation.size else 0.0
    movable = problem.inverse_mass[:, X] > 0.0
    energy = 0.5 * total(1.0 / problem.inverse_mass[movable, X])
    energy *= reference_velocity * reference_velocity
    add_impulses(system)
    scale = ResidualScale(reference_velocity, reference_velocity, energy)
    outcome = solve_system(system, scale, settings, ThreadChoice())
    velocity = system.velocity[: len(problem.velocity), :INVERSE_MASS].copy()
    if arm is not None:
        spin = velocity[:, SURFACE] / np.where(arm > 0.0, arm, 1.0)
        velocity[:, SPIN] = np.where(arm > 0.0, spin, problem.velocity[:, SPIN])
    result = (
        by_slot(system.slot, system.impulse, len(problem.pair))
        if arm is not None
        else system.general_impulse.copy()
    )
    return ContactSolution(
        result, velocity, outcome.converged, outcome.sweeps, outcome.rms, outcome.maximum,
        outcome.energy,
    )  # fmt: skip


def free_velocity(problem: ContactProblem) -> Floats:
    """u_n and u_t of the free velocities [m/s], shape ``(c, 2)``."""
    (nx, ny), lever = problem.normal.T, problem.levers()
    vi, vj = (problem.velocity[problem.pair[:, side]] for side in (FIRST, SECOND))
    (i_n, i_t), (j_n, j_t) = lever[:, FIRST].T, lever[:, SECOND].T
    (dx, dy), spin_i, spin_j = (vi - vj)[:, :SPIN].T, vi[:, SPIN], vj[:, SPIN]
    u_n = dx * nx + dy * ny + spin_i * i_n - spin_j * j_n
    u_t = dy * nx - dx * ny + spin_i * i_t - spin_j * j_t
    return np.column_stack([u_n, u_t - problem.slide])


def _general_system(problem: ContactProblem, impulse: Floats) -> System:
    frame = np.empty((len(problem.pair), 8))
    frame[:, [NX, NY]] = problem.normal
    frame[:, BIAS], frame[:, MU], frame[:, SLIDE] = problem.bias, problem.friction, problem.slide
    frame[:, [W_NN, W_NT, W_TT]] = problem.delassus()
    velocity = np.zeros((len(problem.velocity), 4))
    velocity[:, :INVERSE_MASS] = problem.velocity
    nothing = OneByOne(np.empty((0, 2), np.int32), np.empty((0, 5)), np.empty((0, 2)))
    return one_tile(nothing, velocity, problem.inverse_mass.copy(), 1.0)._replace(
        general_pair=problem.pair.astype(np.int32), general_frame=frame,
        general_lever=problem.levers(), general_impulse=impulse, contacts=len(problem.pair),
    )  # fmt: skip


def _disc_system(problem: ContactProblem, impulse: Floats) -> tuple[System, Floats] | None:
    """The diagonal form and radii of bodies, if movable ones are discs of one kind, or None."""
    inverse, lever = problem.inverse_mass, problem.levers()
    movable = np.asarray(inverse.any(axis=1))
    # Signed levers: a disc's u_t gets −a ω_i and +(−a) ω_j with normals from j to i.
    arm = np.zeros(len(inverse))
    np.maximum.at(arm, problem.pair[:, FIRST], -lever[:, FIRST, TANGENTIAL])
    np.maximum.at(arm, problem.pair[:, SECOND], lever[:, SECOND, TANGENTIAL])
    arm[~movable] = 0.0
    if not movable.any() or (arm[movable] <= 0.0).any() or (inverse[movable, X] == 0.0).any():
        return None
    expected = np.zeros_like(lever)
    expected[:, FIRST, TANGENTIAL] = -arm[problem.pair[:, FIRST]]
    expected[:, SECOND, TANGENTIAL] = arm[problem.pair[:, SECOND]]
    fixed_j = ~movable[problem.pair[:, SECOND]]
    relevant = np.ones_like(lever, bool)
    relevant[fixed_j, SECOND] = False
    beta = inverse[movable, SPIN] * (arm[movable] * arm[movable]) / inverse[movable, X]
    tolerance = 1e-9 * arm.max()
    if (
        not movable[problem.pair[:, FIRST]].all()
        or problem.slide[~fixed_j].any()
        or (np.abs(lever - expected)[relevant] > tolerance).any()
        or not np.allclose(inverse[movable, X], inverse[movable, Y], rtol=1e-12)
        or not np.allclose(beta, beta[0], rtol=1e-9)
    ):
        return None
    bodies, proxies = len(inverse), int(np.count_nonzero(fixed_j))
    velocity = np.zeros((bodies + proxies, 4))
    velocity[:bodies, [X, Y]] = problem.velocity[:, [X, Y]]
    velocity[:bodies, SURFACE] = arm * problem.velocity[:, SPIN]
    velocity[:bodies, INVERSE_MASS] = inverse[:, X]
    pair = problem.pair.astype(np.int32)
    pair[fixed_j, SECOND] = bodies + np.arange(proxies)
    wall = problem.velocity[problem.pair[fixed_j, SECOND]]
    from_wall = problem.lever[fixed_j, SECOND]
    velocity[bodies:, X] = wall[:, X] - wall[:, SPIN] * from_wall[:, Y]
    velocity[bodies:, Y] = wall[:, Y] + wall[:, SPIN] * from_wall[:, X]
    velocity[bodies:, SURFACE] = problem.slide[fixed_j]
    frame = np.empty((len(pair), 5))
    frame[:, [NX, NY]] = problem.normal
    frame[:, MASS] = 1.0 / (
        velocity[pair[:, FIRST], INVERSE_MASS] + velocity[pair[:, SECOND], INVERSE_MASS]
    )
    frame[:, BIAS], frame[:, MU] = problem.bias, problem.friction
    rows = OneByOne(pair, frame, impulse)
    return one_tile(rows, velocity, np.zeros((bodies, 3)), float(beta[0])), arm


def problem_of_step(
    scene: Scene, contacts: Contacts, free: Floats, wall_inverse: Floats, spin_factor: float
) -> ContactProblem:
    """The contact problem of a step, in physical velocities; bodies are the grains, then the walls.

    ``free`` are (v_x, v_y, a ω or Ω, 1/m or s), shape ``(n + w, 4)``, ``wall_inverse`` inverse
    masses of the walls, shape ``(w, 3)``. Raises `ValueError` if there is rolling resistance.
    """
    if contacts["mu_r"].any():
        message = "a contact problem has no couples, and contacts here have rolling resistance"
        raise ValueError(message)
    n = scene.radius.size
    velocity = free[:, :INVERSE_MASS].copy()
    velocity[:n, SPIN] /= scene.radius
    inverse = np.empty((len(free), 3))
    inverse[:n, X] = inverse[:n, Y] = free[:n, INVERSE_MASS]
    inverse[:n, SPIN] = spin_factor * free[:n, INVERSE_MASS] / (scene.radius * scene.radius)
    inverse[n:] = wall_inverse
    i, j = contacts["i"], contacts["j"]
    is_wall = j >= n
    body = j.copy()
    body[is_wall] = n + scene.wall[j[is_wall] - n]
    normal = np.column_stack([contacts["nx"], contacts["ny"]])
    lever = np.empty((i.size, 2, 2))
    lever[:, FIRST] = -scene.radius[i][:, None] * normal
    lever[:, SECOND] = np.column_stack([contacts["lever_x"], contacts["lever_y"]])
    lever[~is_wall, SECOND] = scene.radius[j[~is_wall]][:, None] * normal[~is_wall]
    return ContactProblem(
        inverse, velocity, np.column_stack([i, body]), normal, lever,
        contacts["bias"].copy(), contacts["mu"].copy(),
        np.where(is_wall, free[body, BELT], 0.0),
    )  # fmt: skip


def delassus(pair: Ints, normal: Floats, lever: Floats, inverse: Floats) -> Floats:
    """W_nn, W_nt, W_tt of contacts of bodies with their own inverse masses [1/kg], ``(g, 3)``."""
    nx, ny = normal.T
    w_nn, w_nt, w_tt = np.zeros((3, len(pair)))
    for side in (FIRST, SECOND):
        m, (l_n, l_t) = inverse[pair[:, side]], lever[:, side].T
        w_nn += m[:, X] * (nx * nx) + m[:, Y] * (ny * ny) + m[:, SPIN] * (l_n * l_n)
        w_nt += (m[:, Y] - m[:, X]) * nx * ny + m[:, SPIN] * l_n * l_t
        w_tt += m[:, X] * (ny * ny) + m[:, Y] * (nx * nx) + m[:, SPIN] * (l_t * l_t)
    return np.column_stack([w_nn, w_nt, w_tt])

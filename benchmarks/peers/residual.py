"""The contact problem in matrix form, and one error for the answers of all solvers. Needs numpy and
scipy alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MatrixProblem:
    """Find p with u = W p + q, 0 ≤ p_n ⟂ u_n ≥ 0, and Coulomb's law for p_t; ``c`` contacts, normal
    before tangential.

    Attributes:
        matrix: W [1/kg], shape ``(2 c, 2 c)``.
        free: q, the free velocities with their biases [m/s], shape ``(2 c,)``.
        friction: μ, shape ``(c,)``.
        scale: What errors are measured against [m/s].
    """

    matrix: sparse.csr_matrix
    free: Floats
    friction: Floats
    scale: float


def natural_error(problem: MatrixProblem, impulse: Floats) -> float:
    """rms over the contacts of W_nn |p − proj_K(p − (u + μ|u_t| n)/W_nn)|, over the scale; 0 for a
    solution only.

    Args:
        problem: The problem.
        impulse: p_n, p_t of each contact [N s], shape ``(2 c,)`` or ``(c, 2)``.
    """
    p = np.asarray(impulse, np.float64).reshape(-1, 2)
    u = (problem.matrix @ p.ravel() + problem.free).reshape(-1, 2)
    diagonal = problem.matrix.diagonal()[::2]
    mu = problem.friction
    projected = _project(
        p[:, 0] - (u[:, 0] + mu * np.abs(u[:, 1])) / diagonal, p[:, 1] - u[:, 1] / diagonal, mu
    )
    change = diagonal[:, None] * (p - projected)
    return float(np.sqrt((change**2).sum(axis=1).mean()) / problem.scale)


def _project(n: Floats, t: Floats, mu: Floats) -> Floats:
    """Nearest points of the cones |t| ≤ μ n, shape ``(c, 2)``."""
    size = np.abs(t)
    inside = size <= mu * n
    behind = mu * size <= -n  # nearest to the apex
    edge = np.maximum((n + mu * size) / (1.0 + mu * mu), 0.0)
    normal = np.where(inside, n, np.where(behind, 0.0, edge))
    tangent = np.where(inside, t, np.where(behind, 0.0, mu * edge * np.sign(t)))
    return np.column_stack([normal, tangent])


def save_problem(
    path: str, problem: MatrixProblem, start: Floats, target: float, limit: float
) -> None:
    """Write a problem as ``.npz``.

    Args:
        path: The file.
        problem: The problem.
        start: Impulses to start from [N s], shape ``(2 c,)``.
        target: Error at which the solver may stop.
        limit: Time after which it stops [s].
    """
    w = problem.matrix
    parts = {"data": w.data, "indices": w.indices, "indptr": w.indptr}
    others = {
        "scale": np.array(problem.scale),
        "start": start,
        "target": np.array(target),
        "limit": np.array(limit),
    }
    arrays = {**parts, **others, "free": problem.free, "friction": problem.friction}
    np.savez(path, allow_pickle=False, **arrays)


def load_problem(path: str) -> MatrixProblem:
    """Read what `save_problem` has written."""
    with np.load(path) as stored:
        size = stored["free"].size
        matrix = sparse.csr_matrix(
            (stored["data"], stored["indices"], stored["indptr"]), shape=(size, size)
        )
        return MatrixProblem(matrix, stored["free"], stored["friction"], float(stored["scale"]))

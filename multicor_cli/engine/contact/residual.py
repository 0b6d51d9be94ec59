"""How far impulses are from satisfying the contact law: the only stopping criterion of the solver (theory §5.3)."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.law import solve_exact
from multicor_cli.engine.contact.sweep import EXACT, System, general_solution, general_velocity
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import kernel, loop_body, parallel_kernel, prange
from multicor_cli.model.columns import BIAS, FIRST, MASS, MU, NORMAL, NX, NY, SECOND, SURFACE, TANGENTIAL, W_NN, W_NT, W_TT, X, Y
from multicor_cli.model.model import Floats

_SQUARES, _NORMAL, _TANGENTIAL, _LARGEST, _ACTIVE = range(5)


@loop_body
def _light_residual(k: int, s: System) -> tuple[float, float, float]:
    """Square of e_c, or -1 if the contact is open and satisfied; and the powers p_n e_n and p_t e_t."""
    i, j = s.pair[k, FIRST], s.pair[k, SECOND]
    nx, ny, w_inverse, mu = s.frame[k, NX], s.frame[k, NY], s.frame[k, MASS], s.frame[k, MU]
    dx = s.velocity[i, X] - s.velocity[j, X]
    dy = s.velocity[i, Y] - s.velocity[j, Y]
    u_n = dx * nx + dy * ny + s.frame[k, BIAS]
    u_t = dy * nx - dx * ny - s.velocity[i, SURFACE] - s.velocity[j, SURFACE]
    p_n, p_t = s.impulse[k, NORMAL], s.impulse[k, TANGENTIAL]
    spread = 1.0 + s.spin_factor
    new_n, new_t = solve_exact(p_n, p_t, u_n, u_t, w_inverse, w_inverse / spread, mu)
    c_n, c_t = (new_n - p_n) / w_inverse, (new_t - p_t) * spread / w_inverse
    square = c_n * c_n + c_t * c_t
    if p_n <= 0.0 and square == 0.0:
        square = -1.0
    return square, p_n * c_n, p_t * c_t


@kernel
def _general_residual(g: int, s: System) -> tuple[float, float, float]:
    """As `_light_residual`, for a general contact."""
    u_n, u_t = general_velocity(g, s)
    new_n, new_t = general_solution(g, s, u_n, u_t, EXACT)
    f = s.general_frame[g]
    p_n, p_t = s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL]
    d_n, d_t = new_n - p_n, new_t - p_t
    c_n, c_t = f[W_NN] * d_n + f[W_NT] * d_t, f[W_NT] * d_n + f[W_TT] * d_t
    square = c_n * c_n + c_t * c_t
    if p_n <= 0.0 and square == 0.0:
        square = -1.0
    return square, p_n * c_n, p_t * c_t


@kernel
def _residual_of_chunk(chunk: int, s: System, partial: Floats) -> None:
    squares, normal, tangential, largest, active = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(chunk * CHUNK, min(s.pair.shape[0], (chunk + 1) * CHUNK)):
        square, of_normal, of_tangential = _light_residual(k, s)
        if square >= 0.0:
            squares += square
            active += 1.0
            largest = max(largest, square)
        normal += of_normal
        tangential += of_tangential
    partial[chunk, _SQUARES], partial[chunk, _LARGEST], partial[chunk, _ACTIVE] = squares, largest, active
    partial[chunk, _NORMAL], partial[chunk, _TANGENTIAL] = normal, tangential


@parallel_kernel
def _residuals_of_chunks(s: System, partial: Floats) -> None:
    for chunk in prange(partial.shape[0]):
        _residual_of_chunk(chunk, s, partial)


@kernel
def measure_residual(s: System, parallel: bool) -> tuple[float, float, float, float]:
    """Residuals of the present impulses and velocities.

    Args:
        s: The problem; read only.
        parallel: Use several threads; the result is the same.

    Returns:
        rms and maximum of e_c, the velocity correction that an exact local solve of contact c would make with the others held
        (natural map in velocity units), over contacts with p_n > 0 or e_c > 0 [m/s]; the energy residual Σ(|Σ p_n e_n| +
        |Σ p_t e_t|), with the inner sums over `CHUNK` consecutive light contacts or all general ones [J]; and the number of these
        contacts. Errors of long wavelength have one sign throughout a chunk; those of single contacts cancel.
    """
    chunks = max(1, -(-s.pair.shape[0] // CHUNK))
    partial = np.empty((chunks, 5))
    if parallel:
        _residuals_of_chunks(s, partial)
    else:
        for chunk in range(chunks):
            _residual_of_chunk(chunk, s, partial)
    squares, energy, largest, active = 0.0, 0.0, 0.0, 0.0
    for chunk in range(chunks):
        squares += partial[chunk, _SQUARES]
        energy += abs(partial[chunk, _NORMAL]) + abs(partial[chunk, _TANGENTIAL])
        largest = max(largest, partial[chunk, _LARGEST])
        active += partial[chunk, _ACTIVE]
    normal, tangential = 0.0, 0.0
    for g in range(s.general_pair.shape[0]):
        square, of_normal, of_tangential = _general_residual(g, s)
        if square >= 0.0:
            squares += square
            active += 1.0
            largest = max(largest, square)
        normal += of_normal
        tangential += of_tangential
    energy += abs(normal) + abs(tangential)
    return np.sqrt(squares / max(active, 1.0)), np.sqrt(largest), energy, active

"""General contacts: with walls that have free degrees of freedom, or of arbitrary problems.

Their Delassus matrix is full and every degree of freedom has its inverse mass; they are relaxed one after the other. A flow has few
of them, but those of a loaded lid are in every sweep: the loops take single numbers out of arrays, never rows.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.law import predict_and_correct, solve_full
from multicor_cli.engine.jit.compile import loop_body
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
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


@loop_body
def push_general(
    g: int, d_n: float, d_t: float, velocity: Floats, inverse: Floats, pair: Ints, frame: Floats, lever: Floats
) -> None:
    """Change the velocities of the two bodies of a contact by an impulse. Arrays as in `System`."""
    nx, ny = frame[g, NX], frame[g, NY]
    px, py = d_n * nx - d_t * ny, d_n * ny + d_t * nx
    i, j = pair[g, FIRST], pair[g, SECOND]
    velocity[i, X] += inverse[i, X] * px
    velocity[i, Y] += inverse[i, Y] * py
    velocity[i, SURFACE] += inverse[i, SPIN] * (d_n * lever[g, FIRST, NORMAL] + d_t * lever[g, FIRST, TANGENTIAL])
    velocity[j, X] -= inverse[j, X] * px
    velocity[j, Y] -= inverse[j, Y] * py
    velocity[j, SURFACE] -= inverse[j, SPIN] * (d_n * lever[g, SECOND, NORMAL] + d_t * lever[g, SECOND, TANGENTIAL])


@loop_body
def general_velocity(g: int, velocity: Floats, pair: Ints, frame: Floats, lever: Floats) -> tuple[float, float]:
    """u_n + b and u_t of a contact [m/s]. Arrays as in `System`."""
    i, j = pair[g, FIRST], pair[g, SECOND]
    nx, ny = frame[g, NX], frame[g, NY]
    dx, dy = velocity[i, X] - velocity[j, X], velocity[i, Y] - velocity[j, Y]
    a, b = velocity[i, SURFACE], velocity[j, SURFACE]
    u_n = dx * nx + dy * ny + a * lever[g, FIRST, NORMAL] - b * lever[g, SECOND, NORMAL]
    u_t = dy * nx - dx * ny + a * lever[g, FIRST, TANGENTIAL] - b * lever[g, SECOND, TANGENTIAL]
    return u_n + frame[g, BIAS], u_t - frame[g, SLIDE]


@loop_body
def general_solution(g: int, frame: Floats, p_n: float, p_t: float, u_n: float, u_t: float, is_exact: bool) -> tuple[float, float]:
    """Impulses of a contact after a local solve with the others held."""
    w_nn, w_nt, w_tt, mu = frame[g, W_NN], frame[g, W_NT], frame[g, W_TT], frame[g, MU]
    if is_exact:
        return solve_full(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu)
    # The predictor-corrector needs ρ < 2 over the largest eigenvalue; the trace bounds that.
    rho = min(1.0 / np.sqrt(w_nn * w_tt), 1.5 / (w_nn + w_tt) if w_nt != 0.0 else 1.9 / max(w_nn, w_tt))
    return predict_and_correct(p_n, p_t, u_n, u_t, rho, mu)


@loop_body
def correction(g: int, frame: Floats, d_n: float, d_t: float) -> tuple[float, float]:
    """The velocity that goes with a change of the impulses, W d [m/s]."""
    return frame[g, W_NN] * d_n + frame[g, W_NT] * d_t, frame[g, W_NT] * d_n + frame[g, W_TT] * d_t


@loop_body
def relax_general(
    velocity: Floats, inverse: Floats, pair: Ints, frame: Floats, lever: Floats, impulse: Floats, before: Floats,
    is_exact: bool, extrapolation: float,
) -> float:  # fmt: skip
    """Relax all general contacts; returns the sum of the squares of the velocity corrections [m²/s²].

    Arrays as in `System`, and the last impulses ``before``, from which impulses are extrapolated first.
    """
    total = 0.0
    for g in range(pair.shape[0]):
        now_n, now_t = impulse[g, NORMAL], impulse[g, TANGENTIAL]
        p_n = now_n + extrapolation * (now_n - before[g, NORMAL])
        p_t = now_t + extrapolation * (now_t - before[g, TANGENTIAL])
        u_n, u_t = general_velocity(g, velocity, pair, frame, lever)
        new_n, new_t = general_solution(g, frame, p_n, p_t, u_n, u_t, is_exact)
        impulse[g, NORMAL], impulse[g, TANGENTIAL] = new_n, new_t
        before[g, NORMAL], before[g, TANGENTIAL] = now_n, now_t
        d_n, d_t = new_n - p_n, new_t - p_t
        if d_n != 0.0 or d_t != 0.0:
            push_general(g, d_n, d_t, velocity, inverse, pair, frame, lever)
            c_n, c_t = correction(g, frame, d_n, d_t)
            total += c_n * c_n + c_t * c_t
    return total

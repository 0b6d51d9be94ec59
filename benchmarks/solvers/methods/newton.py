"""Semi-smooth Newton on the law of Alart & Curnier with a sparse factorization, for high accuracy.

The engine's sweeps come first and are the safeguard: a Newton step is kept only if it halves the
residual, otherwise there are more sweeps before the next try. Contact forces of rigid grains are
not unique, nor with friction are velocities: the matrix is singular without the small term that
keeps the impulses near where they are (a proximal step).
"""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from methods.assembly import Assembly, assemble
from methods.engine import Loop
from methods.operators import Log, all_impulses, set_impulses
from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.sweep import System
from multicor_cli.model.model import Floats

_PROXIMAL = 1e-7  # of the diagonal
_FIRST_SWEEPS = 100
_ENOUGH = 0.5


def run_newton(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """Bursts of sweeps and Newton steps, up to ``iterations`` sweep-equivalents; no parameters. A
    Newton step is counted as one.
    """
    loop = Loop(s, 0.0)
    started = time.perf_counter()
    matrices = assemble(s)
    loop.seconds += time.perf_counter() - started
    sweeps, row = _FIRST_SWEEPS, 0
    while loop.work < iterations:
        loop.sweep(sweeps)
        loop.retreat()
        row += 1
        if loop.note(log, row - 1):
            return row
        while loop.work < iterations and _step(loop, matrices):
            row += 1
            if loop.note(log, row - 1):
                return row
        loop.restart()
        sweeps = min(1000, sweeps + sweeps // 2)
    return row


def _step(loop: Loop, matrices: Assembly) -> bool:
    """One Newton step; taken back unless it lowers the residual enough. The residual that decides
    is part of its cost.
    """
    started = time.perf_counter()
    s = loop.system
    saved = s.velocity.copy(), s.impulse.copy(), s.general_impulse.copy()
    before = measure_residual(s, False)[0]
    impulse = all_impulses(s)
    set_impulses(s, impulse + _solve(matrices, impulse, s.velocity[:, :3]))
    is_better = bool(measure_residual(s, False)[0] < _ENOUGH * before)
    if not is_better:
        s.velocity[:], s.impulse[:], s.general_impulse[:] = saved
    loop.seconds += time.perf_counter() - started
    loop.work += 1.0
    return is_better


def _solve(m: Assembly, impulse: Floats, velocity: Floats) -> Floats:
    """The change of the impulses that solves the law with the states of the contacts as they are
    predicted now.
    """
    w_n = m.normal.multiply(m.normal) @ m.inverse
    w_t = m.tangent.multiply(m.tangent) @ m.inverse
    u_n, u_t = m.relative(velocity)
    tau_n, tau_t = impulse[:, 0] - u_n / w_n, impulse[:, 1] - u_t / w_t
    loaded = tau_n > 0.0
    stuck = loaded & (np.abs(tau_t) <= m.friction * tau_n)
    slip = np.where(loaded & ~stuck, np.sign(tau_t) * m.friction, 0.0)
    # Contacts that open or slide have part of their impulses given: these act first.
    known = np.column_stack(
        [
            np.where(loaded, 0.0, -impulse[:, 0]),
            np.where(stuck, 0.0, slip * impulse[:, 0] - impulse[:, 1]),
        ]
    )
    u_n, u_t = m.relative(velocity + m.push(known))
    rows = sparse.vstack([m.normal[loaded], m.tangent[stuck]]).tocsr()
    moves = sparse.vstack(
        [m.normal[loaded] + sparse.diags(slip[loaded]) @ m.tangent[loaded], m.tangent[stuck]]
    ).tocsr()
    matrix = rows @ sparse.diags(m.inverse) @ moves.T + sparse.diags(
        _PROXIMAL * np.concatenate([w_n[loaded], w_t[stuck]])
    )
    solution = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
    ).solve(-np.concatenate([u_n[loaded], u_t[stuck]]))
    count = int(loaded.sum())
    change = known
    change[loaded, 0] += solution[:count]
    change[loaded, 1] += slip[loaded] * solution[:count]
    change[stuck, 1] += solution[count:]
    return change

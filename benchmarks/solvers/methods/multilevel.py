"""Two levels: the engine's sweeps, and from time to time a correction by a stress that is uniform
in each group of grains.

What sweeps are slow at in an elastic body are smooth stresses. Here each group of neighboring
grains has three unknowns σ_xx, σ_yy, σ_xy; a loaded contact with normal n gets the impulse σ n (its
mean over the two groups it joins), a sliding one the part of it that keeps it on its cone. The
small system for these unknowns is factorized, and the correction is kept if it lowers the energy
that the sweeps minimize, halved up to three times if it does not.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from methods.assembly import Assembly, assemble
from methods.engine import Loop
from methods.operators import Log, all_impulses, set_impulses
from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.contact.system import OneByOne, flatten
from multicor_cli.model.columns import MU, NX, NY
from multicor_cli.model.model import Floats

_HALVINGS = 3
_SMALL = 1e-6


def run_multilevel(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """Bursts of sweeps with a correction between them; parameters: grains of a group, sweeps of a
    burst.

    It ends after ``iterations`` sweep-equivalents; a correction is counted as two.
    """
    size, burst = int(parameters[0]), int(parameters[1])
    started = time.perf_counter()
    loop = Loop(s, 0.0)
    matrices, groups = assemble(s), group_grains(s, size)
    loop.seconds += time.perf_counter() - started
    row = 0
    while loop.work < iterations:
        loop.sweep(burst)
        loop.retreat()
        row += 1
        if loop.note(log, row - 1):
            return row
        started = time.perf_counter()
        _correct(s, matrices, groups)
        loop.seconds += time.perf_counter() - started
        loop.work += 2.0
        loop.advance()
    return row


def group_grains(s: System, size: int) -> NDArray[np.int64]:
    """A number of a group for each body (-1: fixed), by walking over contacts from grain to
    grain.
    """
    is_grain = s.velocity[:, 3] > 0.0
    pair = flatten(s).pair
    pair = pair[is_grain[pair].all(axis=1)].astype(np.int64)
    bodies = is_grain.size
    ones = np.ones(2 * len(pair))
    graph = sparse.csr_matrix(
        (ones, (np.concatenate(pair.T), np.concatenate(pair.T[::-1]))), shape=(bodies, bodies)
    )
    group = np.full(bodies, -1, np.int64)
    count = 0
    for seed in np.flatnonzero(is_grain):
        if group[seed] >= 0:
            continue
        members = [int(seed)]
        group[seed] = count
        for member in members:
            for other in graph.indices[graph.indptr[member] : graph.indptr[member + 1]]:
                if group[other] < 0 and len(members) < size:
                    group[other] = count
                    members.append(int(other))
        count += 1
    return group


def _correct(s: System, m: Assembly, groups: NDArray[np.int64]) -> None:
    """One correction of the impulses and velocities."""
    diagonal = flatten(s)
    diagonals, impulse, friction = len(diagonal.pair), diagonal.impulse, diagonal.frame[:, MU]
    loaded = impulse[:, 0] > 0.0
    sliding = loaded & (np.abs(impulse[:, 1]) >= friction * impulse[:, 0] * (1.0 - 1e-9))
    slip = np.where(sliding, np.sign(impulse[:, 1]) * friction, 0.0)
    along_n, along_t = _stress_columns(diagonal, groups, loaded, sliding)
    normal, tangent = m.normal[:diagonals], m.tangent[:diagonals]
    forces = normal.T @ along_n + tangent.T @ (along_t + sparse.diags(slip) @ along_n)
    rows = (normal.T @ along_n + tangent.T @ along_t).T
    matrix = (rows @ sparse.diags(m.inverse) @ forces).tocsc()
    scale = np.abs(matrix.diagonal())
    matrix = matrix + sparse.diags(_SMALL * (scale.max(initial=0.0) + scale) + 1e-300)
    u_n, u_t = m.relative(s.velocity[:, :3])
    defect = along_n.T @ u_n[:diagonals] + along_t.T @ u_t[:diagonals]
    stress = spsolve(matrix.tocsc(), -defect)
    change = np.zeros((len(u_n), 2))
    change[:diagonals, 0] = along_n @ stress
    change[:diagonals, 1] = along_t @ stress + slip * change[:diagonals, 0]
    _apply(s, m, change, u_n, u_t)


def _apply(s: System, m: Assembly, change: Floats, u_n: Floats, u_t: Floats) -> None:
    """Add the change, or the half of it and so on, if that lowers ½ pᵀ W p + pᵀ q."""
    flat = m.push(change).ravel()
    movable = m.inverse > 0.0
    quadratic = 0.5 * float(np.sum(flat[movable] ** 2 / m.inverse[movable]))
    linear = float(np.sum(change[:, 0] * u_n + change[:, 1] * u_t))
    for halving in range(_HALVINGS + 1):
        part = 0.5**halving
        if part * linear + part**2 * quadratic < 0.0:
            set_impulses(s, all_impulses(s) + part * change)
            return


def _stress_columns(
    diagonal: OneByOne, groups: NDArray[np.int64], loaded: Any, sliding: Any
) -> tuple[Any, Any]:
    """Matrices from the stresses of the groups to p_n of loaded contacts, and to p_t of those that
    stick.
    """
    nx, ny = diagonal.frame[:, NX], diagonal.frame[:, NY]
    to_n = np.column_stack([nx * nx, ny * ny, 2.0 * nx * ny]) * loaded[:, None]
    to_t = np.column_stack([-nx * ny, nx * ny, nx * nx - ny * ny]) * (loaded & ~sliding)[:, None]
    first, second = groups[diagonal.pair[:, 0]], groups[diagonal.pair[:, 1]]
    first, second = np.where(first < 0, second, first), np.where(second < 0, first, second)
    rows = np.repeat(np.arange(len(nx)), 3)
    columns = [(3 * group[:, None] + np.arange(3)).ravel() for group in (first, second)]
    shape = (len(nx), 3 * (int(groups.max(initial=0)) + 1))
    matrices = [
        sum(
            sparse.csr_matrix((0.5 * values.ravel(), (rows, places)), shape=shape)
            for places in columns
        )
        for values in (to_n, to_t)
    ]
    return matrices[0], matrices[1]

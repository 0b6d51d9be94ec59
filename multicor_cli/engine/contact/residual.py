"""How far impulses are from the contact law: the solver's only stopping criterion (theory §5.3)."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.face_sweep import first_of_batches, measure_faces
from multicor_cli.engine.contact.law import solve_exact
from multicor_cli.engine.contact.rolling import measure_couples
from multicor_cli.engine.contact.sweep import (
    CellTerms,
    System,
    correction,
    general_solution,
    general_velocity,
    stretch_of,
)
from multicor_cli.engine.contact.vector_sweep import (
    BIAS_,
    MASS_,
    MU_,
    NY_,
    SECOND_,
    SURFACE_,
    TANGENTIAL_,
    Y_,
    frame_place,
    impulse_place,
    measure_batches,
    measure_stretched_batches,
    pair_place,
)
from multicor_cli.engine.jit.compile import kernel, loop_body, prange, threaded_loop
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import BATCHES, HAS_VECTORS, LANES
from multicor_cli.model.columns import NORMAL, TANGENTIAL, XX, XY, YY
from multicor_cli.model.model import Floats, Ints

_SQUARES, _NORMAL, _TANGENTIAL, _LARGEST, _ACTIVE = range(5)


@formula
def lane_velocity(
    lane: np.uint64, velocity: Floats, pair: Ints, frame: Floats, cell: CellTerms
) -> tuple[float, float]:
    """u_n + b and u_t of a diagonal contact [m/s]; arrays as in `relax_lane`."""
    q, f = pair_place(lane), frame_place(lane)
    i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
    nx, ny = frame[f], frame[f + NY_]
    dx, dy = velocity[i] - velocity[j], velocity[i + Y_] - velocity[j + Y_]
    if cell.branch.size:
        row = 4 * cell.row
        xx, yy, xy = velocity[row + XX], velocity[row + YY], velocity[row + XY]
        sx, sy = stretch_of(cell.branch.reshape(-1), lane, xx, yy, xy)
        dx, dy = dx + sx, dy + sy
    u_n = dx * nx + dy * ny + frame[f + BIAS_]
    return u_n, dy * nx - dx * ny - (velocity[i + SURFACE_] + velocity[j + SURFACE_])


@formula
def measure_lane(
    lane: np.uint64, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float,
    cell: CellTerms,
) -> tuple[float, float, float, bool]:  # fmt: skip
    """Square of e_c, p_n e_n and p_t e_t [J], whether p_n > 0 or e_c > 0; as `relax_lane`."""
    u_n, u_t = lane_velocity(lane, velocity, pair, frame, cell)
    f, p = frame_place(lane), impulse_place(lane)
    w_inverse, mu = frame[f + MASS_], frame[f + MU_]
    p_n, p_t = impulse[p], impulse[p + TANGENTIAL_]
    turn = 1.0 + beta
    new_n, new_t = solve_exact(p_n, p_t, u_n, u_t, w_inverse, w_inverse / turn, mu)
    c_n, c_t = (new_n - p_n) / w_inverse, (new_t - p_t) * turn / w_inverse
    square = c_n * c_n + c_t * c_t
    return square, p_n * c_n, p_t * c_t, p_n > 0.0 or square > 0.0


@loop_body
def measure_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    beta: float, cell: CellTerms,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Residuals of the diagonal contacts of batches ``first … last-1``; arrays as `measure_lane`.

    Returns the sums of e_c² and of both powers, the largest e_c², and the number of contacts with
    p_n > 0 or e_c > 0. Sums are taken lane by lane, then over the lanes.
    """
    squares, normal, tangential, largest, active = 0.0, 0.0, 0.0, 0.0, 0.0
    for column in range(LANES):
        lane_squares, lane_normal, lane_tangential = 0.0, 0.0, 0.0
        for batch in range(first, last):
            lane = np.uint64(LANES * batch + column)
            square, of_normal, of_tangential, is_active = measure_lane(
                lane, velocity, pair, frame, impulse, beta, cell
            )
            lane_squares += square
            lane_normal += of_normal
            lane_tangential += of_tangential
            largest = max(largest, square)
            active += 1.0 if is_active else 0.0
        squares += lane_squares
        normal += lane_normal
        tangential += lane_tangential
    return squares, normal, tangential, largest, active


@loop_body
def _measure_vectors(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    beta: float, cell: CellTerms,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    if cell.branch.size:
        row = 4 * cell.row
        return measure_stretched_batches(
            first, last, velocity, pair, frame, impulse, beta, cell.branch.reshape(-1),
            velocity[row + XX], velocity[row + YY], velocity[row + XY],
        )  # fmt: skip
    return measure_batches(first, last, velocity, pair, frame, impulse, beta)


_measure = _measure_vectors if HAS_VECTORS else measure_scalar


@loop_body
def _measure_chunk(
    chunk: int, batches: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    beta: float, cell: CellTerms, partial: Floats,
) -> None:  # fmt: skip
    last = min(batches, (chunk + 1) * BATCHES)
    found = _measure(chunk * BATCHES, last, velocity, pair, frame, impulse, beta, cell)
    for k in range(5):
        partial[chunk, k] = found[k]


@threaded_loop
def _measure_chunks(
    batches: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float,
    cell: CellTerms, partial: Floats,
) -> None:  # fmt: skip
    for chunk in prange(partial.shape[0]):
        _measure_chunk(chunk, batches, velocity, pair, frame, impulse, beta, cell, partial)


@loop_body
def measure_general(g: int, s: System) -> tuple[float, float, float, bool]:
    """As `measure_lane`, for a general contact."""
    u_n, u_t = general_velocity(
        g, s.velocity, s.general_pair, s.general_frame, s.general_lever, s.cell
    )
    p_n, p_t = s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL]
    new_n, new_t = general_solution(g, s.general_frame, p_n, p_t, u_n, u_t, True)
    c_n, c_t = correction(g, s.general_frame, new_n - p_n, new_t - p_t)
    square = c_n * c_n + c_t * c_t
    return square, p_n * c_n, p_t * c_t, p_n > 0.0 or square > 0.0


@kernel
def measure_residual(s: System, parallel: bool) -> tuple[float, float, float, float]:
    """Residuals of the present impulses and velocities; the same on one thread and several.

    Returns:
        rms and maximum of e_c, the velocity correction that an exact local solve of contact c would
        make with the others held (natural map in velocity units), over contacts with p_n > 0 or e_c
        > 0 [m/s], couples counting as further contacts; the energy residual Σ(|Σ p_n e_n| + |Σ p_t
        e_t|), with the inner sums over `CHUNK` lanes of diagonal contacts in the order of the
        sweep, over all faces, or over all other general contacts, and |Σ p_r e_r| of all couples
        [J]; and the number of these contacts and couples.
    """
    velocity, pair = s.velocity.reshape(-1), s.pair.reshape(-1)
    frame, impulse = s.frame.reshape(-1), s.impulse.reshape(-1)
    batches = s.slot.shape[0]
    partial = np.empty((-(-batches // BATCHES), 5))
    if parallel:
        _measure_chunks(batches, velocity, pair, frame, impulse, s.spin_factor, s.cell, partial)
    else:
        for chunk in range(partial.shape[0]):
            _measure_chunk(
                chunk, batches, velocity, pair, frame, impulse, s.spin_factor, s.cell, partial
            )
    squares, energy, largest, active = 0.0, 0.0, 0.0, 0.0
    for chunk in range(partial.shape[0]):
        squares += partial[chunk, _SQUARES]
        energy += abs(partial[chunk, _NORMAL]) + abs(partial[chunk, _TANGENTIAL])
        largest = max(largest, partial[chunk, _LARGEST])
        active += partial[chunk, _ACTIVE]
    normal, tangential = 0.0, 0.0
    of_faces = measure_faces(s.faces, velocity, s.general_impulse, s.cell.row)
    squares += of_faces[_SQUARES]
    energy += abs(of_faces[_NORMAL]) + abs(of_faces[_TANGENTIAL])
    largest = max(largest, of_faces[_LARGEST])
    active += of_faces[_ACTIVE]
    for g in range(first_of_batches(s.faces, s.general_pair.shape[0])):
        square, of_normal, of_tangential, is_active = measure_general(g, s)
        if is_active:
            squares += square
            active += 1.0
            largest = max(largest, square)
        normal += of_normal
        tangential += of_tangential
    of_couples, peak, rolling, rolled = measure_couples(
        s.velocity, s.couples, impulse, s.general_impulse
    )
    squares += of_couples
    active += rolled
    largest = max(largest, peak)
    energy += abs(normal) + abs(tangential) + abs(rolling)
    return np.sqrt(squares / max(active, 1.0)), np.sqrt(largest), energy, active

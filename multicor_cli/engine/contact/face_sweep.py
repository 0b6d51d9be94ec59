"""Points of grains that are no discs, four at a time: their sweep and their residual.

They are general contacts (`engine/contact/sweep.py`), the last rows of those: full Delassus
matrices, but one inverse mass for each body, and no two in a batch share one. What a sweep needs of
a batch lies once more in a block of `ROWS` rows of four.

With s = p − W⁻¹ u and q = W_nt/W_nn the exact law needs no branches: a point sticks with p = s
where |s_t| ≤ μ s_n, else p_t = ± μ p_n and p_n = max(0, s_n + q s_t)/(1 ± μ q), with the sign of
s_t. It holds while μ |q| < 1 (derived from the law: W is positive definite). Steeper points, and
those with walls that loads move, are relaxed one by one before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.vector_sweep import (
    BRANCH_ROWS,
    MovingStretch,
    ResidualSums,
    Stretch,
    bodies_of,
    over_batches,
)
from multicor_cli.engine.jit.compile import loop_body, prange, subroutine, threaded_loop
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import HAS_VECTORS, LANES, Vector, Writer, vector_loop
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
    INVERSE_MASS,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SLIDE,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    XX,
    XY,
    YY,
    X,
    Y,
)
from multicor_cli.model.model import Floats, Ints

# Rows of the blocks after those of frames: turns of both bodies, W⁻¹, q and 1/(1 ± μ q)
A_N, A_T, B_N, B_T, I_NN, I_NT, I_TT, Q, PLUS, MINUS = range(8, 18)
ROWS = 18

FourSums = tuple[float, float, float, float]
_NONE = np.empty(0)


class FaceBatches(NamedTuple):
    """``q`` batches of points, the last rows of the general contacts of a `System`.

    Attributes:
        pair: Bodies: four times their rows, shape ``(q, 2, 4)``.
        block: What a sweep needs, shape ``(q, ROWS, 4)``.
        branch: Branch vectors ℓ [m], shape ``(q, 2, 4)``; no batches where there is no cell.
        tile_start: First batch of each tile, shape ``(tiles + 1,)``.
        first: Row of the first of them among the general contacts.
    """

    pair: Ints
    block: Floats
    branch: Floats
    tile_start: NDArray[np.int64]
    first: int


@formula
def fill_inverse(q: int, lane: int, g: int, frame: Floats, is_there: bool, block: Floats) -> None:
    """W⁻¹ of the general contact g into a lane of ``block``, **modified**; else 0."""
    w_nn, w_nt, w_tt = frame[g, W_NN], frame[g, W_NT], frame[g, W_TT]
    over = 1.0 / (w_nn * w_tt - w_nt * w_nt) if is_there else 0.0
    block[q, I_NN, lane], block[q, I_NT, lane] = w_tt * over, -w_nt * over
    block[q, I_TT, lane] = w_nn * over


# ---- One lane: what the loops compute


@loop_body
def _solution(
    q: int, lane: int, block: Floats, p_n: float, p_t: float, u_n: float, u_t: float
) -> tuple[float, float]:
    """Impulses after an exact local solve."""
    s_n = p_n - (block[q, I_NN, lane] * u_n + block[q, I_NT, lane] * u_t)
    s_t = p_t - (block[q, I_NT, lane] * u_n + block[q, I_TT, lane] * u_t)
    mu = block[q, MU, lane]
    over = block[q, PLUS, lane] if s_t > 0.0 else block[q, MINUS, lane]
    slid_n = (s_n + block[q, Q, lane] * s_t) * over
    slid_n = slid_n if slid_n > 0.0 else 0.0
    slid_t = mu * slid_n if s_t > 0.0 else -(mu * slid_n)
    sticks = abs(s_t) <= mu * s_n
    return (s_n, s_t) if sticks else (slid_n, slid_t)


@formula
def take_turns(sums: FourSums, value: float) -> FourSums:
    """Add to the sum of the next lane: each lane is summed for itself, as vectors do it."""
    return sums[1], sums[2], sums[3], sums[0] + value


@formula
def sum_lanes(sums: FourSums) -> float:
    """The sum of all lanes, in their order."""
    return sums[0] + sums[1] + sums[2] + sums[3]


@loop_body
def sum_tiles(partial: Floats) -> tuple[float, float]:
    """Sums over all tiles, one after the other, of both columns of ``partial``."""
    squares, onward = 0.0, 0.0
    for t in range(partial.shape[0]):
        squares += partial[t, 0]
        onward += partial[t, 1]
    return squares, onward


@loop_body
def _velocity(
    q: int, lane: int, velocity: Floats, pair: Ints, block: Floats, more_x: float, more_y: float
) -> tuple[float, float]:
    """u_n + b and u_t [m/s], with what a gradient adds to velocities; ``velocity`` flat."""
    i, j = pair[q, FIRST, lane], pair[q, SECOND, lane]
    dx = velocity[i + X] - velocity[j + X] + more_x
    dy = velocity[i + Y] - velocity[j + Y] + more_y
    s_i, s_j = velocity[i + SURFACE], velocity[j + SURFACE]
    nx, ny = block[q, NX, lane], block[q, NY, lane]
    u_n = dx * nx + dy * ny + (s_i * block[q, A_N, lane] - s_j * block[q, B_N, lane])
    u_t = dy * nx - dx * ny + (s_i * block[q, A_T, lane] - s_j * block[q, B_T, lane])
    return u_n + block[q, BIAS, lane], u_t - block[q, SLIDE, lane]


@loop_body
def _square(q: int, lane: int, block: Floats, d_n: float, d_t: float) -> tuple[float, float, float]:
    """|W d|² [m²/s²], and both components of W d."""
    w_nn, w_nt, w_tt = block[q, W_NN, lane], block[q, W_NT, lane], block[q, W_TT, lane]
    c_n, c_t = w_nn * d_n + w_nt * d_t, w_nt * d_n + w_tt * d_t
    return c_n * c_n + c_t * c_t, c_n, c_t


@loop_body
def relax_faces_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, block: Floats, impulse: Floats,
    before: Floats, beta: float, extrapolation: float, branch: Floats = _NONE, own: Floats = _NONE,
) -> tuple[float, float]:  # fmt: skip
    """Relax batches ``first … last-1``; returns what `sweep` does, of these: over each lane first.

    ``impulse`` and ``before`` have a row for each lane. In a cell ``branch`` (flat) and ``own`` are
    as in `relax_stretched_scalar`; else they are empty.
    """
    squares, onward = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    has_cell, zero = branch.size > 0, (0.0, 0.0, 0.0)
    now = (own[XX], own[YY], own[XY]) if has_cell else zero
    late = later = whole = zero
    for q in range(first, last):
        pulled = zero
        for lane in range(LANES):
            g = LANES * q + lane
            i, j = pair[q, FIRST, lane], pair[q, SECOND, lane]
            lx, ly, more_x, more_y = 0.0, 0.0, -0.0, -0.0  # −0: adding it changes no bit
            if has_cell:
                place = LANES * BRANCH_ROWS * q + lane
                lx, ly = branch[place], branch[place + LANES]
                more_x, more_y = now[XX] * lx + now[XY] * ly, now[YY] * ly
            u_n, u_t = _velocity(q, lane, velocity, pair, block, more_x, more_y)
            now_n, now_t = impulse[g, NORMAL], impulse[g, TANGENTIAL]
            p_n = now_n + extrapolation * (now_n - before[g, NORMAL])
            p_t = now_t + extrapolation * (now_t - before[g, TANGENTIAL])
            new_n, new_t = _solution(q, lane, block, p_n, p_t, u_n, u_t)
            impulse[g, NORMAL], impulse[g, TANGENTIAL] = new_n, new_t
            before[g, NORMAL], before[g, TANGENTIAL] = now_n, now_t
            d_n, d_t = new_n - p_n, new_t - p_t
            nx, ny = block[q, NX, lane], block[q, NY, lane]
            px, py = d_n * nx - d_t * ny, d_n * ny + d_t * nx
            m_i, m_j = velocity[i + INVERSE_MASS], velocity[j + INVERSE_MASS]
            s_i = beta * (d_n * block[q, A_N, lane] + d_t * block[q, A_T, lane])
            s_j = beta * (d_n * block[q, B_N, lane] + d_t * block[q, B_T, lane])
            velocity[i + X] += m_i * px
            velocity[i + Y] += m_i * py
            velocity[i + SURFACE] += m_i * s_i
            velocity[j + X] -= m_j * px
            velocity[j + Y] -= m_j * py
            velocity[j + SURFACE] -= m_j * s_j
            # Each lane for itself: the sums take turns
            square, c_n, c_t = _square(q, lane, block, d_n, d_t)
            on = c_n * (new_n - now_n) + c_t * (new_t - now_t)
            squares, onward = take_turns(squares, square), take_turns(onward, on)
            pulled = pulled[XX] + px * lx, pulled[YY] + py * ly, pulled[XY] + px * ly
        if has_cell:
            now = (
                now[XX] + own[LANES + XX] * late[XX], now[YY] + own[LANES + YY] * late[YY],
                now[XY] + own[LANES + XY] * late[XY],
            )  # fmt: skip
            late, later = later, pulled
            whole = whole[XX] + pulled[XX], whole[YY] + pulled[YY], whole[XY] + pulled[XY]
    if has_cell:
        own[2 * LANES + XX], own[2 * LANES + YY], own[2 * LANES + XY] = whole
    return sum_lanes(squares), sum_lanes(onward)


@loop_body
def measure_faces_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, block: Floats, impulse: Floats,
    branch: Floats = _NONE, xx: float = 0.0, yy: float = 0.0, xy: float = 0.0,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Residuals of batches, as `measure_scalar` has them; arrays as `relax_faces_scalar`.

    (xx, yy, xy) is the gradient of a cell [1/s].
    """
    squares, normal, tangential, largest, active = 0.0, 0.0, 0.0, 0.0, 0.0
    for lane in range(LANES):
        lane_squares, lane_normal, lane_tangential = 0.0, 0.0, 0.0
        for q in range(first, last):
            g = LANES * q + lane
            p_n, p_t = impulse[g, NORMAL], impulse[g, TANGENTIAL]
            more_x, more_y = -0.0, -0.0
            if branch.size:
                place = LANES * BRANCH_ROWS * q + lane
                lx, ly = branch[place], branch[place + LANES]
                more_x, more_y = xx * lx + xy * ly, yy * ly
            u_n, u_t = _velocity(q, lane, velocity, pair, block, more_x, more_y)
            new_n, new_t = _solution(q, lane, block, p_n, p_t, u_n, u_t)
            square, c_n, c_t = _square(q, lane, block, new_n - p_n, new_t - p_t)
            lane_squares += square
            lane_normal += p_n * c_n
            lane_tangential += p_t * c_t
            largest = max(largest, square)
            active += 1.0 if p_n > 0.0 or square > 0.0 else 0.0
        squares += lane_squares
        normal += lane_normal
        tangential += lane_tangential
    return squares, normal, tangential, largest, active


# ---- The same in vectors

_Value = Any  # of LLVM


class _Lanes:
    """Velocities, law and pushes of batches of points."""

    def __init__(
        self, code: Writer, arrays: Sequence[_Value], stretch: Stretch | None = None
    ) -> None:
        self.code, self.stretch = code, stretch
        self.velocity, self.pair, self.block, self.impulse = arrays
        self.zero = code.number(0.0)

    def gather(self, batch: _Value) -> list[Vector]:
        """u_n + b and u_t."""
        code = self.code
        rows_i, rows_j = bodies_of(code, self.pair, batch)
        xi, yi, si, _ = code.transpose([code.load(self.velocity, at) for at in rows_i])
        xj, yj, sj, _ = code.transpose([code.load(self.velocity, at) for at in rows_j])
        nx, ny, bias, slide, a_n, a_t, b_n, b_t = code.block(
            self.block, batch, ROWS, NX, NY, BIAS, SLIDE, A_N, A_T, B_N, B_T
        )
        dx, dy = xi - xj, yi - yj
        if self.stretch:
            dx, dy = self.stretch.add(batch, dx, dy)
        u_n = dx * nx + dy * ny + (si * a_n - sj * b_n)
        u_t = dy * nx - dx * ny + (si * a_t - sj * b_t)
        return [u_n + bias, u_t - slide]

    def solution(
        self, batch: _Value, p_n: Vector, p_t: Vector, u_n: Vector, u_t: Vector
    ) -> tuple[Vector, Vector]:
        """New impulses."""
        i_nn, i_nt, i_tt, mu, q, plus, minus = self.code.block(
            self.block, batch, ROWS, I_NN, I_NT, I_TT, MU, Q, PLUS, MINUS
        )
        s_n, s_t = p_n - (i_nn * u_n + i_nt * u_t), p_t - (i_nt * u_n + i_tt * u_t)
        over = s_t.where(">", self.zero, plus, minus)
        slid_n = ((s_n + q * s_t) * over).larger(self.zero)
        bound = mu * slid_n
        slid_t = s_t.where(">", self.zero, bound, -bound)
        size, limit = abs(s_t), mu * s_n
        return size.where("<=", limit, s_n, slid_n), size.where("<=", limit, s_t, slid_t)

    def impulses(self, array: _Value, batch: _Value) -> tuple[Vector, Vector]:
        start = self.code.times(batch, 2 * LANES)
        return self.code.apart(
            self.code.load(array, start), self.code.load(array, self.code.offset(start, LANES))
        )

    def store(self, array: _Value, batch: _Value, normal: Vector, tangential: Vector) -> None:
        start = self.code.times(batch, 2 * LANES)
        low, high = self.code.together(normal, tangential)
        self.code.store(array, start, low)
        self.code.store(array, self.code.offset(start, LANES), high)

    def square(self, batch: _Value, d_n: Vector, d_t: Vector) -> tuple[Vector, Vector, Vector]:
        """|W d|² and W d."""
        w_nn, w_nt, w_tt = self.code.block(self.block, batch, ROWS, W_NN, W_NT, W_TT)
        c_n, c_t = w_nn * d_n + w_nt * d_t, w_nt * d_n + w_tt * d_t
        return c_n * c_n + c_t * c_t, c_n, c_t


class _Sweep(_Lanes):
    """Three stages, as those of contacts between discs (`vector_sweep._Sweep`)."""

    def __init__(
        self, code: Writer, arrays: Sequence[_Value], before: _Value, beta: _Value, ahead: _Value,
        moving: MovingStretch | None = None,
    ) -> None:  # fmt: skip
        super().__init__(code, arrays, moving)
        self.moving = moving
        self.before, self.beta, self.ahead = before, code.spread(beta), code.spread(ahead)
        self.sums = code.keep([self.zero] * 2)

    def solve(self, batch: _Value, u_n: Vector, u_t: Vector) -> list[Vector]:
        """New impulses; returns what changes the bodies."""
        code = self.code
        now, last = self.impulses(self.impulse, batch), self.impulses(self.before, batch)
        self.store(self.before, batch, *now)
        p_n, p_t = (p + self.ahead * (p - q) for p, q in zip(now, last, strict=True))
        new_n, new_t = self.solution(batch, p_n, p_t, u_n, u_t)
        self.store(self.impulse, batch, new_n, new_t)
        d_n, d_t = new_n - p_n, new_t - p_t
        square, c_n, c_t = self.square(batch, d_n, d_t)
        on = c_n * (new_n - now[0]) + c_t * (new_t - now[1])
        squares, onward = self.sums.get()
        self.sums.put([squares + square, onward + on])
        nx, ny, a_n, a_t, b_n, b_t = code.block(self.block, batch, ROWS, NX, NY, A_N, A_T, B_N, B_T)
        px, py = d_n * nx - d_t * ny, d_n * ny + d_t * nx
        if self.moving:
            self.moving.pull(batch, px, py)
        return [px, py, self.beta * (d_n * a_n + d_t * a_t), self.beta * (d_n * b_n + d_t * b_t)]

    def apply(self, batch: _Value, px: Vector, py: Vector, s_i: Vector, s_j: Vector) -> None:
        """Change the velocities of the bodies, one by one."""
        code = self.code
        for rows, spin, is_second in zip(
            bodies_of(code, self.pair, batch), (s_i, s_j), (False, True), strict=True
        ):
            for at, push in zip(rows, code.transpose([px, py, spin, self.zero]), strict=True):
                mass = code.everywhere(self.velocity, code.offset(at, INVERSE_MASS))
                old, change = code.load(self.velocity, at), mass * push
                code.store(self.velocity, at, old - change if is_second else old + change)


@vector_loop(results=2)
def _relax_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, block: _Value,
    impulse: _Value, before: _Value, beta: _Value, extrapolation: _Value,
) -> list[_Value]:  # fmt: skip
    """As `relax_faces_scalar`."""
    sweep = _Sweep(code, (velocity, pair, block, impulse), before, beta, extrapolation)
    over_batches(sweep, first, last)
    return [code.total(vector) for vector in sweep.sums.get()]


@vector_loop(results=2)
def _relax_stretched_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, block: _Value,
    impulse: _Value, before: _Value, beta: _Value, extrapolation: _Value, branch: _Value,
    own: _Value,
) -> list[_Value]:  # fmt: skip
    """The same in a cell."""
    moving = MovingStretch(code, branch, own)
    sweep = _Sweep(code, (velocity, pair, block, impulse), before, beta, extrapolation, moving)
    over_batches(sweep, first, last)
    moving.finish()
    return [code.total(vector) for vector in sweep.sums.get()]


@vector_loop(results=5)
def _measure_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, block: _Value,
    impulse: _Value,
) -> list[_Value]:  # fmt: skip
    """As `measure_faces_scalar`."""
    return _measured(code, first, last, _Lanes(code, (velocity, pair, block, impulse)))


@vector_loop(results=5)
def _measure_stretched_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, block: _Value,
    impulse: _Value, branch: _Value, xx: _Value, yy: _Value, xy: _Value,
) -> list[_Value]:  # fmt: skip
    """The same in a cell."""
    stretch = Stretch(code, branch, (xx, yy, xy))
    return _measured(code, first, last, _Lanes(code, (velocity, pair, block, impulse), stretch))


def _measured(code: Writer, first: _Value, last: _Value, lanes: _Lanes) -> list[_Value]:
    sums = ResidualSums(code)
    with code.each(first, last) as batch:
        p_n, p_t = lanes.impulses(lanes.impulse, batch)
        new_n, new_t = lanes.solution(batch, p_n, p_t, *lanes.gather(batch))
        square, c_n, c_t = lanes.square(batch, new_n - p_n, new_t - p_t)
        sums.add(p_n, p_t, c_n, c_t, square)
    return sums.results()


_relax = _relax_batches if HAS_VECTORS else relax_faces_scalar
_relax_stretched = _relax_stretched_batches if HAS_VECTORS else relax_faces_scalar
_measure = _measure_batches if HAS_VECTORS else measure_faces_scalar
_measure_stretched = _measure_stretched_batches if HAS_VECTORS else measure_faces_scalar


# ---- The gradient of a cell, which all contacts share


@loop_body
def begin_gradient(gradient: Floats, inverse: Floats, tiles: int, own: Floats) -> None:
    """Give a tile the gradient as it was before its color, into its row of ``own``, **modified**.

    It moves it on by itself, as if the other tiles of its color did the same: together they must
    not do too much. ``gradient`` and ``inverse`` are its row of the velocities and of the inverse
    masses, ``tiles`` are those of the color.
    """
    for d in range(3):
        own[d], own[LANES + d] = gradient[d], tiles * inverse[d]


@subroutine
def end_gradient(first: int, last: int, gradient: Floats, inverse: Floats, own: Floats) -> None:
    """Move the gradient on by what tiles ``first … last-1`` have done to it."""
    for t in range(first, last):
        for d in range(3):
            gradient[d] += inverse[d] * own[t, 2 * LANES + d]


# ---- All of them


@loop_body
def _relax_tile(
    t: int, tiles: int, faces: FaceBatches, velocity: Floats, impulse: Floats, before: Floats,
    beta: float, extrapolation: float, gradient: Floats, inverse: Floats, own: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Relax one of the ``tiles`` of a color; the rest as in `relax_faces`."""
    first, last = faces.tile_start[t], faces.tile_start[t + 1]
    if faces.branch.size:
        begin_gradient(gradient, inverse, tiles, own[t])
        return _relax_stretched(
            first, last, velocity, faces.pair, faces.block, impulse, before, beta, extrapolation,
            faces.branch.reshape(-1), own[t],
        )  # fmt: skip
    return _relax(
        first, last, velocity, faces.pair, faces.block, impulse, before, beta, extrapolation
    )


@threaded_loop
def _relax_on_threads(
    first: int, last: int, faces: FaceBatches, velocity: Floats, impulse: Floats, before: Floats,
    beta: float, extrapolation: float, gradient: Floats, inverse: Floats, own: Floats,
    partial: Floats,
) -> None:  # fmt: skip
    for t in prange(first, last):
        partial[t, 0], partial[t, 1] = _relax_tile(
            t, last - first, faces, velocity, impulse, before, beta, extrapolation, gradient,
            inverse, own,
        )  # fmt: skip


@subroutine
def relax_faces(
    faces: FaceBatches | None, color_start: NDArray[np.int64], velocity: Floats, impulse: Floats,
    before: Floats, beta: float, extrapolation: float, parallel: bool, partial: Floats,
    gradient: Floats, inverse: Floats, own: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Relax all batches; returns what `sweep` does, of these, the same on any number of threads.

    ``impulse`` and ``before`` are those of all general contacts. In a cell ``gradient`` and
    ``inverse`` are its row of the velocities and of the inverse masses, ``own`` as in `CellTerms`.
    """
    if faces is None:
        return 0.0, 0.0
    impulse, before = impulse[faces.first :], before[faces.first :]
    colors, tiles = color_start.size - 1, faces.tile_start.size - 1
    for color in range(colors + 1):  # and the tile after the last
        first, last = color_start[color], color_start[color + 1] if color < colors else tiles
        if parallel and color < colors:
            _relax_on_threads(
                first, last, faces, velocity, impulse, before, beta, extrapolation, gradient,
                inverse, own, partial,
            )  # fmt: skip
        else:
            for t in range(first, last):
                partial[t, 0], partial[t, 1] = _relax_tile(
                    t, last - first, faces, velocity, impulse, before, beta, extrapolation,
                    gradient, inverse, own,
                )  # fmt: skip
        if faces.branch.size:
            end_gradient(first, last, gradient, inverse, own)
    return sum_tiles(partial[:tiles])


@subroutine
def measure_faces(
    faces: FaceBatches | None, velocity: Floats, impulse: Floats, row: int
) -> tuple[float, float, float, float, float]:
    """Residuals of all batches, as `measure_faces_scalar`; none has any.

    ``row`` is that of the gradient of a cell.
    """
    if faces is None:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    count, impulse = faces.pair.shape[0], impulse[faces.first :]
    if faces.branch.size:
        return _measure_stretched(
            0, count, velocity, faces.pair, faces.block, impulse, faces.branch.reshape(-1),
            velocity[4 * row + XX], velocity[4 * row + YY], velocity[4 * row + XY],
        )  # fmt: skip
    return _measure(0, count, velocity, faces.pair, faces.block, impulse)


@subroutine
def first_of_batches(faces: FaceBatches | None, rows: int) -> int:
    """Number of the general contacts that lie in no batch."""
    if faces is None:
        return rows
    return faces.first

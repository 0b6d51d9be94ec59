"""The loops of the solver over diagonal contacts, four at a time: sweep, residual, pushes.

What they compute is defined by their scalar twins, `relax_scalar`, `measure_scalar`, `push_scalar`
and `pull_scalar`, to the bit. Arrays are those of a `System`, flat.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES, Vector, Writer, vector_loop
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
    INVERSE_MASS,
    MASS,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SURFACE,
    TANGENTIAL,
    XX,
    XY,
    YY,
    X,
    Y,
)

# ---- Where the numbers of a contact lie in the flat arrays of the sweep: blocks of rows of four, a
#      lane for each contact of a batch. Offsets are unsigned: no negative index to be wrapped.

PAIR_ROWS, FRAME_ROWS, IMPULSE_ROWS, BRANCH_ROWS = 2, 5, 2, 2
"""Rows of the blocks."""

_LANES, _SHIFT, _MASK = np.uint64(LANES), np.uint64(2), np.uint64(LANES - 1)
_PAIR, _FRAME, _IMPULSE, _BRANCH = (
    np.uint64(LANES * rows) for rows in (PAIR_ROWS, FRAME_ROWS, IMPULSE_ROWS, BRANCH_ROWS)
)

# From the first row of a block, or the first element of a body, to another
Y_, SURFACE_, INVERSE_MASS_ = np.uint64(Y), np.uint64(SURFACE), np.uint64(INVERSE_MASS)
NY_, MASS_, BIAS_, MU_ = (np.uint64(LANES * column) for column in (NY, MASS, BIAS, MU))
SECOND_, TANGENTIAL_ = np.uint64(LANES * SECOND), np.uint64(LANES * TANGENTIAL)
BRANCH_Y_ = np.uint64(LANES * Y)

LATE = 2
"""Batches after which the next sees what one has done to the gradient of a cell."""


@formula
def pair_place(lane: np.uint64) -> np.uint64:
    """Place of the first body of a contact; ``lane`` counts the lanes of all batches."""
    return _PAIR * (lane >> _SHIFT) + (lane & _MASK)


@formula
def frame_place(lane: np.uint64) -> np.uint64:
    """Place of n_x of a contact among the frames."""
    return _FRAME * (lane >> _SHIFT) + (lane & _MASK)


@formula
def impulse_place(lane: np.uint64) -> np.uint64:
    """Place of p_n of a contact among the impulses."""
    return _IMPULSE * (lane >> _SHIFT) + (lane & _MASK)


@formula
def branch_place(lane: np.uint64) -> np.uint64:
    """Place of ℓ_x of a contact among the branch vectors of a cell."""
    return _BRANCH * (lane >> _SHIFT) + (lane & _MASK)


@formula
def lane_of_impulse(place: int) -> int:
    """Lane of the contact with p_n at this place, the inverse of `impulse_place`."""
    return place // (IMPULSE_ROWS * LANES) * LANES + place % LANES


# ---- The loops

_Value = Any  # of LLVM


OPPOSITE = (True, True, False, False)
"""What has the other sign at the second body: forces; surface speeds and inverse masses add."""


def _between(
    code: Writer, velocity: _Value, i: Sequence[_Value], j: Sequence[_Value]
) -> list[Vector]:
    """v_i - v_j in x and y, s_i + s_j and 1/m_i + 1/m_j of a batch, from the rows of its bodies."""
    pairs = zip(i, j, strict=True)
    return code.transpose(
        [code.load(velocity, a) + code.load(velocity, b).flipped(OPPOSITE) for a, b in pairs]
    )


def bodies_of(code: Writer, pair: _Value, batch: _Value) -> list[list[_Value]]:
    """Where the first and the second bodies of a batch begin in arrays of rows of four."""
    start = code.times(batch, LANES * PAIR_ROWS)
    return [code.indices(pair, code.offset(start, LANES * side)) for side in (FIRST, SECOND)]


class Stretch:
    """What the velocity gradient of a cell adds to velocities between bodies (theory §2.1).

    ``branch`` are the branch vectors ℓ of the contacts, blocks of two rows; ``gradient`` is L: its
    components xx, yy and xy [1/s], numbers that hold for the whole loop.
    """

    def __init__(self, code: Writer, branch: _Value, gradient: Sequence[_Value]) -> None:
        self._code, self._branch = code, branch
        self._gradient = [code.spread(value) for value in gradient]

    def branches(self, batch: _Value) -> list[Vector]:
        """ℓ of the contacts of a batch."""
        return self._code.block(self._branch, batch, BRANCH_ROWS, X, Y)

    def gradient(self) -> Sequence[Vector]:
        return self._gradient

    def of(self, lx: Vector, ly: Vector) -> tuple[Vector, Vector]:
        """L ℓ."""
        xx, yy, xy = self.gradient()
        return xx * lx + xy * ly, yy * ly

    def add(self, batch: _Value, dx: Vector, dy: Vector) -> tuple[Vector, Vector]:
        """Velocities between the bodies of a batch with the gradient."""
        sx, sy = self.of(*self.branches(batch))
        return dx + sx, dy + sy


class MovingStretch(Stretch):
    """The same where each batch moves the gradient on.

    What a batch does to it is seen `LATE` batches later: none has to wait for the one before.
    ``own`` has rows of four: the gradient, what one of p ⊗ ℓ changes it by, and Σ p ⊗ ℓ, which the
    loop writes.
    """

    def __init__(self, code: Writer, branch: _Value, own: _Value) -> None:
        self._code, self._branch, self._own = code, branch, own
        zero = code.number(0.0)
        self._response = code.load(own, code.whole(LANES))
        self._now = code.keep([code.load(own, code.whole(0))])
        self._pull, self._late = code.keep([zero]), code.keep([zero] * LATE)

    def gradient(self) -> Sequence[Vector]:
        (now,) = self._now.get()
        return [self._code.lane(now, component) for component in (XX, YY, XY)]

    def pull(self, batch: _Value, px: Vector, py: Vector) -> None:
        """Let the impulses of a batch pull at the gradient."""
        zero = self._code.number(0.0)
        pulled = zero
        for of_lane in self._code.transpose([*_pull(px, py, *self.branches(batch)), zero]):
            pulled = pulled + of_lane
        (now,), (whole,), late = self._now.get(), self._pull.get(), self._late.get()
        self._now.put([now + self._response * late[0]])
        self._late.put([*late[1:], pulled])
        self._pull.put([whole + pulled])

    def finish(self) -> None:
        """Write Σ p ⊗ ℓ."""
        (whole,) = self._pull.get()
        self._code.store(self._own, self._code.whole(2 * LANES), whole)


def _pull(px: Vector, py: Vector, lx: Vector, ly: Vector) -> list[Vector]:
    """Components of p ⊗ ℓ: what impulses do to a gradient, times its inertia."""
    return [px * lx, py * ly, px * ly]


def _apply(
    code: Writer, velocity: _Value, bodies: Sequence[Sequence[_Value]], px: Vector, py: Vector,
    spin: Vector,
) -> None:  # fmt: skip
    """Change the velocities of the bodies of a batch, one by one: empty lanes share theirs."""
    pushes = code.transpose([px, py, spin, code.number(0.0)])
    for side, rows in enumerate(bodies):
        for at, push in zip(rows, pushes, strict=True):
            mass = code.everywhere(velocity, code.offset(at, INVERSE_MASS))
            signed = push.flipped(OPPOSITE) if side == SECOND else push
            code.store(velocity, at, code.load(velocity, at) + mass * signed)


class _Sweep:
    """Three stages: gather the velocities of a batch, solve its contacts, apply the changes."""

    def __init__(
        self, code: Writer, arrays: Sequence[_Value], beta: _Value, way: Sequence[_Value],
        stretch: MovingStretch | None = None,
    ) -> None:  # fmt: skip
        self.code, self.stretch = code, stretch
        self.velocity, self.pair, self.frame, self.impulse, self.before = arrays
        normal, tangential, extrapolation = way
        one, spin = code.number(1.0), code.spread(beta)
        self.beta, self.one_plus_beta = spin, one + spin
        self.normal = code.spread(normal)
        self.tangential = code.spread(tangential) * (one / self.one_plus_beta)
        self.extrapolation = code.spread(extrapolation)
        self.sums = code.keep([code.number(0.0)] * 2)

    def gather(self, batch: _Value) -> list[Vector]:
        """u_n + b, u_t and W_nn of the contacts."""
        dx, dy, spins, w = _between(
            self.code, self.velocity, *bodies_of(self.code, self.pair, batch)
        )
        if self.stretch:
            dx, dy = self.stretch.add(batch, dx, dy)
        nx, ny, bias = self.code.block(self.frame, batch, FRAME_ROWS, NX, NY, BIAS)
        return [dx * nx + dy * ny + bias, dy * nx - dx * ny - spins, w]

    def solve(self, batch: _Value, u_n: Vector, u_t: Vector, w: Vector) -> list[Vector]:
        """New impulses; returns what changes the bodies."""
        nx, ny, w_inverse, mu = self.code.block(self.frame, batch, FRAME_ROWS, NX, NY, MASS, MU)
        now_n, now_t = self.code.block(self.impulse, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        p_n, p_t = self._extrapolated(batch, now_n, now_t)
        new_n = (p_n - u_n * (self.normal * w_inverse)).larger(self.code.number(0.0))
        bound = mu * new_n
        new_t = (p_t - u_t * (self.tangential * w_inverse)).smaller(bound).larger(-bound)
        self._store(self.impulse, batch, new_n, new_t)
        d_n, d_t = new_n - p_n, new_t - p_t
        c_n, c_t = w * d_n, w * self.one_plus_beta * d_t
        more = c_n * c_n + c_t * c_t, c_n * (new_n - now_n) + c_t * (new_t - now_t)
        self.sums.put([a + b for a, b in zip(self.sums.get(), more, strict=True)])
        px, py = d_n * nx - d_t * ny, d_n * ny + d_t * nx
        if self.stretch:
            self.stretch.pull(batch, px, py)
        return [px, py, -(self.beta * d_t)]

    def apply(self, batch: _Value, px: Vector, py: Vector, spin: Vector) -> None:
        """Change the velocities of the bodies."""
        _apply(self.code, self.velocity, bodies_of(self.code, self.pair, batch), px, py, spin)

    def _extrapolated(self, batch: _Value, *now: Vector) -> list[Vector]:
        """Impulses moved on by their last change; what they are ``now`` is noted as the last."""
        last = self.code.block(self.before, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        self._store(self.before, batch, *now)
        return [p + self.extrapolation * (p - q) for p, q in zip(now, last, strict=True)]

    def _store(self, array: _Value, batch: _Value, normal: Vector, tangential: Vector) -> None:
        start = self.code.times(batch, LANES * IMPULSE_ROWS)
        self.code.store(array, start, normal)
        self.code.store(array, self.code.offset(start, LANES), tangential)


def over_batches(sweep: Any, first: _Value, last: _Value) -> None:
    """Let a sweep ``gather``, ``solve`` and ``apply`` all batches.

    A pipeline, for a processor would wait for the results of one batch before it could begin the
    next: while the changes of a batch are applied, the next is solved and the one after that is
    gathered. A body comes again after two batches at the earliest, and there are at least two
    batches or none.
    """
    code: Writer = sweep.code
    with code.if_any(first, last):
        solved = code.keep(sweep.solve(first, *sweep.gather(first)))
        gathered = code.keep(sweep.gather(code.offset(first, 1)))
        with code.each(code.offset(first, 2), last) as batch:
            now, done = gathered.get(), solved.get()
            sweep.apply(code.offset(batch, -2), *done)
            solved.put(sweep.solve(code.offset(batch, -1), *now))
            gathered.put(sweep.gather(batch))
        sweep.apply(code.offset(last, -2), *solved.get())
        sweep.apply(code.offset(last, -1), *sweep.solve(code.offset(last, -1), *gathered.get()))


@vector_loop(results=2)
def relax_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, frame: _Value,
    impulse: _Value, before: _Value,
    beta: _Value, normal: _Value, tangential: _Value, extrapolation: _Value,
) -> list[_Value]:  # fmt: skip
    """As `relax_scalar` for the exact law."""
    sweep = _Sweep(
        code, (velocity, pair, frame, impulse, before), beta, (normal, tangential, extrapolation)
    )
    over_batches(sweep, first, last)
    return [code.total(vector) for vector in sweep.sums.get()]


@vector_loop(results=2)
def relax_stretched_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, frame: _Value,
    impulse: _Value, before: _Value,
    beta: _Value, normal: _Value, tangential: _Value, extrapolation: _Value,
    branch: _Value, own: _Value,
) -> list[_Value]:  # fmt: skip
    """As `relax_stretched_scalar` for the exact law."""
    stretch = MovingStretch(code, branch, own)
    sweep = _Sweep(
        code, (velocity, pair, frame, impulse, before), beta, (normal, tangential, extrapolation),
        stretch,
    )  # fmt: skip
    over_batches(sweep, first, last)
    stretch.finish()
    return [code.total(vector) for vector in sweep.sums.get()]


class ResidualSums:
    """What `measure_scalar` returns, over the batches of a loop."""

    def __init__(self, code: Writer) -> None:
        self._code, self._zero, self._one = code, code.number(0.0), code.number(1.0)
        self._sums = code.keep([self._zero] * 5)

    def add(self, p_n: Vector, p_t: Vector, c_n: Vector, c_t: Vector, square: Vector) -> None:
        """Add a batch with these impulses, corrections and their squares."""
        squares, normal, tangential, largest, active = self._sums.get()
        is_active = p_n.larger(square).where(">", self._zero, self._one, self._zero)
        sums = squares + square, normal + p_n * c_n, tangential + p_t * c_t
        self._sums.put([*sums, square.larger(largest), active + is_active])

    def results(self) -> list[_Value]:
        """Sums of the squares and of both powers, the largest square, the number of contacts."""
        code, (*sums, largest, active) = self._code, self._sums.get()
        return [*map(code.total, sums), code.largest(largest), code.total(active)]


@vector_loop(results=5)
def measure_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, frame: _Value,
    impulse: _Value, beta: _Value,
) -> list[_Value]:  # fmt: skip
    """As `measure_scalar`."""
    return _measure(code, first, last, (velocity, pair, frame, impulse), beta, None)


@vector_loop(results=5)
def measure_stretched_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, frame: _Value,
    impulse: _Value, beta: _Value, branch: _Value, xx: _Value, yy: _Value, xy: _Value,
) -> list[_Value]:  # fmt: skip
    """The same in a cell."""
    stretch = Stretch(code, branch, (xx, yy, xy))
    return _measure(code, first, last, (velocity, pair, frame, impulse), beta, stretch)


def _measure(
    code: Writer, first: _Value, last: _Value, arrays: Sequence[_Value], beta: _Value,
    stretch: Stretch | None,
) -> list[_Value]:  # fmt: skip
    velocity, pair, frame, impulse = arrays
    zero = code.number(0.0)
    turn, sums = code.number(1.0) + code.spread(beta), ResidualSums(code)
    with code.each(first, last) as batch:
        dx, dy, spins, _ = _between(code, velocity, *bodies_of(code, pair, batch))
        if stretch:
            dx, dy = stretch.add(batch, dx, dy)
        nx, ny, w_inverse, bias, mu = code.block(frame, batch, FRAME_ROWS, NX, NY, MASS, BIAS, MU)
        p_n, p_t = code.block(impulse, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        u_n, u_t = dx * nx + dy * ny + bias, dy * nx - dx * ny - spins
        new_n = (p_n - u_n * w_inverse).larger(zero)
        bound = mu * new_n
        new_t = (p_t - u_t * (w_inverse / turn)).smaller(bound).larger(-bound)
        c_n, c_t = (new_n - p_n) / w_inverse, (new_t - p_t) * turn / w_inverse
        sums.add(p_n, p_t, c_n, c_t, c_n * c_n + c_t * c_t)
    return sums.results()


@vector_loop(results=0)
def push_batches(
    code: Writer, first: _Value, last: _Value, velocity: _Value, pair: _Value, frame: _Value,
    impulse: _Value, beta: _Value,
) -> list[_Value]:  # fmt: skip
    """As `push_scalar`."""
    beta = code.spread(beta)
    with code.each(first, last) as batch:
        nx, ny = code.block(frame, batch, FRAME_ROWS, NX, NY)
        p_n, p_t = code.block(impulse, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        bodies = bodies_of(code, pair, batch)
        _apply(code, velocity, bodies, p_n * nx - p_t * ny, p_n * ny + p_t * nx, -(beta * p_t))
    return []


@vector_loop(results=3)
def pull_batches(
    code: Writer, first: _Value, last: _Value, frame: _Value, impulse: _Value, branch: _Value
) -> list[_Value]:
    """As `pull_scalar`."""
    sums = code.keep([code.number(0.0)] * 3)
    with code.each(first, last) as batch:
        nx, ny = code.block(frame, batch, FRAME_ROWS, NX, NY)
        p_n, p_t = code.block(impulse, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        lx, ly = code.block(branch, batch, BRANCH_ROWS, X, Y)
        added = _pull(p_n * nx - p_t * ny, p_n * ny + p_t * nx, lx, ly)
        sums.put([a + b for a, b in zip(sums.get(), added, strict=True)])
    return [code.total(vector) for vector in sums.get()]

"""The sweep over points of grains with corners: the law it solves, and its vectors."""

import numpy as np
import pytest
from entries import entry

from multicor_cli.engine.contact import face_sweep, patches
from multicor_cli.engine.contact.face_sweep import ROWS
from multicor_cli.engine.contact.law import solve_full
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.vectors import HAS_VECTORS, LANES
from multicor_cli.model.columns import BIAS, MU, NX, NY, SLIDE, W_NN, W_NT, W_TT

BETA = 2.0


def _points(rng, batches):
    """Batches of points with levers of any size, each between two bodies of its own."""
    lanes = LANES * batches
    pair = 4 * np.arange(2 * lanes, dtype=np.int32).reshape(lanes, 2)
    velocity = rng.uniform(-1.0, 1.0, (2 * lanes, 4))
    velocity[:, 3] = rng.uniform(0.2, 3.0, 2 * lanes)
    angle, turns = rng.uniform(0.0, 2.0 * np.pi, lanes), rng.uniform(-1.0, 1.0, (lanes, 4))
    m_i, m_j = velocity[pair[:, 0] // 4, 3], velocity[pair[:, 1] // 4, 3]
    (a_n, a_t, b_n, b_t), mu = turns.T, rng.uniform(0.0, 1.2, lanes)
    w_nn = m_i + m_j + BETA * (m_i * a_n**2 + m_j * b_n**2)
    w_tt = m_i + m_j + BETA * (m_i * a_t**2 + m_j * b_t**2)
    w_nt = BETA * (m_i * a_n * a_t + m_j * b_n * b_t)
    mu = np.minimum(mu, 0.9 * w_nn / np.abs(w_nt))
    over, q = 1.0 / (w_nn * w_tt - w_nt**2), w_nt / w_nn
    rows = np.zeros((lanes, ROWS))
    rows[:, NX], rows[:, NY] = np.cos(angle), np.sin(angle)
    rows[:, W_NN], rows[:, W_NT], rows[:, W_TT], rows[:, MU] = w_nn, w_nt, w_tt, mu
    rows[:, BIAS], rows[:, SLIDE] = rng.uniform(-0.3, 0.3, (2, lanes))
    for row, values in {
        "A_N": a_n, "A_T": a_t, "B_N": b_n, "B_T": b_t, "I_NN": w_tt * over, "I_NT": -w_nt * over,
        "I_TT": w_nn * over, "Q": q, "PLUS": 1.0 / (1.0 + mu * q), "MINUS": 1.0 / (1.0 - mu * q),
    }.items():  # fmt: skip
        rows[:, getattr(face_sweep, row)] = values
    impulse = rng.uniform(0.0, 0.5, (lanes, 2)) * rng.integers(0, 2, (lanes, 1))
    impulse[:, 1] *= rng.uniform(-1.0, 1.0, lanes) * mu

    def blocks(values):
        columns = values.shape[1]
        of_batches = values.reshape(batches, LANES, columns).transpose(0, 2, 1)
        return np.ascontiguousarray(of_batches)

    return velocity, blocks(pair), blocks(rows), rows, impulse


_relax_scalar, NONE = entry(face_sweep.relax_faces_scalar), np.empty(0)


@kernel
def _relaxed(first, last, velocity, pair, block, impulse, before, beta, ahead, branch, own):
    if branch.size:
        return face_sweep._relax_stretched(
            first, last, velocity, pair, block, impulse, before, beta, ahead, branch, own
        )
    return face_sweep._relax(first, last, velocity, pair, block, impulse, before, beta, ahead)


@kernel
def _measured(first, last, velocity, pair, block, impulse, branch, xx, yy, xy):
    if branch.size:
        return face_sweep._measure_stretched(
            first, last, velocity, pair, block, impulse, branch, xx, yy, xy
        )
    return face_sweep._measure(first, last, velocity, pair, block, impulse)


def test_the_law_without_branches_is_that_of_the_full_local_problem():
    """One relaxation of free points gives the impulses of the enumeration of all states."""
    velocity, pair, block, rows, impulse = _points(np.random.default_rng(1), 50)
    old, now = impulse.copy(), velocity.copy()
    flat, before = now.reshape(-1), old.copy()
    _relax_scalar(0, len(pair), flat, pair, block, impulse, before, BETA, 0.0, NONE, NONE)
    found = {"open": 0, "sticks": 0, "slides": 0}
    for g, row in enumerate(rows):
        i, j = pair[g // LANES, :, g % LANES] // 4
        (x, y), (s_i, s_j) = velocity[i, :2] - velocity[j, :2], (velocity[i, 2], velocity[j, 2])
        turns = [row[getattr(face_sweep, name)] for name in ("A_N", "A_T", "B_N", "B_T")]
        u_n = x * row[NX] + y * row[NY] + s_i * turns[0] - s_j * turns[2] + row[BIAS]
        u_t = y * row[NX] - x * row[NY] + s_i * turns[1] - s_j * turns[3] - row[SLIDE]
        right = solve_full(*old[g], u_n, u_t, row[W_NN], row[W_NT], row[W_TT], row[MU])
        assert impulse[g] == pytest.approx(right, rel=1e-12, abs=1e-13)
        p_n, p_t = impulse[g]
        slides = abs(p_t) >= row[MU] * p_n * (1.0 - 1e-12)
        found["open" if p_n == 0.0 else "slides" if slides else "sticks"] += 1
    assert min(found.values()) >= 10


def test_points_that_are_held_keep_their_impulses():
    """Block Gauss–Seidel sweeps over all others; then they are what they were, to the bit."""
    velocity, pair, block, rows, _ = _points(np.random.default_rng(3), 2)
    frame = rows[:, :8].copy()
    faces = face_sweep.FaceBatches(pair, block.copy(), np.empty((0, 2, LANES)), np.array([0, 2]), 3)
    impulse = np.column_stack([np.ones(len(rows)), 0.5 * frame[:, MU]])
    before, general = impulse.copy(), np.concatenate([np.ones((3, 8)), frame])
    held = np.array([1, 3, 8])  # one of them in no batch
    patches._hold_points(faces, general, held, True)
    flat, old = velocity.reshape(-1), before.copy()
    _relax_scalar(0, 2, flat, pair, faces.block, impulse, old, BETA, 0.0, NONE, NONE)
    stayed = (impulse == before).all(axis=1)
    assert stayed[[0, 5]].all()
    assert stayed.sum() < 5
    patches._hold_points(faces, general, held, False)
    np.testing.assert_array_equal(faces.block, block)


@pytest.mark.skipif(not HAS_VECTORS, reason="nothing is compiled")
@pytest.mark.parametrize("in_cell", [False, True])
def test_vectors_have_the_bits_of_the_scalar_loop(in_cell):
    rng = np.random.default_rng(2)
    velocity, pair, block, _, impulse = _points(rng, 40)
    before = impulse * rng.uniform(0.5, 1.5, impulse.shape)
    branch, gradient = np.empty(0), [0.0, 0.0, 0.0]
    if in_cell:
        branch, gradient = rng.normal(size=(40, 2, LANES)).reshape(-1), [0.3, -0.2, 0.5]
    results = []
    for relax, measure in (
        (_relaxed, _measured), map(entry, (face_sweep.relax_faces_scalar, face_sweep.measure_faces_scalar))
    ):  # fmt: skip
        now, p, last = velocity.copy().reshape(-1), impulse.copy(), before.copy()
        own = np.array([*gradient, 0.0, 0.01, 0.02, 0.03, 0.0, *4 * [0.0]])
        sums = [
            relax(0, len(pair), now, pair, block, p, last, BETA, ahead, branch, own)
            for ahead in (0.0, 0.7, 0.3)
        ]
        residuals = measure(0, len(pair), now, pair, block, p, branch, *gradient)
        results.append((sums, now, p, last, own, residuals))
        assert residuals[-1] > LANES
        assert own[2 * LANES :].any() == in_cell
    for vectors, scalars in zip(*results, strict=True):
        np.testing.assert_array_equal(vectors, scalars)

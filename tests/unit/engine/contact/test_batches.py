"""Batches of four contacts: their schedule, and vector loops that give the bits of the scalar
ones."""

import os
import subprocess
import sys

import numpy as np
import pytest
from places import DATA
from scene_parts import advance, shear_engine

from multicor_cli.engine.contact import residual, sweep, vector_sweep
from multicor_cli.engine.contact.ordering import SPACING, make_batches
from multicor_cli.engine.contact.problem import ContactProblem, solve_contacts
from multicor_cli.engine.contact.sweep import EXACT, NO_CELL, Before, CellTerms, Relaxation
from multicor_cli.engine.contact.system import OneByOne, by_slot, flatten, one_tile
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.vectors import HAS_VECTORS, LANES
from multicor_cli.model.columns import (
    INVERSE_MASS,
    MASS,
    NORMAL,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    X,
    Y,
)

needs_vectors = pytest.mark.skipif(not HAS_VECTORS, reason="kernels are not compiled")

SIZES = [0, 1, 2, 3, 4, 5, 7, 8, 9, 12, 31, 200]
WAYS = [
    Relaxation(1.0, 1.0, 0.0), Relaxation(1.0, 1.0, 0.7), Relaxation(0.5, 1.0, 0.3),
    Relaxation(1.0, 0.3, 0.0),
]  # fmt: skip


def random_contacts(count, bodies, seed, held=0):
    """Contacts between random bodies, the last ``held`` of which nothing moves, and the
    velocities."""
    random = np.random.default_rng(seed)
    first = random.integers(0, bodies - held, count)
    second = (first + random.integers(1, bodies, count)) % bodies
    velocity = random.normal(size=(bodies, 4))
    velocity[:, INVERSE_MASS] = random.uniform(0.5, 2.0, bodies)
    velocity[bodies - held :, INVERSE_MASS] = 0.0
    angle = random.uniform(0.0, 7.0, count)
    mass = 1.0 / (velocity[first, INVERSE_MASS] + velocity[second, INVERSE_MASS])
    some = random.uniform(size=count)
    friction = np.where(some < 0.2, 0.0, some)
    frame = np.column_stack(
        [np.cos(angle), np.sin(angle), mass, random.normal(size=count) * 0.1, friction]
    )
    normal = np.maximum(random.normal(size=count), 0.0)
    impulse = np.column_stack([normal, friction * normal * random.uniform(-1.0, 1.0, count)])
    return OneByOne(np.column_stack([first, second]).astype(np.int32), frame, impulse), velocity


def system_of(contacts, velocity):
    return one_tile(contacts, velocity, np.zeros((len(velocity), 3)), 2.0)


def real_system(columns):
    """The next problem of a sheared layer that has moved for a while: with anchors of walls, tiles,
    and a start."""
    engine = shear_engine(columns=columns, rows=6)
    advance(engine, 0.02, 60)
    return engine.next_system(0.02, 0.0).system


def systems():
    for count in SIZES:
        for bodies, held in ((4, 0), (9, 2), (300, 40)):
            yield (
                f"{count} of {bodies}",
                system_of(*random_contacts(count, bodies, 7 * count + bodies, held)),
            )
    for columns in (8, 30):
        yield f"{columns} columns", real_system(columns)


def copy(system):
    return system._replace(velocity=system.velocity.copy(), impulse=system.impulse.copy())


def flat(system, before):
    return [
        array.reshape(-1)
        for array in (system.velocity, system.pair, system.frame, system.impulse, before)
    ]


def bits(*arrays):
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize(("bodies", "tiles"), [(3, 1), (5, 2), (40, 3), (500, 2)])
def test_schedule_keeps_the_order_and_the_distance(count, bodies, tiles):
    pair = random_contacts(count, bodies, count + bodies)[0].pair
    start = np.linspace(0, count, tiles + 1).astype(np.int64)
    slot, first = make_batches(pair, start, bodies)
    assert sorted(slot[slot >= 0].tolist()) == list(range(count))
    assert first[0] == 0
    assert first[-1] == len(slot)
    for t in range(tiles):
        own = slot[first[t] : first[t + 1]]
        assert set(own[own >= 0].tolist()) == set(range(start[t], start[t + 1]))
        assert len(own) == 0 or len(own) >= SPACING
        seen = {}
        for number, lanes in enumerate(own):
            for k in sorted(lanes[lanes >= 0].tolist()):
                for body in pair[k].tolist():
                    last_batch, last_contact = seen.get(body, (-SPACING, -1))
                    assert number - last_batch >= SPACING
                    assert k > last_contact
                    seen[body] = number, k


def test_batches_are_full_where_contacts_are_independent():
    pair = np.arange(800, dtype=np.int32).reshape(-1, 2)
    slot, _ = make_batches(pair, np.array([0, 400]), 800)
    assert slot.tolist() == np.arange(400).reshape(-1, LANES).tolist()


def test_rows_and_batches_are_each_other_s_reverse():
    contacts, velocity = random_contacts(50, 20, 1)
    system = system_of(contacts, velocity)
    assert by_slot(system.slot, system.impulse, 50).tolist() == contacts.impulse.tolist()
    order = by_slot(
        system.slot,
        np.where(system.slot < 0, 0, system.slot)[:, None, :].repeat(2, 1).astype(float),
        50,
    )
    assert order[:, 0].tolist() == list(range(50))
    rows = flatten(system)
    assert sorted(map(tuple, rows.frame.tolist())) == sorted(map(tuple, contacts.frame.tolist()))


def one_sweep(contacts, velocity, beta):
    """Gauss–Seidel contact by contact, in Python."""
    for (i, j), (nx, ny, mass, bias, mu), p in zip(
        contacts.pair, contacts.frame, contacts.impulse, strict=True
    ):
        vi, vj = velocity[i], velocity[j]
        dx, dy = vi[X] - vj[X], vi[Y] - vj[Y]
        new_n, new_t = sweep.solve_exact(
            p[NORMAL], p[TANGENTIAL], dx * nx + dy * ny + bias,
            dy * nx - dx * ny - (vi[SURFACE] + vj[SURFACE]),
            mass, 1.0 / (1.0 + beta) * mass, mu,
        )  # fmt: skip
        d_n, d_t = new_n - p[NORMAL], new_t - p[TANGENTIAL]
        p[:] = new_n, new_t
        push = np.array([d_n * nx - d_t * ny, d_n * ny + d_t * nx, -beta * d_t, 0.0])
        vi += vi[INVERSE_MASS] * push
        vj += vj[INVERSE_MASS] * push * [-1.0, -1.0, 1.0, 0.0]


@pytest.mark.parametrize("count", SIZES)
def test_batches_make_the_sweep_of_one_contact_after_the_other(count):
    contacts, velocity = random_contacts(count, 30, count, held=3)
    system = system_of(contacts, velocity)
    before = Before(system.impulse.copy(), system.general_impulse, system.couples.impulse)
    for _ in range(3):
        one_sweep(contacts, velocity, system.spin_factor)
        sweep.sweep(system, before, EXACT, WAYS[0], False, np.empty((1, 2)))
    assert by_slot(system.slot, system.impulse, count).tolist() == contacts.impulse.tolist()
    assert system.velocity[:30].tolist() == velocity.tolist()
    assert not system.velocity[30:].any()  # bodies of empty lanes


def test_sweep_says_how_far_and_where_its_corrections_point():
    """Σ c² and Σ c (p − p_before), with c = W d from impulses alone: walls, too."""
    is_against = []
    for name, system in [("real", real_system(20)), *systems()]:
        before = Before(0.8 * system.impulse, 1.1 * system.general_impulse, np.empty(0))
        partial = np.empty((len(system.tile_start) - 1, 2))
        for way in (Relaxation(1.0, 1.0, 5.0), WAYS[0], WAYS[1]):
            old, last = system.impulse.copy(), before.impulse.copy()
            old_general, last_general = system.general_impulse.copy(), before.general_impulse.copy()
            squares, onward = sweep.sweep(system, before, EXACT, way, False, partial)
            w = 1.0 / system.frame[:, MASS]
            d = system.impulse - (old + way.extrapolation * (old - last))
            c = d * np.stack([w, (1.0 + system.spin_factor) * w], axis=1)
            step, new = system.impulse - old, system.general_impulse
            d = new - (old_general + way.extrapolation * (old_general - last_general))
            w_nn, w_nt, w_tt = system.general_frame[:, [W_NN, W_NT, W_TT]].T
            general = np.stack(
                [w_nn * d[:, 0] + w_nt * d[:, 1], w_nt * d[:, 0] + w_tt * d[:, 1]], axis=1
            )
            expected = (c**2).sum() + (general**2).sum()
            assert squares == pytest.approx(expected, rel=1e-9, abs=1e-300), name
            against = (c * step).sum() + (general * (new - old_general)).sum()
            size = np.abs(c * step).sum() + np.abs(general * (new - old_general)).sum()
            assert onward == pytest.approx(against, abs=1e-9 * size), name
            is_against.append(onward < 0.0)
            assert way.extrapolation > 0.0 or onward >= 0.0, name
    assert 0 < sum(is_against) < len(is_against)


@kernel
def relax_as_vectors(first, last, velocity, pair, frame, impulse, before, beta, way):
    return vector_sweep.relax_batches(
        first, last, velocity, pair, frame, impulse, before, beta, way.normal, way.tangential,
        way.extrapolation,
    )  # fmt: skip


@kernel
def relax_one_by_one(first, last, velocity, pair, frame, impulse, before, beta, way):
    return sweep.relax_scalar(first, last, velocity, pair, frame, impulse, before, beta, EXACT, way)


@needs_vectors
@pytest.mark.parametrize("way", WAYS)
def test_sweep_has_the_bits_of_the_scalar_one(way):
    for name, system in systems():
        results = []
        for relax in (relax_as_vectors, relax_one_by_one):
            own, before = copy(system), system.impulse * 0.9
            for _ in range(4):
                total = relax(0, len(own.slot), *flat(own, before), own.spin_factor, way)
            results.append((total, bits(own.velocity, own.impulse, before)))
        assert results[0] == results[1], name


GRADIENT = 0.3, -0.2, 0.5


def in_cell(system, seed=5):
    """The same with branch vectors; the first body is its gradient too."""
    branch = np.random.default_rng(seed).normal(size=(len(system.slot), 2, LANES))
    branch *= (system.slot >= 0)[:, np.newaxis]
    return system._replace(
        cell=CellTerms(branch, NO_CELL.general, 0, np.zeros((len(system.tile_start) - 1, 12)))
    )


@kernel
def relax_stretched_as_vectors(
    first, last, velocity, pair, frame, impulse, before, beta, way, branch, own
):
    return vector_sweep.relax_stretched_batches(
        first, last, velocity, pair, frame, impulse, before, beta, way.normal, way.tangential,
        way.extrapolation, branch, own,
    )  # fmt: skip


@kernel
def relax_stretched_one_by_one(
    first, last, velocity, pair, frame, impulse, before, beta, way, branch, own
):
    return sweep.relax_stretched_scalar(
        first, last, velocity, pair, frame, impulse, before, beta, EXACT, way, branch, own
    )


@needs_vectors
def test_sweep_of_a_cell_has_the_bits_of_the_scalar_one():
    for name, plain in systems():
        results, system = [], in_cell(plain)
        for relax in (relax_stretched_as_vectors, relax_stretched_one_by_one):
            own, before, sums = copy(system), system.impulse * 0.9, []
            for _ in range(4):
                of_cell = np.array([*GRADIENT, 0.0, 0.2, 0.3, 0.1, *[0.0] * 5])
                sums += [
                    relax(
                        0, len(own.slot), *flat(own, before), own.spin_factor, WAYS[1],
                        system.cell.branch.reshape(-1), of_cell,
                    ),
                    *of_cell.tolist(),
                ]  # fmt: skip
            results.append((sums, bits(own.velocity, own.impulse, before)))
        assert results[0] == results[1], name


@kernel
def pull_as_vectors(last, frame, impulse, branch):
    return vector_sweep.pull_batches(0, last, frame, impulse, branch)


@kernel
def pull_one_by_one(last, frame, impulse, branch):
    return sweep.pull_scalar(0, last, frame, impulse, branch)


@needs_vectors
def test_pull_on_a_cell_has_the_bits_of_the_scalar_one():
    """It is Σ p ⊗ ℓ."""
    for name, plain in systems():
        system = in_cell(plain)
        arrays = [a.reshape(-1) for a in (system.frame, system.impulse, system.cell.branch)]
        pull = pull_as_vectors(len(system.slot), *arrays)
        assert pull == pull_one_by_one(len(system.slot), *arrays), name
        (nx, ny), (p_n, p_t) = system.frame[:, :2].swapaxes(0, 1), system.impulse.swapaxes(0, 1)
        lx, ly = system.cell.branch.swapaxes(0, 1)
        px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
        assert pull == pytest.approx([(px * lx).sum(), (py * ly).sum(), (px * ly).sum()])


@kernel
def measure_as_vectors(first, last, velocity, pair, frame, impulse, beta, cell):
    if cell.branch.size:
        return vector_sweep.measure_stretched_batches(
            first, last, velocity, pair, frame, impulse, beta, cell.branch.reshape(-1),
            velocity[0], velocity[1], velocity[2],
        )  # fmt: skip
    return vector_sweep.measure_batches(first, last, velocity, pair, frame, impulse, beta)


@kernel
def measure_one_by_one(first, last, velocity, pair, frame, impulse, beta, cell):
    return residual.measure_scalar(first, last, velocity, pair, frame, impulse, beta, cell)


@needs_vectors
@pytest.mark.parametrize("is_cell", [False, True])
def test_residual_has_the_bits_of_the_scalar_one(is_cell):
    for name, plain in systems():
        system = in_cell(plain) if is_cell else plain
        arrays, whole = flat(system, system.impulse)[:4], len(system.slot)
        rest = system.spin_factor, system.cell
        for first, last in ((0, whole), (whole // 3, whole // 2)):
            vectors = measure_as_vectors(first, last, *arrays, *rest)
            assert vectors == measure_one_by_one(first, last, *arrays, *rest), name
            # Empty lanes are never active
            assert vectors[4] <= np.count_nonzero(system.slot[first:last] >= 0), name


@kernel
def push_as_vectors(first, last, velocity, pair, frame, impulse, beta):
    vector_sweep.push_batches(first, last, velocity, pair, frame, impulse, beta)


@kernel
def push_one_by_one(first, last, velocity, pair, frame, impulse, beta):
    sweep.push_scalar(first, last, velocity, pair, frame, impulse, beta)


@needs_vectors
def test_pushes_have_the_bits_of_the_scalar_ones():
    for name, system in systems():
        results = []
        for push in (push_as_vectors, push_one_by_one):
            own = copy(system)
            push(0, len(own.slot), *flat(own, own.impulse)[:4], own.spin_factor)
            results.append(bits(own.velocity))
        assert results[0] == results[1], name
        assert (results[0] != bits(system.velocity)) == system.impulse.any(), name


FALLBACK = """
import sys
from multicor_cli.engine.contact.problem import ContactProblem, solve_contacts
from multicor_cli.engine.orders import Settings
from multicor_cli.engine.jit.vectors import HAS_VECTORS
assert not HAS_VECTORS
solution = solve_contacts(ContactProblem.load(sys.argv[1]), Settings(max_sweeps=6))
sys.stdout.buffer.write(solution.impulse.tobytes() + solution.velocity.tobytes())
"""


@needs_vectors
def test_without_compilation_the_bits_are_the_same():
    from multicor_cli.engine.orders import Settings

    path = DATA / "two-solutions.npz"
    expected = solve_contacts(ContactProblem.load(path), Settings(max_sweeps=6))
    run = subprocess.run(
        [sys.executable, "-c", FALLBACK, str(path)], env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True, check=True,
    )  # fmt: skip
    assert run.stdout == bits(expected.impulse, expected.velocity)

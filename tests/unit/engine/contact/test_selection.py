"""Which pairs are contacts, what a step says of them, and that a state knows all of it."""

from dataclasses import replace

import numpy as np
import pytest
from cells import flow, loose_cell, orders
from scene_parts import (
    FLOOR,
    advance,
    continued,
    make_engine,
    make_laws,
    make_model,
    resume,
    shear_engine,
)

from multicor_cli.engine import Engine
from multicor_cli.engine.contact import vector_step
from multicor_cli.engine.contact.selection import Selection
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.vectors import HAS_VECTORS
from multicor_cli.model import State
from multicor_cli.model.state import find_misfit

needs_vectors = pytest.mark.skipif(not HAS_VECTORS, reason="kernels are not compiled")

DT = 0.02


def copy_of(state):
    return State.from_dict({name: np.array(value) for name, value in state.as_dict().items()})


def pairs_of(state):
    return set(zip(state.near_i.tolist(), state.near_j.tolist(), strict=True))


def test_no_other_pair_meets_and_those_that_carry_are_among_them():
    """By brute force over all pairs of grains, with the velocities that a step ends with."""
    engine = shear_engine(columns=10, rows=8)
    n, radius, period = engine.model.grain_count, engine.model.grains.radius, engine.model.period
    sought = 0
    for step in range(250):
        before = engine.state.near_i
        engine.step(DT, step * DT)
        sought += engine.state.near_i is not before
        scene, _, after, *_ = engine.mechanics.moved
        apart = scene.position[:, None, :2] - scene.position[None, :, :2]
        apart[..., 0] -= period * np.floor(apart[..., 0] / period + 0.5)
        distance = np.hypot(apart[..., 0], apart[..., 1])
        np.fill_diagonal(distance, 1.0)
        approach = (apart * (after[:n, None, :2] - after[None, :n, :2])).sum(axis=2) / distance
        end = distance - radius[:, None] - radius[None] + DT * approach
        meeting = np.argwhere(np.triu(end < -1e-12, 1))
        near = pairs_of(engine.state)
        assert {tuple(pair) for pair in meeting.tolist()} <= near
        carrying = zip(engine.state.contact_i, engine.state.contact_j, strict=True)
        assert {(int(i), int(j)) for i, j in carrying} <= near
    assert 5 < sought < 120


def normals_of(apart, velocity, radii, least):
    """Normals at q_m, or of the closest approach of discs that will pass each other, in NumPy."""
    square, along = (velocity**2).sum(axis=1), (apart * velocity).sum(axis=1)
    gap = np.hypot(*apart.T) - radii
    when = np.minimum(np.where(along < 0.0, -along / np.maximum(square, 1e-300), 0.0), DT)
    there = apart + when[:, None] * velocity
    passes = np.hypot(*there.T) >= radii - np.where(when < DT, 5e-4 * least, 0.0)
    chosen = np.where(((gap > 0.0) & (along < 0.0) & passes)[:, None], there, apart)
    return chosen / np.hypot(*chosen.T)[:, None], passes & (along < 0.0) & (gap > 0.0)


def test_the_table_of_a_step_is_that_of_its_geometry_and_velocities():
    """Gaps, normals and slips of contacts of two grains, in NumPy."""
    engine = shear_engine(columns=45, rows=6)
    advance(engine, DT, 139)
    before = np.column_stack([engine.state.velocity[:, :2]])
    engine.step(DT, 139 * DT)
    table, (scene, _, after, *_) = engine.contacts(), engine.mechanics.moved
    n, period = engine.model.grain_count, engine.model.period
    both = table.j < n
    i, j = table.i[both], table.j[both]
    apart = scene.position[i, :2] - scene.position[j, :2]
    apart[:, 0] -= period * np.floor(apart[:, 0] / period + 0.5)
    distance = np.hypot(*apart.T)
    assert table.gap[both] == pytest.approx(distance - scene.radius[i] - scene.radius[j], abs=1e-13)
    radii = scene.radius[i] + scene.radius[j]
    least = np.minimum(scene.radius[i], scene.radius[j])
    normal, passing = normals_of(apart, before[i] - before[j], radii, least)
    assert 50 < passing.sum() < 300
    assert table.normal[both] == pytest.approx(normal, abs=1e-13)
    velocity = after[i] - after[j]
    along = velocity[:, 1] * normal[:, 0] - velocity[:, 0] * normal[:, 1]
    assert table.slip[both] == pytest.approx(along - after[i, 2] - after[j, 2], abs=1e-12)
    assert (table.impulse[both, 0] > 0.0).sum() > 20


@pytest.mark.parametrize("least", [0.0, 1e-4])
def test_which_pairs_overlap_at_the_end_of_a_step_is_known_from_its_lanes(least):
    """Beside all pairs at q⁺ before it is corrected, in NumPy; all with walls are among them."""
    engine, found = shear_engine(columns=10, rows=6), 0
    for step in range(60):
        engine.step(DT, step * DT)
        selection, (_, _, after, *_) = engine.mechanics.layout.selection, engine.mechanics.moved
        n, i, j = engine.model.grain_count, selection.pair_i, selection.pair_j
        both, grain = j < n, engine.mechanics.layout.middle[:, :2] + 0.5 * DT * after[:n, :2]
        apart = grain[i[both]] - grain[j[both]]
        apart[:, 0] -= engine.model.period * np.floor(apart[:, 0] / engine.model.period + 0.5)
        radius = engine.model.grains.radius
        first, second = radius[i[both]], radius[j[both]]
        depth = (first + second - np.hypot(*apart.T)) / np.minimum(first, second)
        deep, clear = np.ones((2, i.size), np.bool_)  # the last bits of those that are not: open
        deep[both], clear[both] = depth > least, np.abs(depth - least) > 1e-13
        pairs_i, pairs_j, below = selection.deep_pairs(least)
        key, chosen = i.astype(np.int64) << 32 | j, pairs_i.astype(np.int64) << 32 | pairs_j
        assert (np.diff(chosen) > 0).all()
        assert np.isin(key, chosen)[clear].tolist() == deep[clear].tolist()
        assert below == pytest.approx(max(0.0, depth[~(depth > least)].max(initial=0.0)), abs=1e-13)
        found += int((depth > least).sum())
    assert found > 2


@pytest.mark.parametrize("law", [{}, {"restitution": 0.5}, {"adhesion": 1.0}, {"rolling": 0.3}])
def test_a_state_goes_on_to_the_same_bits_wherever_it_is_taken_up(law):
    engine = shear_engine(columns=8, rows=6, **law)
    kept = {}
    for step in range(160):
        if step in (1, 40, 41, 97):
            kept[step] = copy_of(engine.state)
        engine.step(DT, step * DT)
    for start, state in kept.items():
        other = Engine(engine.model, state, threads=1)
        other.resume(engine.orders)
        for step in range(start, 160):
            other.step(DT, step * DT)
        assert other.state.digest() == engine.state.digest(), start


def test_other_impulses_and_laws_are_noticed():
    """A state that someone changes between two steps, and a stage with other laws."""
    engine = shear_engine(columns=8, rows=6)
    advance(engine, DT, 50)
    engine.state.contact_impulse = np.zeros_like(engine.state.contact_impulse)
    other = Engine(engine.model, copy_of(engine.state), threads=1)
    rough = engine.model.laws._replace(friction=engine.model.laws.friction + 0.3)
    for each in (engine, other):
        each.resume(replace(engine.orders, laws=rough))
        each.step(DT, 50 * DT)
    assert engine.state.digest() == other.state.digest()
    assert engine.contacts().impulse.tolist() == other.contacts().impulse.tolist()


def test_adhesion_and_rolling_resistance_do_not_outlast_a_stage_with_them():
    """A disc rolls down a slope. A stage without them, and one that has them again, are the same to
    an engine whose contact has known them and to a new one.
    """
    model = make_model([0.3], FLOOR, gravity=(2.0, -9.81), adhesion=5.0, rolling=0.1)
    engine = make_engine(model, [[0.0, 0.3]])
    advance(engine, DT, 5)
    for laws in (make_laws(), None):
        resume(engine, laws=laws)
        other = continued(engine)
        for each in (engine, other):
            advance(each, DT, 5)
        assert engine.contacts().impulse.tolist() == other.contacts().impulse.tolist()
        assert engine.state.digest() == other.state.digest()
        assert find_misfit(engine.state, model) is None


def test_rolling_resistance_that_the_model_lacks_is_refused():
    engine = make_engine(make_model([0.3], FLOOR), [[0.0, 0.3]])
    with pytest.raises(ValueError, match="couples"):
        resume(engine, laws=make_laws(rolling=0.1))


def test_contacts_are_sought_where_a_state_has_none():
    engine = shear_engine(columns=8, rows=6)
    advance(engine, DT, 50)
    state = copy_of(engine.state)
    none = np.zeros(0, np.int32)
    state.near_i, state.near_j, state.tile = none, none, np.zeros_like(state.tile)
    other = Engine(engine.model, state, threads=1)
    other.resume(engine.orders)
    for each in (engine, other):
        each.step(DT, 50 * DT)
    assert other.state.near_i.size
    assert other.state.velocity == pytest.approx(engine.state.velocity, abs=0.05)


def test_the_age_of_the_list_decides_on_nothing(monkeypatch):
    """Contacts are the same if the neighbor list is built in every step."""
    digests = []
    for is_new in (False, True):
        engine = shear_engine(columns=16, rows=6)
        take = Selection.take

        def forget(self, state, take=take):
            self._pairs._cutoff = self._pairs.complete = -1.0
            take(self, state)

        with monkeypatch.context() as patch:
            if is_new:
                patch.setattr(Selection, "take", forget)
            advance(engine, DT, 200)
        digests.append(engine.state.digest())
        assert engine.state.named("tallies")["corrected_steps"] > 0.0
    assert digests[0] == digests[1]


# ---- The loops over the contacts of two grains


XX, YY, XY = 0.3, -0.2, 0.5
"""A velocity gradient."""


@kernel
def begin_as_vectors(
    first, last, a, b, c, d, e, f, g, h, branch, dt, ratio, period, half, height, tilt
):
    return vector_step.begin_lanes(
        first, last, a, b, c, d, e, f, g, h, dt, period, half, ratio, branch, height, tilt, XX, YY,
        XY,
    )  # fmt: skip


@kernel
def begin_one_by_one(
    first, last, a, b, c, d, e, f, g, h, branch, dt, ratio, period, half, height, tilt
):
    return vector_step.begin_scalar(
        first, last, a, b, c, d, e, f, g, h, dt, period, half, ratio, branch, height, tilt, XX, YY,
        XY,
    )  # fmt: skip


@kernel
def end_as_vectors(first, last, a, b, c, d, e, f, g, h, branch, depth, step, period, half):
    return vector_step.end_lanes(
        first, last, a, b, c, d, e, f, g, h, step, period, half, branch, XX, YY, XY, depth
    )


@kernel
def end_one_by_one(first, last, a, b, c, d, e, f, g, h, branch, depth, step, period, half):
    return vector_step.end_scalar(
        first, last, a, b, c, d, e, f, g, h, step, period, half, branch, XX, YY, XY, depth
    )


def lanes_of(columns, seed):
    """Lanes of the next step of a sheared layer, with bounces, gaps and impulses of all kinds.

    In a cell instead where there are no ``columns``.
    """
    if columns:
        engine = shear_engine(columns=columns, rows=6)
        advance(engine, DT, 80)
    else:
        engine, _ = flow(*loose_cell(700, solid_fraction=0.8), orders(("stress", 1.0)), 4.0)
    lanes = engine.next_system(DT, 0.0).schedule
    random = np.random.default_rng(seed)
    ours = lanes.about[:, vector_step.IS_OURS] > 0.0
    lanes.about[:, vector_step.BOUNCE] = np.where(ours, random.choice([0.0, 0.4], ours.shape), 0.0)
    lanes.impulse[:, 1] -= 0.2 * lanes.impulse[:, 0]
    width, height, tilt = engine.state.wall_position[0].tolist()
    if columns:
        return lanes, [(engine.model.period, 0.5 * engine.model.period), (0.0, np.inf)], (0.0, 0.0)
    return lanes, [(width, 0.5 * width)], (height, tilt + 0.3)


@needs_vectors
@pytest.mark.parametrize("columns", [0, 12, 30])
@pytest.mark.parametrize("ratio", [0.0, 1.0, 0.7])
def test_contacts_begin_with_the_bits_of_the_scalar_loop(columns, ratio):
    lanes, periods, cell = lanes_of(columns, 3)
    ours = lanes.about[:, vector_step.IS_OURS] > 0.0
    found = []
    for begin in (begin_as_vectors, begin_one_by_one):
        frame, impulse, before, gap, branch = (
            array.copy()
            for array in (lanes.frame, lanes.impulse, lanes.before, lanes.gap, lanes.branch)
        )
        arrays = (
            lanes.middle, lanes.start, lanes.pair, lanes.about, frame, impulse, before, gap, branch,
        )  # fmt: skip
        sums = [
            begin(first, last, *(array.reshape(-1) for array in arrays), DT, ratio, *period, *cell)
            for first, last in ((0, len(gap)), (len(gap) // 3, len(gap) // 2))
            for period in periods
        ]
        kept = [array.transpose(0, 2, 1)[ours].tobytes() for array in (frame, impulse, before)]
        found.append((sums, kept, gap[ours].tobytes(), branch.tobytes()))
    assert found[0] == found[1]
    assert all(value > 0.0 for value in found[0][0][0][: 2 if ratio == 0.0 else 6])


@needs_vectors
@pytest.mark.parametrize("columns", [0, 8, 30])
def test_contacts_end_with_the_bits_of_the_scalar_loop(columns):
    lanes, periods, _ = lanes_of(columns, 4)
    arrays = (
        lanes.middle, lanes.velocity, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
        lanes.before, lanes.gap, lanes.branch,
    )  # fmt: skip
    flat, count = [array.reshape(-1) for array in arrays], len(lanes.gap)
    for first, last in ((0, count), (count // 3, count // 2)):
        for period in periods:
            depth, twin = np.full(4 * count, np.nan), np.full(4 * count, np.nan)
            sums = end_as_vectors(first, last, *flat, depth, 0.5 * DT, *period)
            assert sums == end_one_by_one(first, last, *flat, twin, 0.5 * DT, *period)
            assert depth.tobytes() == twin.tobytes()
            assert np.nanmax(depth) == sums[vector_step.OVERLAP]
            assert sums[vector_step.LOADED] > 0.0
            assert sums[vector_step.LARGEST] > 0.0

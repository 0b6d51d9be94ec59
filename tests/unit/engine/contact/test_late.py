"""Contacts that come late go where the schedule of all would put them next, however many at once."""

import numpy as np
import pytest
from scene_parts import (
    FLOOR,
    advance,
    continued,
    copy_of,
    make_engine,
    make_model,
    resume,
    shear_engine,
)

from multicor_cli.engine import Engine
from multicor_cli.engine.contact import selection as module
from multicor_cli.engine.contact.late import closing_soon
from multicor_cli.engine.contact.ordering import SPACING, lay_tiles, schedule_contacts
from multicor_cli.engine.contact.selection import Selection
from multicor_cli.engine.geometry.scene import pair_geometry
from multicor_cli.model.state import find_misfit

DT = 0.02


def discs_anywhere(rng, count):
    """The scene of a step of discs that lie about, many over others."""
    places = rng.uniform(0.0, 12.0, (count, 2))
    engine = make_engine(make_model([0.3] * count, FLOOR), places)
    engine.step(1e-9, 0.0)
    return engine.mechanics.moved.scene


def at_once(engine):
    """The schedule of the same contacts, made anew from the state."""
    layout, state = engine.mechanics.layout, engine.state
    other = Selection(layout.model, layout.pairs, layout.pieces)
    other.take(state)
    scene = engine.mechanics.moved.scene
    return other.schedule(
        scene, engine.mechanics.motion.is_free, engine.mechanics.laws, layout.before, state
    ), other


@pytest.mark.parametrize("law", [{}, {"restitution": 0.5}, {"adhesion": 1.0}, {"rolling": 0.3}])
def test_lanes_are_those_of_a_schedule_that_is_made_at_once(law, monkeypatch):
    """So a run that goes on from a checkpoint sweeps in the same order; the lid is a free wall."""
    monkeypatch.setattr(module, "SKIN", 0.01)
    monkeypatch.setattr(module, "LATE_SHARE", 0.5)
    engine, seen, with_walls = shear_engine(columns=10, rows=8, **law), 0, 0
    for step in range(120):
        engine.step(DT, step * DT)
        if not engine.state.near_late.any():
            continue
        selection = engine.mechanics.layout.selection
        lanes, (new, other) = selection.lanes, at_once(engine)
        for name in ("slot", "tile_start", "lane", "walls", "general", "of_walls", "room"):
            assert np.array_equal(getattr(lanes, name), getattr(new, name)), (step, name)
        assert np.array_equal(selection.contacts["i"][lanes.of_walls], selection.i[lanes.of_walls])
        assert np.array_equal(selection.contacts["j"][lanes.of_walls], selection.j[lanes.of_walls])
        late = selection.late > 0
        assert sorted(selection.late[late]) == sorted(set(selection.late[late].tolist()))
        with_walls += int((late & (selection.j >= engine.model.grain_count)).sum())
        seen += int(late.sum())
        assert other.late is engine.state.near_late
    assert seen > 100
    assert with_walls > 0


@pytest.mark.parametrize("law", [{}, {"restitution": 0.5}, {"adhesion": 1.0}, {"rolling": 0.3}])
def test_a_state_with_late_contacts_goes_on_to_the_same_bits(law, monkeypatch):
    monkeypatch.setattr(module, "SKIN", 0.01)
    monkeypatch.setattr(module, "LATE_SHARE", 0.5)
    engine, kept = shear_engine(columns=8, rows=6, **law), {}
    for step in range(160):
        if engine.state.near_late.any() and len(kept) < 12:
            kept[step] = copy_of(engine.state)
        engine.step(DT, step * DT)
    assert len(kept) > 5
    for start, state in kept.items():
        assert find_misfit(state, engine.model) is None
        other = Engine(engine.model, state, threads=1)
        other.resume(engine.orders)
        for step in range(start, 160):
            other.step(DT, step * DT)
        assert other.state.digest() == engine.state.digest(), start


def test_no_batch_has_a_body_twice_nor_within_the_spacing(monkeypatch):
    monkeypatch.setattr(module, "SKIN", 0.01)
    monkeypatch.setattr(module, "LATE_SHARE", 0.5)
    engine, seen = shear_engine(columns=10, rows=8), 0
    for step in range(80):
        engine.step(DT, step * DT)
        lanes = engine.mechanics.layout.selection.lanes
        last = {}
        for q in range(lanes.tile_start[-2], lanes.tile_start[-1]):
            used = lanes.slot[q] >= 0
            rows = lanes.pair[q][:, used].ravel().tolist()
            assert len(rows) == len(set(rows))
            for row in rows:
                assert q - last.get(row, -SPACING) >= SPACING
                last[row] = q
            seen += int(used.sum())
    assert seen > 100


def test_with_more_late_contacts_than_there_is_room_for_room_is_made():
    """As after grains have left, with contacts that were there when the late ones came."""
    count = 400
    scene = discs_anywhere(np.random.default_rng(3), count)
    i = np.zeros(count - 1, np.int32)
    j = np.arange(1, count, dtype=np.int32)
    late = np.arange(3, count - 1, dtype=np.int32)[::-1].copy()
    tile = lay_tiles(scene, 1.0, 0.6)
    free = np.zeros(1, np.bool_)
    whole = schedule_contacts(scene, i, j, tile, free, late=late)
    schedule = whole.cut()
    placed = schedule.slot[schedule.slot >= 0]
    assert sorted(placed.tolist()) == list(range(count - 1))
    order = [schedule.lane[c] for c in late]  # all share a grain: in their order
    assert order == sorted(order)
    assert whole.slot.shape[0] >= schedule.slot.shape[0] > SPACING * (late.size - 1)


def test_pairs_that_close_soon_are_found_beside_all_pairs():
    """In NumPy: those within the cutoff that meet in time with either of both velocities."""
    rng, count = np.random.default_rng(5), 120
    scene = discs_anywhere(rng, count)
    i, j = np.triu_indices(count, 1)
    i, j = i.astype(np.int32), j.astype(np.int32)
    start, free = rng.normal(0.0, 1.0, (2, count + 1, 4))
    first, second, *rest = closing_soon(scene, i, j, start, free, 0.5, 0.3, -1.0)
    expected = []
    for a, b in zip(i, j, strict=True):
        gap, nx, ny = pair_geometry(scene, a, b)
        speeds = [(v[a, 0] - v[b, 0]) * nx + (v[a, 1] - v[b, 1]) * ny for v in (start, free)]
        expected.append(gap <= -1.0 or (gap < 0.5 and gap + 0.3 * min(speeds) < 0.0))
    expected = np.array(expected)
    assert np.array_equal(first, i[expected])
    assert np.array_equal(second, j[expected])
    assert np.array_equal(rest[0], i[~expected])
    assert np.array_equal(rest[1], j[~expected])
    assert 20 < expected.sum() < i.size - 20


def test_what_was_fast_when_contacts_were_sought_does_not_stay():
    """Grains that close at many diameters in a step are contacts of all around, for a few steps."""
    engine = shear_engine(columns=16, rows=6)
    rng = np.random.default_rng(1)
    state = copy_of(engine.state)
    state.velocity[:, :2] += rng.normal(0.0, 200.0, (engine.model.grain_count, 2))
    other = Engine(engine.model, state, threads=1)
    other.resume(engine.orders)
    other.step(DT, 0.0)
    most = other.state.near_i.size
    other.state.velocity[:] = engine.state.velocity
    for step in range(1, 20):
        other.step(DT, step * DT)
    assert most > 6 * engine.model.grain_count
    assert other.state.near_i.size < 4 * engine.model.grain_count


@pytest.mark.parametrize("wrong", [[1], [-1]])
def test_late_contacts_that_fit_no_pairs_are_refused(wrong):
    engine = shear_engine(columns=8, rows=6)
    advance(engine, DT, 60)
    state = copy_of(engine.state)
    count = state.near_i.size
    assert count > 2
    state.near_late = np.array(wrong * (count if wrong == [-1] else count - 1), np.int32)
    assert find_misfit(state, engine.model) is not None


def test_a_stage_with_another_kind_of_wall_knows_late_contacts(monkeypatch):
    """A lid that is held was general before, and is not now: all lanes are laid anew."""
    monkeypatch.setattr(module, "SKIN", 0.01)
    monkeypatch.setattr(module, "LATE_SHARE", 0.5)
    engine = shear_engine(columns=8, rows=6)
    for step in range(160):
        engine.step(DT, step * DT)
        if engine.state.near_late.any() and step > 40:
            break
    assert engine.state.near_late.any()
    other = continued(engine)
    for each in (engine, other):
        resume(each, drives=None)
        advance(each, DT, 20)
    assert engine.state.digest() == other.state.digest()

"""Survival of contacts: by hand, of contacts that end at a constant rate, and against plain loops."""

import numpy as np
import pytest
from cells import make_cell, strained
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import make_model

from multicor_cli import post

ALL = post.Selection(start=0.0)
COUNT = 40


def frame_with(pairs, force=None, sliding=None, **said):
    """A frame of discs of which these pairs are in contact."""
    i, j = np.array(pairs, int).reshape(-1, 2).T
    force = np.ones(i.size) if force is None else np.asarray(force, float)
    contacts = contacts_of(i, j, (1.0, 0.0), np.column_stack([force, 0.0 * force]))
    if sliding is not None:
        contacts.sliding = np.asarray(sliding, bool)
    return frame_of(np.zeros((said.pop("grains", COUNT), 2)), walls=1, contacts=contacts, **said)


def source_with(*frames, time=None, **said):
    return source_of(make_model(np.full(COUNT, 0.5), **said), frames, time)


def test_two_frames_by_hand():
    """Four contacts, of which three are there half a second later; the strong one has weakened."""
    first = frame_with([(0, 1), (1, 2), (2, 3), (3, 4)], [9.0, 1.0, 1.0, 1.0], [0, 1, 1, 0])
    second = frame_with([(0, 1), (1, 2), (3, 4), (7, 8)], [1.0, 1.0, 1.0, 9.0], [0, 1, 0, 1])
    table = post.lifetimes(source_with(first, second, time=[1.0, 1.5]), ALL)
    assert (table.lag, table.contacts, table.again) == ([0.5], [0.75], [0.75])
    assert (table.strong, table.sliding, table.origins) == ([0.0], [0.5], [1])
    assert table.lifetime == pytest.approx(-0.5 / np.log(0.75))
    assert table.lifetime_sliding == pytest.approx(0.5 / np.log(2.0))
    assert np.isnan(table.lifetime_strong)  # shorter than the interval
    assert np.isnan([table.error_contacts[0], table.strain[0], table.shear_rate]).all()
    assert table.contacts_per_frame == 4.0
    lasting = post.lifetimes(source_with(first, first), ALL)
    assert np.isnan(lasting.lifetime)  # none ends
    assert lasting.contacts == [1.0]


def test_contacts_that_come_again():
    """Open in the second frame: there again in the third, but not throughout."""
    pairs = [(0, 1), (2, 3)]
    frames = [frame_with(pairs), frame_with(pairs[:1]), frame_with(pairs), frame_with(pairs),
        frame_with(pairs)]  # fmt: skip
    table = post.lifetimes(source_with(*frames), ALL)
    assert table.lag.tolist() == [1.0, 2.0]
    assert table.contacts == pytest.approx([(1 + 1 + 2 + 2) / 7, (1 + 1 + 2) / 5])
    assert table.again == pytest.approx([(1 + 1 + 2 + 2) / 7, (2 + 1 + 2) / 5])


@pytest.mark.parametrize("lifetime", [8.0, 0.7])
def test_contacts_that_end_at_a_constant_rate(lifetime):
    """C = exp(−τ/T) with the true T within the errors, also where most end between two frames."""
    random, n = np.random.default_rng(2), 2000
    ends, number, there, total = np.zeros(n), np.arange(n), [], n
    for time in range(80):
        over = np.flatnonzero(ends <= time)  # another begins with each frame in which one is gone
        ends[over] = time + random.exponential(lifetime, over.size)
        number[over] = total + np.arange(over.size)
        total += over.size
        there.append(number.copy())
    frames = [frame_with(np.column_stack([own, own + total]), grains=2 * total) for own in there]
    table = post.lifetimes(source_of(make_model(np.full(2 * total, 0.5)), frames), ALL)
    assert abs(table.lifetime - lifetime) < 3.0 * table.lifetime_error < 0.1 * lifetime
    near = table.lag <= max(1.0, lifetime)
    away = np.abs(table.contacts - np.exp(-table.lag / lifetime))[near]
    assert (away < 3.0 * table.error_contacts[near]).all()
    assert table.contacts.tolist() == table.again.tolist()  # each comes once


def test_against_plain_loops():
    """Sets of pairs at random, with forces and sliding at random."""
    random = np.random.default_rng(5)
    frames, sets = [], []
    for _ in range(9):
        pairs = sorted({tuple(sorted(random.choice(8, 2, replace=False))) for _ in range(25)})
        force, sliding = random.exponential(1.0, len(pairs)), random.random(len(pairs)) < 0.5
        frames.append(frame_with(pairs, force, sliding))
        mean = force.mean()
        sets.append({
            "contacts": set(pairs),
            "strong": {p for p, f in zip(pairs, force, strict=True) if f > mean},
            "sliding": {p for p, s in zip(pairs, sliding, strict=True) if s},
        })  # fmt: skip
    table = post.lifetimes(source_with(*frames), ALL)
    assert table.lag.tolist() == [1.0, 2.0, 3.0, 4.0]
    for row, lag in enumerate((1, 2, 3, 4)):
        for name in ("contacts", "strong", "sliding"):
            kept = began = again = 0
            for start in range(9 - lag):
                through = [own[name] for own in sets[start : start + lag + 1]]
                kept += len(set.intersection(*through))
                again += len(through[0] & through[-1])
                began += len(through[0])
            assert getattr(table, name)[row] == pytest.approx(kept / began)
            if name == "contacts":
                assert table.again[row] == pytest.approx(again / began)


def test_pairs_go_by_the_numbers_of_the_grains():
    """Grain 5 leaves, so those after it move up; the wall has the number after the grains."""
    model = make_model(np.full(COUNT, 0.5), [(0, 0, (0.0, 0.0, 0.0, 1.0))])
    here = np.delete(np.arange(COUNT), 5)
    left = model.with_grains(here)
    before = frame_with([(4, 5), (6, 7), (8, COUNT)], model=model, number=np.arange(COUNT))
    after = frame_with([(5, 6), (7, COUNT - 1), (0, 1)], grains=COUNT - 1, model=left, number=here)
    table = post.lifetimes(source_of(model, [before, after]), ALL)
    assert table.contacts == pytest.approx([2 / 3])


def test_images_of_a_pair_are_one_contact():
    model, state = make_cell([[0.5, 0.5], [1.5, 0.5]], [0.5, 0.5], (2.0, 1.0))
    frames = [
        frame_with(pairs, grains=2, wall_position=state.wall_position)
        for pairs in ([(0, 1), (0, 1)], [(0, 1)])
    ]
    series = strained((2.0, 1.0, 0.0), (0.0, 0.0, 0.2), [0.0, 1.0])
    table = post.lifetimes(source_of(model, frames, series=series), ALL)
    assert (table.contacts, table.contacts_per_frame) == ([1.0], 1.0)
    assert (table.strain[0], table.shear_rate) == pytest.approx((0.2, 0.2))


def test_contacts_begin_in_the_bulk(column):
    """Of nine contacts between ten discs above each other those in the middle of the layer."""
    whole, bulk = (post.lifetimes(column, ALL, margin=margin) for margin in (0.0, 2.9))
    assert whole.contacts_per_frame - bulk.contacts_per_frame >= 4.0
    assert bulk.contacts_per_frame == 5.0


def test_refusals(silent):
    with pytest.raises(post.PostError, match="lifetimes need two frames"):
        post.lifetimes(source_with(frame_with([(0, 1)])), ALL)
    with pytest.raises(post.PostError, match="no contact in these frames"):
        post.lifetimes(source_with(frame_with([]), frame_with([])), ALL)
    with pytest.raises(post.PostError, match=r"contacts = true in \[output\]"):
        post.lifetimes(silent)

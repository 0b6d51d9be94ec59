"""Force chains of discs laid in rows, and clusters of sliding contacts, against plain loops."""

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import make_model

from multicor_cli import post
from multicor_cli.post.chains import decay_length, find_chains
from multicor_cli.post.contacts import loaded_contacts

ALL = post.Selection(start=0.0)


def line(*turns, force=5.0):
    """Discs of diameter 1 that press on each other in a row, which turns by angles [°] at each."""
    heading = np.radians(np.cumsum([0.0, *turns]))
    steps = np.column_stack([np.cos(heading), np.sin(heading)])
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    i = np.arange(len(steps))
    return places, i, i + 1, -steps, np.tile([force, 0.0], (len(steps), 1))


def scene(*rows, idle=0):
    """A frame of rows far from each other, and of idle grains that bring the mean down."""
    places, i, j, normal, force, count = [], [], [], [], [], 0
    for k, (place, *contact) in enumerate(rows):
        places.append(place + np.array([0.0, 20.0 * k]))
        for own, values in zip((i, j, normal, force), contact, strict=True):
            own.append(values + (count if values.ndim == 1 else 0))
        count += len(place)
    places.append(np.column_stack([-10.0 - np.arange(idle), np.zeros(idle)]))
    contacts = contacts_of(*map(np.concatenate, (i, j, normal, force)))
    return make_model(np.full(count + idle, 0.5)), frame_of(
        np.concatenate(places), walls=1, contacts=contacts
    )


def lengths_of(model, *frames, angle=45.0):
    table = post.chain_lengths(source_of(model, frames), ALL, angle=angle)
    return dict(zip(table.length.tolist(), table.count.tolist(), strict=True))


def test_straight_rows():
    """Ends bear half of what those between do: above the mean with enough idle grains."""
    model, frame = scene(line(*[0.0] * 6), line(*[0.0] * 3), line(0.0), line(), idle=40)
    table = post.chains(source_of(model, [frame]), ALL)
    assert {3: 1, 5: 1, 8: 1}.items() <= lengths_of(model, frame).items()
    mean, grains = table.mean, model.grain_count
    assert mean["chains"] == pytest.approx(3e3 / grains)
    assert mean["share"] == pytest.approx(16.0 / grains)
    assert (mean["mean_length"], mean["longest"]) == pytest.approx((16.0 / 3.0, 8.0))
    assert (mean["direction"], mean["order"]) == pytest.approx((0.0, 1.0))
    shown = post.chain_map(source_of(model, [frame]), 0)
    assert shown.chain.tolist() == [0] * 8 + [1] * 5 + [2] * 3
    assert shown.grain.tolist() == list(range(16))
    # two contacts, f a each over the area: 2 · 5 · ½/(π/4)
    assert shown.stress[[0, 1]] == pytest.approx(np.array([10.0, 20.0]) / np.pi)
    assert shown.degrees % 180.0 == pytest.approx(0.0, abs=1e-9)
    assert shown.link.tolist() == list(range(7 + 4 + 2))
    assert dict(shown.rows)["longest chain (grains) [1]"] == 8.0


@pytest.mark.parametrize(("turn", "angle", "is_whole"), [
    (60.0, 45.0, True), (80.0, 39.0, False), (80.0, 41.0, True), (100.0, 39.0, False),
    (100.0, 41.0, True),
])  # fmt: skip
def test_rows_that_turn(turn, angle, is_whole):
    """At a kink the major stress halves the angle of both branches as lines: 40° from either."""
    model, frame = scene(line(0.0, 0.0, turn, 0.0, 0.0), idle=40)
    whole = {3: 0, 4: 0, 5: 0, 6: 0, 7: 1}
    assert lengths_of(model, frame, angle=angle) == (whole if is_whole else {3: 2})


def test_a_row_that_ends_where_it_begins():
    """In a cell: seven grains in a row from side to side are one chain without ends."""
    count = 7
    place = np.column_stack([np.arange(count) + 0.5, np.full(count, 0.1)])
    idle = np.column_stack([np.arange(count) + 0.5, np.full(count, 3.0)])
    model, state = make_cell(np.concatenate([place, idle]), np.full(2 * count, 0.5), (count, 6.0))
    i = np.arange(count)
    contacts = contacts_of(i, np.roll(i, -1), (-1.0, 0.0), (2.0, 0.0))
    frame = frame_of(np.concatenate([place, idle]), walls=1, contacts=contacts)
    frame.wall_position = state.wall_position
    source = source_of(model, [frame])
    assert post.chain_lengths(source, ALL).count.tolist() == [0, 0, 0, 0, 1]
    shown = post.chain_map(source, 0)
    assert shown.link.tolist() == i.tolist()


def random_contacts(seed=0, count=150):
    """Discs of several sizes anywhere, and contacts of neighbors with forces of any size."""
    random = np.random.default_rng(seed)
    place, radius = random.random((count, 2)) * 10.0, random.uniform(0.3, 0.7, count)
    away = place[:, None] - place[None]
    distance = np.hypot(*np.moveaxis(away, -1, 0))
    i, j = np.nonzero(np.triu(distance < 1.1 * (radius[:, None] + radius[None]), 1))
    normal = away[i, j] / distance[i, j][:, None]
    f = random.exponential(1.0, i.size)
    force = np.column_stack([f, 0.4 * f * random.uniform(-1.0, 1.0, i.size)])
    contacts = contacts_of(i, j, normal, force)
    contacts.sliding = random.random(i.size) < 0.3
    model = make_model(radius)
    return model, frame_of(place, walls=1, contacts=contacts)


def joined(pairs, count):
    """Groups of numbers that pairs join, one pair after the other."""
    group = list(range(count))
    for a, b in pairs:
        old, new = group[a], group[b]
        group = [new if own == old else own for own in group]
    return [[k for k in range(count) if group[k] == name] for name in sorted(set(group))]


@pytest.mark.parametrize("seed", range(4))
def test_chains_against_plain_loops(seed):
    model, frame = random_contacts(seed)
    radius, c = model.grains.radius, frame.contacts
    stress = np.zeros((radius.size, 2, 2))
    for i, j, n, (f, g) in zip(c.i, c.j, c.normal, c.force, strict=True):
        force = f * n + g * np.array([-n[1], n[0]])
        for grain, way, sign in ((i, n * radius[i], 1.0), (j, -n * radius[j], -1.0)):
            stress[grain] += np.outer(sign * force, way) / (np.pi * radius[grain] ** 2)
    value, vector = np.linalg.eigh(0.5 * (stress + np.swapaxes(stress, 1, 2)))
    major, along = value[:, 1], vector[:, :, 1]
    links = [
        (i, j)
        for i, j, n in zip(c.i.tolist(), c.j.tolist(), c.normal, strict=True)
        if min(major[i], major[j]) > major.mean()
        and min(abs(along[i] @ n), abs(along[j] @ n)) >= np.cos(np.radians(40.0))
    ]
    expected = sorted(own for own in joined(links, radius.size) if len(own) >= 3)
    found = find_chains(loaded_contacts(frame, model), model, 40.0)
    assert len(expected) > 2
    assert found.stress == pytest.approx(major)
    assert (
        sorted(np.flatnonzero(found.of_grain == k).tolist() for k in range(found.length.size))
        == expected
    )
    assert found.length.tolist() == sorted(map(len, expected), reverse=True)
    in_chains = {grain for own in expected for grain in own}
    assert found.link.size == sum(i in in_chains for i, _ in links)


def test_decay_of_lengths_that_were_drawn():
    """The likeliest one, and the true one within three times its error l₀/√n."""
    length, count = 4.0, 40_000
    drawn = 2 + np.random.default_rng(1).geometric(1.0 - np.exp(-1.0 / length), count)
    found = float(decay_length(drawn.mean()))
    assert found == pytest.approx(length, abs=3.0 * length / np.sqrt(count))

    def likelihood(l0):
        return np.sum(np.log1p(-np.exp(-1.0 / l0)) - (drawn - 3) / l0)

    assert likelihood(found) > max(likelihood(0.999 * found), likelihood(1.001 * found))
    assert float(decay_length(3.0)) == 0.0


def test_chains_are_averaged_over_all_frames():
    one, two = scene(line(0.0), idle=40), scene(line(0.0), idle=40)
    turned = two[1]
    turned.contacts.normal = turned.contacts.normal[:, ::-1]
    turned.position = turned.position[:, ::-1]
    table = post.chains(source_of(one[0], [one[1], turned]), ALL)
    assert table.values["direction"] == pytest.approx([0.0, 90.0])
    assert table.values["order"] == pytest.approx([1.0, 1.0])
    assert table.mean["order"] == pytest.approx(0.0, abs=1e-12)
    assert table.spread["share"].error == 0.0


def test_no_chain():
    model, frame = scene(line(), idle=40)
    source = source_of(model, [frame])
    table = post.chains(source, ALL)
    assert (table.mean["chains"], table.mean["share"], table.mean["longest"]) == (0.0, 0.0, 0.0)
    assert np.isnan(table.mean["mean_length"])
    assert np.isnan(table.mean["decay_length"])
    with pytest.raises(post.PostError, match="there is no force chain"):
        post.chain_lengths(source, ALL)
    for angle in (0.0, 90.0, np.nan):
        with pytest.raises(post.PostError, match="between 0 and 90"):
            post.chains(source, ALL, angle=angle)


# ---- Clusters of sliding contacts


def test_clusters_by_hand():
    """Sliding: three in a row, one that joins no other, none of the wall."""
    contacts = contacts_of([0, 1, 2, 4, 6, 0], [1, 2, 3, 5, 7, 8], (1.0, 0.0), (1.0, 0.1))
    contacts.sliding = np.array([True, True, True, True, False, True])
    model = make_model(np.full(8, 0.5), [(0, 0, (0.0, 0.0, 0.0, 1.0))])
    frame = frame_of(np.zeros((8, 2)), walls=1, contacts=contacts)
    mean = post.clusters(source_of(model, [frame]), ALL).mean
    assert mean == pytest.approx({
        "sliding": 4 / 5, "clusters": 1e3 * 2 / 8, "mean_size": 2.0, "weight_size": 10 / 4,
        "largest": 3.0, "largest_share": 3 / 4,
    })  # fmt: skip
    contacts.sliding = np.zeros(6, bool)
    mean = post.clusters(source_of(model, [frame]), ALL).mean
    assert (mean["sliding"], mean["clusters"], mean["largest"]) == (0.0, 0.0, 0.0)
    assert np.isnan(mean["weight_size"])


def test_clusters_against_plain_loops():
    model, frame = random_contacts(7)
    c = frame.contacts
    pairs = [(int(i), int(j)) for i, j, s in zip(c.i, c.j, c.sliding, strict=True) if s]
    size = [
        sum(i in own for i, _ in pairs)
        for own in map(set, joined(pairs, model.grain_count))
        if len(own) > 1
    ]
    mean = post.clusters(source_of(model, [frame]), ALL).mean
    assert mean["largest"] == max(size)
    assert mean["weight_size"] == pytest.approx(sum(s * s for s in size) / len(pairs))
    assert mean["mean_size"] == pytest.approx(np.mean(size))
    assert mean["clusters"] == pytest.approx(1e3 * len(size) / model.grain_count)

"""Frames of several groups, of grains that come and go, and a time series, that no run has; and tables
of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from made_up_frames import frame_of, source_of
from scene_parts import make_model

from multicor_cli import post
from multicor_cli.model.state import Presence
from multicor_cli.store.frames import NamedColumn

LAPSE = 0.5


def source_of_groups(groups, frames, names=("a", "b"), period=0.0):
    """Frames of discs of diameter 1 in these groups, with a period in x or without."""
    model = make_model(np.full(len(groups), 0.5), period=period)
    model = replace(
        model, groups=names, grains=replace(model.grains, group=np.array(groups, np.int32))
    )
    return source_of(model, [frame_of(position, walls=1) for position in frames])


def source_of_stays(stays, frames, groups=None, lost=()):
    """Frames of grains that are there in these frames each, ``(first, last)``; ``lost`` ones go
    beside the outlets. Grains stand side by side."""
    n = len(stays)
    model = make_model(np.full(n, 0.1))
    if groups is not None:
        grains = replace(model.grains, group=np.array(groups, np.int32))
        model = replace(model, groups=("a", "b"), grains=grains)
    made = []
    for k in range(frames):
        presence = np.full(n, Presence.WAITS)
        for grain, (first, last) in enumerate(stays):
            if k > last:
                presence[grain] = Presence.LOST if grain in lost else Presence.LEFT
            elif k >= first:
                presence[grain] = Presence.THERE
        number = np.flatnonzero(presence == Presence.THERE)
        at = np.column_stack([number, np.zeros(number.size)]).astype(float)
        frame = frame_of(at, unwrapped=at, presence=presence, number=number, is_open=True)
        made.append(frame)
    return source_of(model, made, LAPSE * np.arange(frames))


def source_of_series(values, step=0.1, **more):
    """A time series with a column ``pull`` in newton."""
    time = step * np.arange(1, len(values) + 1)
    columns = [NamedColumn("time", "s", time), NamedColumn("pull", "N", np.asarray(values))]
    columns += [NamedColumn(name, "N", np.asarray(each)) for name, each in more.items()]
    return SimpleNamespace(series_columns=columns)


def mixed():
    """Two groups at random, three times."""
    random = np.random.default_rng(1)
    frames = random.random((3, 200, 2)) * 20.0
    return post.mixing(source_of_groups(np.arange(200) % 2, frames, ("small", "large")))


def parted(of="share", frames=20):
    """Large grains that rise through small ones."""
    random, size = np.random.default_rng(1), np.arange(200) % 2
    at = random.random((frames, 200, 2)) * 20.0
    at[:, size == 1, 1] += np.linspace(0.0, 20.0, frames)[:, np.newaxis]
    source = source_of_groups(1 - size, at, ("large", "small"))
    grains = replace(source.model.grains, radius=0.4 + 0.2 * size)
    source.model = replace(source.model, grains=grains)
    return post.segregation(source, of=of)


def stayed():
    """Stays of two groups, some of which go on."""
    start = np.random.default_rng(1).integers(1, 20, 40)
    stays = list(zip(start, start + 5, strict=True))
    return post.residence(source_of_stays(stays, 20, np.arange(40) % 2))


def dropped(*, power_law=False):
    """Drops of a column, of one size or distributed as a power law."""
    drop = np.random.default_rng(1).random(300) ** -0.8 if power_law else np.full(30, 2.0)
    value = np.column_stack([drop, np.zeros(drop.size)]).ravel()
    return post.avalanches(source_of_series(value), "pull", threshold=1.0)

"""Frames that no run has recorded, as tables take them."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multicor_cli.model import Model
from multicor_cli.post import PROFILED, Column, ProfileTable


class Frame(SimpleNamespace):
    """A frame; what it does not say of its grains is that all of the model of its run are there."""

    def __getattr__(self, name: str) -> Any:
        if name in ("model", "run_model"):
            return self.source.model
        if name == "number":
            return np.arange(len(self.position))
        if name in ("is_open", "radius"):
            return {"is_open": False, "radius": None}[name]
        raise AttributeError(name)


class Frames(list[Any]):
    """Frames with their times [s], by default 0, 1, …; all in the first stage."""

    def __init__(self, frames: Iterable[Any], time: ArrayLike | None, source: Any) -> None:
        super().__init__()
        self._source = source
        for frame in frames:
            self.append(frame)
        self.time = np.arange(float(len(self))) if time is None else np.asarray(time)
        self.stage = np.zeros(len(self), np.int32)

    def append(self, frame: Any) -> None:
        """Add a frame of the run; one that is read from a file as it is."""
        is_made_up = isinstance(frame, SimpleNamespace)
        super().append(Frame(**vars(frame) | {"source": self._source}) if is_made_up else frame)


def source_of(
    model: Model, frames: Iterable[Any], time: ArrayLike | None = None, **more: Any
) -> SimpleNamespace:
    """What tables can be made of instead of a run."""
    source = SimpleNamespace(model=model, **more)
    source.frames = Frames(frames, time, source)
    return source


def frame_of(position: ArrayLike, *, walls: int = 2, **said: Any) -> Frame:
    """A frame; of what is not said all is at rest, and no contacts were recorded."""
    position = np.asarray(position, float)
    n, wall = len(position), np.zeros((walls, 3))
    rest = {"velocity": np.zeros((n, 3)), "spin": np.zeros(n), "temperature": None, "dt": 1e-3}
    rest |= {"contacts": contacts_of(recorded=False), "wall_position": wall, "wall_velocity": wall}
    return Frame(position=position, **rest | said)


def put(frame: Any, **values: ArrayLike) -> None:
    """Let a frame that is read from a file hold other arrays."""
    for name, value in values.items():
        vars(frame)[getattr(type(frame), name).path] = np.asarray(value, float)


def contacts_of(
    i: ArrayLike = (),
    j: ArrayLike = (),
    normal: ArrayLike = (0.0, 0.0),
    force: ArrayLike = (0.0, 0.0),
    *,
    recorded: bool = True,
) -> SimpleNamespace:
    """Contacts without gaps that stick; a normal or force for all of them, or for each its own."""
    first, second = np.asarray(i, np.int64), np.asarray(j, np.int64)
    shape = (first.size, 2)
    return SimpleNamespace(
        i=first, j=second, normal=np.broadcast_to(np.asarray(normal, float), shape),
        force=np.broadcast_to(np.asarray(force, float), shape), gap=np.zeros(first.size),
        sliding=np.zeros(first.size, bool), recorded=recorded,
    )  # fmt: skip


def profile_of(
    of: str,
    y: ArrayLike,
    value: ArrayLike,
    error: float,
    *,
    at_walls: tuple[float, float] = (0.0, 0.0),
    shear_rate: float = 0.0,
) -> ProfileTable:
    """A profile between walls at 0 and 1 m in bins of 0.1 m that no run has."""
    field, y = PROFILED[of], np.asarray(y)
    facts = {
        "of": of, "unit": field.unit, "y_unit": "m", "normalized": False, "times": (0.0, 1.0),
        "height": 1.0, "walls": ("bottom", "top"), "wall_values": at_walls,
        "shear_rate": shear_rate, "bin_width": 0.1,
    }  # fmt: skip
    columns = [
        Column("y", "m", y), Column("value", field.unit, np.asarray(value), of),
        Column("error", field.unit, np.full(y.size, error)), Column("area", "m2", np.ones(y.size)),
    ]  # fmt: skip
    parts = {
        "frames": np.arange(5), "is_normalized": False, "width": 0.1, "left_out": 0.0, "note": "",
        "groups": (), "about_groups": "",
    }  # fmt: skip
    return ProfileTable(columns, facts, field=field, **parts)

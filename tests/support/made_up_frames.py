"""Frames that no run has recorded, as tables take them."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multicor_cli.model import Model
from multicor_cli.post import PROFILED, Column, ProfileTable


class Frames(list[Any]):
    """Frames with their times [s], by default 0, 1, …; all in the first stage."""

    def __init__(self, frames: Iterable[Any], time: ArrayLike | None = None) -> None:
        super().__init__(frames)
        self.time = np.arange(float(len(self))) if time is None else np.asarray(time)
        self.stage = np.zeros(len(self), np.int32)


def source_of(
    model: Model, frames: Iterable[Any], time: ArrayLike | None = None, **more: Any
) -> SimpleNamespace:
    """What tables can be made of instead of a run."""
    return SimpleNamespace(model=model, frames=Frames(frames, time), **more)


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
    field = PROFILED[of]
    facts = {
        "of": of, "unit": field.unit, "y_unit": "m", "normalized": False, "times": (0.0, 1.0),
        "height": 1.0,
        "walls": ("bottom", "top"), "wall_values": at_walls, "shear_rate": shear_rate,
        "bin_width": 0.1,
    }  # fmt: skip
    columns = [
        Column("y", "m", np.asarray(y)), Column("value", field.unit, np.asarray(value), of),
        Column("error", field.unit, np.full(np.size(y), error)),
        Column("area", "m2", np.ones(np.size(y))),
    ]  # fmt: skip
    parts = {
        "frames": np.arange(5),
        "is_normalized": False,
        "width": 0.1,
        "left_out": 0.0,
        "note": "",
        "groups": (),
        "about_groups": "",
    }
    return ProfileTable(columns, facts, field=field, **parts)

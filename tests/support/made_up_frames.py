"""Frames that no run has recorded, as tables take them."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multicor_cli.model import Model


class Frames(list[Any]):
    """Frames with their times [s], by default 0, 1, …; all in the first stage."""

    def __init__(self, frames: Iterable[Any], time: ArrayLike | None = None) -> None:
        super().__init__(frames)
        self.time = np.arange(float(len(self))) if time is None else np.asarray(time)
        self.stage = np.zeros(len(self), np.int32)


def source_of(model: Model, frames: Iterable[Any], time: ArrayLike | None = None, **more: Any) -> SimpleNamespace:
    """What tables can be made of instead of a run."""
    return SimpleNamespace(model=model, frames=Frames(frames, time), **more)

"""A run turned by a right angle, so that what is measured from below upwards is from left to right.

What lies at (x, y) is at (−y, x) there: a wall on the left of the grains is below them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import TAIL, Tail
from multicor_cli.post.source import Frame, Run, model_of


def turned(source: Run) -> Run:
    """The run, turned to the left: places, normals and walls; not its time series.

    The domain must not be periodic.
    """
    return cast("Run", _Run(source))


def _turn(vectors: ArrayLike) -> Floats:
    """Vectors, or what begins with them, of shape ``(…, k)`` with k ≥ 2."""
    found = np.array(vectors, np.float64)
    found[..., 0], found[..., 1] = -found[..., 1].copy(), found[..., 0].copy()
    return found


def _turn_model(model: Model) -> Model:
    shapes, tail = model.shapes, TAIL[model.shapes.kind]
    moves = (tail == Tail.DIRECTION) | (tail == Tail.POINT)
    geometry = _turn(shapes.geometry)
    geometry[moves, 2:] = _turn(geometry[moves, 2:])
    return replace(model, shapes=replace(shapes, geometry=geometry))


@dataclass(frozen=True)
class _Contacts:
    contacts: Any

    def __getattr__(self, name: str) -> Any:
        return getattr(self.contacts, name)

    @cached_property
    def normal(self) -> Floats:
        return _turn(self.contacts.normal)


@dataclass(frozen=True)
class _Frame:
    frame: Frame
    model: Model

    def __getattr__(self, name: str) -> Any:
        return getattr(self.frame, name)

    @cached_property
    def position(self) -> Floats:
        return _turn(self.frame.position)

    @cached_property
    def wall_position(self) -> Floats:
        return _turn(self.frame.wall_position)

    @cached_property
    def contacts(self) -> _Contacts:
        return _Contacts(self.frame.contacts)


@dataclass(frozen=True)
class _Frames:
    source: Run
    model: Model

    def __getattr__(self, name: str) -> Any:  # the times, for one
        return getattr(self.source.frames, name)

    def __getitem__(self, index: int) -> Any:
        frame = self.source.frames[index]
        model = model_of(self.source, frame)
        return _Frame(frame, self.model if model is self.source.model else _turn_model(model))


@dataclass(frozen=True)
class _Run:
    source: Run

    def __getattr__(self, name: str) -> Any:
        return getattr(self.source, name)

    @cached_property
    def model(self) -> Model:
        return _turn_model(self.source.model)

    @cached_property
    def frames(self) -> _Frames:
        return _Frames(self.source, self.model)

"""A run as if it had only the grains of some of its groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import LoadedContacts
from multicor_cli.post.source import FrameSequence, FrameSource, GrainFrame, PostError, model_of
from multicor_cli.text import choices

_OF_GRAINS = ("position", "velocity", "spin", "temperature", "generated", "unwrapped", "angle")


class FrameOfGroups:
    """A frame with the grains of some groups; walls, times and what else belongs to the whole are its own.

    Attributes:
        whole: The frame with all its grains.
        rows: Rows of these grains in it, shape ``(n,)``.
    """

    def __init__(self, whole: GrainFrame, model: Model, groups: NDArray[np.int64]) -> None:
        self.whole, self._model = whole, model
        self.rows = np.flatnonzero(np.isin(model.grains.group, groups))

    @cached_property
    def model(self) -> Model:
        """The model of these grains."""
        return self._model.with_grains(self.rows)

    @property
    def number(self) -> NDArray[np.int64]:
        """Numbers of these grains among all of the run, shape ``(n,)``."""
        numbers = getattr(self.whole, "number", None)
        return self.rows if numbers is None else np.asarray(numbers)[self.rows]

    @property
    def contacts(self) -> Any:
        """Refused: a contact may be one with a grain of another group; see `parts`."""
        raise PostError("contacts are not those of one group: leave out --group, or choose a quantity of grains")

    def parts(self, contacts: LoadedContacts) -> Floats:
        """Which part of each contact of the whole is that of these grains: half for each of two grains, shape ``(c,)``.

        What a grain exchanges with a wall is its own. So the parts of all groups add up to 1.
        """
        n = contacts.grain_count
        counts = np.zeros(contacts.reach_of.size)
        counts[self.rows] = 1.0
        first, second = counts[contacts.i], counts[contacts.j]
        return np.asarray(np.where(contacts.j < n, 0.5 * (first + second), first))

    def __getattr__(self, name: str) -> Any:
        values = getattr(self.whole, name)
        return values if name not in _OF_GRAINS or values is None else np.asarray(values)[self.rows]


@dataclass(frozen=True)
class _Frames:
    source: FrameSource
    groups: NDArray[np.int64]

    @property
    def time(self) -> NDArray[Any]:
        return self.source.frames.time

    @property
    def stage(self) -> NDArray[Any]:
        return self.source.frames.stage

    def __getitem__(self, index: int) -> Any:
        frame = self.source.frames[index]
        return FrameOfGroups(frame, model_of(self.source, frame), self.groups)


@dataclass(frozen=True)
class _Source:
    model: Model
    frames: FrameSequence


def of_groups(source: FrameSource, names: Sequence[str]) -> FrameSource:
    """The run as if it had only the grains of these groups.

    Args:
        source: The run.
        names: Names of ``[[particles]]``.

    Raises:
        PostError: If there is no such group.
    """
    known = source.model.groups
    for name in names:
        if name not in known:
            raise PostError(f"there is no group '{name}'; {choices(name, known)}")
    groups = np.array([known.index(name) for name in names], np.int64)
    return _Source(source.model, _Frames(source, groups))

"""Which points the lines join in the view of ``results.h5``: contacts as lines, a block of frames at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model

CHUNK_ROWS = 1 << 14
"""Rows of a chunk."""

BLOCK_ROWS = 1 << 18
"""Rows of grains and contacts that are looked at together."""

Indices = NDArray[np.int64]


class Growing:
    """A dataset whose length is known only in the end; every chunk is written once."""

    def __init__(self, file: h5py.Group, path: str, dtype: Any, *tail: int) -> None:
        self._dataset = file.create_dataset(
            path, (0, *tail), dtype, maxshape=(None, *tail), chunks=(CHUNK_ROWS, *tail),
            shuffle=True, compression="gzip", compression_opts=1, fletcher32=True,
        )  # fmt: skip
        self._pending: list[NDArray[Any]] = []
        self._count = 0

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows; whole chunks are written."""
        self._pending.append(rows)
        self._count += len(rows)
        if self._count >= CHUNK_ROWS:
            self._write(self._count // CHUNK_ROWS * CHUNK_ROWS)

    def close(self) -> None:
        """Write the rest."""
        self._write(self._count)

    def _write(self, count: int) -> None:
        if not count:
            return
        rows = np.concatenate(self._pending)
        start = len(self._dataset)
        self._dataset.resize(start + count, axis=0)
        self._dataset[start:] = rows[:count]
        self._pending, self._count = [rows[count:]], len(rows) - count


def frame_blocks(sizes: Indices) -> Iterator[tuple[int, int]]:
    """Ranges of frames with about `BLOCK_ROWS` rows each."""
    start, total = 0, 0
    for frame, size in enumerate(sizes):
        if total and total + size > BLOCK_ROWS:
            yield start, frame
            start, total = frame, 0
        total += int(size)
    yield start, len(sizes)


def ranges(lengths: Indices) -> Indices:
    """``0 … length-1`` for each length, one after the other."""
    starts = np.cumsum(lengths) - lengths
    return np.asarray(np.arange(int(lengths.sum())) - np.repeat(starts, lengths), np.int64)


@dataclass(frozen=True)
class LineBlock:
    """The contacts of consecutive frames; ``c`` rows.

    Attributes:
        grains: Number of grains n.
        counts: Contacts of each frame.
        frame: Frame of each contact, from 0 in the block.
        i: First shape of each contact.
        j: Second shape of each contact.
        is_open: Whether the line ends in an appended point.
        reach: From the center of i against the normal to that point [m], shape ``(c, 2)``.
        center: Centers of i [m], shape ``(c, 3)``.
    """

    grains: int
    counts: Indices
    frame: Indices
    i: Indices
    j: Indices
    is_open: NDArray[np.bool_]
    reach: NDArray[np.float64]
    center: NDArray[np.float64]

    @classmethod
    def read(cls, file: h5py.File, model: Model, start: int, stop: int, offset: Indices) -> LineBlock:
        """Read the frames ``start:stop``; contact rows begin at ``offset``."""
        n, first, last = model.grain_count, int(offset[start]), int(offset[stop])
        counts: Indices = np.diff(offset[start : stop + 1])
        frame = np.repeat(np.arange(stop - start), counts)
        i, j = (file[f"contacts/{name}"][first:last].astype(np.int64) for name in "ij")
        position = file["particles/position"][start * n : stop * n].astype(np.float64)
        is_wall = j >= n
        partner = np.where(is_wall, i, j)
        center = position[frame * n + i]
        crosses = np.abs(center[:, 0] - position[frame * n + partner, 0]) > 0.5 * (model.period or np.inf)
        radius = model.grains.radius
        length = radius[i] + np.where(is_wall, 0.0, radius[partner]) + file["contacts/gap"][first:last]
        reach = length[:, None] * file["contacts/normal"][first:last]
        return cls(n, counts, frame, i, j, is_wall | crosses, reach, center)

    @property
    def end_counts(self) -> Indices:
        """Appended points of each frame."""
        return np.bincount(self.frame[self.is_open], minlength=len(self.counts)).astype(np.int64)

    def end_points(self) -> NDArray[np.float64]:
        """Appended points [m], in the order of the contacts."""
        points = self.center[self.is_open]
        points[:, :2] -= self.reach[self.is_open]
        return points

    def connectivity(self, lines: Indices) -> Indices:
        """Both ends of every line, counted from 0 in each frame; ``lines`` is their number in each frame."""
        joined = np.zeros((int(lines.sum()), 2), np.int64)
        row = (np.cumsum(lines) - lines)[self.frame] + ranges(self.counts)
        end = self.j.copy()
        end[self.is_open] = self.grains + ranges(self.end_counts)
        joined[row, 0], joined[row, 1] = self.i, end
        return joined.ravel()

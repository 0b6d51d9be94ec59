"""A quantity of every grain of one frame, to be drawn as a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.quantities import MAPPED, SAME, Quantity
from multicor_cli.post.scene import GrainScene, make_scene
from multicor_cli.post.source import FrameSource, PostError, frame_index, need_grains, rows_of
from multicor_cli.post.table import Table
from multicor_cli.text import choices


@dataclass(frozen=True, repr=False)
class GrainMap(Table):
    """A quantity of every grain; ``n`` grains.

    Attributes:
        field: What it is.
        scene: Where the grains and walls are.
        value: Values; magnitudes of vectors, shape ``(n,)``.
        vector: The vectors, shape ``(n, 2)``, or None.
        frame: Index of the frame.
        time: Time of the frame [s].
        names: What the values 0, 1, … stand for, where they are no amounts.
    """

    field: Quantity
    scene: GrainScene
    value: Floats
    vector: Floats | None
    frame: int
    time: float
    names: tuple[str, ...] = ()

    @property
    def headings(self) -> tuple[str, str]:
        """Names of the columns of `rows`."""
        return (self.field.label, "grains") if self.names else ("quantity", "value")

    @property
    def rows(self) -> list[tuple[str, float]]:
        """Statistics of the values; how many grains there are of each kind, where they stand for names."""
        if self.names:
            return [(name, float((self.value == k).sum())) for k, name in enumerate(self.names)]
        unit = f" [{self.field.unit}]"
        quantiles = np.quantile(self.value, (0.0, 0.05, 0.5, 0.95, 1.0))
        names = ("smallest", "5 % of the grains below", "half of the grains below", "95 % of the grains below", "largest")
        pairs = [("mean", float(self.value.mean())), *zip(names, quantiles.tolist(), strict=True)]
        return [("grains", float(self.value.size)), *((name + unit, value) for name, value in pairs)]

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        unit, name = self.field.unit, self.field.name
        vector = () if self.vector is None else (f"{name} x [{unit}]", f"{name} y [{unit}]")
        return ("x [m]", "y [m]", "radius [m]", f"{name} [{unit}]", *vector)

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """One row per grain: center, radius, value, and the vector if there is one."""
        return rows_of([*self.scene.center.T, self.scene.radius, self.value, *(() if self.vector is None else self.vector.T)])

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        data = {
            "of": self.field.name,
            "unit": self.field.unit,
            "frame": self.frame,
            "time": self.time,
            "x": self.scene.center[:, 0].tolist(),
            "y": self.scene.center[:, 1].tolist(),
            "radius": self.scene.radius.tolist(),
            "value": self.value.tolist(),
        }
        if self.names:
            data["names"] = list(self.names)
        return data if self.vector is None else data | {"vector": self.vector.tolist()}


def grain_map(source: FrameSource, of: str, frame: int = -1, *, may_be_empty: bool = False) -> GrainMap:
    """A quantity of every grain of one frame.

    Args:
        source: The run.
        of: Name of the quantity, one of `MAPPED`.
        frame: Index of the frame; negative counts from the last one.
        may_be_empty: Whether there may be no grain in the frame, of whose values a table can tell nothing.

    Raises:
        PostError: If there is no such quantity, frame or grain, or the run has no heat and the quantity needs it.
        StoreError: If the run cannot be read.
    """
    chosen = MAPPED.get(SAME.get(of, of))
    if chosen is None or chosen.of_grain is None:
        raise PostError(f"there is no map of '{of}'; {choices(of, MAPPED)}")
    index = frame_index(source.frames, frame)
    if not may_be_empty:
        need_grains(source, np.array([index]))
    values = chosen.of_grain(source, index)
    vector = values if values.ndim == 2 else None
    return GrainMap(
        chosen,
        make_scene(source, source.frames[index]),
        values if vector is None else np.hypot(*vector.T),
        vector,
        index,
        float(np.asarray(source.frames.time)[index]),
        () if chosen.names_of is None else chosen.names_of(source.model),
    )

"""The contact forces of one frame: how large, how many, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import loaded_contacts, with_forces
from multicor_cli.post.scene import GrainScene, make_scene
from multicor_cli.post.source import FrameSource, frame_index, model_of, need_grains, rows_of
from multicor_cli.post.table import Table

SUMMARY = (
    "contacts", "wall_contacts", "normal_force_mean", "normal_force_max", "tangential_force_mean", "coordination", "rattler_share",
    "sliding_share",
)  # fmt: skip
"""Names of the numbers of a whole network."""


@dataclass(frozen=True, repr=False)
class ForceNetwork(Table):
    """The contacts of a frame that carry a force; ``c`` of them.

    Attributes:
        scene: Where the grains and walls are.
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below the number of grains), shape ``(c,)``.
        normal: Unit normal from j to i, shape ``(c, 2)``.
        start: Center of the grain i [m], shape ``(c, 2)``.
        end: Center of the grain j next to it, free or glued, or where the grain touches a smooth wall [m], shape ``(c, 2)``.
        force: Normal and tangential force on i, mean of the last step [N], shape ``(c, 2)``.
        sliding: Whether the contact slides, shape ``(c,)``.
        frame: Index of the frame.
        time: Time of the frame [s].
    """

    scene: GrainScene
    i: NDArray[Any]
    j: NDArray[Any]
    normal: Floats
    start: Floats
    end: Floats
    force: Floats
    sliding: NDArray[np.bool_]
    frame: int
    time: float

    @property
    def headings(self) -> tuple[str, str]:
        """Names of the columns of `rows`."""
        return "quantity", "value"

    @property
    def is_wall(self) -> NDArray[np.bool_]:
        """Whether a contact is one of a grain with a wall, shape ``(c,)``."""
        return np.asarray(self.j >= self.scene.radius.size)

    @property
    def coordination(self) -> float:
        """Mean number of contacts of a grain that carry a force, Z; those with walls included."""
        return float(2 * self.i.size - np.count_nonzero(self.is_wall)) / self.scene.radius.size

    @property
    def rattler_share(self) -> float:
        """Share of the grains with fewer than two contacts that carry a force."""
        n = self.scene.radius.size
        contacts = np.bincount(self.i, minlength=n) + np.bincount(self.j[~self.is_wall], minlength=n)
        return float(np.count_nonzero(contacts < 2)) / n

    @property
    def summary(self) -> dict[str, float]:
        """The numbers of `rows` by name; nan where there is no contact."""
        normal, tangential = self.force.T
        none = not normal.size
        values = (
            normal.size,
            int(np.count_nonzero(self.is_wall)),
            np.nan if none else float(normal.mean()),
            np.nan if none else float(normal.max()),
            np.nan if none else float(np.abs(tangential).mean()),
            self.coordination,
            self.rattler_share,
            np.nan if none else float(self.sliding.mean()),
        )
        return dict(zip(SUMMARY, values, strict=True))

    @property
    def rows(self) -> list[tuple[str, float]]:
        """The numbers of `summary` with names for people."""
        return list(zip(_LABELS, self.summary.values(), strict=True))

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        return "i", "j", "x [m]", "y [m]", "normal x [1]", "normal y [1]", "normal force [N]", "tangential force [N]", "sliding"

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """One row per contact; x and y are the point where the grain i touches."""
        touch = self.start - self.normal * self.scene.radius[self.i][:, np.newaxis]
        return rows_of([self.i, self.j, *touch.T, *self.normal.T, *self.force.T, self.sliding.astype(np.int64)])

    def as_dict(self) -> dict[str, Any]:
        """The numbers of the whole network as JSON types; numbers may be nan."""
        return {"frame": self.frame, "time": self.time, **self.summary}


_LABELS = (
    "contacts that carry a force",
    "  of these with walls",
    "mean normal force [N]",
    "largest normal force [N]",
    "mean tangential force, without sign [N]",
    "coordination number Z",
    "share of rattlers (fewer than two contacts)",
    "share of sliding contacts",
)


def force_network(source: FrameSource, frame: int = -1) -> ForceNetwork:
    """The force network of one frame.

    Args:
        source: The run.
        frame: Index of the frame; negative counts from the last one.

    Raises:
        PostError: If there is no such frame, or no grain in it, or no contact forces belong to it.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    need_grains(source, np.array([index]))
    with_forces(source, np.array([index]))
    chosen = source.frames[index]
    loaded = loaded_contacts(chosen, model_of(source, chosen))
    scene = make_scene(source, chosen)
    start = scene.center[loaded.i]
    return ForceNetwork(
        scene,
        loaded.i,
        loaded.j,
        loaded.normal,
        start,
        start - loaded.branch,
        loaded.force,
        np.asarray(chosen.contacts.sliding, np.bool_)[loaded.row],
        index,
        float(np.asarray(source.frames.time)[index]),
    )

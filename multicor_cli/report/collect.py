"""The frames of a run as the page needs them: read once, kept small."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import has_forces, loaded_contacts
from multicor_cli.post.scene import make_scene
from multicor_cli.report.fields import fields_of, values_of
from multicor_cli.store import Run
from multicor_cli.store.frame_view import Frame

Singles = NDArray[np.float32]


@dataclass(frozen=True)
class ContactsView:
    """The contacts of a frame that carry a force; ``c`` of them, ordered by the first grain.

    Attributes:
        i: First grain, shape ``(c,)``.
        j: Second grain; −1: a wall, shape ``(c,)``.
        angle: Direction from the first grain to the contact [rad], −π … π, shape ``(c,)``.
        force: Normal force without sign [N], shape ``(c,)``.
    """

    i: NDArray[np.int64]
    j: NDArray[np.int64]
    angle: Singles
    force: Singles

    def strongest(self, count: int) -> ContactsView:
        """The ``count`` contacts with the largest forces."""
        if count >= self.i.size:
            return self
        kept = np.sort(np.argpartition(-self.force, count)[:count]) if count else np.zeros(0, np.int64)
        return ContactsView(self.i[kept], self.j[kept], self.angle[kept], self.force[kept])


@dataclass(frozen=True)
class FrameView:
    """A frame; ``n`` grains, ``w`` walls.

    Attributes:
        index: Its number in the run.
        center: Centers, x within the period [m], shape ``(n, 2)``.
        values: Values of the fields by name, each of shape ``(n,)``; a field that this frame lacks is missing.
        contacts: Its contacts, or None where they are not in the file.
        walls: Displacement [m] and angle [rad] of the walls, shape ``(w, 3)``.
        box: Corners of what is to be seen [m], shape ``(2, 2)``.
    """

    index: int
    center: Singles
    values: dict[str, NDArray[Any]]
    contacts: ContactsView | None
    walls: Floats
    box: Floats


def thin_frames(count: int, wanted: int) -> NDArray[np.int64]:
    """Numbers of about ``wanted`` of ``count`` frames, evenly spaced; the last one is always among them."""
    if wanted >= count:
        return np.arange(count)
    return np.unique(np.rint(np.linspace(0.0 if wanted > 1 else count - 1.0, count - 1.0, wanted)).astype(np.int64))


def view_of(run: Run, index: int) -> FrameView:
    """Read a frame; raises `multicor_cli.store.StoreError`."""
    frame = run.frames[index]
    scene = make_scene(run, frame)
    values = {}
    for field in fields_of(run):
        found = values_of(field, run, index)
        if found is not None:
            # Temperatures may differ by millikelvins only, which single precision does not resolve.
            values[field.name] = np.asarray(found, np.float64 if field.unit == "K" else np.float32)
    walls = np.array(frame.wall_position, np.float64)
    center = scene.center.astype(np.float32)
    if frame.is_open:  # grains that are not there have no place
        center, values = _spread(run, frame, center), {name: _spread(run, frame, found) for name, found in values.items()}
    return FrameView(index, center, values, _contacts(run, index), walls, scene.box)


def _spread(run: Run, frame: Frame, values: NDArray[Any]) -> NDArray[Any]:
    """Values of all grains of the run, nan for those that are not there."""
    found = np.full((run.model.grain_count, *values.shape[1:]), np.nan, values.dtype)
    found[frame.number] = values
    return found


def _contacts(run: Run, index: int) -> ContactsView | None:
    frame = run.frames[index]
    if not has_forces(frame):
        return None
    contacts = loaded_contacts(frame, frame.model)
    normal, j = contacts.normal, np.where(contacts.is_wall, -1, contacts.j).astype(np.int64)
    i = frame.number[contacts.i]
    j[~contacts.is_wall] = frame.number[j[~contacts.is_wall]]
    angle = np.arctan2(-normal[:, 1], -normal[:, 0]).astype(np.float32)
    return ContactsView(i, j, angle, np.abs(contacts.force[:, 0]).astype(np.float32))

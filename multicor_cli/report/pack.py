"""The grains of many frames in as few bytes as the page may have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post import Quantity
from multicor_cli.post.quantities import color_range
from multicor_cli.report.collect import ContactsView, FrameView, thin_frames, view_of
from multicor_cli.report.fields import SPACINGS, fields_of
from multicor_cli.report.quantize import Code, compress
from multicor_cli.store import Run
from multicor_cli.store.progress import Progress, no_progress

_CONTACT_SHARE = 0.25  # of the bytes of a frame may belong to contacts if not everything fits
_SAFETY = 1.03  # frames may be this much larger than the one that was tried
_ABSURD = 1e38  # single precision ends there
_ANGLES = 1024  # directions that the contact with a wall can have


@dataclass(frozen=True)
class Chunk:
    """A packed frame.

    Attributes:
        index: Its number in the run.
        data: Compressed bytes.
        arrays: Name, bytes per number and length of the arrays in it.
        contact_count: Contacts that carry a force, packed or not; None where they are not in the file.
        box: Corners of what is to be seen of it [m], shape ``(2, 2)``.
    """

    index: int
    data: bytes
    arrays: list[tuple[str, int, int]]
    contact_count: int | None
    box: Floats


@dataclass(frozen=True)
class Packed:
    """The frames in the page.

    Attributes:
        chunks: The frames.
        fields: The quantities that grains have.
        codes: How they and the coordinates ``x`` and ``y`` are stored, by name; ``contact`` are the forces of contacts.
        colors: Smallest and largest value that has a color of its own, by field.
        mean_force: Mean force of the contacts that carry one [N]; 0 without such contacts.
        walls: Displacement and angle of the walls, shape ``(frames, w, 3)``.
        box: Corners of what is to be seen [m], shape ``(2, 2)``.
        radii: Radii of the grains, compressed float32.
        frame_count: Frames of the run.
        contact_limit: Most contacts that a frame may have here; None: no limit.
    """

    chunks: tuple[Chunk, ...]
    fields: tuple[Quantity, ...]
    codes: dict[str, Code]
    colors: dict[str, tuple[float, float]]
    mean_force: float
    walls: Floats
    box: Floats
    radii: bytes
    frame_count: int
    contact_limit: int | None

    @property
    def size(self) -> int:
        """Bytes of the packed frames."""
        return sum(len(chunk.data) for chunk in self.chunks) + len(self.radii)

    def thinned(self, wanted: int) -> Packed:
        """The same with fewer frames."""
        kept = thin_frames(len(self.chunks), wanted)
        return replace(self, chunks=tuple(self.chunks[int(k)] for k in kept), walls=self.walls[kept])


@dataclass(frozen=True)
class _Plan:
    """How many frames with how many contacts, and how many bytes a value may take."""

    frames: int
    width: int
    contacts: int | None


def pack_frames(run: Run, budget: int, frames: int | None = None, progress: Progress = no_progress) -> Packed:
    """Pack as many frames of a run as fit.

    Everything is kept if it fits. Otherwise values are stored with 8 instead of 16 bits, then only the strongest contacts of
    each frame are kept, then fewer frames.

    Args:
        run: A run with at least one frame.
        budget: Bytes that the packed frames may take together.
        frames: Largest number of frames; default: all.
        progress: Is told how far it is.

    Raises:
        StoreError: If the run cannot be read.
    """
    count = len(run.frames)
    plan = _make_plan(view_of(run, count - 1), run, budget, min(count, frames or count))
    views = []
    chosen = thin_frames(count, plan.frames)
    for number, index in enumerate(chosen.tolist()):
        view = view_of(run, index)
        total = None if view.contacts is None else view.contacts.i.size
        limited = view.contacts if view.contacts is None or plan.contacts is None else view.contacts.strongest(plan.contacts)
        views.append((replace(view, contacts=limited), total))
        progress(number + 1, chosen.size)
    codes = _make_codes([view for view, _ in views], run, plan.width)
    packing = Packed(
        chunks=tuple(_pack(view, codes, total, run.model.grain_count) for view, total in views),
        fields=tuple(field for field in fields_of(run) if field.name != "heat" or codes["heat"].high > 0.0),
        codes=codes,
        colors=_color_ranges(fields_of(run), [view for view, _ in views]),
        mean_force=_mean_force([view for view, _ in views]),
        walls=np.array([view.walls for view, _ in views]),
        box=_join_boxes([view.box for view, _ in views], codes),
        radii=compress([run.model.grains.radius.astype("<f4").view("<u4")]),
        frame_count=count,
        contact_limit=plan.contacts,
    )
    while packing.size > budget and len(packing.chunks) > 1:
        packing = packing.thinned(min(len(packing.chunks) - 1, int(len(packing.chunks) * budget / packing.size)) or 1)
    return packing


def _make_plan(view: FrameView, run: Run, budget: int, wanted: int) -> _Plan:
    """Decide from the size of one frame."""
    for width in (2, 1):
        grains, contacts = _sizes(view, run, width)
        if wanted * (grains + contacts) <= budget:
            return _Plan(wanted, width, None)
    count = 0 if view.contacts is None else view.contacts.i.size
    room = max(budget / wanted - grains, _CONTACT_SHARE / (1.0 - _CONTACT_SHARE) * grains)
    share = min(1.0, room / max(contacts, 1.0))
    frames = int(budget / (grains + share * contacts))
    return _Plan(max(1, min(wanted, frames)), 1, math.floor(share * count) if share < 1.0 else None)


def _sizes(view: FrameView, run: Run, width: int) -> tuple[float, float]:
    """Bytes of the grains and of the contacts of a frame, with some room."""
    codes = _make_codes([view], run, width)
    whole = len(_pack(view, codes, None, run.model.grain_count).data)
    grains = len(_pack(replace(view, contacts=None), codes, None, run.model.grain_count).data)
    return _SAFETY * grains, _SAFETY * (whole - grains)


def _make_codes(views: Sequence[FrameView], run: Run, width: int) -> dict[str, Code]:
    codes = {name: Code(*_ends([view.center[:, axis] for view in views]), 2) for axis, name in enumerate("xy")}
    for field in fields_of(run):
        found = [view.values[field.name] for view in views if field.name in view.values]
        low, high = _ends(found)
        most = max(abs(low), abs(high))
        ends = {"even": (low, high), "square": (0.0, high), "signed": (-most, most)}[SPACINGS[field.name]]
        codes[field.name] = Code(*ends, width, SPACINGS[field.name])
    contacts = [view.contacts.force for view in views if view.contacts is not None]
    codes["contact"] = Code(0.0, _ends(contacts)[1], width, "square")
    return codes


def _ends(arrays: list[NDArray[Any]]) -> tuple[float, float]:
    """Smallest and largest number."""
    full = [numbers for array in arrays if (numbers := _sane(array)).size]
    return (float(min(a.min() for a in full)), float(max(a.max() for a in full))) if full else (0.0, 0.0)


def _sane(values: NDArray[Any]) -> NDArray[Any]:
    """Values that are nan or absurd do not count: a damaged file must not spoil the scale of the others."""
    return np.asarray(values[np.abs(values) < _ABSURD])


def _mean_force(views: Sequence[FrameView]) -> float:
    forces = [_sane(view.contacts.force) for view in views if view.contacts is not None]
    count = sum(force.size for force in forces)
    return sum(float(force.sum(dtype=np.float64)) for force in forces) / count if count else 0.0


def _pack(view: FrameView, codes: dict[str, Code], contact_count: int | None, grains: int) -> Chunk:
    arrays = {"x": codes["x"].encode(view.center[:, 0]), "y": codes["y"].encode(view.center[:, 1])}
    arrays |= {name: codes[name].encode(values) for name, values in view.values.items()}
    if view.contacts is not None:
        arrays |= _contact_arrays(view.contacts, codes["contact"], grains)
    layout = [(name, array.dtype.itemsize, array.size) for name, array in arrays.items()]
    return Chunk(view.index, compress(list(arrays.values())), layout, contact_count, _join_boxes([view.box], codes))


def _contact_arrays(contacts: ContactsView, code: Code, grains: int) -> dict[str, NDArray[Any]]:
    """First grains as steps from one contact to the next; second grains, or ``grains`` plus the direction of a wall."""
    turn = np.rint(np.nan_to_num(contacts.angle) / (2.0 * np.pi) * _ANGLES).astype(np.int64) % _ANGLES
    return {
        "contact_step": np.diff(contacts.i, prepend=0).astype("<u4"),
        "contact_end": np.where(contacts.j >= 0, contacts.j, grains + turn).astype("<u4"),
        "contact_force": code.encode(contacts.force),
    }


def _color_ranges(fields: tuple[Quantity, ...], views: list[FrameView]) -> dict[str, tuple[float, float]]:
    found = {}
    for field in fields:
        values = [view.values[field.name] for view in views if field.name in view.values]
        found[field.name] = color_range(field, _sane(np.concatenate(values or [np.zeros(0)])), views[0].center.shape[0])
    return found


def _join_boxes(boxes: list[Floats], codes: dict[str, Code]) -> Floats:
    """Around the boxes that are finite, and of a width and height above zero."""
    grains = np.array([[codes[name].low, codes[name].high] for name in "xy"]).T
    whole = [box for box in boxes if (np.abs(box) < _ABSURD).all()] or [grains]
    low, high = np.min([box[0] for box in whole], axis=0), np.max([box[1] for box in whole], axis=0)
    room = np.where(high > low, 0.0, 0.5)
    return np.array([low - room, high + room])

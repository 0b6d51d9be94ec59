"""The grains of many frames in as few bytes as a page may have: which, and how made small."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Outlines
from multicor_cli.post import QUANTITIES, GrainQuantity, PostError
from multicor_cli.post.contacts import has_forces, loaded_contacts
from multicor_cli.post.grain_map import make_scene
from multicor_cli.post.lattice import velocity_at
from multicor_cli.post.quantities import color_range
from multicor_cli.post.rings import rings_of
from multicor_cli.store import Run
from multicor_cli.store.frames import Frame
from multicor_cli.store.layout import Progress, no_progress

# ---- Numbers as small integers of known resolution, and as few bytes as deflate makes of them

Spacing = Literal["even", "square", "signed"]
"""``even``: all steps are equal. ``square``: steps grow from the low end on, ``signed``: from the
middle on, to both sides, for quantities of which most values are small."""

_LEVEL = 6  # of deflate: 9 takes three times as long for 1 % less


@dataclass(frozen=True)
class Code:
    """How numbers become integers; the largest integer of the type stands for "not known".

    Attributes:
        low: Number that becomes 0.
        high: Number that becomes the largest code in use.
        width: Bytes of a code: 1, 2 or 4.
        spacing: How the numbers between are spaced.
    """

    low: float
    high: float
    width: int
    spacing: Spacing = "even"

    @property
    def largest(self) -> int:
        """The largest code in use."""
        return int(256**self.width - 2)

    @property
    def resolution(self) -> float:
        """Largest distance of neighboring numbers, over their range."""
        return (1.0 if self.spacing == "even" else 2.0) / self.largest

    def encode(self, values: NDArray[Any]) -> NDArray[Any]:
        """Codes of numbers; outside of the range that of its end, nan the one for "not known"."""
        values = np.asarray(values, np.float64)
        width = self.high - self.low
        share = (
            np.clip((values - self.low) / width, 0.0, 1.0)
            if width > 0.0
            else np.where(np.isnan(values), np.nan, 0.0)
        )
        if self.spacing == "square":
            share = np.sqrt(share)
        elif self.spacing == "signed":
            share = 0.5 + 0.5 * np.sign(share - 0.5) * np.sqrt(np.abs(2.0 * share - 1.0))
        unknown = np.isnan(share)
        codes = np.rint(np.where(unknown, 0.0, share) * self.largest).astype(f"<u{self.width}")
        codes[unknown] = self.largest + 1
        return np.asarray(codes)

    def decode(self, codes: NDArray[Any]) -> Floats:
        """Numbers of codes, as the page computes them."""
        share = codes.astype(np.float64) / self.largest
        if self.spacing == "square":
            share *= share
        elif self.spacing == "signed":
            share = 0.5 + 0.5 * (2.0 * share - 1.0) * np.abs(2.0 * share - 1.0)
        return np.where(codes > self.largest, np.nan, self.low + (self.high - self.low) * share)


def compress(arrays: list[NDArray[Any]]) -> bytes:
    """Deflated (zlib) unsigned integers, each array as its lowest bytes, then the next ones."""
    planes = [
        np.ascontiguousarray(array.view(np.uint8).reshape(array.size, -1).T).tobytes()
        for array in arrays
        if array.size
    ]
    return zlib.compress(b"".join(planes), _LEVEL)


# ---- What the grains on the page can be colored by

SPACINGS: dict[str, Spacing] = {
    "speed": "square",
    "velocity": "signed",
    "velocity-y": "signed",
    "spin": "signed",
    "temperature": "even",
    "heat": "square",
    "force": "square",
}
"""How the values of each quantity are stored; the page has these quantities, in this order."""


def fields_of(run: Run) -> tuple[GrainQuantity, ...]:
    """The quantities that a run can have."""
    return tuple(
        QUANTITIES[name]
        for name in SPACINGS
        if run.model.thermal is not None or not QUANTITIES[name].needs_heat
    )


def values_of(quantity: GrainQuantity, run: Run, frame: int) -> Floats | None:
    """Values of the grains of a frame, shape ``(n,)``, or None where the frame has none."""
    assert quantity.of_grain is not None
    try:
        return quantity.of_grain(run, frame)
    except PostError:
        return None


# ---- The frames of a run as the page needs them: read once, kept small

Singles = NDArray[np.float32]


@dataclass(frozen=True)
class ContactsView:
    """The contacts of a frame that carry a force; ``c`` of them, ordered by the first grain.

    Attributes:
        total: How many there were before only the strongest were kept.
        i: First grain, shape ``(c,)``.
        j: Second grain; −1: a wall, shape ``(c,)``.
        angle: Direction from the first grain to the contact [rad], −π … π, shape ``(c,)``.
        force: Normal force without sign [N], shape ``(c,)``.
        arm: From the first grain to where it touches [m], ``(c, 2)``; None if all are discs.
    """

    total: int
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    angle: Singles
    force: Singles
    arm: Singles | None = None

    def strongest(self, count: int) -> ContactsView:
        if count >= self.i.size:
            return self
        kept = np.sort(np.argpartition(-self.force, count)[:count])
        i, j, angle, force = self.i[kept], self.j[kept], self.angle[kept], self.force[kept]
        arm = None if self.arm is None else self.arm[kept]
        return ContactsView(self.total, i, j, angle, force, arm)


@dataclass(frozen=True)
class FrameView:
    """A frame; ``n`` grains, ``w`` walls.

    Attributes:
        index: Its number in the run.
        center: Centers, within the period or the cell [m], shape ``(n, 2)``.
        values: Values of the fields that this frame has, by name, shape ``(n,)``.
        contacts: Its contacts, or None where they are not in the file.
        walls: Displacement [m] and angle [rad] of the walls, shape ``(w, 3)``; of a cell width,
            height and tilt [m].
        box: Corners of what is to be seen [m], shape ``(2, 2)``.
        angle: Angles of the grains [rad], −π … π, shape ``(n,)``; None if all are discs.
        radius: Their radii [m], shape ``(n,)``; None where sizes do not change.
    """

    index: int
    center: Singles
    values: dict[str, NDArray[Any]]
    contacts: ContactsView | None
    walls: Floats
    box: Floats
    angle: Singles | None = None
    radius: Singles | None = None


def thin_frames(count: int, wanted: int) -> NDArray[np.int64]:
    """Numbers of about ``wanted`` of ``count`` frames, evenly spaced, the last one among them."""
    if wanted >= count:
        return np.arange(count)
    places = np.linspace(0.0 if wanted > 1 else count - 1.0, count - 1.0, wanted)
    return np.unique(np.rint(places).astype(np.int64))


def view_of(run: Run, index: int) -> FrameView:
    """Read a frame; raises `multicor_cli.store.StoreError`."""
    frame = run.frames[index]
    scene = make_scene(run, frame)
    values: dict[str, NDArray[Any]] = {}
    for field in fields_of(run):
        found = values_of(field, run, index)
        if run.model.is_cell and field.of_velocity is not None:  # where the picture has the grain
            found = field.of_velocity(velocity_at(frame, scene.center))
        if found is not None:
            # Temperatures may differ by millikelvins only, which single precision does not resolve.
            values[field.name] = np.asarray(found, np.float64 if field.unit == "K" else np.float32)
    walls = np.array(frame.wall_position, np.float64)
    center, angle = scene.center.astype(np.float32), None
    if scene.rings is not None:
        turned = np.asarray(frame.angle, np.float64)
        angle = (turned - 2.0 * np.pi * np.rint(turned / (2.0 * np.pi))).astype(np.float32)
    radius = None if frame.radius is None else np.asarray(frame.radius, np.float32)
    if frame.is_open:

        def of_all(here: NDArray[Any]) -> NDArray[Any]:
            """Of all grains of the run, nan for those that are not there."""
            found = np.full((run.model.grain_count, *here.shape[1:]), np.nan, here.dtype)
            found[frame.number] = here
            return found

        center, values = of_all(center), {name: of_all(here) for name, here in values.items()}
        angle, radius = (None if own is None else of_all(own) for own in (angle, radius))
    return FrameView(index, center, values, _contacts(frame), walls, scene.box, angle, radius)


def _contacts(frame: Frame) -> ContactsView | None:
    if not has_forces(frame):
        return None
    contacts = loaded_contacts(frame, frame.model)
    normal, j = contacts.normal, np.where(contacts.is_wall, -1, contacts.j).astype(np.int64)
    i = frame.number[contacts.i]
    j[~contacts.is_wall] = frame.number[j[~contacts.is_wall]]
    angle = np.arctan2(-normal[:, 1], -normal[:, 0]).astype(np.float32)
    force = np.abs(contacts.force[:, 0]).astype(np.float32)
    arm = None if frame.model.outlines is None else contacts.arm.astype(np.float32)
    return ContactsView(i.size, i, j, angle, force, arm)


# ---- What grains look like, once for those that are alike but for their size

_SHARES = Code(-1.01, 1.01, 2)
"""Of the points of lines around grains, in radii of the grains; those around arcs lie outside."""


@dataclass(frozen=True)
class Looks:
    """Lines around grains that are no discs.

    Attributes:
        data: What each grain looks like (0: a disc, else a number from 1), how many rings each look
            has, how many points each ring, and these in `_SHARES`, x and y.
        arrays: As those of `Chunk`.
    """

    data: bytes
    arrays: list[tuple[str, int, int]]


def looks_of(outlines: Outlines) -> Looks:
    """The looks of grains."""
    rings, is_disc, radius = rings_of(outlines), outlines.is_disc, outlines.radius
    known: dict[tuple[bytes, ...], int] = {}
    look = np.zeros(radius.size, "<u4")
    counts, shapes = list[int](), list[NDArray[Any]]()
    parts: list[list[NDArray[Any]]] = [[] for _ in radius]
    for grain, ring in zip(rings.grain.tolist(), rings, strict=True):
        parts[grain].append(_SHARES.encode(ring / radius[grain]))
    for grain in np.flatnonzero(~is_disc).tolist():
        key = tuple(ring.tobytes() for ring in parts[grain])
        if key not in known:
            known[key] = len(known) + 1
            counts.append(len(key))
            shapes += parts[grain]
        look[grain] = known[key]
    points = np.concatenate(shapes) if shapes else np.zeros((0, 2), "<u2")
    arrays = {
        "look": look, "rings": np.array(counts, "<u4"),
        "points": np.array([len(ring) for ring in shapes], "<u4"),
        **{name: np.ascontiguousarray(points[:, axis]) for axis, name in enumerate("xy")},
    }  # fmt: skip
    return Looks(compress(list(arrays.values())), _layout(arrays))


# ---- Frames as bytes

_CONTACT_SHARE = 0.25  # of the bytes of a frame may belong to contacts if not everything fits
_SAFETY = 1.03  # frames may be this much larger than the one that was tried
_ABSURD = 1e38  # single precision ends there
_LOOKS_SHARE = 0.5  # of all bytes may belong to lines around grains; else they are circles
_ANGLES = 1024  # directions that the contact with a wall can have


@dataclass(frozen=True)
class Chunk:
    """A packed frame.

    Attributes:
        index: Its number in the run.
        arrays: Name, bytes per number and length of the arrays in it.
        contact_count: Contacts with a force, packed or not; None where they are not in the file.
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
        fields: The quantities that grains have.
        codes: How they, ``x``, ``y``, forces of contacts (``contact``) … are stored, by name.
        colors: Smallest and largest value that has a color of its own, by field.
        mean_force: Mean force of the contacts that carry one [N]; 0 without such contacts.
        walls: Displacement and angle of the walls, shape ``(frames, w, 3)``.
        box: Corners of what is to be seen [m], shape ``(2, 2)``.
        radii: Radii of the grains at the start, compressed float32.
        looks: What they look like; None if all are discs, or have to be shown as such.
        frame_count: Frames of the run.
        contact_limit: Most contacts that a frame may have here; None: no limit.
    """

    chunks: tuple[Chunk, ...]
    fields: tuple[GrainQuantity, ...]
    codes: dict[str, Code]
    colors: dict[str, tuple[float, float]]
    mean_force: float
    walls: Floats
    box: Floats
    radii: bytes
    looks: Looks | None
    frame_count: int
    contact_limit: int | None

    @property
    def size(self) -> int:
        """Bytes of the packed frames."""
        looks = 0 if self.looks is None else len(self.looks.data)
        return sum(len(chunk.data) for chunk in self.chunks) + len(self.radii) + looks

    def thinned(self, wanted: int) -> Packed:
        kept = thin_frames(len(self.chunks), wanted)
        return replace(
            self, chunks=tuple(self.chunks[int(k)] for k in kept), walls=self.walls[kept]
        )


@dataclass(frozen=True)
class _Plan:
    """How many frames with how many contacts, and how many bytes a value may take."""

    frames: int
    width: int
    contacts: int | None


def pack_frames(
    run: Run, budget: int, frames: int | None = None, progress: Progress = no_progress
) -> Packed:
    """Pack as many frames of a run as fit into ``budget`` bytes, at most ``frames`` (None: all).

    Everything is kept if it fits. Otherwise values are stored with 8 instead of 16 bits, then only
    the strongest contacts of each frame are kept, then fewer frames.

    Raises:
        StoreError: If the run cannot be read.
    """
    count = len(run.frames)
    plan = _make_plan(view_of(run, count - 1), run, budget, min(count, frames or count))
    views = []
    chosen = thin_frames(count, plan.frames)
    for number, index in enumerate(chosen.tolist()):
        view = view_of(run, index)
        if view.contacts is not None and plan.contacts is not None:
            view = replace(view, contacts=view.contacts.strongest(plan.contacts))
        views.append(view)
        progress(number + 1, chosen.size)
    codes = _make_codes(views, run, plan.width)
    outlines = run.model.outlines
    looks = None if outlines is None else looks_of(outlines)
    if looks is not None and len(looks.data) > _LOOKS_SHARE * budget:
        looks = None
    forces = [_sane(view.contacts.force) for view in views if view.contacts is not None]
    loaded = sum(force.size for force in forces)
    packing = Packed(
        chunks=tuple(_pack(view, codes, run.model.grain_count) for view in views),
        fields=tuple(
            field for field in fields_of(run) if field.name != "heat" or codes["heat"].high > 0.0
        ),
        codes=codes,
        colors=_color_ranges(fields_of(run), views),
        mean_force=sum(float(force.sum(dtype=np.float64)) for force in forces) / max(loaded, 1),
        walls=np.array([view.walls for view in views]),
        box=_join_boxes([view.box for view in views], codes),
        radii=compress([run.model.grains.radius.astype("<f4").view("<u4")]),
        looks=looks,
        frame_count=count,
        contact_limit=plan.contacts,
    )
    while packing.size > budget and len(packing.chunks) > 1:
        packing = packing.thinned(
            min(len(packing.chunks) - 1, int(len(packing.chunks) * budget / packing.size)) or 1
        )
    return packing


def _make_plan(view: FrameView, run: Run, budget: int, wanted: int) -> _Plan:
    """Decide from the size of one frame."""
    for width in (2, 1):
        codes = _make_codes([view], run, width)
        whole, alone = (
            len(_pack(each, codes, run.model.grain_count).data)
            for each in (view, replace(view, contacts=None))
        )
        grains, contacts = _SAFETY * alone, _SAFETY * (whole - alone)
        if wanted * (grains + contacts) <= budget:
            return _Plan(wanted, width, None)
    count = 0 if view.contacts is None else view.contacts.i.size
    room = max(budget / wanted - grains, _CONTACT_SHARE / (1.0 - _CONTACT_SHARE) * grains)
    share = min(1.0, room / max(contacts, 1.0))
    frames = int(budget / (grains + share * contacts))
    return _Plan(max(1, min(wanted, frames)), 1, math.floor(share * count) if share < 1.0 else None)


def _make_codes(views: Sequence[FrameView], run: Run, width: int) -> dict[str, Code]:
    codes = {
        name: Code(*_ends([view.center[:, axis] for view in views]), 2)
        for axis, name in enumerate("xy")
    }
    for field in fields_of(run):
        found = [view.values[field.name] for view in views if field.name in view.values]
        low, high = _ends(found)
        most = max(abs(low), abs(high))
        ends = {"even": (low, high), "square": (0.0, high), "signed": (-most, most)}[
            SPACINGS[field.name]
        ]
        codes[field.name] = Code(*ends, width, SPACINGS[field.name])
    contacts = [view.contacts.force for view in views if view.contacts is not None]
    codes["contact"] = Code(0.0, _ends(contacts)[1], width, "square")
    radii = [view.radius for view in views if view.radius is not None]
    if radii:
        codes["radius"] = Code(*_ends(radii), 2)
    if run.model.outlines is not None:
        farthest = max(float(run.model.grains.radius.max()), _ends(radii)[1])
        codes |= {"angle": Code(-np.pi, np.pi, 2), "arm": Code(-farthest, farthest, 2)}
        codes["look"] = _SHARES
    return codes


def _ends(arrays: list[NDArray[Any]]) -> tuple[float, float]:
    full = [numbers for array in arrays if (numbers := _sane(array)).size]
    if not full:
        return 0.0, 0.0
    return float(min(a.min() for a in full)), float(max(a.max() for a in full))


def _sane(values: NDArray[Any]) -> NDArray[Any]:
    """Values that are not nan or absurd: a damaged file must not spoil the scale of the others."""
    return np.asarray(values[np.abs(values) < _ABSURD])


def _pack(view: FrameView, codes: dict[str, Code], grains: int) -> Chunk:
    arrays = {"x": codes["x"].encode(view.center[:, 0]), "y": codes["y"].encode(view.center[:, 1])}
    arrays |= {name: codes[name].encode(values) for name, values in view.values.items()}
    for name, own in (("angle", view.angle), ("radius", view.radius)):
        if own is not None:
            arrays[name] = codes[name].encode(own)
    contacts = view.contacts
    if contacts is not None:
        # First grains as steps between contacts; second ones, or grains plus a wall direction
        turn = np.rint(np.nan_to_num(contacts.angle) / (2.0 * np.pi) * _ANGLES) % _ANGLES
        end = np.where(contacts.j >= 0, contacts.j, grains + turn.astype(np.int64))
        arrays["contact_step"] = np.diff(contacts.i, prepend=0).astype("<u4")
        arrays["contact_end"] = end.astype("<u4")
        arrays["contact_force"] = codes["contact"].encode(contacts.force)
        if contacts.arm is not None:
            for axis, name in enumerate("xy"):
                arrays[f"contact_arm_{name}"] = codes["arm"].encode(contacts.arm[:, axis])
    data, box = compress(list(arrays.values())), _join_boxes([view.box], codes)
    total = None if contacts is None else contacts.total
    return Chunk(view.index, data, _layout(arrays), total, box)


def _layout(arrays: dict[str, NDArray[Any]]) -> list[tuple[str, int, int]]:
    return [(name, array.dtype.itemsize, array.size) for name, array in arrays.items()]


def _color_ranges(
    fields: tuple[GrainQuantity, ...], views: list[FrameView]
) -> dict[str, tuple[float, float]]:
    found = {}
    for field in fields:
        values = [view.values[field.name] for view in views if field.name in view.values]
        found[field.name] = color_range(
            field, _sane(np.concatenate(values or [np.zeros(0)])), views[0].center.shape[0]
        )
    return found


def _join_boxes(boxes: list[Floats], codes: dict[str, Code]) -> Floats:
    """Around the boxes that are finite, and of a width and height above zero."""
    grains = np.array([[codes[name].low, codes[name].high] for name in "xy"]).T
    whole = [box for box in boxes if (np.abs(box) < _ABSURD).all()] or [grains]
    low, high = np.min([box[0] for box in whole], axis=0), np.max([box[1] for box in whole], axis=0)
    room = np.where(high > low, 0.0, 0.5)
    return np.array([low - room, high + room])

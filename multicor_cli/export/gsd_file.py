"""GSD files, which OVITO and the HOOMD family read: grains as particles, contacts as bonds.

GSD stores coordinates in single precision, in a box around the origin. What it has no name for is
logged per particle and per bond, as OVITO expects it (``log/particles/temperature``). Grains that
are no discs have a type for each outline, and where sizes change each of them has its own: the
format knows shapes of types, which are not scaled.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.export.target import ExportRefused, check_output, choose_frames, new_file
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Outlines
from multicor_cli.optional import library
from multicor_cli.post.lattice import Lattice, lattice_of, velocity_at
from multicor_cli.post.rings import rings_of
from multicor_cli.store import Frame, Run, StorageError, schema
from multicor_cli.store.layout import Progress, no_progress
from multicor_cli.store.schema import Column, Reader

_DEPTH = 1.0
"""Length of the box in z: OVITO wants one, though the frame says that it has two dimensions."""


def export_gsd(
    run: Run,
    path: Path,
    frames: slice | None = None,
    *,
    is_overwriting: bool = False,
    progress: Progress = no_progress,
) -> int:
    """Write ``frames`` of a run, all by default, as a GSD file; gives their number.

    Raises:
        ExportError: If there are no such frames.
        ExportRefused: If the file may not be written.
        MissingLibrary: If ``gsd`` is not installed.
        StoreError: If the run cannot be read, or the file not be written.
    """
    hoomd = library("gsd.hoomd")
    check_output(path, is_overwriting=is_overwriting)
    chosen = choose_frames(run, frames)
    # What single precision cannot hold, in a damaged file, becomes infinite without a warning.
    with (
        np.errstate(all="ignore"),
        new_file(path, is_overwriting=is_overwriting) as temporary,
        _library_errors(path),
        hoomd.open(str(temporary), "w") as file,
    ):
        box, types = _Box.around(run.model, chosen), _Types.of(run.model, chosen)
        for number, frame in enumerate(chosen):
            target = hoomd.Frame()
            target.configuration.step = frame.step
            target.configuration.dimensions = 2
            if run.model.is_cell:
                box = _Box.of_cell(lattice_of(run.model, frame))
            target.configuration.box = [*box.size, _DEPTH, box.slant, 0.0, 0.0]
            logged = _logged(frame, schema.STEPS)
            target.log.update({name: np.array([value]) for name, value in logged})
            target.log["box_center"] = box.center
            target.log["contacts_recorded"] = np.array([frame.contacts.recorded], np.uint8)
            _fill_particles(target, run.model, frame, box, types)
            _fill_bonds(target, frame)
            file.append(target)
            progress(number + 1, len(chosen))
    return len(chosen)


@contextlib.contextmanager
def _library_errors(path: Path) -> Iterator[None]:
    """The library does not always say that the disk is full: its last write fails otherwise."""
    try:
        yield
    except UnicodeEncodeError as error:
        raise ExportRefused(
            f"{path}: the library gsd takes no names that are not UTF-8; choose another with -o"
        ) from error
    except RuntimeError as error:
        raise StorageError(
            f"{path}: the library gsd cannot write it ({error}); is there space left on the disk?"
        ) from error


@dataclass(frozen=True)
class _Box:
    """The box, the same in all frames but those of a cell.

    Its center in our coordinates [m], its lengths [m], and how far it leans in x per height.
    """

    center: Floats
    size: Floats
    slant: float = 0.0

    @classmethod
    def of_cell(cls, sides: Lattice) -> _Box:
        """That of a cell."""
        return cls(sides.corners.mean(axis=0), np.array(sides[:2]), sides.slant)

    @classmethod
    def around(cls, model: Model, frames: list[Frame]) -> _Box:
        """All grains with a margin, for the format makes directions periodic; or the period."""
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for frame in frames:
            radius = frame.model.grains.radius[:, None]
            low = np.minimum(low, (frame.position - radius).min(axis=0, initial=np.inf))
            high = np.maximum(high, (frame.position + radius).max(axis=0, initial=-np.inf))
        if not np.isfinite(low).all():  # no grain is there in any of them
            low, high = np.zeros(2), np.zeros(2)
        margin = 2.0 * model.grains.radius.max()
        low, high = low - margin, high + margin
        if model.period > 0.0:
            low[0], high[0] = 0.0, model.period
        return cls(0.5 * (low + high), high - low)


@dataclass(frozen=True)
class _Types:
    """Types of particles: names, the type of each grain, and shapes, None if all are discs."""

    names: list[str]
    number: NDArray[Any]
    shapes: list[dict[str, Any]] | None = None

    @classmethod
    def of(cls, model: Model, frames: Sequence[Frame]) -> _Types:
        """The groups, or a type for each different outline in a group: for each where they grow."""
        if model.outlines is None:
            return cls(list(model.groups), model.grains.group)
        names, shapes, number = list[str](), list[dict[str, Any]](), list[int]()
        known: dict[tuple[int, str, int], int] = {}
        grows = any(frame.radius is not None for frame in frames)
        for group, shape in zip(model.grains.group.tolist(), _shapes(model.outlines), strict=True):
            key = (group, json.dumps(shape), len(number) if grows else -1)
            if key not in known:
                known[key] = len(names)
                names.append(f"{model.groups[group]} {len(names)}")
                shapes.append(shape)
            number.append(known[key])
        return cls(names, np.array(number, np.uint32), shapes)

    def shapes_in(self, frame: Frame) -> list[dict[str, Any]] | None:
        """The shapes as large as those of the grains that are there in a frame."""
        outlines = frame.model.outlines
        if self.shapes is None or outlines is None or frame.radius is None:
            return self.shapes
        here = dict(zip(self.number[frame.number].tolist(), _shapes(outlines), strict=True))
        return [here.get(number, shape) for number, shape in enumerate(self.shapes)]


def _shapes(outlines: Outlines) -> Iterator[dict[str, Any]]:
    """What the schema of GSD says of grains: discs, rounded polygons, or lines around them."""
    is_disc, rings = outlines.is_disc, rings_of(outlines).single()
    for grain, line in enumerate(rings):
        (corners, rounding), *others = outlines.pieces(grain)
        if is_disc[grain]:
            yield {"type": "Sphere", "diameter": 2.0 * rounding}
        elif others or len(corners) < 3:
            yield {"type": "Polygon", "rounding_radius": 0.0, "vertices": line.tolist()}
        else:
            yield {"type": "Polygon", "rounding_radius": rounding, "vertices": corners.tolist()}


def _fill_particles(target: Any, model: Model, frame: Frame, box: _Box, types: _Types) -> None:
    particles, grains = target.particles, frame.model.grains
    half = 0.5 * frame.angle
    turn = np.column_stack([np.cos(half), np.zeros((len(half), 2)), np.sin(half)])
    particles.N = len(half)
    particles.types = types.names
    particles.typeid = types.number[frame.number]
    if types.shapes is not None:
        particles.type_shapes = types.shapes_in(frame)
        target.log["particles/group"] = grains.group
    position, velocity = frame.position, frame.velocity
    if model.is_cell:
        position = lattice_of(model, frame).wrapped(position)
        velocity = velocity_at(frame, position)
    particles.position = _spatial(position - box.center)
    particles.image = np.column_stack([frame.image, np.zeros((len(half), 2), np.int64)])
    if types.shapes is None:  # OVITO scales shapes by radii, if there are any
        particles.diameter = 2.0 * grains.radius
    particles.mass = grains.mass
    particles.moment_inertia = np.column_stack([np.zeros((len(half), 2)), grains.inertia])
    particles.orientation = turn
    particles.velocity = _spatial(velocity)
    # Angular momentum in the library's form: twice the orientation times (0, 0, 0, I ω).
    momentum = 2.0 * grains.inertia * frame.spin
    particles.angmom = np.column_stack(
        [-momentum * turn[:, 3], np.zeros((len(half), 2)), momentum * turn[:, 0]]
    )
    target.log["particles/angular_velocity"] = frame.spin
    target.log.update(
        {f"particles/{name}": values for name, values in _logged(frame, schema.PARTICLES)}
    )


def _fill_bonds(target: Any, frame: Frame) -> None:
    """Contacts that carry a force; frames without say so, or readers repeat the first one's."""
    contacts, bonds = frame.contacts, target.bonds
    shown = (contacts.kind == 0) & (contacts.impulse[:, 0] != 0.0)
    bonds.N = int(shown.sum())
    bonds.types = ["contact"]
    bonds.typeid = np.zeros(bonds.N, np.uint32)
    bonds.group = np.column_stack([contacts.i, contacts.j])[shown]
    for name, column in (("normal_force", 0), ("tangential_force", 1)):
        target.log[f"bonds/{name}"] = contacts.force[shown, column]
    target.log.update(
        {f"bonds/{name}": values[shown] for name, values in _logged(contacts, schema.CONTACTS)}
    )


def _logged(source: Reader, table: Sequence[Column[Any]]) -> Iterator[tuple[str, Any]]:
    """Names and values of what the format has no name for, as far as the run has it."""
    for row in table:
        values = source.read(row) if "gsd" in row.exports else None
        if values is not None:
            yield row.name, values


def _spatial(values: NDArray[Any]) -> NDArray[Any]:
    return np.column_stack([values, np.zeros(len(values))])

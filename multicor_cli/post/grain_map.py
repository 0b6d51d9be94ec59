"""Grains and walls of a frame as shapes that can be drawn, and a map of a quantity of grains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multicor_cli.model.cell import mean_flow
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline
from multicor_cli.post.lattice import Lattice, gradient_of, lattice_of, velocity_at
from multicor_cli.post.quantities import MAPPED, SAME, GrainQuantity
from multicor_cli.post.rings import Rings, order_of, rings_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    frame_index,
    need_grains,
    placed_walls,
    places_of,
)
from multicor_cli.post.table import Column, Table, values_of_quantities, with_unit
from multicor_cli.text import choices

# ---- The grains and walls of a frame as shapes that can be drawn

# Walls count for the frame of a picture if they begin within this part of the grains' extent
_NEAR = 0.25
_MARGIN = 0.02


@dataclass(frozen=True)
class GrainScene:
    """Where the grains and walls of a frame are.

    Attributes:
        center: Centers of the grains [m], shape ``(n, 2)``.
        radius: Radii of the grains [m], shape ``(n,)``.
        walls: Outlines of the walls in the world by kind; glued grains lie within the period.
        lattice: Where images are.
        box: Lower left and upper right corner of what is to be seen [m], shape ``(2, 2)``.
        rings: Lines around the grains, or None if all are discs.
    """

    center: Floats
    radius: Floats
    walls: Sequence[Outline]
    lattice: Lattice
    box: Floats
    rings: Rings | None = None


def make_scene(source: Run, frame: Frame) -> GrainScene:
    """The scene of a frame; grains lie within the period or the cell.

    Args:
        source: The run.
        frame: One of its frames.

    Raises:
        StoreError: If the run cannot be read.
    """
    model = frame.model
    radius, lattice = model.grains.radius, lattice_of(model, frame)
    center = lattice.wrapped(places_of(frame))
    pose = np.asarray(frame.wall_position, np.float64)
    walls = [outline for _, outline in placed_walls(model, pose)]
    for outline in walls:
        if outline.is_grain:
            outline.points[:, 0] = lattice.wrapped(outline.points[:, 0])
    if model.is_cell:
        corners = lattice.corners
        margin = _MARGIN * float(np.ptp(corners, axis=0).max())
        box = np.array([corners.min(axis=0) - margin, corners.max(axis=0) + margin])
    else:
        box = _find_box(center, radius, walls)
        if model.period > 0.0:
            box[:, 0] = 0.0, model.period
    return GrainScene(center, radius, walls, lattice, box, _rings(frame, center))


def _rings(frame: Frame, center: Floats) -> Rings | None:
    """Lines around the grains of a frame, whose centers are these."""
    model = frame.run_model
    if model.outlines is None:
        return None
    rings = rings_of(model.outlines)
    if frame.is_open:
        rings = rings.of_grains(frame.number)
    if frame.radius is not None:
        rings = rings.sized(frame.radius / model.grains.radius[frame.number])
    return rings.placed(center, np.asarray(frame.angle, np.float64))


def _find_box(center: Floats, radius: Floats, walls: Sequence[Outline]) -> Floats:
    """Around the grains and the walls with ends that are near."""
    low, high = np.concatenate(
        [np.zeros((2, 0, 2)), *(outline.corners() for outline in walls if outline.normal is None)],
        axis=1,
    )
    if radius.size:
        reach = radius[:, np.newaxis]
        grains = np.array([(center - reach).min(axis=0), (center + reach).max(axis=0)])
    elif len(low):  # no grain is there yet, or any more
        grains = np.array([low.min(axis=0), high.max(axis=0)])
    else:
        grains = np.array([[0.0, 0.0], [1.0, 1.0]])
    room = _NEAR * (grains[1] - grains[0]).max()
    near = ((low <= grains[1] + room) & (high >= grains[0] - room)).all(axis=1)
    box = np.array([np.minimum(grains[0], low[near].min(axis=0, initial=np.inf)), grains[1]])
    box[1] = np.maximum(box[1], high[near].max(axis=0, initial=-np.inf))
    margin = _MARGIN * float((box[1] - box[0]).max())
    return np.asarray(box + np.array([[-margin], [margin]]))


# ---- A quantity of every grain of one frame, to be drawn as a map


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
        flow: Velocities of the grains [m/s], shape ``(n, 2)``, and gradient of the mean flow [1/s],
            shape ``(3,)``, where images of a grain have values of their own; else None.
    """

    def values_of_images(self) -> Floats:
        """Values of all that `Lattice.images` gives of the grains: images move as the mean flow."""
        which, shift = self.scene.lattice.images(self.scene.center, self.scene.radius)
        if self.flow is None:
            return np.asarray(self.value[which])
        velocity, gradient = self.flow
        return np.asarray(self.field.of_velocity(velocity[which] + mean_flow(shift, gradient)))


def grain_map(source: Run, of: str, frame: int = -1, *, may_be_empty: bool = False) -> GrainMap:
    """A quantity of every grain of one frame.

    Args:
        source: The run.
        of: Name of the quantity, one of `MAPPED`.
        frame: Index of the frame; negative counts from the last one.
        may_be_empty: Whether there may be no grain in the frame, and so nothing to tell.

    Raises:
        PostError: If there is no such quantity, frame or grain, or no heat for it in the run.
        StoreError: If the run cannot be read.
    """
    chosen = MAPPED.get(SAME.get(of, of))
    if chosen is None or chosen.of_grain is None:
        raise PostError(f"there is no map of '{of}'; {choices(of, MAPPED)}")
    index = frame_index(source.frames, frame)
    if not may_be_empty:
        need_grains(source, np.array([index]))
    there = source.frames[index]
    values, scene = chosen.of_grain(source, index), make_scene(source, there)
    flow = None
    if source.model.is_cell and chosen.of_velocity is not None:
        flow = velocity_at(there, scene.center), gradient_of(there)
        values = chosen.of_velocity(flow[0])
    vector = values if values.ndim == 2 else None
    value = values if vector is None else np.hypot(*vector.T)
    names = () if chosen.names_of is None else chosen.names_of(source.model)
    time = float(np.asarray(source.frames.time)[index])
    grains = [
        *(Column(axis, "m", scene.center[:, k]) for k, axis in enumerate("xy")),
        Column("radius", "m", scene.radius),
        Column("value", chosen.unit, value, chosen.name),
    ]
    facts = {
        "of": chosen.name,
        "unit": chosen.unit,
        "frame": index,
        "time": time,
        **{c.name: c.values for c in grains},
    }
    if names:
        facts["names"] = names
    if vector is not None:
        facts["vector"] = vector
        grains += [
            Column(f"vector_{axis}", chosen.unit, vector[:, k], f"{chosen.name} {axis}")
            for k, axis in enumerate("xy")
        ]
    parts = {"field": chosen, "scene": scene, "vector": vector, "names": names, "flow": flow}
    return GrainMap(_statistics(chosen, value, names), facts, grains, **parts)


def _statistics(field: GrainQuantity, value: Floats, names: tuple[str, ...]) -> tuple[Column, ...]:
    """How the values are distributed; where they stand for names, how many grains have each."""
    if names:
        counts = [float((value == k).sum()) for k in range(len(names))]
        return Column("kind", "", names, field.label, ""), Column("grains", "", counts, key="")
    value = value[np.isfinite(value)]  # some grains may have none
    if not value.size:
        return values_of_quantities([("grains", 0.0)])
    if field.scale == "half turn":  # modulo 180°: there is no mean, and no smallest one
        order, director = order_of(np.exp(2j * np.radians(value)))
        return values_of_quantities([
            ("grains", float(value.size)), ("nematic order", order),
            (with_unit("director of the long axes", field.unit), director),
        ])  # fmt: skip
    quantiles = np.quantile(value, (0.0, 0.05, 0.5, 0.95, 1.0)).tolist()
    below = [f"{part} of the grains below" for part in ("5 %", "half", "95 %")]
    labels = ("mean", "smallest", *below, "largest")
    lines = zip(labels, (float(value.mean()), *quantiles), strict=True)
    return values_of_quantities(
        [("grains", float(value.size)), *((with_unit(k, field.unit), v) for k, v in lines)]
    )

"""A quantity of every grain of one frame, to be drawn as a map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import loaded_contacts, with_forces
from multicor_cli.post.flow import mean_flow
from multicor_cli.post.profile import make_bins
from multicor_cli.post.scene import GrainScene, make_scene
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, frame_index, need_heat

Scale = Literal["linear", "centered", "logarithmic"]
"""How values become colors: ``centered`` scales are symmetric about zero."""


@dataclass(frozen=True)
class MapField:
    """A quantity that can be mapped.

    Attributes:
        name: Name on the command line.
        label: Name in figures.
        symbol: Symbol in figures (TeX).
        unit: SI unit.
        values: Values of the grains, shape ``(n,)``, or ``(n, 2)`` for vectors, of a frame of a run.
        scale: How values become colors.
    """

    name: str
    label: str
    symbol: str
    unit: str
    values: Callable[[FrameSource, int], Floats]
    scale: Scale = "linear"


@dataclass(frozen=True)
class GrainMap:
    """A quantity of every grain; ``n`` grains.

    Attributes:
        field: What it is.
        scene: Where the grains and walls are.
        value: Values; magnitudes of vectors, shape ``(n,)``.
        vector: The vectors, shape ``(n, 2)``, or None.
        frame: Index of the frame.
        time: Time of the frame [s].
    """

    field: MapField
    scene: GrainScene
    value: Floats
    vector: Floats | None
    frame: int
    time: float

    @property
    def headings(self) -> tuple[str, str]:
        """Names of the columns of `rows`."""
        return "quantity", "value"

    @property
    def rows(self) -> list[tuple[str, float]]:
        """Statistics of the values."""
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
        columns = [*self.scene.center.T, self.scene.radius, self.value, *(() if self.vector is None else self.vector.T)]
        return list(zip(*(column.tolist() for column in columns), strict=True))

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
        return data if self.vector is None else data | {"vector": self.vector.tolist()}


def grain_map(source: FrameSource, of: str, frame: int = -1) -> GrainMap:
    """A quantity of every grain of one frame.

    Args:
        source: The run.
        of: Name of the quantity, one of `MAP_FIELDS`.
        frame: Index of the frame; negative counts from the last one.

    Raises:
        PostError: If there is no such quantity or frame, or the run has no heat and the quantity needs it.
        StoreError: If the run cannot be read.
    """
    chosen = MAP_FIELDS.get(of)
    if chosen is None:
        raise PostError(f"there is no map of '{of}'; choose from: {', '.join(MAP_FIELDS)}")
    index = frame_index(source.frames, frame)
    values = chosen.values(source, index)
    vector = values if values.ndim == 2 else None
    return GrainMap(
        chosen,
        make_scene(source, source.frames[index]),
        values if vector is None else np.hypot(*vector.T),
        vector,
        index,
        float(np.asarray(source.frames.time)[index]),
    )


def _of_frame(values: Callable[[GrainFrame], Any]) -> Callable[[FrameSource, int], Floats]:
    return lambda source, frame: np.array(values(source.frames[frame]), np.float64)


def _heat_rates(source: FrameSource, frame: int) -> Floats:
    """Mean heat of friction and impacts that each grain has received per time since the frame before [W], shape ``(n,)``."""
    after = need_heat(source.frames[frame].generated)
    if frame == 0:
        raise PostError("the map of heat shows what was generated since the frame before; frame 0 has none")
    times = np.asarray(source.frames.time)
    return np.asarray((after - need_heat(source.frames[frame - 1].generated)) / float(times[frame] - times[frame - 1]))


def _pressures(source: FrameSource, frame: int) -> Floats:
    """Mean pressure in each grain by its contact forces [N/m], shape ``(n,)``.

    Half the trace of its virial Σ f⊗ℓ/(π a²), ℓ from where it is touched to its center: Σ f_n/(2π a).
    """
    with_forces(source, np.array([frame]))
    contacts = loaded_contacts(source.frames[frame], source.model)
    n, between = source.model.grain_count, ~contacts.is_wall
    load = np.bincount(contacts.i, contacts.force[:, 0], minlength=n)
    load += np.bincount(contacts.j[between], contacts.force[between, 0], minlength=n)
    return np.asarray(load / (2.0 * np.pi * source.model.grains.radius))


def _fluctuations(source: FrameSource, frame: int) -> Floats:
    """Velocities relative to the mean horizontal flow of the same frame at the height of each grain [m/s], shape ``(n, 2)``."""
    chosen = np.array([frame])
    flow = mean_flow(source, chosen, make_bins(source, chosen))
    flow.velocity[:, 1] = 0.0
    return flow.fluctuation(source.frames[frame])


MAP_FIELDS: dict[str, MapField] = {
    field.name: field
    for field in (
        MapField("temperature", "temperature", "T", "K", _of_frame(lambda frame: need_heat(frame.temperature))),
        MapField("velocity", "velocity", "v_x", "m/s", _of_frame(lambda frame: frame.velocity[:, 0])),
        MapField("fluctuation", "velocity fluctuation", r"|v - \langle v_x \rangle|", "m/s", _fluctuations),
        MapField("heat", "generated heat", r"\dot{Q}", "W", _heat_rates, "logarithmic"),
        MapField("stress", "contact pressure", "p", "N/m", _pressures, "logarithmic"),
        MapField("spin", "spin", r"\omega", "rad/s", _of_frame(lambda frame: frame.spin), "centered"),
    )
}
"""All quantities that can be mapped, by name."""

"""What the page states of a run of plane shear, in numbers; profiles are averages over the later
half of the shearing.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post import (
    ForceNetwork,
    ProfileTable,
    Selection,
    force_network,
    grain_map,
    profile,
)
from multicor_cli.store import Run

Floats = NDArray[np.float64]

BINS = 15
LAYER = (0.75, 0.95)
"""The sheared layer, in parts of the height."""

MIDDLE = (0.1, 0.9)
LEVELS = (0.1, 0.5, 0.9)
"""Parts of the velocity of the wall whose heights are printed."""

_APART = (2.25, 2.75)  # distance of the pairs whose fluctuations are correlated, in mean diameters
_BLOCKS = 6  # of consecutive frames, whose scatter gives the error
# Frames at most from which fluctuations are taken: single ones differ, more add little
_PICTURES = 60


@dataclass(frozen=True)
class Flow:
    """A run of plane shear.

    Attributes:
        first: Index of the first frame of the shearing.
        start: Forces in that frame.
        end: Forces in the last frame.
        velocity: Profile over the velocity of the walls.
        spin: Profile in bins of 1/15 of the height [rad/s].
        shear: Shear rate of the mean flow in these bins [1/s].
        heat: Profile of the heat rate in these bins [W/m²].
        temperature: Profile of the rise in these bins [K].
        books: What has been added to the energy books by the shearing [J].
        numbers: Further numbers by name.
        rises: Mean rise at the end by diameter [m] [K].
    """

    first: int
    start: ForceNetwork
    end: ForceNetwork
    velocity: ProfileTable
    spin: ProfileTable
    shear: Floats
    heat: ProfileTable
    temperature: ProfileTable
    books: dict[str, float]
    numbers: dict[str, float]
    rises: dict[float, float]

    @property
    def heights(self) -> list[float]:
        """Heights y/H up to which the grains are slower than the parts `LEVELS` of V."""
        y, value = self.velocity.y, np.maximum.accumulate(self.velocity.value)
        return [float(np.interp(level, value, y)) for level in LEVELS]

    @property
    def likeness(self) -> tuple[float, float]:
        """Correlation of the profile of the heat rate with those of the shear rate and of −spin."""
        return _alike(self.heat.value, self.shear), _alike(self.heat.value, -self.spin.value)

    @property
    def spin_ratio(self) -> Floats:
        """−spin over shear rate in the bins of the upper part, where there is a flow."""
        upper = self.spin.y > 0.7 * self.spin.height
        return np.asarray(-self.spin.value[upper] / self.shear[upper])

    def peak(self, table: ProfileTable) -> float:
        """Height of the largest value, in parts of the height."""
        return float(table.y[np.nanargmax(np.abs(table.value))] / table.height)


def measure(run: Run) -> Flow:
    """The numbers of a finished run of plane shear with heat."""
    stage = np.asarray(run.frames.stage)
    first = int(np.flatnonzero(stage == stage[-1])[0])
    tables = {
        name: profile(run, name, bins=BINS, exclude_walls=0.0)
        for name in ("velocity", "spin", "heat", "temperature")
    }
    start, end = force_network(run, first), force_network(run)
    speed = tables["velocity"]
    return Flow(
        first,
        start,
        end,
        profile(run, "velocity", exclude_walls=0.0).normalized(),
        tables["spin"],
        np.gradient(speed.value, speed.y),
        tables["heat"],
        tables["temperature"],
        _books(run),
        _numbers(run, first, speed, end),
        _rises(run, first),
    )


def _alike(first: Floats, second: Floats) -> float:
    known = np.isfinite(first) & np.isfinite(second)
    return float(np.corrcoef(first[known], second[known])[0, 1])


def _books(run: Run) -> dict[str, float]:
    stage = np.asarray(run.series["stage"])
    before = int(np.flatnonzero(stage < stage[-1])[-1])
    names = (
        "heat_friction",
        "heat_impact",
        "heat_to_walls",
        "friction_loss",
        "friction_sliding",
        "impact_loss",
    )
    return {name: float(run.series[name][-1] - run.series[name][before]) for name in names}


def _rises(run: Run, first: int) -> dict[float, float]:
    radius = run.model.grains.radius
    rise = np.asarray(run.frames[-1].temperature, np.float64) - np.asarray(
        run.frames[first].temperature, np.float64
    )
    return {2.0 * float(size): float(rise[radius == size].mean()) for size in np.unique(radius)}


def _numbers(run: Run, first: int, speed: ProfileTable, end: ForceNetwork) -> dict[str, float]:
    inside = (speed.y > LAYER[0] * speed.height) & (speed.y < LAYER[1] * speed.height)
    shear = float(np.polyfit(speed.y[inside], speed.value[inside], 1)[0])
    scale = _inertial_time(run)
    swirl, together, uncertain = _fluctuations(run, speed)
    diffusivity = _conduction(run, end)
    mixing = _mixing(run, speed)
    return {
        "inertial": speed.shear_rate * scale,
        "layer_inertial": shear * scale,
        "solid_start": _solid(run, Selection(frames=slice(first, first + 1))),
        "solid": _solid(run, None),
        "swirl": swirl / (shear * 2.0 * float(run.model.grains.radius.mean())),
        "together": together,
        "together_error": uncertain,
        "conduction": speed.height**2 / (np.pi**2 * diffusivity),
        "mixing": speed.height**2 / (np.pi**2 * mixing),
        "duration": float(run.frames.time[-1] - run.frames.time[first]),
        "strain": float(run.series["strain"][-1]) if "strain" in run.series else np.nan,
        "mean_rise": float(
            np.nanmax(
                profile(
                    run, "temperature", Selection(frames=slice(-1, None)), BINS, exclude_walls=0.0
                ).value
            )
        ),
    }


def _inertial_time(run: Run) -> float:
    """√(m/P) [s]: mean mass of a grain, and force per length on the upper wall in the later half of
    the shearing.
    """
    time, stage = np.asarray(run.series["time"]), np.asarray(run.series["stage"])
    last = stage == stage[-1]
    later = last & (time >= 0.5 * (time[last][0] + time[-1]))
    force = float(
        np.asarray(run.series["wall_force"])[later, run.wall_names.index("top"), 1].mean()
    )
    return float(np.sqrt(run.model.grains.mass.mean() * run.period / abs(force)))


def _solid(run: Run, selection: Selection | None) -> float:
    table = profile(run, "solid-fraction", selection, bins=2 * BINS, exclude_walls=0.0)
    middle = (table.y > MIDDLE[0] * table.height) & (table.y < MIDDLE[1] * table.height)
    return float(table.value[middle].mean())


def _chosen(run: Run) -> NDArray[np.int64]:
    chosen = Selection().indices(run.frames)
    return chosen[:: -(-chosen.size // _PICTURES)]


def _fluctuations(run: Run, speed: ProfileTable) -> tuple[float, float, float]:
    """In the sheared layer: rms fluctuation [m/s]; correlation of its vertical part between distant
    grains, and its error.
    """
    sums = np.array([_layer_sums(run, int(index), speed.height) for index in _chosen(run)])
    blocks = np.array(
        [_correlation(rows.sum(axis=0)) for rows in np.array_split(sums, min(_BLOCKS, len(sums)))]
    )
    error = float(blocks.std(ddof=1) / np.sqrt(blocks.size)) if blocks.size > 1 else np.nan
    total = sums.sum(axis=0)
    return float(np.sqrt(total[0] / total[2])), _correlation(total), error


def _correlation(sums: Floats) -> float:
    return float((sums[3] / sums[4]) / (sums[1] / sums[2]))


def _layer_sums(run: Run, index: int, height: float) -> tuple[float, ...]:
    """Of grains in the sheared layer: squares, vertical squares, number; of pairs: products of the
    vertical parts, number.
    """
    table = grain_map(run, "fluctuation", index)
    assert table.vector is not None
    y = table.scene.center[:, 1] - _floor(run, index)
    inside = (y > LAYER[0] * height) & (y < LAYER[1] * height)
    center, vector = table.scene.center[inside], table.vector[inside]
    vector = vector - vector.mean(axis=0)  # the layer as a whole rises and sinks with the wall
    apart = center[:, np.newaxis] - center
    apart[..., 0] -= run.period * np.round(apart[..., 0] / run.period)
    distance = np.hypot(apart[..., 0], apart[..., 1]) / (
        2.0 * float(run.model.grains.radius.mean())
    )
    near = np.triu((distance > _APART[0]) & (distance < _APART[1]))
    upwards = vector[:, 1]
    return (
        float((vector**2).sum()),
        float((upwards**2).sum()),
        float(upwards.size),
        float(np.outer(upwards, upwards)[near].sum()),
        float(near.sum()),
    )


def _floor(run: Run, index: int) -> float:
    """Height of the lowest grain's lower edge [m]."""
    return float((np.asarray(run.frames[index].position)[:, 1] - run.model.grains.radius).min())


def _conduction(run: Run, network: ForceNetwork) -> float:
    """Diffusivity 3/2 H d²/C of a lattice with the mean conductance H of the contacts between
    grains [m²/s].
    """
    (material,) = tomllib.loads(run.scenario_resolved)["materials"].values()
    radius, between = run.model.grains.radius, ~network.is_wall
    i, j, force = network.i[between], network.j[between], network.force[between, 0]
    reduced = radius[i] * radius[j] / (radius[i] + radius[j])
    modulus = material["young"] / (2.0 * (1.0 - material["poisson"] ** 2))
    spot: Any = np.cbrt(3.0 * force * reduced / (4.0 * modulus))
    conductance = 2.0 * material["conductivity"] * float(spot.mean())
    capacity = float(run.model.grains.mass.mean()) * material["heat_capacity"]
    return float(1.5 * conductance * (2.0 * float(radius.mean())) ** 2 / capacity)


def _mixing(run: Run, speed: ProfileTable) -> float:
    """Diffusivity of the grains across the flow, from their vertical displacements over the later
    half of the shearing [m²/s].
    """
    chosen = Selection().indices(run.frames)
    before, after = (
        np.asarray(run.frames[int(k)].position, np.float64)[:, 1] for k in (chosen[0], chosen[-1])
    )
    y = before - _floor(run, int(chosen[0]))
    middle = (y > MIDDLE[0] * speed.height) & (y < MIDDLE[1] * speed.height)
    lapse = float(run.frames.time[int(chosen[-1])] - run.frames.time[int(chosen[0])])
    return float(np.var((after - before)[middle])) / (2.0 * lapse)

"""State of the bulk of a plane shear flow, from a run directory: inertial number, μ*, solid fraction, spin."""

import itertools
from dataclasses import dataclass

import numpy as np

from multicor_cli import open_run
from multicor_cli.post.binning import area_below

MARGIN = 8.0  # mean diameters next to a rough wall that do not count as bulk: spins are disturbed that far


@dataclass
class Bulk:
    """Means and standard errors (from ten blocks) over the frames after a strain."""

    inertial_number: float
    friction: float
    friction_error: float
    solid_fraction: float
    solid_fraction_error: float
    spin_ratio: float
    spin_ratio_error: float


def _blocks(values, count=10):
    means = np.array([block.mean(axis=0) for block in np.array_split(np.asarray(values), count)])
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(count)


def _block_ratios(above, below, count=10):
    """Ratio of the means and its standard error from the ratios of blocks (both fluctuate together)."""
    pairs = zip(np.array_split(above, count), np.array_split(below, count), strict=True)
    ratios = np.array([a.mean() / b.mean() for a, b in pairs])
    return above.mean() / below.mean(), ratios.std(ddof=1) / np.sqrt(count)


def _interval(first, second, model):
    """Shear rate (least squares), solid fraction and mean spin of the grains between the margins, between two frames.

    Velocity and spin are displacements over the interval, so nothing of the fluctuations in between is missed.
    """
    diameter, period, lapse = model.mean_diameter, model.period, second.time - first.time
    low = second.wall_position[0, 1] + 0.5 * diameter + MARGIN * diameter
    high = second.wall_position[1, 1] - 0.5 * diameter - MARGIN * diameter
    y, radius = second.position[:, 1], model.grains.radius
    area = area_below(high - y, radius) - area_below(low - y, radius)
    x = [frame.position[:, 0] + period * frame.image for frame in (first, second)]
    inside = (y > low) & (y < high)
    rate = np.polyfit(y[inside], (x[1] - x[0])[inside] / lapse, 1)[0]
    # A least-squares slope weighs the local shear rate with (y − low)(high − y); so must the spin it is compared with.
    weight = ((y - low) * (high - y))[inside]
    spin = np.average((second.angle - first.angle)[inside], weights=weight) / lapse
    return rate, area.sum() / ((high - low) * period), spin


def measure_bulk(directory, *, load, strain=6.0):
    """Average over the frames whose shear strain exceeds ``strain``; ``load`` is the force on the upper wall [N]."""
    with open_run(directory) as run:
        model, series = run.model, run.series
        moved = series["strain"] > strain
        force = series["wall_force"][moved]
        began = series["time"][np.argmax(moved)]
        frames = [frame for frame in run.frames if frame.time >= began]
        intervals = [_interval(*pair, model) for pair in itertools.pairwise(frames)]
        mass = model.grains.mass.mean()
        pressure = load / model.period
    rates, fractions, spins = np.array(intervals).T
    rate = rates.mean()
    friction, friction_error = _blocks(0.5 * (force[:, 0, 0] - force[:, 1, 0]) / force[:, 1, 1].mean())
    fraction, fraction_error = _blocks(fractions)
    spin, spin_error = _block_ratios(spins, rates)
    return Bulk(
        rate * np.sqrt(mass / pressure), friction, friction_error, fraction, fraction_error, spin, spin_error
    )  # fmt: skip

"""What the rheologies of a layer and of a cell have in common: sums over contacts, averages."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import heights, part_between
from multicor_cli.post.contacts import has_forces, loaded_contacts
from multicor_cli.post.source import Frame
from multicor_cli.post.sums import Spread, pseudo_values, spread
from multicor_cli.post.table import Quantity

CONTACT_SUMS = (
    "xx", "xy", "yx", "yy", "contacts", "grains", "loaded_contacts", "loaded_grains",
    "normal_xx", "normal_xy", "normal_yy", "normal_count",
)  # fmt: skip
"""Names of the sums of `contact_sums`."""

OF_CONTACTS = (
    Quantity("coordination", "coordination number", "Z"),
    Quantity("coordination_loaded", "coordination number without rattlers", "Z'"),
    Quantity("fabric_anisotropy", "fabric anisotropy a_c", "a_c"),
    Quantity("fabric_direction", "its direction, from x counter-clockwise", r"\theta_c", "deg"),
)
"""What is made of them."""

INERTIAL_NUMBERS = (
    Quantity("inertial_number", "inertial number (rate × √(m/P))", "I"),
    Quantity("inertial_number_density", "inertial number (rate × d/√(P/ρ))", "I_\\rho"),
)


def contact_sums(
    model: Model, frame: Frame, inside: NDArray[np.bool_], low: float, high: float
) -> list[float]:
    """`CONTACT_SUMS` over the grains ``inside`` and the branches between two heights [m].

    They are zero if no forces belong to the frame.
    """
    if not has_forces(frame):
        return [0.0] * len(CONTACT_SUMS)
    contacts = loaded_contacts(frame, model)
    start = heights(frame)[contacts.i]
    part = part_between(start, start - contacts.branch[:, 1], low, high)
    stress = [float((part * contacts.virial(a, b)).sum()) for a in (0, 1) for b in (0, 1)]
    counts = contacts.counts[inside]
    loaded = counts[counts >= 2]
    numbers = (counts.sum(), counts.size, loaded.sum(), loaded.size)
    # n⊗n of the contacts whose branch has its middle in the bulk, and their number
    middle = start - 0.5 * contacts.branch[:, 1]
    is_near = ((middle > low) & (middle < high)).astype(np.float64)
    x, y = contacts.normal.T
    # Products by hand: BLAS would start threads for each, and wait for busy cores.
    normals = [float((is_near * a * b).sum()) for a, b in ((x, x), (x, y), (y, y))]
    return [*stress, *map(float, numbers), *normals, float(is_near.sum())]


def derive_contacts(sums: dict[str, Floats]) -> dict[str, Floats]:
    """The quantities `OF_CONTACTS` by name."""
    # ⟨n⊗n⟩ = ½ 1 + ¼ a_c (cos 2θ_c, sin 2θ_c; sin 2θ_c, −cos 2θ_c)
    along = (sums["normal_xx"] - sums["normal_yy"]) / sums["normal_count"]
    across = 2.0 * sums["normal_xy"] / sums["normal_count"]
    return {
        "coordination": sums["contacts"] / sums["grains"],
        "coordination_loaded": sums["loaded_contacts"] / sums["loaded_grains"],
        "fabric_anisotropy": 2.0 * np.hypot(along, across),
        "fabric_direction": np.degrees(0.5 * np.arctan2(across, along)) % 180.0,
    }


def inertial_numbers(model: Model, rate: Floats, pressure: Floats) -> dict[str, Floats]:
    """Both `INERTIAL_NUMBERS` by name, of shear rates [1/s] and pressures [N/m]."""
    grains = model.grains
    density = grains.mass.sum() / (np.pi * grains.radius**2).sum()
    return {
        "inertial_number": np.abs(rate) * np.sqrt(grains.mass.mean() / pressure),
        "inertial_number_density": np.abs(rate) * model.mean_diameter * np.sqrt(density / pressure),
    }


def sums_between(series: Floats, times: Floats, rows: Floats) -> Floats:
    """Sums of the ``rows`` of a time series that end between two frames, shape ``(r, …)``.

    ``series`` are the times of the rows, ``times`` those of the frames, in ``r`` intervals [s].
    """
    interval = np.searchsorted(times, series, side="left") - 1
    inside = (interval >= 0) & (interval < times.size - 1)
    return np.column_stack(
        [np.bincount(interval[inside], row[inside], minlength=times.size - 1) for row in rows.T]
    )


class Averages(NamedTuple):
    """Quantities by name: in each interval, of all of them, and the errors of these."""

    values: dict[str, Floats]
    mean: dict[str, float]
    spread: dict[str, Spread]


def average_ratios(
    derive: Callable[[Floats], dict[str, Floats]], sums: Floats, times: Floats
) -> Averages:
    """Quantities that ``derive`` makes of rows of sums, from ratios of the sums of all rows.

    Args:
        derive: Makes them; of what is not finite there is no value.
        sums: A row for each interval between two of the ``times`` [s].
        times: Times of the frames.
    """
    return average_rows(derive, sums, 0.5 * (times[1:] + times[:-1]))


def average_rows(
    derive: Callable[[Floats], dict[str, Floats]], sums: Floats, times: Floats
) -> Averages:
    """As `average_ratios`, of rows that each have a time [s]."""

    def known(rows: Floats) -> dict[str, Floats]:
        # Where nothing presses a ratio has no value, whether it is 0/0 or 1/0.
        with np.errstate(invalid="ignore", divide="ignore"):
            return {n: np.where(np.isfinite(v), v, np.nan) for n, v in derive(rows).items()}

    whole = sums.sum(axis=0)
    mean = {name: float(value[0]) for name, value in known(whole[np.newaxis]).items()}
    without = known(whole - sums)
    for name in mean:
        if name.endswith("direction"):  # these repeat every 180°
            turned = (without[name] - mean[name] + 90.0) % 180.0 - 90.0
            without[name] = mean[name] + turned
    spreads = {
        name: spread(pseudo_values(np.asarray(mean[name]), rows), times)
        for name, rows in without.items()
    }
    return Averages(known(sums), mean, spreads)

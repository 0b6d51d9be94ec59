"""Bulk of a plane shear flow, from a run directory: inertial number, μ*, solid fraction, spin."""

from dataclasses import dataclass

import numpy as np

from multicor_cli import open_run
from multicor_cli.post import Selection, rheology


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

    def __str__(self):
        return (
            f"I = {self.inertial_number:.4g}, μ* = {self.friction:.4f} ± {self.friction_error:.4f}"
            f", ν = {self.solid_fraction:.4f} ± {self.solid_fraction_error:.4f}"
            f", spin over γ̇ = {self.spin_ratio:.3f} ± {self.spin_ratio_error:.3f}"
        )


def measure_bulk(directory, *, load, strain=6.0):
    """Means over frames with shear strain above ``strain``; ``load``: on the upper wall [N]."""
    with open_run(directory) as run:
        series = run.series
        began = series["time"][np.argmax(series["strain"] > strain)]
        table = rheology(run, Selection(start=began), margin=8.0)
        mean, names = table.mean, ("friction_walls", "solid_fraction", "spin_ratio")
        number = mean["inertial_number"] * np.sqrt(mean["pressure"] / (load / run.period))
    return Bulk(number, *(of[name] for name in names for of in (mean, table.error)))

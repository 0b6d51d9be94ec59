"""`configs/chute.toml`: Bagnold's velocity profile, tan θ = μ(I), and rest below the angle of
repose.

Steady flow in which the friction of the layer depends on the inertial number alone has tan θ = μ(I)
at every height, so that I is the same there, and γ̇ = I √(P/ρ)/d with P ∝ H − y gives v ∝ H^{3/2} −
(H − y)^{3/2} (GDR MiDi, Eur. Phys. J. E 14, 341, 2004).
"""

import math

import numpy as np
import pytest
from bulk import measure_bulk
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.post.profile import profile
from multicor_cli.post.source import Selection

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

LAYER = 0.25, 0.8
"""Part of the layer that is looked at: the base orders the grains above it, and the topmost ones
fly."""


def flow(directory, angle):
    return run_config("chute", directory / f"chute-{angle}", f"variables.angle={angle}")


def layer(directory):
    """Heights and velocities in the layer, its height H, and the mean inertial number."""
    with multicor.open_run(directory) as run:
        model, chosen = run.model, Selection(start=0.6 * run.frames[-1].time)
        table, fill = (
            profile(run, of, chosen, bin_width=1.0, exclude_walls=0.0)
            for of in ("velocity", "solid-fraction")
        )
    gravity, mass = -float(model.gravity[1]), float(np.mean(model.grains.mass))
    # The load of what lies above, per length; H is where it would end if the surface were as dense
    # as the bulk.
    weight = fill.area * float(model.grains.mass.sum()) / fill.area.sum() * gravity / model.period
    load = np.cumsum(weight[::-1])[::-1] - 0.5 * weight
    middle = slice(*(round(share * len(table.y)) for share in LAYER))
    slope, top = np.polyfit(load[middle], table.y[middle], 1)
    assert slope < 0.0
    number = np.gradient(table.value, table.y) * np.sqrt(mass / load)
    return table.y[middle], table.value[middle], float(top), float(np.mean(number[middle]))


def sheared_friction(directory, inertial_number):
    """μ of plane shear without gravity at an inertial number, between two runs around it."""
    found = []
    for factor in (0.8, 1.25):
        speed = 5.9 * factor * inertial_number / 0.1
        changes = [
            f"loading.0.drives.top.x.velocity={speed}", f"particles.0.velocity=[{0.5 * speed},0.0]",
            f"particles.0.shear_rate={speed / 0.045}", f"output.frame_interval={5.9e-3 / speed}",
            "solver.dt=auto",
        ]  # fmt: skip
        path = directory / f"shear-{inertial_number:.3f}-{factor}"
        run_config("shear-gravity-free", path, *changes)
        found.append(measure_bulk(path, load=0.3))
    numbers, frictions = [bulk.inertial_number for bulk in found], [bulk.friction for bulk in found]
    share = math.log(inertial_number / numbers[0]) / math.log(numbers[1] / numbers[0])
    assert -1.0 < share < 2.0
    return frictions[0] + share * (frictions[1] - frictions[0])


@pytest.mark.parametrize("angle", [24.0, 20.0])
def test_steady_flow(angle, tmp_path, record_property):
    y, v, top, inertial_number = layer(flow(tmp_path, angle))
    shape = top**1.5 - (top - y) ** 1.5
    amplitude, slip = np.polyfit(shape, v, 1)
    misfit = np.abs(slip + amplitude * shape - v).max() / np.ptp(v)
    friction = sheared_friction(tmp_path, inertial_number)
    numbers = f"H = {top:.4g} m, I = {inertial_number:.4f}, misfit {misfit:.4f}"
    print(f"θ = {angle}°: {numbers}, μ(I) = {friction:.4f}")
    curves = {"height": y, "velocity": v, "bagnold": slip + amplitude * shape}
    found = {"top": top, "inertial_number": inertial_number, "friction": friction}
    keep(record_property, **curves, **found)
    assert misfit < 0.03
    assert friction == pytest.approx(math.tan(math.radians(angle)), abs=0.03)


def test_rest_below_the_angle_of_repose(tmp_path):
    """The deposited layer settles by less than a fiftieth of a diameter in the last second,
    wherever that is to."""
    with multicor.open_run(flow(tmp_path, 10.0)) as run:
        end = run.frames[-1]
        before = next(frame for frame in run.frames if frame.time >= end.time - 1.0)
        way = np.abs(end.unwrapped[:, :2] - before.unwrapped[:, :2]).mean(axis=0)
        assert way.max() < 0.02 * run.model.mean_diameter

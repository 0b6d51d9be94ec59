"""`configs/annular-shear.toml`: the torque through every circle between two cylinders is the same.

The balance of angular momentum about the axis: in a steady state without gravity the torque that
contacts pass on through a circle, and what moving grains carry through it, together do not depend
on its radius, r² σ_rθ = const, and are the torque of either cylinder.
"""

import math

import numpy as np
import pytest
from scenarios import run_config

import multicor_cli as multicor

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

INNER, OUTER = 0, 1
D, SPIN = 1e-3, 10.0
CIRCLES = np.arange(9.0, 19.5) * D
"""Edges of the rings of which torques are means: from what is glued to the inner cylinder to what
is glued to the outer one."""


def cross(a, b):
    """z component of the products, shape ``(n,)``."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def momenta(frame, model, center):
    """Angular momentum of each grain about the axis, its spin included [N m s], shape ``(n,)``."""
    momentum = model.grains.mass[:, None] * frame.velocity[:, :2]
    return cross(frame.position[:, :2] - center, momentum) + model.grains.inertia * frame.spin


def by_contacts(frame, model, center):
    """Torque that contacts pass on outwards [N m], averaged over the circles in each ring, shape
    ``(rings,)``.

    A contact passes on its torque through all circles between the two centers; that of a cylinder
    is the axis, or far away.
    """
    contacts = frame.contacts
    n = np.asarray(contacts.normal, np.float64)
    across = np.stack([-n[:, 1], n[:, 0]], axis=1)
    p = contacts.impulse[:, :1] * n + contacts.impulse[:, 1:] * across
    at = frame.position[:, :2] - center
    torque = cross(at[contacts.i] - model.grains.radius[contacts.i, None] * n, p) / frame.dt
    of_walls = np.where(model.shapes.wall == INNER, 0.0, math.inf)
    r = np.concatenate([np.hypot(at[:, 0], at[:, 1]), of_walls])
    inside = np.minimum(r[contacts.i], r[contacts.j])
    outside = np.maximum(r[contacts.i], r[contacts.j])
    share = np.minimum(outside[:, None], CIRCLES[1:]) - np.maximum(inside[:, None], CIRCLES[:-1])
    outwards = np.where(r[contacts.i] > r[contacts.j], torque, -torque)
    return (outwards @ np.maximum(share, 0.0)) / np.diff(CIRCLES)


def by_grains(frame, model, center):
    """Angular momentum that grains carry outwards in a second [N m], averaged likewise: the kinetic
    part."""
    at = frame.position[:, :2] - center
    r = np.hypot(at[:, 0], at[:, 1])
    flow = momenta(frame, model, center) * (at * frame.velocity[:, :2]).sum(axis=1) / r
    return np.histogram(r, CIRCLES, weights=flow)[0] / np.diff(CIRCLES)


@pytest.mark.parametrize("seed", [6, 7])
def test_every_circle_passes_on_the_torque_of_the_cylinders(seed, tmp_path):
    """Frames are of every step here: what rings take up in one step and give away in the next adds
    up to nothing."""
    changes = [
        f"scenario.seed={seed}", "variables.turns=2", f"output.frame_interval={0.005 / SPIN}",
    ]  # fmt: skip
    with multicor.open_run(run_config("annular-shear", tmp_path / "run", *changes)) as run:
        model, series = run.model, run.series
        frames = [frame for frame in run.frames if run.stages[frame.stage] == "steady"]
        center = np.asarray(series["wall_position"])[0, OUTER, :2]
        contacts = np.mean([by_contacts(frame, model, center) for frame in frames], axis=0)
        grains = np.mean([by_grains(frame, model, center) for frame in frames], axis=0)
        first, last = (float(momenta(frames[k], model, center).sum()) for k in (0, -1))
        gained = (last - first) / (frames[-1].time - frames[0].time)
        rows = np.asarray(series["time"]) > frames[0].time
        weight, force = (
            np.asarray(series[name])[rows] for name in ("window_duration", "wall_force")
        )
    torque = np.average(force[:, :, 2], axis=0, weights=weight)
    through, outer = contacts + grains, torque[OUTER]
    print(f"seed {seed}: torques {torque} N m, gained {gained:.3g} N m")
    print(f"contacts {contacts / outer}\ngrains {grains / outer}\ntogether {through / outer}")
    assert outer > 0.0
    assert torque[INNER] == pytest.approx(-outer, rel=0.02)
    assert torque.sum() + gained == pytest.approx(0.0, abs=1e-3 * outer)
    assert through == pytest.approx(np.full(len(through), through.mean()), rel=0.02)
    assert through.mean() == pytest.approx(outer, rel=0.02)

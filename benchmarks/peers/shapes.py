"""Polygons here and in other codes: what they cost, and how right they are."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from ours import loosened
from polygons import (
    GRAVITY,
    Bodies,
    Pour,
    Run,
    Seen,
    describe_pour,
    drift,
    least_thickness,
    loose_pentagons,
    slope_errors,
)
from shape_peers import BOX2D, ShapePeer
from table import draw, spread

from multicor_cli.engine import Engine
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import parse_scenario

FRAMES, FALLS = 60, 6.0
"""Frames of a pour, and its time in falls through the height from which the last grain comes."""

OURS = ((1.6e-2, 2e-3), (4e-3, 2e-3), (4e-3, 2e-4))
"""Our time steps [s] and rms tolerances; the first is what the others are compared with."""

BOX2D_SETTINGS = (
    (1.0 / 60.0, {"substeps": 4, "hertz": 30.0, "unit": 1.0}),
    (1.0 / 240.0, {"substeps": 4, "hertz": 1e6, "unit": 0.1}),
    (1.0 / 240.0, {"substeps": 16, "hertz": 1e6, "unit": 0.1}),
    (1.0 / 960.0, {"substeps": 16, "hertz": 1e6, "unit": 0.1}),
)
"""Time steps [s] and tunings. The first is how games use it. With 10⁶ Hz contacts are as stiff as
the substeps allow, and with a unit of 0.1 its slop is a tenth."""

LMGC90_SETTINGS = ((1e-2, {"alert": 1e-2}), (4e-3, {"alert": 1e-2}))
"""Time steps [s] and tunings; all else is what the binding sets."""


@dataclass(frozen=True)
class Setting:
    """A code with its settings: name, what runs it, and whether it can pour grains."""

    name: str
    run: Run
    pours: bool = True


@dataclass(frozen=True)
class Still:
    """How right a code is where hardly anything moves.

    Attributes:
        slides: Error of the acceleration of a block that slides, over its own.
        slips: Way of a block that should rest [m].
        thickness: Least thickness of an arch, over that of limit analysis.
        drift: Way of the brick of masonry that has moved most, over the height of one.
        cost: Time of the processor for a brick and simulated second [s].
    """

    slides: float
    slips: float
    thickness: float
    drift: float
    cost: float


@dataclass(frozen=True)
class Found:
    """What a setting did: masonry and pours, and the cost of a grain and second in each round."""

    name: str
    still: Still
    pour: Pour | None
    costs: list[float]


def compare_shapes(
    grains: int, courses: int, rounds: int, peers: Sequence[ShapePeer], folder: Path,
    say: Callable[[str], None],
) -> list[Found]:  # fmt: skip
    """Run all scenes in all codes, ours first.

    Args:
        grains: How many are poured.
        courses: Height of the masonry, in bricks.
        rounds: Of the pours; each code begins from the same grains in all of them.
        peers: The others.
        folder: Where they work.
        say: Tells what is being done.
    """
    settings = _settings(peers, folder)
    bodies = loose_pentagons(grains, seed=1)
    height = float(max(corners[:, 1].max() for corners in bodies.outlines))
    duration = FALLS * math.sqrt(2.0 * height / GRAVITY)
    say("compiling")
    settings[0].run(loose_pentagons(20, seed=2), 1.0, 1)
    stills = []
    for setting in settings:
        say(f"{setting.name}: slope, arch, masonry")
        thickness = least_thickness(setting.run)
        stills.append(Still(*slope_errors(setting.run), thickness, *drift(setting.run, courses)))
    pours: dict[str, list[Seen]] = {setting.name: [] for setting in settings}
    for number in range(rounds):
        for setting in settings:
            if setting.pours:
                say(f"{setting.name}: pour {number + 1}")
                seen = setting.run(bodies, duration / FRAMES, FRAMES)
                pours[setting.name].append(seen)
    found = []
    for setting, still in zip(settings, stills, strict=True):
        runs = pours[setting.name]
        pour = describe_pour(bodies, runs[0]) if runs else None
        costs = [float(run.seconds.sum()) / (grains * duration) for run in runs]
        found.append(Found(setting.name, still, pour, costs))
    return found


def _settings(peers: Sequence[ShapePeer], folder: Path) -> list[Setting]:
    settings = [
        Setting(f"multicor Δt = {1e3 * dt:.3g} ms, rms {rms:g}", partial(
            run_ours, dt=dt, tolerance=rms, folder=folder
        ))
        for dt, rms in OURS
    ]  # fmt: skip
    for peer in peers:
        is_box2d = peer.name == BOX2D
        for dt, tuning in BOX2D_SETTINGS if is_box2d else LMGC90_SETTINGS:
            said = (
                f", {tuning['substeps']:g} substeps, {tuning['hertz']:.0e} Hz" if is_box2d else ""
            )
            name = f"{peer.name} Δt = {1e3 * dt:.3g} ms{said}"
            run = partial(peer.run, dt=dt, tuning=tuning, folder=folder)
            settings.append(Setting(name, run, pours=is_box2d))
    return settings


# ---- Results

_STILL = (
    "code", "slope: error of a", "slips [m]", "arch: least thickness", "masonry: drift",
    "µs per brick and s", "ratio",
)  # fmt: skip
_POUR = (
    "code", "largest overlap", "mean", "kinetic left", "energy made", "height [m]",
    "µs per grain and s", "ratio",
)  # fmt: skip


def as_text(found: Sequence[Found]) -> str:
    """The results as two tables."""
    still, poured, ours = [], [], found[0]
    for one in found:
        s = one.still
        still.append([
            one.name, f"{s.slides:.0e}", f"{s.slips:.0e}", f"{s.thickness:.4f}", f"{s.drift:.0e}",
            f"{1e6 * s.cost:.0f}", f"{s.cost / ours.still.cost:.2g}",
        ])  # fmt: skip
        if one.pour is not None:
            p = one.pour
            ratios = [b / a for a, b in zip(ours.costs, one.costs, strict=True)]
            poured.append([
                one.name, f"{p.largest:.1e}", f"{p.mean:.1e}", f"{p.kinetic:.0e}", f"{p.made:.0e}",
                f"{p.height:.2f}", spread([1e6 * cost for cost in one.costs]), spread(ratios),
            ])  # fmt: skip
    return f"{draw(_STILL, still)}\n\n{draw(_POUR, poured)}"


def as_json(found: Sequence[Found]) -> dict[str, Any]:
    """The results as JSON types."""
    return {"codes": [asdict(one) for one in found]}


# ---- This program

_SCENARIO = """\
[scenario]
name = "polygons"
seed = 1
[domain]
size = [{size!r}, {size!r}]
gravity = [{gx!r}, {gy!r}]
[materials.stuff]
density = 1.0
[[contacts]]
pair = ["*", "*"]
friction = {friction!r}
restitution = 0.0
[[particles]]
name = "grains"
material = "stuff"
shape = {{ kind = "file", file = "outlines.csv" }}
thickness = 1.0
packing = {{ kind = "outlines" }}
[[walls]]
name = "floor"
material = "stuff"
geometry = {{ kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }}
{sides}
[solver]
dt = {dt!r}
[[loading]]
duration = 1e6
[output]
frame_interval = 1e6
"""

_SIDE = """\
[[walls]]
name = "{name}"
material = "stuff"
geometry = {{ kind = "plane", point = [{x!r}, 0.0], normal = [{normal!r}, 0.0] }}
"""


def engine_of(bodies: Bodies, dt: float, tolerance: float, folder: Path) -> Engine:
    """An engine in front of bodies, with a time step [s] and an rms tolerance."""
    rows = ["grain,x,y"]
    rows += [f"{k},{x!r},{y!r}" for k, one in enumerate(bodies.outlines) for x, y in one.tolist()]
    (folder / "outlines.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    top = float(max(one.max() for one in bodies.outlines))
    sides = ""
    if bodies.width > 0.0:
        sides = _SIDE.format(name="left", x=0.0, normal=1.0)
        sides += _SIDE.format(name="right", x=bodies.width, normal=-1.0)
    gx, gy = bodies.gravity.tolist()
    text = _SCENARIO.format(
        size=2.0 * max(top, 20.0), gx=gx, gy=gy, friction=bodies.friction, sides=sides, dt=dt
    )
    scenario = parse_scenario(text, folder / "polygons.toml")
    model, state = build(scenario)
    engine = make_engine(scenario, model, state, 1)
    begin_stage(engine, make_plan(scenario, model).stages[0], [0.0])
    engine.resume(replace(engine.orders, settings=loosened(tolerance)))
    return engine


def run_ours(bodies: Bodies, between: float, frames: int, dt: float, tolerance: float,
             folder: Path) -> Seen:  # fmt: skip
    """Run the program; as `Run`."""
    every = math.ceil(between / dt * (1.0 - 1e-9))
    engine = engine_of(bodies, between / every, tolerance, folder)
    places, velocities, seconds = [], [], []
    for _ in range(frames):
        begin = time.process_time()
        for _ in range(every):
            engine.step(between / every, 0.0)
        seconds.append(time.process_time() - begin)
        places.append(engine.state.position.copy())
        velocities.append(engine.state.velocity.copy())
    return Seen(np.array(places), np.array(velocities), np.array(seconds))

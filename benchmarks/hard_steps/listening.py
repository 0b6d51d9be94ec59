"""Listens to the solver of an engine: what every solve costs, and copies of chosen problems before
they are solved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableSequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.bench.driving import prepare
from multicor_cli.bench.scenes import SCENES
from multicor_cli.engine import mechanics as engine_module
from multicor_cli.engine.contact.solve import Outcome, ResidualScale
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.jit.arrays import aligned_copy
from multicor_cli.packing import build
from multicor_cli.running.controller import Controller
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import parse_scenario


@dataclass(frozen=True)
class Problem:
    """A contact problem with its warm start. The system is not to be changed: `copy` it."""

    system: System
    scale: ResidualScale

    def copy(self) -> System:
        """A system that may be changed."""
        return copied(self.system)


@dataclass
class Heard:
    """What was heard.

    Attributes:
        wanted: Whether the problem of a solve is kept, by its number.
        outcomes: Results of all solves.
        problems: The problems that were kept.
    """

    wanted: Callable[[int], bool] = lambda _number: False
    outcomes: list[Outcome] = field(default_factory=list)
    problems: MutableSequence[Problem] = field(default_factory=list)


class _NoRecorder:
    """Writes nothing."""

    def frame(self, state: Any, contacts: Any) -> None:
        """Ignored."""

    def series(self, state: Any) -> None:
        """Ignored."""

    def stage_ended(self, end: Any) -> None:
        """Ignored."""

    def checkpoint(self, state: Any) -> None:
        """Ignored."""

    def heartbeat(self, data: dict[str, Any]) -> None:
        """Ignored."""


def copied(system: System) -> System:
    """A copy of all arrays, which begin at cache lines as they do in a run: sweeps change some, and
    later steps write into the same lanes.
    """
    arrays = {
        name: aligned_copy(value)
        for name, value in zip(System._fields, system, strict=True)
        if isinstance(value, np.ndarray)
    }
    return system._replace(**arrays)


@contextmanager
def listening(heard: Heard) -> Iterator[None]:
    """While this lasts, ``heard`` hears all engines."""
    names = vars(engine_module)
    solve: Callable[..., Outcome] = names["solve_system"]

    def listen(system: System, scale: ResidualScale, *rest: Any, **named: Any) -> Outcome:
        if heard.wanted(len(heard.outcomes)) and scale.velocity > 0.0:
            heard.problems.append(Problem(copied(system), scale))
        heard.outcomes.append(solve(system, scale, *rest, **named))
        return heard.outcomes[-1]

    names["solve_system"] = listen
    try:
        yield
    finally:
        names["solve_system"] = solve


def run_scenario(
    text: str, heard: Heard, overrides: list[str], path: Path = Path("hard-steps.toml")
) -> Any:
    """Run a scenario to its end on one thread without writing anything; returns its state. What it
    names lies beside ``path``.
    """
    scenario = parse_scenario(text, path, overrides)
    model, state = build(scenario)
    engine = make_engine(scenario, model, state, 1)
    with listening(heard):
        Controller(make_plan(scenario, model), engine, _NoRecorder()).run(is_new=True)
    return state


def run_scene(name: str, grains: int, seed: int, heard: Heard) -> None:
    """Prepare a scene of ``multicor bench`` and take four of its rounds."""
    scene = SCENES[name]
    with listening(heard):
        prepare(scene, grains, seed=seed).take(scene.warm_steps + 4 * scene.steps)


def falling_bed(seed: int) -> str:
    """1,008 discs that fall from a lattice until 0.09 s and collapse until 0.25 s: the former bed
    of ``multicor bench``.
    """
    return f"""\
[scenario]
name = "falling-bed"
seed = {seed}
[domain]
size = [0.07, 0.135]
periodic = true
gravity = [0.0, -9.81]
[materials.stuff]
density = 2500.0
[[contacts]]
pair = ["stuff", "stuff"]
friction = 0.5
restitution = 0.0
[[particles]]
name = "grains"
material = "stuff"
shape = "sphere"
sizes = {{ kind = "uniform", min = 0.8e-3, max = 1.2e-3 }}
count = 1008
region = {{ min = [0.0, 0.0], max = [0.07, 0.135] }}
packing = {{ kind = "lattice", lattice = "square", spacing = 2.5e-3, jitter = 0.02 }}
[[walls]]
name = "floor"
material = "stuff"
geometry = {{ kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }}
[[loading]]
name = "fall"
duration = 0.25
[solver]
dt = 2e-4
[output]
frame_interval = 1.0
"""


def cold(problem: Problem) -> Problem:
    """The same problem from impulses of zero; diagonal contacts only."""
    system = problem.copy()
    add_impulses(system._replace(impulse=-system.impulse))
    system.impulse[:] = 0.0
    return Problem(system, problem.scale)

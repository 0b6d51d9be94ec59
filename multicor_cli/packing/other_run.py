"""Other runs: a moment to go on from, the last checkpoint or a frame, and grains of a frame."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.model import Model, State
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import NORMAL
from multicor_cli.model.contacts import are_impacts
from multicor_cli.model.faults import find_misfit
from multicor_cli.model.model import Floats
from multicor_cli.packing.initial_grains import InitialGrains, describe_faults
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.problems import Refused
from multicor_cli.store import StoreError, layout, open_run
from multicor_cli.store.atomic import is_regular
from multicor_cli.store.errors import NoFrame
from multicor_cli.store.frames import Frame

_RUN, _FRAME = ("start", "run"), ("start", "frame")


@dataclass(frozen=True)
class Source:
    """A moment of another run: a frame, counted from 0, or the last checkpoint.

    Of a frame with heat the temperatures at the start of ``model`` are the frame's; of a frame the
    state is what it holds, without running averages of heat. ``size`` is that of the domain [m],
    None if the scenario does not tell; ``geometries`` are tables of the walls, by their names.
    """

    path: Path
    run_id: str
    frame: int | None
    model: Model
    state: State
    digest: str
    size: tuple[float, float] | None
    geometries: dict[str, Any]

    @property
    def temperature(self) -> Floats | None:
        """Temperatures of the grains [K], shape ``(n,)``; None if the run has no heat."""
        return None if self.model.thermal is None else self.state.temperature(self.model.thermal)


def read_source(scenario: Scenario) -> Source:
    """The moment that ``[start]`` names; the run may be going on, and is not changed.

    `Refused`, by a key from the top, if there is no such run or moment, or it is damaged.
    """
    start = scenario.start
    assert start is not None  # only then it is asked for
    path = scenario.resolve_path(start.run)
    verify = "check {} with multicor verify, {}".format
    try:
        if not is_regular(path / layout.RUN):
            what = f"'{path}' is not a run directory"
            raise Refused(_RUN, what, "give the directory of a run, relative to the scenario file")
        with open_run(path) as run:
            model, told = run.model, _told(run.scenario_resolved)
            if start.frame is None:
                state = run.state()
                if state is None:
                    what = (
                        f"the run '{path}' has no checkpoint: it stopped before its grains were "
                        "placed, or its checkpoints were removed"
                    )
                    raise Refused(_RUN, what, "let it run first, or go on from a frame")
                return Source(path, run.run_id, None, model, state, state.digest(), *told)
            frame = run.frames[start.frame]
            source = Source(path, run.run_id, frame.index, *_of_frame(frame, model), *told)
    except NoFrame as error:
        what = f"cannot go on from the run '{path}': {error}"
        raise Refused(_FRAME, what, "choose another frame") from None
    except Refused:
        raise
    except (StoreError, ValueError, RecursionError) as error:
        what = f"cannot go on from the run '{path}': {error}"
        raise Refused(_RUN, what, verify("it", "and whether it ever began")) from None
    misfit = find_misfit(source.state, source.model)
    if misfit is not None:
        what = f"frame {source.frame} of the run '{path}': {misfit}"
        raise Refused(_FRAME, what, verify("the run", "or go on from another frame"))
    return source


def _told(resolved: str) -> tuple[tuple[float, float] | None, dict[str, Any]]:
    """Size of the domain, geometries of walls in a scenario from anywhere; raises `ValueError`."""
    tables = tomllib.loads(resolved)
    try:
        walls = {str(wall["name"]): wall["geometry"] for wall in tables.get("walls", [])}
        width, height = tables["domain"]["size"]
        return (float(width), float(height)), walls
    except (LookupError, TypeError, AttributeError):
        return None, {}


def _of_frame(frame: Frame, model: Model) -> tuple[Model, State, str]:
    """What a frame holds as a model with its temperatures, a state, and the digest of both.

    Positions and velocities are those at the end of the step, as in the state.
    """
    here = frame.number
    state = State.at_rest(model, np.zeros((model.grain_count, 3)))
    state.position[here], state.velocity[here] = _motion(frame)
    state.image[here] = frame.image
    if frame.is_open:
        state.presence = np.array(frame.column("particles/presence"), np.uint8)
    state.wall_position = np.array(frame.wall_position, float)
    state.wall_velocity = np.array(frame.wall_velocity, float)
    if frame.wall_surface is not None:
        state.wall_surface = np.array(frame.wall_surface, float)
    if model.is_cell:  # frames have real velocities, states those relative to the mean flow
        state.velocity[:, :2] -= mean_flow(state.position, state.wall_velocity[0])
    state.step, state.time, state.last_dt = frame.step, frame.time, frame.dt
    _take_contacts(frame, model, state)
    digest = hashlib.blake2b(state.digest().encode(), digest_size=16)
    thermal, of_walls = model.thermal, frame.wall_temperature
    if thermal is not None and frame.temperature is not None and of_walls is not None:
        temperature = thermal.initial_temperature.copy()
        temperature[here] = frame.temperature
        model = replace(model, thermal=replace(thermal, initial_temperature=temperature))
        state.wall_temperature = np.array(of_walls, float)
        digest.update(temperature.tobytes())
    return model, state, digest.hexdigest()


def _motion(frame: Frame) -> tuple[Floats, Floats]:
    """Centers, angles [m, rad], velocities, spins [m/s, rad/s] in a frame, both ``(n, 3)``."""
    position = np.column_stack([frame.position, frame.angle])
    velocity = np.column_stack([frame.velocity, frame.spin])
    return position.astype(float), velocity.astype(float)


_APART = 1e-4
"""Gap over the radius from which on a contact under tension does not touch."""


def _take_contacts(frame: Frame, model: Model, state: State) -> None:
    """Contacts of a frame that carry an impulse, and bridges, if any; q = p + F Δt (theory §3.1).

    What is pulled across a gap has q = 0.
    """
    from multicor_cli.engine.contact.adhesion import resting_attraction

    contacts = frame.contacts
    if not contacts.recorded or not len(contacts) or not state.last_dt:
        return
    shapes = model.grain_count + np.arange(model.shape_count)
    number = np.concatenate([frame.number, shapes]).astype(np.int32)
    i, j = number[contacts.i], number[contacts.j]
    impulse = np.array(contacts.impulse, float)
    is_loaded = impulse.any(axis=1) & ~are_impacts(np.asarray(contacts.gap))
    scene = scene_of(model, state.position, state.wall_position)
    laws = model.laws.with_ranges(model.mean_diameter)
    attraction = resting_attraction(laws, scene, i, j, state.last_dt)
    if attraction.size:
        is_apart = np.asarray(contacts.gap) > _APART * model.grains.radius[i]
        is_loaded &= ~(is_apart & (impulse[:, NORMAL] < 0.0))
        impulse[:, NORMAL] += attraction
        is_bridge = np.array(laws.is_wet[scene.material[i], scene.material[j]], bool)
        state.bridge_i, state.bridge_j = i[is_bridge], j[is_bridge]
    is_loaded &= impulse[:, NORMAL] > 0.0
    state.contact_i, state.contact_j = i[is_loaded], j[is_loaded]
    state.contact_impulse = impulse[is_loaded]
    if model.laws.rolling.size:
        couple = np.zeros(len(i)) if contacts.couple is None else contacts.couple
        state.contact_couple = np.array(couple, float)[is_loaded]


# ---- A group of grains from a frame of another run

_KEY = ("packing", "path")


def read_frame(path: Path, frame: int) -> InitialGrains:
    """Grains of a frame: radii, wrapped centers, angles, motion and, where known, temperatures.

    Walls and materials are not taken over. ``path`` is a run directory (or a ``results.h5``); a
    negative index of a frame counts from the last one. `Refused` if there is no readable run, or no
    such frame, or it holds what no grain can have.
    """
    try:
        with open_run(path) as run:
            chosen = run.frames[frame]
            position, velocity = _motion(chosen)
            radius = np.array(chosen.model.grains.radius, float)
            temperature = chosen.temperature
    except NoFrame as error:
        what = f"cannot take grains from the run '{path}': {error}"
        raise Refused(("packing", "frame"), what, "choose another frame") from None
    except StoreError as error:
        what = f"the run '{path}' cannot be read: {error}"
        raise Refused(_KEY, what, "give the directory of a run") from None
    names = ("x", "y", "angle", "vx", "vy", "spin")
    columns = dict(zip(names, [*position.T, *velocity.T], strict=True)) | {"radius": radius}
    if temperature is not None:
        columns["temperature"] = np.array(temperature, float)
    if len({len(values) for values in columns.values()}) > 1:
        what = (
            f"the run '{path}' is damaged: the number of grains in frame {frame} differs from "
            "that of the run"
        )
        raise Refused(_KEY, what, "check it with multicor verify")
    faults = describe_faults(columns)
    if faults:
        what = f"frame {frame} of the run '{path}': {faults}"
        raise Refused(_KEY, what, "check the run with multicor verify")
    temperatures = columns.get("temperature")
    return InitialGrains(radius, position, velocity, temperatures, is_velocity_real=True)

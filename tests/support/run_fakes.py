"""For tests of the controller: an engine that counts, a recorder, an observer that stops a run."""

import copy
import signal

import numpy as np
from scenarios import digests

from multicor_cli import run
from multicor_cli.engine.motion.drives import Constant, DofDrive, Spacing, WallDrive
from multicor_cli.engine.orders import Interrupted, Settings, StepReport
from multicor_cli.model import BOOK_NAMES, State
from multicor_cli.model.contacts import ContactTable
from multicor_cli.running.conditions import Aim, RestReached, StrainReached
from multicor_cli.running.outcome import QuietObserver
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.running.time_step import Acting, scales_of_stage
from multicor_cli.scenario.settings import Output
from multicor_cli.scenario.stage_drives import StageDrives

KINETIC = BOOK_NAMES.index("kinetic")


class StopAt(QuietObserver):
    """Sends the signal to stop after a step; 0: before the first one."""

    def __init__(self, step, number=signal.SIGTERM):
        self.step, self.number = step, number

    def message(self, text):
        if self.step == 0 and "grains, " in text:
            signal.raise_signal(self.number)

    def stepped(self, status):
        if status.state.step == self.step:
            signal.raise_signal(self.number)


def in_pieces(given, directory, *steps, **options):
    """Carry a run out, stopped after each of these steps; its digests at the end."""
    for step in steps:
        assert not run(given, directory, observer=StopAt(step), **options).is_finished
    assert run(given, directory, **options).is_finished
    return digests(directory)


class FakeEngine:
    """Moves walls as driven and damps the kinetic energy; all numbers depend on the state alone."""

    def __init__(self, model, state=None, decay=0.5):
        self.model = model
        self.state = state or State.at_rest(
            model,
            np.column_stack([np.arange(model.grain_count) * 0.3, 0.5 * np.ones(model.grain_count)]),
        )
        self.settings = Settings()
        self.decay = decay
        self.calls = []
        self.before_step = lambda step: None
        self._drives = []

    def begin(self, orders):
        self._take_up(orders, "begin")
        if self.state.step > 0:
            # The switch of a wall's kinetic energy: must happen once per stage
            self.state.books[KINETIC] += 1.0

    def resume(self, orders):
        self._take_up(orders, "resume")

    def _take_up(self, orders, call):
        self.calls += [call] if orders.gravity is None else [call, "gravity"]
        self.settings, self._drives = orders.settings, list(orders.drives or [])

    def pass_grains(self):
        """No grain comes or goes."""

    def step(self, dt, t, should_stop=None):
        state = self.state
        self.before_step(state.step)
        if should_stop is not None and should_stop():
            raise Interrupted
        for w, drive in enumerate(self._drives):
            for d, dof in enumerate(drive.dofs()):
                if dof.velocity is not None:
                    state.wall_position[w, d] += dt * dof.velocity.value(t + 0.5 * dt)
        state.position[:, 0] += dt * np.sin(state.position[:, 0])
        kinetic = state.books[KINETIC]
        state.books[KINETIC] = 1.0 if state.step == 0 else kinetic * self.decay
        state.window[0] += dt
        state.window[1] += 1.0
        state.last_dt = dt
        state.step += 1
        state.stage_step += 1
        state.time = state.stage_start + state.stage_step * dt
        return StepReport(3.0, True, 1e-4, 1e-3, 1e-3, 7, 9, 0.0)

    def contacts(self):
        return ContactTable.empty()


class MemoryRecorder:
    """Remembers what it is given; `rewind` brings back a checkpoint, as a resumed run does."""

    def __init__(self):
        self.frames = []
        self.rows = []
        self.checkpoints = []
        self.beats = []
        self.ends = []

    def frame(self, state, contacts):
        self.frames.append((state.step, state.time, state.stage))

    def series(self, state):
        self.rows.append((state.step, state.time, state.stage, float(state.window[1])))

    def stage_ended(self, end):
        self.ends.append(end)

    def checkpoint(self, state):
        self.checkpoints.append((copy.deepcopy(state), len(self.frames), len(self.rows)))

    def heartbeat(self, data):
        self.beats.append(data)

    def rewind(self):
        state, frames, rows = self.checkpoints[-1]
        del self.frames[frames:], self.rows[rows:]
        return copy.deepcopy(state)


class FakeDrives:
    """Drives that are the same whenever the stage starts; remembers what it was told."""

    def __init__(self, *walls):
        self.walls = list(walls)
        self.starts = []

    def started(self, stage_starts):
        self.starts.append(list(stage_starts))
        return self.walls


def shear(speed):
    return FakeDrives(WallDrive(), WallDrive(x=DofDrive(velocity=Constant(speed))))


def scales_of_drives(scenario, model, drives):
    """The scales of a first stage in which walls are driven so."""
    driven = StageDrives(0, tuple(drives), ((0,) * 4,) * len(drives))
    return scales_of_stage(scenario, model, 0, Acting(driven, None, None, None))


def strain_reached(spacing, goal):
    return StrainReached(Aim("the shear strain", "1", "at least", goal), spacing)


def rest_reached(ratio):
    return RestReached(Aim("the kinetic energy over its largest value", "1", "at most", ratio))


def make_plan(model, *, checkpoint_interval=1e9):
    """Settle (until rest or 20 steps), shear to 0.5 by 0.025 per step, 7 steps of other length."""
    settings, sheared = Settings(), strain_reached(Spacing.between(model, "bottom", "top"), 0.5)
    stages = (
        StagePlan("settle", 0.01, 20, rest_reached(1e-3), 4, 2, settings, shear(0.0)),
        StagePlan("shear", 0.025, None, sheared, 6, 3, Settings(max_sweeps=7), shear(-1.0)),
        StagePlan("hold", 0.5, 7, None, 100, 100, settings, shear(0.0)),
    )
    return RunPlan(
        "fake", stages, Output(frame_interval=1.0, checkpoint_interval=checkpoint_interval)
    )

"""The loop of a run with an engine that only counts: cadences, stages, stopping and exact
resuming."""

import os
import random
import signal

import numpy as np
import pytest
from run_fakes import FakeEngine, MemoryRecorder, make_plan, rest_reached, shear, strain_reached
from scene_parts import between_planes

from multicor_cli.engine.motion.drives import Spacing, wall_places
from multicor_cli.engine.orders import PhysicsError, Settings
from multicor_cli.model import BOOK_NAMES, State
from multicor_cli.running.conditions import StepDone, update_peak
from multicor_cli.running.controller import WARM_UP_STEPS, Controller, Pace
from multicor_cli.running.outcome import QuietObserver, StopReason
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.running.signals import STOP_SIGNALS, StopSignals
from multicor_cli.scenario.settings import Output

MODEL = between_planes()


class Clock:
    """Time that passes by `tick` at every look."""

    def __init__(self, tick=0.0):
        self.now, self.tick = 0.0, tick

    def __call__(self):
        self.now += self.tick
        return self.now


class Scene:
    """A run of the plan of `make_plan` by an engine that counts, from a state."""

    def __init__(self, state=None, recorder=None, plan=None):
        self.engine, self.recorder = FakeEngine(MODEL, state), recorder or MemoryRecorder()
        self.signals, self.plan = StopSignals(), plan or make_plan(MODEL)

    def run(self, act=None, *, is_new=True, clock=None, **options):
        if act is not None:
            self.engine.before_step = act
        options = {"stop_signals": self.signals, "clock": clock or Clock(), **options}
        return Controller(self.plan, self.engine, self.recorder, **options).run(is_new=is_new)

    @property
    def checkpoints(self):
        return [state.step for state, *_ in self.recorder.checkpoints]

    @property
    def frames(self):
        return [frame[0] for frame in self.recorder.frames]


@pytest.fixture
def reference():
    scene = Scene()
    assert scene.run() is StopReason.FINISHED
    return scene


def test_cadences_are_counted_from_the_start_of_each_stage(reference):
    """settle: kinetic energy 1, 1/2, 1/4 … falls below 1e-3 after step 11; shear: 0.5 in steps of
    0.025; hold: 7 steps. Times are products, not sums."""
    assert reference.frames == [0, 4, 8, 11, 17, 23, 29, 31, 38]
    assert [frame[2] for frame in reference.recorder.frames] == [0, 0, 0, 0, 1, 1, 1, 1, 2]
    rows = reference.recorder.rows
    assert [row[0] for row in rows] == [0, 2, 4, 6, 8, 10, 11, 14, 17, 20, 23, 26, 29, 31, 38]
    windows = [row[3] for row in rows]
    assert sum(windows) == 38  # every step lies in exactly one window
    assert windows[:3] == [0, 2, 2]
    assert reference.recorder.frames[3][1] == 11 * 0.01
    assert reference.recorder.frames[-1][1] == 11 * 0.01 + 20 * 0.025 + 7 * 0.5
    assert (reference.engine.state.stage, reference.engine.state.stage_step) == (3, 0)


def test_settings_and_drives_of_each_stage_reach_the_engine(reference):
    """Those of the first stage before the first row, too; drives learn when stages began."""
    assert reference.engine.calls == ["begin"] * 4
    assert reference.engine.settings.max_sweeps == 50_000
    assert reference.engine.state.wall_position[1, 0] == pytest.approx(-0.5)
    starts = [0.0, 0.11, 0.11 + 20 * 0.025]
    for number, stage in enumerate(reference.plan.stages):
        assert stage.drives.starts[-1] == starts[: number + 1]


@pytest.mark.parametrize("seed", range(6))
def test_resumed_run_equals_uninterrupted_run(seed, reference):
    """Signals, and crashes that lose everything since the last checkpoint, at random steps."""
    rng = random.Random(seed)
    recorder, state = MemoryRecorder(), None
    for attempt in range(200):
        scene = Scene(state, recorder)
        fate, steps = rng.choice(["signal", "crash", "checkpoint"]), rng.randint(1, 9)
        last = scene.engine.state.step + steps

        def act(step, scene=scene, fate=fate, last=last):
            if fate == "checkpoint":
                scene.signals.is_checkpoint_wanted = True
            elif step == last and fate == "signal":
                scene.signals.stop_signal = signal.SIGINT
            elif step == last:
                raise PhysicsError(step, "crash")

        try:
            reason = scene.run(act, is_new=attempt == 0)
        except PhysicsError:
            reason = None
        if reason is StopReason.FINISHED:
            break
        state = recorder.rewind()
    assert scene.engine.state.digest() == reference.engine.state.digest()
    assert recorder.frames == reference.recorder.frames
    assert recorder.rows == reference.recorder.rows


def test_signal_during_the_first_step_waits_where_the_process_is_not_ours():
    scene = Scene()
    reason = scene.run(lambda _step: scene.signals._on_signal(signal.SIGINT, None))
    assert reason is StopReason.INTERRUPTED
    assert scene.engine.state.step == scene.recorder.rewind().step == 0


def test_time_limit_stops_with_a_checkpoint():
    scene = Scene()
    assert scene.run(deadline=50.0, clock=Clock(tick=1.0)) is StopReason.TIME_LIMIT
    assert 0 < scene.engine.state.step < 38
    assert scene.recorder.checkpoints[-1][0].digest() == scene.engine.state.digest()


@pytest.mark.parametrize(("seconds", "every"), [(0.01, 4), (1.5, 10)])
def test_checkpoints_follow_the_wall_clock_and_slow_ones_are_rare(seconds, every, reference):
    """Steps of 3 s, checkpoints 10 s apart, or 20 times as long as one takes. Else there are those
    of the start and the end alone; nothing else changes."""
    clock = Clock()

    class SlowRecorder(MemoryRecorder):
        def checkpoint(self, state):
            super().checkpoint(state)
            clock.now += seconds

    scene = Scene(None, SlowRecorder(), make_plan(MODEL, checkpoint_interval=10.0))
    scene.run(lambda _step: setattr(clock, "now", clock.now + 3.0), clock=clock)
    assert scene.checkpoints == [*range(0, 38, every), 38]
    assert reference.checkpoints == [0, 38]
    assert scene.recorder.frames == reference.recorder.frames
    assert scene.recorder.rows == reference.recorder.rows


def test_checkpoint_on_request_goes_on():
    scene = Scene()

    def act(step):
        if step == 5:
            scene.signals._on_signal(signal.SIGUSR1, None)

    assert scene.run(act).is_end
    assert scene.checkpoints == [0, 6, 38]


def test_finished_state_runs_nothing(reference):
    frames = list(reference.frames)
    assert reference.run(is_new=False) is StopReason.FINISHED
    assert reference.frames == frames


def test_observer_sees_every_step_and_a_progress_that_grows():
    class Listener(QuietObserver):
        def stepped(self, status):
            seen.append((status.state.step, status.stage, status.progress))

    seen = []
    Scene().run(observer=Listener())
    steps, stages, progress = zip(*seen, strict=True)
    assert steps == tuple(range(1, 39))
    assert list(progress) == sorted(progress)
    assert progress[-1] == 1.0
    assert set(stages) == {"settle", "shear", "hold"}


def at_rest():
    return State.at_rest(MODEL, np.zeros((2, 2)))


def test_strain_counts_to_and_fro():
    condition = strain_reached(Spacing.between(MODEL, "bottom", "top"), 1.0)
    state = at_rest()
    for shift in (0.1, -0.1, 0.1):
        before = state.wall_position.copy()
        state.wall_position[1, 0] += shift
        state.wall_position[1, 1] = 1.0  # twice as far apart
        condition.note(state, StepDone(0.1, before, np.zeros((2, 3))))
    assert condition.value(state) == pytest.approx(0.15)


def test_strain_and_peak_begin_anew_in_each_stage():
    until = strain_reached(Spacing.between(MODEL, "bottom", "top"), 0.5)
    stages = tuple(
        StagePlan(name, 0.025, None, until, 100, 100, Settings(), shear(1.0))
        for name in ("forth", "on")
    )
    output = Output(frame_interval=1.0, checkpoint_interval=1e9)
    scene = Scene(plan=RunPlan("twice", stages, output))
    scene.run()
    assert scene.frames == [0, 20, 40]
    assert (scene.engine.state.stage_strain, scene.engine.state.stage_peak) == (0.0, 0.0)


def test_strain_is_that_of_two_walls_and_survives_rounding():
    with pytest.raises(ValueError, match="no wall 'lid'"):
        Spacing.between(MODEL, "bottom", "lid")
    with pytest.raises(ValueError, match="between 'top' and itself"):
        Spacing.between(MODEL, "top", "top")
    assert wall_places(MODEL, 1).tolist() == [0.0, 1.0]
    condition, state = strain_reached(Spacing(0, 1, 1, 1.0), 1.5), at_rest()
    for _ in range(15_000):
        state.stage_strain += 1e-4
    assert state.stage_strain != 1.5
    assert condition.holds(state)
    state.stage_strain -= 1e-4
    assert not condition.holds(state)


def test_rest_needs_motion_first_and_knows_the_initial_energy():
    state, rest = at_rest(), rest_reached(0.1)
    assert not rest.holds(state)
    state.step = 1
    state.books[BOOK_NAMES.index("kinetic_start")] = 10.0
    for kinetic, is_rest in ((1.5, False), (1.0, True)):
        state.books[BOOK_NAMES.index("kinetic")] = kinetic
        update_peak(state)
        assert state.stage_peak == 10.0
        assert rest.holds(state) is is_rest


def test_progress_by_steps_where_their_number_is_known():
    stages = tuple(
        StagePlan(name, 0.1, limit, None, 1, 1, Settings(), shear(1.0))
        for name, limit in (("a", 10), ("b", 30))
    )
    plan, state = RunPlan("p", stages, Output(frame_interval=1.0)), at_rest()
    state.stage, state.stage_step = 1, 15
    assert plan.progress(state, [10, 30]) == pytest.approx(25 / 40)
    assert plan.progress(state, [10, 6]) == pytest.approx(13 / 16)  # foreseen by a condition
    state.stage, state.stage_step = 2, 0
    assert plan.progress(state, [10, 30]) == 1.0


def test_pace_leaves_out_compilation():
    pace = Pace()
    pace.note(100.0, WARM_UP_STEPS - 1, 0.1)  # a hundred seconds of compilation
    assert pace.speed() is pace.remaining() is None
    for k in range(21):
        pace.note(100.0 + k, 10 + 5 * k, 0.1 + 0.01 * k)
    assert (pace.speed(), pace.remaining()) == (pytest.approx(5.0), pytest.approx(70.0))


def test_stop_signals_are_collected_and_handlers_put_back():
    before, stop_signals = signal.getsignal(signal.SIGTERM), StopSignals()
    with stop_signals.installed():
        signal.raise_signal(signal.SIGUSR1)
        assert stop_signals.is_checkpoint_wanted
        assert not stop_signals.should_stop()
        signal.raise_signal(signal.SIGTERM)
        assert stop_signals.stop_signal == signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_process_of_others_waits_for_the_first_signal():
    """Whoever interrupts a notebook twice does not lose all that is in it."""
    stop_signals = StopSignals()
    with stop_signals.installed(), stop_signals.exit_at_once():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        assert stop_signals.stop_signal == signal.SIGINT


def ends_by(act, on_exit, numbers):
    """Exit code of a process that signals end at once while ``act`` is done with what collects."""
    child = os.fork()
    if child == 0:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)
        stop_signals = StopSignals(may_exit=True)
        stop_signals.on_exit = on_exit
        with stop_signals.installed():
            act(stop_signals)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("number", STOP_SIGNALS)
@pytest.mark.parametrize("when", ["before", "inside"])
def test_a_process_that_exits_at_once_says_why(number, when, capfd):
    def act(stop_signals):
        if when == "before":
            signal.raise_signal(number)
        with stop_signals.exit_at_once():
            if when == "inside":
                signal.raise_signal(number)

    assert ends_by(act, lambda n: os.write(1, b"farewell %d" % n), [number]) == 128 + number
    assert capfd.readouterr().out == f"farewell {number}"


def test_second_signal_ends_the_process_at_once_also_during_its_farewell(capfd):
    def on_exit(_number):
        signal.raise_signal(signal.SIGTERM)
        os.write(1, b"not reached")

    def act(stop_signals):
        with stop_signals.exit_at_once():
            signal.raise_signal(signal.SIGINT)

    assert ends_by(act, on_exit, []) == 143
    assert capfd.readouterr().out == ""


def test_ignored_hangup_stays_ignored_and_reasons_have_exit_codes():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        stop_signals = StopSignals()
        with stop_signals.installed():
            signal.raise_signal(signal.SIGHUP)
        assert not stop_signals.should_stop()
    finally:
        signal.signal(signal.SIGHUP, before)
    codes = {reason.name: int(reason.exit_code) for reason in StopReason}
    ended = {"FINISHED": 0, "ALREADY_FINISHED": 0, "TIME_LIMIT": 75}
    assert codes == ended | {"INTERRUPTED": 130, "TERMINATED": 143, "HUNG_UP": 129}
    assert StopReason.of_signal(signal.SIGTERM) is StopReason.TERMINATED

"""The loop of a run with an engine that only counts: cadences, stages, stopping and exact
resuming.
"""

from __future__ import annotations

import os
import random
import signal

import numpy as np
import pytest
from run_fakes import FakeEngine, MemoryRecorder, make_plan, rest_reached, shear, strain_reached
from scene_parts import between_planes

from multicor_cli.engine.motion.spacing import Spacing, wall_places
from multicor_cli.engine.orders import PhysicsError, Settings
from multicor_cli.model import BOOK_NAMES, State
from multicor_cli.running.conditions import StepDone, update_peak
from multicor_cli.running.controller import WARM_UP_STEPS, Controller, Pace
from multicor_cli.running.outcome import SilentObserver, Status, StopReason
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.running.signals import STOP_SIGNALS, StopSignals
from multicor_cli.scenario.settings import Output


class Clock:
    """Time that passes by `tick` at every look."""

    def __init__(self, tick: float = 0.0) -> None:
        self.now, self.tick = 0.0, tick

    def __call__(self) -> float:
        self.now += self.tick
        return self.now


class Listener(SilentObserver):
    def __init__(self) -> None:
        self.statuses: list[tuple[int, str, float]] = []

    def stepped(self, status: Status) -> None:
        self.statuses.append((status.state.step, status.stage, status.progress))


def run_all(plan: RunPlan, recorder: MemoryRecorder, engine: FakeEngine) -> StopReason:
    return Controller(plan, engine, recorder, clock=Clock()).run(is_new=True)


@pytest.fixture
def reference() -> tuple[FakeEngine, MemoryRecorder]:
    model = between_planes()
    engine, recorder = FakeEngine(model), MemoryRecorder()
    assert run_all(make_plan(model), recorder, engine) is StopReason.FINISHED
    return engine, recorder


def test_cadences_are_counted_from_the_start_of_each_stage(
    reference: tuple[FakeEngine, MemoryRecorder],
) -> None:
    _, recorder = reference
    # settle: kinetic energy 1, 1/2, 1/4 … falls below 1e-3 after step 11; shear: 0.5 in steps of
    # 0.025; hold: 7 steps.
    steps = [frame[0] for frame in recorder.frames]
    assert steps == [0, 4, 8, 11, 17, 23, 29, 31, 38]
    assert [frame[2] for frame in recorder.frames] == [0, 0, 0, 0, 1, 1, 1, 1, 2]
    assert [row[0] for row in recorder.rows] == [
        0,
        2,
        4,
        6,
        8,
        10,
        11,
        14,
        17,
        20,
        23,
        26,
        29,
        31,
        38,
    ]
    windows = [row[3] for row in recorder.rows]
    assert sum(windows) == 38  # every step lies in exactly one window
    assert windows[:3] == [0, 2, 2]


def test_times_are_products_not_sums(reference: tuple[FakeEngine, MemoryRecorder]) -> None:
    engine, recorder = reference
    assert recorder.frames[3][1] == 11 * 0.01
    assert recorder.frames[-1][1] == 11 * 0.01 + 20 * 0.025 + 7 * 0.5
    assert (engine.state.stage, engine.state.stage_step) == (3, 0)


def test_settings_and_drives_of_each_stage_reach_the_engine(
    reference: tuple[FakeEngine, MemoryRecorder],
) -> None:
    engine, _ = reference
    # Those of the first stage before the first row, too
    assert engine.calls == ["begin", "begin", "begin", "begin"]
    assert engine.settings.max_sweeps == 50_000
    assert engine.state.wall_position[1, 0] == pytest.approx(-0.5)


def test_drives_learn_when_the_stages_began() -> None:
    model = between_planes()
    plan = make_plan(model)
    run_all(plan, MemoryRecorder(), FakeEngine(model))
    assert [stage.drives.starts[-1] for stage in plan.stages] == [
        [0.0],
        [0.0, 0.11],
        [0.0, 0.11, 0.11 + 20 * 0.025],
    ]


@pytest.mark.parametrize("seed", range(6))
def test_resumed_run_equals_uninterrupted_run(
    seed: int, reference: tuple[FakeEngine, MemoryRecorder]
) -> None:
    """Signals, and crashes that lose everything since the last checkpoint, at random steps."""
    rng = random.Random(seed)
    model = between_planes()
    recorder, state, is_new = MemoryRecorder(), None, True
    for _ in range(200):
        engine, stop_signals = FakeEngine(model, state), StopSignals()
        fate, steps = rng.choice(["signal", "crash", "checkpoint"]), rng.randint(1, 9)
        first = engine.state.step

        def act(
            step: int,
            fate: str = fate,
            last: int = first + steps,
            stop_signals: StopSignals = stop_signals,
        ) -> None:
            if fate == "checkpoint":
                stop_signals.is_checkpoint_wanted = True
            elif step == last and fate == "signal":
                stop_signals.stop_signal = signal.SIGINT
            elif step == last:
                raise PhysicsError(step, "crash")

        engine.before_step = act
        try:
            reason = Controller(
                make_plan(model), engine, recorder, stop_signals=stop_signals, clock=Clock()
            ).run(is_new=is_new)
        except PhysicsError:
            reason = None
        if reason is StopReason.FINISHED:
            break
        state, is_new = recorder.rewind(), False
    expected_engine, expected = reference
    assert engine.state.digest() == expected_engine.state.digest()
    assert recorder.frames == expected.frames
    assert recorder.rows == expected.rows


@pytest.mark.parametrize("last", [0, 1, 11, 12, 30, 31, 37])
def test_interrupted_step_leaves_the_state_of_the_step_before(last: int) -> None:
    """Also in the first step of a stage, whose drives have been set by then (steps 11 and 31)."""
    model = between_planes()
    engine, recorder, stop_signals = FakeEngine(model), MemoryRecorder(), StopSignals()

    def act(step: int) -> None:
        if step == last:
            stop_signals.stop_signal = signal.SIGTERM

    engine.before_step = act
    reason = Controller(
        make_plan(model), engine, recorder, stop_signals=stop_signals, clock=Clock()
    ).run(is_new=True)
    assert reason is StopReason.TERMINATED
    state = recorder.rewind()
    assert state.step == last
    resumed = FakeEngine(model, state)
    assert (
        Controller(make_plan(model), resumed, recorder, clock=Clock()).run(is_new=False)
        is StopReason.FINISHED
    )
    straight = FakeEngine(model)
    run_all(make_plan(model), MemoryRecorder(), straight)
    assert resumed.state.digest() == straight.state.digest()


def test_signal_during_the_first_step_waits_where_the_process_is_not_ours() -> None:
    model = between_planes()
    engine, recorder, stop_signals = FakeEngine(model), MemoryRecorder(), StopSignals()
    engine.before_step = lambda _step: stop_signals._on_stop(signal.SIGINT, None)
    reason = Controller(
        make_plan(model), engine, recorder, stop_signals=stop_signals, clock=Clock()
    ).run(is_new=True)
    assert reason is StopReason.INTERRUPTED
    assert engine.state.step == recorder.rewind().step == 0


def test_time_limit_stops_with_a_checkpoint() -> None:
    model = between_planes()
    engine, recorder = FakeEngine(model), MemoryRecorder()
    controller = Controller(
        make_plan(model), engine, recorder, deadline=50.0, clock=Clock(tick=1.0)
    )
    assert controller.run(is_new=True) is StopReason.TIME_LIMIT
    assert 0 < engine.state.step < 38
    assert recorder.checkpoints[-1][0].digest() == engine.state.digest()


class SlowRecorder(MemoryRecorder):
    """Takes some time to write a checkpoint."""

    def __init__(self, clock: Clock, seconds: float) -> None:
        super().__init__()
        self.clock, self.seconds = clock, seconds

    def checkpoint(self, state: State) -> None:
        super().checkpoint(state)
        self.clock.now += self.seconds


def test_slow_checkpoints_are_rare() -> None:
    model = between_planes()
    recorder = SlowRecorder(Clock(), 1.5)
    engine = FakeEngine(model)
    engine.before_step = lambda _step: setattr(recorder.clock, "now", recorder.clock.now + 3.0)
    Controller(
        make_plan(model, checkpoint_interval=10.0), engine, recorder, clock=recorder.clock
    ).run(is_new=True)
    # 30 s apart: 20 times 1.5 s
    assert [checkpoint[0].step for checkpoint in recorder.checkpoints] == [0, 10, 20, 30, 38]


def test_checkpoints_follow_the_wall_clock() -> None:
    model = between_planes()
    recorder = SlowRecorder(Clock(), 0.01)
    plan = make_plan(model, checkpoint_interval=10.0)
    engine = FakeEngine(model)
    engine.before_step = lambda _step: setattr(recorder.clock, "now", recorder.clock.now + 3.0)
    Controller(plan, engine, recorder, clock=recorder.clock).run(is_new=True)
    assert [checkpoint[0].step for checkpoint in recorder.checkpoints] == [*range(0, 38, 4), 38]
    never = MemoryRecorder()
    run_all(make_plan(model), never, FakeEngine(model))
    # The start and the end
    assert [checkpoint[0].step for checkpoint in never.checkpoints] == [0, 38]
    assert never.frames == recorder.frames
    assert never.rows == recorder.rows


def test_checkpoint_on_request_goes_on() -> None:
    model = between_planes()
    engine, recorder, stop_signals = FakeEngine(model), MemoryRecorder(), StopSignals()

    def act(step: int) -> None:
        if step == 5:
            stop_signals._on_checkpoint(signal.SIGUSR1, None)

    engine.before_step = act
    assert (
        Controller(make_plan(model), engine, recorder, stop_signals=stop_signals, clock=Clock())
        .run(is_new=True)
        .is_end
    )
    assert [checkpoint[0].step for checkpoint in recorder.checkpoints] == [0, 6, 38]


def test_physics_error_keeps_the_last_checkpoint() -> None:
    model = between_planes()
    engine, recorder = FakeEngine(model), MemoryRecorder()

    def act(step: int) -> None:
        if step == 9:
            raise PhysicsError(step, "the position of grain 1 is not finite")

    engine.before_step = act
    with pytest.raises(PhysicsError, match="step 9: the position of grain 1"):
        run_all(make_plan(model), recorder, engine)
    assert len(recorder.checkpoints) == 1
    assert [frame[0] for frame in recorder.frames] == [0, 4, 8]


def test_finished_state_runs_nothing(reference: tuple[FakeEngine, MemoryRecorder]) -> None:
    engine, recorder = reference
    again = Controller(make_plan(engine.model), engine, recorder, clock=Clock())
    frames = list(recorder.frames)
    assert again.run(is_new=False) is StopReason.FINISHED
    assert recorder.frames == frames


def test_observer_sees_every_step_and_a_progress_that_grows() -> None:
    model = between_planes()
    listener = Listener()
    Controller(
        make_plan(model), FakeEngine(model), MemoryRecorder(), observer=listener, clock=Clock()
    ).run(is_new=True)
    assert [step for step, _, _ in listener.statuses] == list(range(1, 39))
    progress = [p for _, _, p in listener.statuses]
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert {name for _, name, _ in listener.statuses} == {"settle", "shear", "hold"}


def test_strain_counts_to_and_fro() -> None:
    model = between_planes()
    condition = strain_reached(Spacing.between(model, "bottom", "top"), 1.0)
    state = State.at_rest(model, np.zeros((2, 2)))
    for shift in (0.1, -0.1, 0.1):
        before = state.wall_position.copy()
        state.wall_position[1, 0] += shift
        state.wall_position[1, 1] = 1.0  # twice as far apart
        condition.note(state, StepDone(0.1, before, np.zeros((2, 3))))
    assert condition.value(state) == pytest.approx(0.15)


def test_strain_and_peak_begin_anew_in_each_stage() -> None:
    model = between_planes()
    until = strain_reached(Spacing.between(model, "bottom", "top"), 0.5)
    stages = tuple(
        StagePlan(name, 0.025, None, until, 100, 100, Settings(), shear(1.0))
        for name in ("forth", "on")
    )
    engine, recorder = FakeEngine(model), MemoryRecorder()
    run_all(
        RunPlan("twice", stages, Output(frame_interval=1.0, checkpoint_interval=1e9)),
        recorder,
        engine,
    )
    assert [frame[0] for frame in recorder.frames] == [0, 20, 40]
    assert (engine.state.stage_strain, engine.state.stage_peak) == (0.0, 0.0)


def test_a_spacing_refuses_unknown_and_equal_walls() -> None:
    model = between_planes()
    with pytest.raises(ValueError, match="no wall 'lid'"):
        Spacing.between(model, "bottom", "lid")
    with pytest.raises(ValueError, match="between 'top' and itself"):
        Spacing.between(model, "top", "top")
    assert wall_places(model, 1).tolist() == [0.0, 1.0]


def test_strain_goal_survives_rounding() -> None:
    condition = strain_reached(Spacing(0, 1, 1, 1.0), 1.5)
    state = State.at_rest(between_planes(), np.zeros((2, 2)))
    for _ in range(15_000):
        state.stage_strain += 1e-4
    assert state.stage_strain != 1.5
    assert condition.holds(state)
    state.stage_strain -= 1e-4
    assert not condition.holds(state)


def test_rest_needs_motion_first_and_knows_the_initial_energy() -> None:
    state = State.at_rest(between_planes(), np.zeros((2, 2)))
    rest = rest_reached(0.1)
    assert not rest.holds(state)
    state.step = 1
    state.books[BOOK_NAMES.index("kinetic_start")] = 10.0
    state.books[BOOK_NAMES.index("kinetic")] = 1.5
    update_peak(state)
    assert state.stage_peak == 10.0
    assert not rest.holds(state)
    state.books[BOOK_NAMES.index("kinetic")] = 1.0
    assert rest.holds(state)


def test_progress_by_steps_where_their_number_is_known() -> None:
    stages = tuple(
        StagePlan(name, 0.1, limit, None, 1, 1, Settings(), shear(1.0))
        for name, limit in (("a", 10), ("b", 30))
    )
    plan = RunPlan("p", stages, Output(frame_interval=1.0))
    state = State.at_rest(between_planes(), np.zeros((2, 2)))
    state.stage, state.stage_step = 1, 15
    assert plan.progress(state, [10, 30]) == pytest.approx(25 / 40)
    assert plan.progress(state, [10, 6]) == pytest.approx(13 / 16)  # foreseen by a condition
    state.stage, state.stage_step = 2, 0
    assert plan.progress(state, [10, 30]) == 1.0


def test_pace_leaves_out_compilation() -> None:
    pace = Pace()
    pace.note(100.0, WARM_UP_STEPS - 1, 0.1)  # a hundred seconds of compilation
    assert pace.speed() is None
    assert pace.remaining() is None
    for k in range(21):
        pace.note(100.0 + k, 10 + 5 * k, 0.1 + 0.01 * k)
    assert pace.speed() == pytest.approx(5.0)
    assert pace.remaining() == pytest.approx(70.0)


def test_stop_signals_are_collected_and_handlers_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    stop_signals = StopSignals()
    with stop_signals.installed():
        signal.raise_signal(signal.SIGUSR1)
        assert stop_signals.is_checkpoint_wanted
        assert not stop_signals.should_stop()
        signal.raise_signal(signal.SIGTERM)
        assert stop_signals.stop_signal == signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize("number", STOP_SIGNALS)
@pytest.mark.parametrize("when", ["before", "inside"])
def test_a_process_that_exits_at_once_says_why(number: signal.Signals, when: str, capfd) -> None:
    child = os.fork()
    if child == 0:
        signal.signal(number, signal.SIG_DFL)
        stop_signals = StopSignals(may_exit=True)
        stop_signals.on_exit = lambda number: os.write(1, b"farewell %d" % number)
        with stop_signals.installed():
            if when == "before":
                signal.raise_signal(number)
            with stop_signals.exit_at_once():
                if when == "inside":
                    signal.raise_signal(number)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 128 + number
    assert capfd.readouterr().out == f"farewell {number}"


def test_second_signal_ends_the_process_at_once_also_during_its_farewell(capfd) -> None:
    child = os.fork()
    if child == 0:
        stop_signals = StopSignals(may_exit=True)

        def on_exit(_number: int) -> None:
            signal.raise_signal(signal.SIGTERM)
            os.write(1, b"not reached")

        stop_signals.on_exit = on_exit
        with stop_signals.installed(), stop_signals.exit_at_once():
            signal.raise_signal(signal.SIGINT)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 143
    assert capfd.readouterr().out == ""


def test_ignored_hangup_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        stop_signals = StopSignals()
        with stop_signals.installed():
            signal.raise_signal(signal.SIGHUP)
        assert not stop_signals.should_stop()
    finally:
        signal.signal(signal.SIGHUP, before)


def test_reasons_have_exit_codes() -> None:
    codes = {reason: reason.exit_code for reason in StopReason}
    assert codes[StopReason.INTERRUPTED] == 130
    assert codes[StopReason.TERMINATED] == 143
    assert codes[StopReason.HUNG_UP] == 129
    assert codes[StopReason.TIME_LIMIT] == 75
    assert codes[StopReason.FINISHED] == codes[StopReason.ALREADY_FINISHED] == 0
    assert StopReason.of_signal(signal.SIGTERM) is StopReason.TERMINATED

"""One session of a run in this process: how it ends, what ``run.json`` says, and that a resumed run
is the same run."""

import json
import shutil
import signal
import threading
from pathlib import Path

import pytest
from run_fakes import StopAt
from scenes import SMALL, changed, write_small

from multicor_cli import run as run_scenario
from multicor_cli.engine import PhysicsError
from multicor_cli.packing import build, place
from multicor_cli.running import session as session_module
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.outcome import QuietObserver, StopReason, exit_code_of
from multicor_cli.running.session import stage_starts
from multicor_cli.scenario import load_scenario, parse_scenario
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import DamagedRun, StorageFull, open_run, run_info

KEPT = """
[[loading]]
name = "back"
duration = 0.004
drives.bottom = { x = { velocity = 0.0 } }
"""


class Recorder(QuietObserver):
    def __init__(self):
        self.messages, self.warnings, self.steps, self.is_closed = [], [], [], False

    def message(self, text):
        self.messages.append(text)

    def warning(self, text):
        self.warnings.append(text)

    def stepped(self, status):
        self.steps.append(status.state.step)

    def closed(self):
        self.is_closed = True


def stop_at(monkeypatch, step, act):
    """Do something when the engine is about to take a step."""
    original = session_module.Engine.step

    def stepping(self, *arguments, **options):
        if self.state.step == step:
            act(self)
        return original(self, *arguments, **options)

    monkeypatch.setattr(session_module.Engine, "step", stepping)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """The small scenario with a fourth stage: the lid of the second one's ramp goes on through two
    stages."""
    text = changed(SMALL, ("[solver]", KEPT + "\n[solver]"))
    return write_small(tmp_path_factory.mktemp("scenario"), text)


@pytest.fixture(scope="module")
def reference(path):
    outcome = run_scenario(path, path.parent / "reference")
    assert outcome.reason is StopReason.FINISHED
    return outcome


def digest(directory):
    return run_info(directory)["data_digest"]


@pytest.mark.parametrize("step", [0, 1, 17])
def test_stopped_run_goes_on_as_if_nothing_had_happened(step, path, reference, tmp_path):
    outcome = run_scenario(path, tmp_path / "run", observer=StopAt(step))
    assert outcome.reason is StopReason.TERMINATED
    assert outcome.step <= step + 1
    assert run_info(tmp_path / "run")["status"] == "stopped"
    observer = Recorder()
    assert run_scenario(path, tmp_path / "run", observer=observer).is_finished
    assert any("continuing from step" in text for text in observer.messages)
    assert digest(tmp_path / "run") == digest(reference.directory)


@pytest.mark.parametrize("back", [1, 5, 25])
def test_signals_kept_from_an_earlier_stage_survive_a_resume(back, path, reference, tmp_path):
    """In the last stages the lid follows a ramp that began two stages before, at a time that only
    the frames tell."""
    observer = StopAt(reference.step - back, signal.SIGINT)
    stopped = run_scenario(path, tmp_path / "run", observer=observer)
    assert stopped.reason is StopReason.INTERRUPTED
    assert run_scenario(path, tmp_path / "run").is_finished
    assert digest(tmp_path / "run") == digest(reference.directory)


def test_stage_starts_are_read_from_the_frames(path, reference):
    with open_run(reference.directory) as run:
        state = run.state()
        stages, times = run.frames.stage, run.frames.time
    scenario = load_scenario(path)
    plan = make_plan(scenario, build(scenario)[0])
    starts = stage_starts(reference.directory, state, plan)
    assert starts == [0.0, *(float(times[stages == k].max()) for k in range(state.stage))]
    assert starts[-1] == state.stage_start


def test_changed_scenario_is_refused_before_anything_is_touched(path, reference):
    before = (reference.directory / "run.json").read_bytes()
    wider = ("size = [0.02, 0.02]", "size = [0.02, 0.03]")
    text = changed(path.read_text(), wider, ("friction = 0.4", "friction = 0.5"))
    with pytest.raises(ScenarioError) as caught:
        run_scenario(parse_scenario(text, path), reference.directory)
    keys = [problem.key for problem in caught.value.problems]
    assert keys == ["domain.size.1", "contacts.0.friction"]
    assert "was 0.02 when the run in" in str(caught.value)
    assert (reference.directory / "run.json").read_bytes() == before


def test_a_changed_variable_is_refused_in_terms_of_the_keys_that_it_changes(path, reference):
    text = changed(
        path.read_text(),
        ("[domain]", "[variables]\nmu = 0.4\n[domain]"),
        ("friction = 0.4", 'friction = "= mu"'),
    )
    same = parse_scenario(text, path)
    assert run_scenario(same, reference.directory).reason is StopReason.ALREADY_FINISHED
    with pytest.raises(ScenarioError) as caught:
        run_scenario(parse_scenario(text, path, ["variables.mu=0.5"]), reference.directory)
    (problem,) = caught.value.problems
    assert problem.key == "contacts.0.friction"
    assert problem.source_line == 'friction = "= mu"'
    assert 'is 0.5 now ("= mu")' in problem.message


def test_random_seed_is_drawn_once(path, tmp_path):
    path = write_small(tmp_path, changed(SMALL, ("seed = 3", 'seed = "random"')))
    directory = tmp_path / "run"
    assert not run_scenario(path, directory, observer=StopAt(5)).is_finished
    seed = run_info(directory)["provenance"]["seed"]
    assert load_scenario(path).seed != seed
    assert run_scenario(path, directory).is_finished
    assert run_info(directory)["provenance"]["seed"] == seed
    changed_twice = tmp_path / "changed"
    for _ in range(2):  # a script that is executed again goes on with its run
        scenario = load_scenario(path).with_({"output.frame_interval": 0.004})
        outcome = run_scenario(scenario, changed_twice)
    assert outcome.reason is StopReason.ALREADY_FINISHED
    assert load_scenario(path).with_({"scenario.seed": 5}).seed == 5
    again = tmp_path / "again"
    assert run_scenario(path, again, overrides=[f"scenario.seed={seed}"]).is_finished
    assert digest(again) == digest(directory)


def test_physics_error_keeps_checkpoint_and_frames(path, tmp_path, monkeypatch):
    def fail(_engine):
        raise PhysicsError(25, "the velocity of grain 7 is not finite")

    directory = tmp_path / "run"
    stop_at(monkeypatch, 25, fail)
    with pytest.raises(PhysicsError, match="grain 7"):
        run_scenario(path, directory)
    info = run_info(directory)
    assert (info["status"], info["exit_code"]) == ("failed", 4)
    assert info["stop_reason"] == "step 25: the velocity of grain 7 is not finite"
    with open_run(directory) as run:
        assert run.frames.step.tolist() == [0, 10, 20]
        state = run.state()
        assert state.step == 0


@pytest.mark.parametrize(
    ("error", "code"),
    [(StorageFull(Path("x")), 5), (MemoryError(), 5), (ZeroDivisionError("oops"), 1)],
)
def test_other_failures_are_recorded(error, code, path, tmp_path, monkeypatch):
    def fail(_engine):
        raise error

    with monkeypatch.context() as patch:
        stop_at(patch, 3, fail)
        with pytest.raises(type(error)):
            run_scenario(path, tmp_path / "run")
    assert run_info(tmp_path / "run")["exit_code"] == code == exit_code_of(error)
    assert run_scenario(path, tmp_path / "run").is_finished


def test_signal_while_the_grains_are_placed_waits_for_them(path, tmp_path, monkeypatch):
    """Of Python users, whose process is not ours to end."""

    def place_interrupted(scenario):
        signal.raise_signal(signal.SIGINT)
        return place(scenario)

    monkeypatch.setattr(session_module, "place", place_interrupted)
    outcome = run_scenario(path, tmp_path / "run")
    assert (outcome.reason, outcome.step) == (StopReason.INTERRUPTED, 0)
    monkeypatch.undo()
    assert run_scenario(path, tmp_path / "run").is_finished


def test_domain_too_narrow_for_the_engine_is_a_problem_of_the_scenario(tmp_path):
    text = SMALL.replace("0.02", "0.003").replace("count = 60", "count = 6")
    with pytest.raises(ScenarioError, match=r"the period .* widen the domain"):
        run_scenario(parse_scenario(text, tmp_path / "narrow.toml"), tmp_path / "run")


@pytest.mark.parametrize(("damage", "message"), [
    (Path.unlink, "missing"), (lambda file: file.write_bytes(b"text"), "it was cut or replaced"),
])  # fmt: skip
def test_a_run_without_its_results_is_not_finished(damage, message, path, reference, tmp_path):
    copy = shutil.copytree(reference.directory, tmp_path / "run")
    damage(copy / "results.h5")
    with pytest.raises(DamagedRun, match=message):
        run_scenario(path, copy)


def test_runs_in_other_threads_leave_signals_alone(path, reference, tmp_path):
    before, found = signal.getsignal(signal.SIGINT), []
    worker = threading.Thread(target=lambda: found.append(run_scenario(path, reference.directory)))
    worker.start()
    worker.join()
    assert found[0].reason is StopReason.ALREADY_FINISHED
    assert signal.getsignal(signal.SIGINT) is before


def test_observer_and_heartbeat(path, tmp_path):
    observer = Recorder()
    outcome = run_scenario(path, tmp_path / "run", observer=observer)
    assert observer.steps == list(range(1, outcome.step + 1))
    assert observer.is_closed
    assert any("60 grains, 2 walls" in text for text in observer.messages)
    assert json.loads((tmp_path / "run" / "progress.json").read_text())["step"] == outcome.step


def test_another_version_may_continue_with_a_warning(path, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        stop_at(patch, 3, lambda _engine: signal.raise_signal(signal.SIGINT))
        run_scenario(path, tmp_path / "run")
    monkeypatch.setattr(session_module, "__version__", "9.9.9")
    with monkeypatch.context() as patch:
        stop_at(patch, 6, lambda _engine: signal.raise_signal(signal.SIGINT))
        with pytest.warns(UserWarning, match=r"this is 9\.9\.9"):
            run_scenario(path, tmp_path / "run")
    observer = Recorder()
    assert run_scenario(path, tmp_path / "run", observer=observer).is_finished
    assert any("9.9.9" in text for text in observer.warnings)


def test_overrides_need_a_path(path, tmp_path):
    with pytest.raises(ValueError, match="give them to load_scenario"):
        run_scenario(load_scenario(path), tmp_path / "run", overrides=["solver.dt=1e-4"])

"""A checkpoint holds everything that changes the future, and nothing that cannot be."""

from __future__ import annotations

import signal
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import SMALL, WARM
from store_support import advance, make_model, make_run, start
from trials import trials

from multicor_cli import run as run_scenario
from multicor_cli.model import State
from multicor_cli.running.outcome import SilentObserver, Status
from multicor_cli.running.session import Session
from multicor_cli.store import DamagedRun, RunDirectory, Snapshot, run_info

STOPS = {"small": (SMALL, (45, 90)), "warm": (WARM, (7, 22, 30))}
"""Scenarios that together use all fields, and steps at which they are stopped: after the peak of
kinetic energy of a stage that looks at it, in a later stage; between two rows of the series, in the
frozen stage, after it."""

FIELDS = tuple(f.name for f in fields(State))
FOLLOWS = {
    "time": "is set anew from the start of the stage by the first step",
    "wall_temperature": "is taken anew from the conditions of the walls by the first step",
}
"""Fields without which a run ends in the same bits, and why."""


class StopAt(SilentObserver):
    def __init__(self, step: int) -> None:
        self.step = step

    def stepped(self, status: Status) -> None:
        if status.state.step == self.step:
            signal.raise_signal(signal.SIGTERM)


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    directory = tmp_path_factory.mktemp("ends")
    found = {}
    for name, (text, _) in STOPS.items():
        (directory / f"{name}.toml").write_text(text)
        run_scenario(directory / f"{name}.toml", directory / name)
        found[name] = (
            run_info(directory / name)["state_digest"] + run_info(directory / name)["data_digest"]
        )
    return found


@trials(short=1, long=len(FIELDS))
def test_every_field_counts(
    tmp_path: Path, ends: dict[str, str], monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    """A run that is continued without one of the fields, and only such a run, ends in other bits
    (or does not end).
    """
    carry_on = Session._carry_on
    lost = ""

    def forgetful(
        self: Session, directory: Any, scenario: Any, model: Any, state: State, **options: Any
    ) -> Any:
        if lost and state.step:
            setattr(
                state, lost, getattr(State.at_rest(model, np.zeros((model.grain_count, 2))), lost)
            )
        return carry_on(self, directory, scenario, model, state, **options)

    monkeypatch.setattr(Session, "_carry_on", forgetful)
    chosen = ["", *FIELDS[:: -(-len(FIELDS) // count)]]
    unnoticed = []
    for name in chosen:
        is_noticed = False
        for scenario, (text, steps) in STOPS.items():
            for step in steps:
                run = tmp_path / f"{name or 'none'}-{scenario}-{step}"
                (tmp_path / f"{scenario}.toml").write_text(text)
                lost = ""
                run_scenario(tmp_path / f"{scenario}.toml", run, observer=StopAt(step))
                lost = name
                try:
                    run_scenario(tmp_path / f"{scenario}.toml", run)
                    info = run_info(run)
                    is_noticed |= info["state_digest"] + info["data_digest"] != ends[scenario]
                except Exception:
                    is_noticed = True
                if is_noticed:
                    break
            if is_noticed:
                break
        if is_noticed != (name not in ("", *FOLLOWS)):
            unnoticed.append(name)
    assert not unnoticed, unnoticed


BROKEN = {
    "a contact with a grain that does not exist": {"contact_j": 10**6},
    "a contact with a negative grain": {"contact_i": -1},
    "a value that is not finite": {"velocity": np.nan},
    "an absurd value": {"position": 1e300},
    "a negative stage": {"stage": -1},
    "a stage after the last": {"stage": 100},
}


@pytest.mark.parametrize("what", BROKEN)
def test_states_that_cannot_be_are_refused(tmp_path: Path, what: str) -> None:
    """With right digests, as an attacker may write them who wants the program to read where it
    should not.
    """
    model = make_model()
    with make_run(tmp_path / "run") as run:
        state, writer = start(model), run.writer(model)
        for _ in range(3):
            advance(state, model)
        writer.series_row(Snapshot(state, model))
        (name, value), *_ = BROKEN[what].items()
        before = getattr(state, name)
        if isinstance(before, np.ndarray):
            changed = before.copy()
            changed.reshape(-1)[0] = value
        else:
            changed = value
        run.checkpoint(replace(state, **{name: changed}), writer)
    words = r"does not fit the model|summary\.stage is -1"
    with pytest.raises(DamagedRun, match=words), RunDirectory.resume(tmp_path / "run") as again:
        again.load_checkpoint()

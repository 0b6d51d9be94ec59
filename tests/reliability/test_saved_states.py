"""A checkpoint holds everything that changes the future, and nothing that cannot be."""

from dataclasses import fields, replace

import numpy as np
import pytest
from run_fakes import StopAt
from scenes import SMALL, WARM
from store_support import advance, ends_of, make_model, make_run, start
from trials import trials

from multicor_cli import run as run_scenario
from multicor_cli.model import State
from multicor_cli.running.session import Session
from multicor_cli.store import DamagedRun, RunDirectory, Snapshot

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


@trials(short=1, long=len(FIELDS))
def test_every_field_counts(tmp_path, monkeypatch, count):
    """A run that is continued without one of the fields, and only such a run, ends in other bits
    (or does not end)."""
    carry_on, lost, ends = Session._carry_on, "", {}

    def forgetful(self, directory, scenario, placed, **options):
        if lost and placed.state.step:
            model = placed.model
            empty = State.at_rest(model, np.zeros((model.grain_count, 2)))
            setattr(placed.state, lost, getattr(empty, lost))
        return carry_on(self, directory, scenario, placed, **options)

    monkeypatch.setattr(Session, "_carry_on", forgetful)
    for name, (text, _) in STOPS.items():
        (tmp_path / f"{name}.toml").write_text(text)
        run_scenario(tmp_path / f"{name}.toml", tmp_path / name)
        ends[name] = ends_of(tmp_path / name)

    def is_noticed(name, scenario, step):
        nonlocal lost
        run = tmp_path / f"{name or 'none'}-{scenario}-{step}"
        lost = ""
        run_scenario(tmp_path / f"{scenario}.toml", run, observer=StopAt(step))
        lost = name
        try:
            run_scenario(tmp_path / f"{scenario}.toml", run)
            return ends_of(run) != ends[scenario]
        except Exception:
            return True

    unnoticed = [
        name
        for name in ["", *FIELDS[:: -(-len(FIELDS) // count)]]
        if any(
            is_noticed(name, scenario, step) for scenario in STOPS for step in STOPS[scenario][1]
        )
        != (name not in ("", *FOLLOWS))
    ]
    assert not unnoticed, unnoticed


BROKEN = {
    "a contact with a grain that does not exist": ("contact_j", 10**6),
    "a contact with a negative grain": ("contact_i", -1),
    "a value that is not finite": ("velocity", np.nan),
    "an absurd value": ("position", 1e300),
    "a negative stage": ("stage", -1),
    "a stage after the last": ("stage", 100),
}


@pytest.mark.parametrize("what", BROKEN)
def test_states_that_cannot_be_are_refused(tmp_path, what):
    """With right digests, as an attacker may write them who wants the program to read where it
    should not."""
    model = make_model()
    with make_run(tmp_path / "run") as run:
        state, writer = start(model), run.writer(model)
        for _ in range(3):
            advance(state, model)
        writer.series_row(Snapshot(state, model))
        name, value = BROKEN[what]
        changed = np.array(getattr(state, name))
        changed.reshape(-1)[0] = value
        run.checkpoint(replace(state, **{name: changed if changed.ndim else value}), writer)
    words = r"does not fit the model|summary\.stage is -1"
    with pytest.raises(DamagedRun, match=words), RunDirectory.resume(tmp_path / "run") as again:
        again.load_checkpoint()

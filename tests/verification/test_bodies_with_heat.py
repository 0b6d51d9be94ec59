"""Walls with a heat capacity: one temperature, which what they exchange with the grains and what they rub changes."""

import signal

import numpy as np
import pytest
from heat_parts import coupled_engine, heat_book, make_heat_laws, touching_engine, with_heat
from scene_parts import FLOOR, advance, begin, make_model
from scenes import WARM, changed, write_small

import multicor_cli as multicor
from multicor_cli.engine.heat import integration
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.running import session as session_module
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import run_info

CAPACITY = 3.0
RATE = 2.0 ** (1.0 / 3.0)
"""H [W/K] between a grain of `touching_engine` and a plane, where a* = a."""


def on_a_body(start, initial, **settings):
    engine = touching_engine(
        [[0.0, 1.0]], start, shapes=FLOOR, walls=("floor",), conditions=[WallHeat("capacity", capacity=CAPACITY)], **settings
    )
    engine.state.wall_temperature[0] = initial
    return engine


def after(engine, total, count):
    for k in range(count):
        engine.step(total / count, k * total / count)
    return float(engine.state.temperature(engine.model.thermal)[0]), float(engine.state.wall_temperature[0])


@pytest.mark.parametrize(("integrator", "order"), [("explicit", 3), ("implicit", 2)])
def test_a_grain_and_a_body_reach_a_common_temperature(integrator, order, monkeypatch):
    """ΔT decays with τ = C_1 C_2/((C_1 + C_2) H); the mean by capacity stays."""
    monkeypatch.setattr(integration, "SHARPNESS", 1e-24)
    monkeypatch.setattr(integration, "EULER", 0.0)
    tau = CAPACITY / ((1.0 + CAPACITY) * RATE)
    mean = (300.0 + CAPACITY * 400.0) / (1.0 + CAPACITY)
    grain, body = mean - 75.0 * np.exp(-1.0), mean + 25.0 * np.exp(-1.0)
    errors = []
    for count in (8, 16, 32, 64):
        engine = on_a_body(300.0, 400.0, integrator=integrator, tolerance=1e9)
        found = after(engine, tau, count)
        errors.append(abs(found[0] - grain))
        assert found[0] + CAPACITY * found[1] == pytest.approx(300.0 + CAPACITY * 400.0, rel=1e-14)
        assert abs(found[1] - body) == pytest.approx(errors[-1] / CAPACITY, rel=1e-6, abs=1e-11)
        assert engine.state.wall_heat[0].tolist() == pytest.approx([engine.state.heat[0], 0.0], rel=1e-13)
        assert heat_book(engine.state, "closure") < 1e-14
    ratios = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(ratios - order) < 0.15), ratios


@pytest.mark.parametrize("conduction", ["hertz", "none"])
def test_a_body_gets_its_share_of_the_heat_of_friction(conduction):
    """A grain that slides to rest or to rolling on a body: what the motion lost is in the two, half of it each at first."""
    model = with_heat(make_model([1e-2], FLOOR, ("floor",), friction=0.3, shape="sphere", density=7500.0), 300.0)
    engine = coupled_engine(
        model, [[0.0, 1e-2]], [[1.0, 0.0, 0.0]], [WallHeat("capacity", capacity=0.5, initial=310.0)],
        laws=make_heat_laws(), conduction=conduction,
    )  # fmt: skip
    begin(engine, is_new=np.array([True]))
    state = engine.state
    advance(engine, 1e-4, 2000)
    lost = 0.5 * float(model.grains.mass[0]) - float(0.5 * model.grains.mass[0] * (1.0 + 0.4) * state.velocity[0, 0] ** 2)
    gained = float(state.heat[0]) + 0.5 * (float(state.wall_temperature[0]) - 310.0)
    assert gained == pytest.approx(lost, rel=1e-9)
    assert state.wall_heat[0, 1] == pytest.approx(0.5 * lost, rel=1e-9)
    if conduction == "none":
        assert state.wall_temperature[0] - 310.0 == pytest.approx(0.5 * lost / 0.5, rel=1e-9)


BODY = changed(
    WARM,
    ('name = "shake-again"\n', 'name = "shake-again"\nthermal.floor = { capacity = 2e-3 }\n'),
    ("thermal = { temperature = { sine = { mean = 310.0, amplitude = 10.0, period = 0.05 } } }", "thermal = { capacity = 1e-3 }"),
    ('name = "cold"\n', 'name = "cold"\nthermal.floor = { capacity = 1e-3, initial = 350.0 }\n'),
)
"""A body from the start, then of prescribed temperature, then a body that goes on from there, then one set anew."""


def temperatures(run):
    """The temperature of the floor in each frame, by stage."""
    found = {}
    for frame in run.frames:
        found.setdefault(run.stages[frame.stage], []).append(float(frame.wall_temperature[0]))
    return found


def test_a_body_begins_with_the_temperature_that_is_there(tmp_path):
    multicor.run(write_small(tmp_path, BODY), tmp_path / "run")
    with multicor.open_run(tmp_path / "run") as run:
        floor = temperatures(run)
        assert 293.15 < floor["shake"][-1] < 300.0  # from that of [heat]; the grains are warmer
        assert floor["wait"][-1] == 330.0
        assert 0.0 < abs(floor["shake-again"][-1] - 330.0) < 5.0
        assert floor["cold"][-1] == 350.0  # heat is off
    assert run_info(tmp_path / "run")["heat_closure"] < 1e-13


def run_in(directory):
    directory.mkdir(exist_ok=True)
    return multicor.run(write_small(directory, BODY), directory / "run")


def test_a_body_goes_on_after_a_stop(tmp_path, monkeypatch):
    original = session_module.Engine.step

    def stepping(self, *arguments, **options):
        if self.state.step in (7, 29):
            signal.raise_signal(signal.SIGTERM)
        return original(self, *arguments, **options)

    assert run_in(tmp_path / "whole").is_finished
    with monkeypatch.context() as patch:
        patch.setattr(session_module.Engine, "step", stepping)
        for _ in range(2):
            assert not run_in(tmp_path / "cut").is_finished
    assert run_in(tmp_path / "cut").is_finished
    whole, cut = (run_info(tmp_path / folder / "run") for folder in ("whole", "cut"))
    assert [whole[key] for key in ("state_digest", "data_digest")] == [cut[key] for key in ("state_digest", "data_digest")]


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("{ capacity = 0.0 }", "must be positive"),
        ("{ capacity = 1.0, temperature = 300.0 }", "exactly one of temperature, flow, capacity, insulated"),
        ("{ initial = 300.0 }", "exactly one of"),
        ("{ capacity = 1.0, initial = 20 }", ""),
        ("{ capacity = 1.0, initial = -20 }", "kelvin"),
    ],
)
def test_refused_bodies(condition, words, tmp_path):
    text = changed(
        WARM, ("thermal = { temperature = { sine = { mean = 310.0, amplitude = 10.0, period = 0.05 } } }", f"thermal = {condition}")
    )
    path = write_small(tmp_path, text)
    if not words:
        multicor.load_scenario(path)
        return
    with pytest.raises(ScenarioError, match=words):
        multicor.load_scenario(path)

"""Steps in two calls have the bits of those with Python between their kernels."""

from dataclasses import replace

import numpy as np
import pytest
from digest_cases import CONFIGS, SHIPPED
from scene_parts import advance, copy_of, shear_engine
from scenes import RAIN, SMALL, changed

from multicor_cli.engine.jit.addresses import call, serial, table
from multicor_cli.engine.jit.compile import IS_COMPILING, kernel, parallel_kernel, prange
from multicor_cli.engine.mechanics import Mechanics
from multicor_cli.engine.orders import Interrupted, PhysicsError, Settings
from multicor_cli.running import session
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import begin_stage
from multicor_cli.scenario.scenario import load_scenario

STEPS, DT = 120, 0.02
STRICT = Settings(max_sweeps=1, tolerance_rms=1e-9, on_failure="error")


def steps_of(path, overrides, steps=STEPS):
    """States after each of so many steps, a third of them in each of the first stages."""
    scenario = load_scenario(path, list(overrides))
    placed = session.place(scenario)
    engine = session.make_engine(scenario, placed.model, placed.state, 1)
    plan, states = make_plan(scenario, placed.model, placed.state), []
    for number, stage in enumerate(plan.stages[:3]):
        state = engine.state
        state.stage, state.stage_step, state.stage_start = number, 0, state.time
        begin_stage(engine, stage, [0.0, state.time, state.time][: number + 1])
        for step in range(steps // 3):
            dt = stage.step_after(step)
            engine.step(dt, step * dt)
            states.append({name: np.array(it) for name, it in engine.state.as_dict().items()})
    return states


def counted(monkeypatch):
    """How many steps go either way from now on."""
    ways = {True: 0, False: 0}
    ask = Mechanics._is_plain

    def note(self, step):
        is_plain = ask(self, step)
        ways[is_plain] += 1
        return is_plain

    monkeypatch.setattr(Mechanics, "_is_plain", note)
    return ways


@pytest.mark.parametrize(
    ("source", "least"),
    [
        ("shear", 75),
        ("shear-gravity-free", 35),
        ("column-collapse", 50),
        ("vibrated-bed", 35),
        ("annular-shear", 75),
        (SMALL, 60),
        (changed(SMALL, ("restitution = 0.3", "restitution = 0.0")), 115),
        (changed(SMALL, ("friction = 0.4", "friction = { speed = [0, 1.0], values = [0.4, 0.2] }")), 0),
        (RAIN, 35),
    ],
    ids=(
        "shear", "free", "collapse", "vibrated", "annular", "rebound", "stick", "table", "inflow"
    ),
)  # fmt: skip
def test_bits_are_those_of_the_other_way(source, least, tmp_path, monkeypatch):
    path, overrides = CONFIGS / f"{source}.toml", SHIPPED.get(source, ())
    if "\n" in source:
        path = tmp_path / "scene.toml"
        path.write_text(source)
    with monkeypatch.context() as patch:
        patch.setattr(Mechanics, "_is_plain", lambda self, step: False)
        expected = steps_of(path, overrides)
    ways = counted(monkeypatch)
    for step, (had, has) in enumerate(zip(expected, steps_of(path, overrides), strict=True)):
        for name, value in had.items():
            assert np.array_equal(value, has[name], equal_nan=True), (step, name)
    assert ways[True] >= least, ways
    assert ways[False] >= 1, ways
    assert (ways[True] > 0) == (least > 0), ways


def is_same(one, other):
    both = zip(one.as_dict().items(), other.as_dict().values(), strict=True)
    return [name for (name, a), b in both if not np.array_equal(a, b, equal_nan=True)] == []


def test_a_step_that_fails_leaves_the_state_as_it_was():
    """Stopped or not solved, it can be taken again, with the bits that it would have had."""
    failing, other = shear_engine(), shear_engine()
    usual, failed = other.orders, 0
    for engine in (failing, other):
        advance(engine, DT, 30)
    for step in range(30, 50):
        before = copy_of(failing.state)
        with pytest.raises(Interrupted):
            failing.step(DT, step * DT, lambda: True)
        assert is_same(before, failing.state)
        for engine in (failing, other):
            engine.resume(replace(usual, settings=STRICT))
        try:
            failing.step(DT, step * DT)
        except PhysicsError:
            failed += 1
            assert is_same(before, failing.state)
            for engine in (failing, other):
                engine.resume(usual)
            failing.step(DT, step * DT)
        other.step(DT, step * DT)
        assert is_same(failing.state, other.state)
        for engine in (failing, other):
            engine.resume(usual)
    assert failed > 5


# ---- Kernels that are called where they are


@parallel_kernel
def _halves(values):
    out = np.empty(values.size)
    for k in prange(values.size):
        out[k] = 0.5 * values[k]
    return out


@kernel
def _split(values, at):
    if at > values.size:
        raise ValueError("too far")
    total = 0.0
    for k in range(at):
        total += values[k]
    return total, values[at:].copy()


_halves_alone = serial(_halves)


@kernel
def _both(kernels, values, at):
    first, rest = call(_split, kernels, (values, at))
    return first, call(_halves_alone, kernels, (rest,))


def test_a_kernel_is_called_where_it_is():
    values = np.arange(8.0)
    _halves(values)
    _split(values, 3)
    first, rest = _both(table((_halves, _split)), values, 3)
    assert first == 3.0
    assert rest.tolist() == [1.5, 2.0, 2.5, 3.0, 3.5]
    with pytest.raises(ValueError, match="too far"):
        _both(table((_halves, _split)), values, 9)


@pytest.mark.skipif(not IS_COMPILING, reason="kernels are not compiled")
def test_what_is_not_compiled_for_these_arguments_is_not_called():
    values = np.arange(8.0)
    narrow = values.astype(np.float32)
    _halves(values)
    _split(values, 3)
    known = table((_halves, _split))
    with pytest.raises(LookupError, match="_halves is not compiled"):
        _both(table((_split,)), values, 3)
    with pytest.raises(LookupError, match="_split is not compiled"):
        _both(known[:1], narrow, 3)

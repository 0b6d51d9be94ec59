"""A heated triangular lattice with weight (theory §15.3): mechanics, freezing, conduction."""

import numpy as np
import pytest
from heat_parts import at_temperature, frozen_engine, heat_book, warm_model
from recorded import keep
from scene_parts import FLOOR, copy_of, make_engine

from multicor_cli.engine import Settings
from multicor_cli.engine.heat.gas import Gas

RADIUS, ROWS, COLUMNS, HEIGHT = 1.5e-3, 116, 4, 0.304
ETA = [0.01, 0.03, 0.05, 0.1]


def lattice():
    """Rows of touching spheres, each in the hollows of the one below; periodic in x."""
    d = 2.0 * RADIUS
    k = np.arange(ROWS * COLUMNS)
    row = k // COLUMNS
    x = (k % COLUMNS + 0.5 * (row % 2) + 0.25) * d
    return np.column_stack([x, RADIUS + row * d * np.sqrt(3.0) / 2.0])


@pytest.fixture(scope="module")
def settled():
    """The lattice after three steps to tight tolerances."""
    radius = np.full(ROWS * COLUMNS, RADIUS)
    period = COLUMNS * 2.0 * RADIUS
    model = warm_model(radius, 298.15, FLOOR, friction=0.0, period=period, density=7500.0)
    tight = {"tolerance_rms": 1e-6, "tolerance_max": 1e-4, "tolerance_energy": 1e-6}
    settings = Settings(max_sweeps=50_000, **tight)
    engine = make_engine(model, lattice(), settings=settings)
    for k in range(3):
        assert engine.step(1e-3, k * 1e-3).converged
    return model, engine.state


def theta(model, state, **settings):
    """θ by row after half an hour on a floor 25 K warmer, and the state then."""
    state = copy_of(state)
    frozen_engine(model, state, [at_temperature(323.15)], **settings).step(1800.0, 0.0)
    assert heat_book(state, "closure") < 1e-13
    by_row = ((state.temperature(model.thermal) - 298.15) / 25.0).reshape(ROWS, COLUMNS)
    assert np.ptp(by_row, axis=1).max() < 2e-3
    return by_row.mean(axis=1), state


def test_forces_grow_from_row_to_row(settled):
    """Σ over a row = 2 columns·k m g/√3 with k rows above; one by one they may differ, since
    horizontal contacts may press too."""
    model, state = settled
    weight = model.grains.mass[0] * 9.81
    i, j, force = state.contact_i, state.contact_j, state.contact_impulse[:, 0] / state.last_dt
    inclined = (j < model.grain_count) & (i // COLUMNS != j // COLUMNS)
    by_row = np.bincount(i[inclined] // COLUMNS, weights=force[inclined], minlength=ROWS)
    above, total = ROWS - 1 - np.arange(ROWS - 1), model.grain_count * weight
    expected = 2.0 * COLUMNS * above * weight / np.sqrt(3.0)
    assert by_row[: ROWS - 1] == pytest.approx(expected, abs=1e-3 * total)
    assert force[j >= model.grain_count].sum() == pytest.approx(total, rel=1e-3)


@pytest.mark.parametrize(("settings", "expected"), [
    ({}, [0.7274, 0.4359, 0.2275, 0.0224]),
    ({"mechanisms": (Gas(0.026),)}, [0.9044, 0.7757, 0.6532, 0.3893]),
], ids=["vacuum", "air"])  # fmt: skip
def test_profile(settled, settings, expected, record_property):
    """θ(η) of the exact solution, interpolated between rows: within 0.005."""
    values, _ = theta(*settled, **settings)
    eta = (RADIUS + np.arange(ROWS) * RADIUS * np.sqrt(3.0)) / HEIGHT
    keep(record_property, eta=eta, theta=values, exact_eta=ETA, exact_theta=expected)
    assert np.interp(ETA, eta, values) == pytest.approx(expected, abs=0.005)


def test_the_profile_is_that_of_the_explicit_scheme_and_walls_keep_everything(settled):
    implicit, _ = theta(*settled, tolerance=1e-7)
    explicit, _ = theta(*settled, integrator="explicit", tolerance=1e-7)
    assert explicit == pytest.approx(implicit, abs=2e-6)
    model, state = settled[0], copy_of(settled[1])
    frozen_engine(model, state).step(1800.0, 0.0)
    assert np.abs(state.heat).max() == 0.0


def test_the_paper_s_condition_on_the_gas_fails_in_air(settled):
    """λ_s s/(λ_f a) = 2.66 for a contact of 62 mN, below 1 near the top (theory §15.3)."""
    _, state = theta(*settled, mechanisms=(Gas(0.026),))
    assert 0.0 < heat_book(state, "solid_gas_min") < 1.0
    assert 2.0 < heat_book(state, "solid_gas_max") < 5.0

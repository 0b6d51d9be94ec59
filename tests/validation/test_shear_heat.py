"""Where the heat of a sheared layer goes (theory §15.4): isothermal walls against conduction
measured apart, adiabatic walls.

python -m pytest -m validation tests/validation/test_shear_heat.py -s
"""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import at_temperature, heat_book, make_heat_laws, with_heat
from recorded import keep
from scene_parts import book, copy_of, shear_scene

from multicor_cli.engine import Engine, Orders
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.model import State

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1200)]

SPEED, DT = 0.06, 0.2
"""I = γ̇ √(m/P) is near 0.006: networks last long enough for a frozen one to stand for the moving
ones. At I = 0.06 it does not (the flow stays 15 to 35 % cooler than its frozen networks say, since
contacts come and go faster than heat)."""

BINS, COLUMNS, ROWS, AMBIENT = 12, 12, 12, 300.0


def peak(height, source, conductivity):
    """Largest rise between two isothermal walls, q h²/(8 k_eff)."""
    return source * height * height / (8.0 * conductivity)


def parabola(y, height, source, conductivity):
    """Steady rise at a distance y from the lower wall, q y (h − y)/(2 k_eff)."""
    return source * y * (height - y) / (2.0 * conductivity)


class Layer:
    """A sheared layer between two rough walls, without gravity; mean mass, diameter and pressure
    are 1."""

    def __init__(self, conductivity, conditions, seed):
        layer = {"columns": COLUMNS, "rows": ROWS, "seed": seed, "speed": SPEED}
        model, positions, origins, drives = shear_scene(**layer)
        self.model = with_heat(model, AMBIENT, specific=1.0)
        laws = make_heat_laws(conductivity=conductivity, young=2e6 * (1.0 - 0.3**2), poisson=0.3)
        self.settings = HeatSettings(laws, impact=True)
        self.state = State.at_rest(self.model, positions)
        self.state.wall_position[:] = origins
        self.engine = Engine(self.model, self.state, threads=1, heat=self.settings)
        self.engine.begin(Orders(drives, conditions=conditions))
        self.strain, self.steps = 0.0, 0

    def step(self):
        self.engine.step(DT, self.steps * DT)
        self.steps += 1
        self.strain += SPEED * DT / self.height

    def run(self, strain):
        end = self.strain + strain
        while self.strain < end:
            self.step()

    @property
    def height(self):
        """Between the faces of the walls' grains."""
        return self.state.wall_position[1, 1] - self.state.wall_position[0, 1] - 1.0

    def bins(self):
        y = self.state.position[:, 1] - self.state.wall_position[0, 1] - 0.5
        return np.clip((y / self.height * BINS).astype(int), 0, BINS - 1)

    def rise(self):
        return self.state.temperature(self.model.thermal) - AMBIENT

    def conduct(self):
        """Steady conduction through the frozen grains from a wall 1 K warmer: flow, and mean
        temperature by bin.

        Grains that hang in no network take no part; in the flow they do, and count in its
        temperatures.
        """
        state = copy_of(self.state)
        state.heat[:] = 0.0
        initial = np.full(self.model.grain_count, AMBIENT + 0.5)
        thermal = replace(self.model.thermal, initial_temperature=initial)
        model = replace(self.model, thermal=thermal)
        engine = Engine(model, state, threads=1, heat=self.settings)
        walls = [at_temperature(AMBIENT), at_temperature(AMBIENT + 1.0)]
        engine.resume(Orders(conditions=walls, is_frozen=True))
        engine.step(1e5, 0.0)
        before = state.wall_heat[1, 0]
        engine.step(1e4, 0.0)
        taking_part = state.heat != 0.0
        rise = (state.temperature(model.thermal) - AMBIENT)[taking_part]
        where = self.bins()[taking_part]
        total = np.bincount(where, rise, minlength=BINS), np.bincount(where, minlength=BINS)
        return (state.wall_heat[1, 0] - before) / 1e4, *total


@pytest.mark.parametrize(("conductivity", "seed"), [(20.0, 1), (10.0, 2)])
def test_isothermal_walls(record_property, conductivity, seed):
    """T(y) in the flow = measured source through the resistance of the frozen packing, within 10 %
    in every bin."""
    layer = Layer(conductivity, [at_temperature(AMBIENT)] * 2, seed)
    layer.run(9.0)
    rise, count, source = np.zeros(BINS), np.zeros(BINS), np.zeros(BINS)
    flows, cold, grains, heights, spread, start = [], np.zeros(BINS), np.zeros(BINS), [], [], None
    begin = layer.steps
    while layer.strain < 30.0:
        before = layer.state.generated.copy()
        layer.step()
        where = layer.bins()
        rise += np.bincount(where, layer.rise(), minlength=BINS)
        count += np.bincount(where, minlength=BINS)
        source += np.bincount(where, layer.state.generated - before, minlength=BINS)
        heights.append(layer.height)
        if layer.steps % 200 == 0:
            flow, total, number = layer.conduct()
            flows.append(flow)
            cold += total
            grains += number
            if start is not None:
                spread.append(np.mean((layer.state.position[:, 1] - start) ** 2) / (2.0 * 200 * DT))
            start = layer.state.position[:, 1].copy()
    height, measured = np.mean(heights), rise / count
    source /= (layer.steps - begin) * DT
    resistance = np.diff(np.concatenate([[0.0], cold / grains, [1.0]])) / np.mean(flows)
    below = np.concatenate([[0.0], np.cumsum(source)])
    inflow = (resistance * below).sum() / resistance.sum()
    expected = np.cumsum(resistance * (inflow - below))[:-1]
    middle = slice(BINS // 4, 3 * BINS // 4)
    y = (np.arange(BINS) + 0.5) * height / BINS
    slope = np.polyfit(y[middle], (cold / grains)[middle], 1)[0]
    bulk = np.mean(flows) / layer.model.period / slope
    conduction = bulk * layer.model.period * height / layer.model.thermal.capacity.sum()
    mixing, rate = np.mean(spread), SPEED / height
    relaxation = height**2 / (np.pi**2 * conduction) * rate
    mean_source = source.sum() / (layer.model.period * height)
    # A uniform source between walls that add a resistance of their own: a parabola upon a jump.
    face = 0.5 * (layer.model.period / np.mean(flows) - height / bulk)
    jump = 0.5 * mean_source * height * face
    simple = parabola(y, height, mean_source, bulk) + jump
    print(
        f"\nλ = {conductivity}, I = {rate:.4f}: D_cond = {conduction:.4f}, D_mix = {mixing:.2e} "
        f"({conduction / mixing:.0f} times), relaxation after a strain of {relaxation:.2f}\n"
        f"k_eff {bulk:.4f} ± {np.std(flows) / np.mean(flows) / np.sqrt(len(flows)):.1%}, s h²/(8 "
        f"k_eff) = {peak(height, mean_source, bulk):.4f}, jump at the walls "
        f"{jump:.4f}\nmeasured {np.round(measured, 4)}\n"
        f"expected {np.round(expected, 4)}\nratio    {np.round(measured / expected, 3)}\n"
        f"parabola {np.round(simple, 4)}\nsource   {np.round(source / source.mean(), 3)}"
    )
    profile = {"height": y / height, "rise": measured, "expected": expected}
    keep(record_property, conductivity=conductivity, **profile)
    assert conduction > 20.0 * mixing
    assert relaxation * 5.0 < 9.0
    assert measured == pytest.approx(expected, rel=0.10)
    assert heat_book(layer.state, "closure") < 1e-10


@pytest.mark.parametrize("seed", [1, 2])
def test_adiabatic_walls(seed):
    """Heating = mechanical losses to round-off, and μ* P γ̇/(ρ φ c) within 2 %."""
    layer = Layer(5.0, [WallHeat(), WallHeat()], seed)
    layer.run(3.0)
    state = layer.state
    stored, time = state.heat.sum(), state.time
    generated = sum(heat_book(state, name) for name in ("friction", "impact", "ahead"))
    losses = book(state, "friction_loss") + book(state, "impact_loss")
    state.window_wall_impulse[:] = 0.0
    heights = []
    end = layer.strain + 12.0
    while layer.strain < end:
        layer.step()
        heights.append(layer.height)
    duration, height = state.time - time, np.mean(heights)
    heating = (state.heat.sum() - stored) / duration
    generated = sum(heat_book(state, name) for name in ("friction", "impact", "ahead")) - generated
    lost = (book(state, "friction_loss") + book(state, "impact_loss") - losses) / duration
    assert heating == pytest.approx(generated / duration, rel=1e-10)
    assert heating == pytest.approx(lost, rel=1e-4)
    shear_force, load = -state.window_wall_impulse[1, 0] / duration, layer.model.period
    effective = shear_force / load
    rate = SPEED / height
    capacity = layer.model.thermal.capacity.sum()
    density = capacity / (layer.model.period * height)
    expected = effective * 1.0 * rate / density
    print(
        f"\nμ* = {effective:.4f}, dT/dt = {heating / capacity:.5e}, μ* P γ̇/(ρ φ c) = {expected:.5e}"
    )
    assert heating / capacity == pytest.approx(expected, rel=0.02)
    assert heat_book(state, "closure") < 1e-10

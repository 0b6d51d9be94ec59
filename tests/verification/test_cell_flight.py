"""Grains in flight in a cell, against an event-driven program of their own: real velocities, and
all images."""

import itertools

import numpy as np
import pytest
from cells import flow, loose_cell, make_cell, orders
from heat_parts import make_heat_laws, with_heat
from scene_parts import advance

from multicor_cli.engine import Engine
from multicor_cli.engine.contact.meetings import Air, discs_meet_soon, meets, relative
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.impacts import impact_exchange
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.model.cell import mean_flow, real_velocity
from multicor_cli.model.state import State


def thrown(count=60, *, fraction=0.35, seed=1, speed=0.5, rates=(0.0, 0.0, 0.0), **laws):
    """A gas whose mean flow is that of the cell, with these rates."""
    model, state = loose_cell(count, solid_fraction=fraction, seed=seed, **laws)
    random = np.random.default_rng(seed)
    peculiar = speed * random.normal(size=(count, 2))
    mass = model.grains.mass[:, None]
    state.velocity[:, :2] = peculiar - (mass * peculiar).sum(axis=0) / mass.sum()
    state.velocity[:, 2] = random.normal(size=count)
    state.wall_velocity[0] = rates
    return model, state


class EventDriven:
    """Discs that fly straight, in a lattice of images that the mean flow carries along."""

    def __init__(self, model, state, restitution, friction):
        self.model, self.t, self.impacts = model, 0.0, 0
        width, height, tilt = state.wall_position[0]
        xx, yy, xy = state.wall_velocity[0]
        self.gradient = np.array([[xx, xy], [0.0, yy]])
        self.sides = np.array([[width, tilt], [0.0, height]])  # columns
        self.place = state.position[:, :2].copy()
        self.velocity = real_velocity(model, state)[:, :2].copy()
        self.spin = state.velocity[:, 2].copy()
        self.restitution, self.friction = restitution, friction
        numbers = np.array(list(itertools.product(range(-3, 4), repeat=2)))
        self.images = numbers @ self.sides.T
        i, j = np.triu_indices(len(self.place), 1)
        self.pairs = np.column_stack([i, j])

    def next_meeting(self):
        i, j = self.pairs.T
        away = (self.place[i] - self.place[j])[:, None] - self._now(self.images)
        speed = (self.velocity[i] - self.velocity[j])[:, None] - self.images @ self.gradient.T
        reach = (self.model.grains.radius[i] + self.model.grains.radius[j])[:, None]
        along = (away * speed).sum(axis=-1)
        room = (away**2).sum(axis=-1) - reach**2
        square = along**2 - (speed**2).sum(axis=-1) * room
        with np.errstate(invalid="ignore", divide="ignore"):
            wait = np.where(
                (along < 0.0) & (square > 0.0), room / (np.sqrt(square) - along), np.inf
            )
        wait = np.maximum(wait, 0.0)
        k, image = np.unravel_index(wait.argmin(), wait.shape)
        return wait[k, image], i[k], j[k], away[k, image], speed[k, image]

    def _now(self, images):
        return images + self.t * (images @ self.gradient.T)

    def advance(self, end):
        while True:
            wait, i, j, away, speed = self.next_meeting()
            if self.t + wait >= end:
                break
            self.place += wait * self.velocity
            self.t += wait
            self._hit(i, j, away + wait * speed, speed)
        self.place += (end - self.t) * self.velocity
        self.t = end

    def _hit(self, i, j, away, speed):
        """Restitution along the normal; along the surface what friction allows: β = 2."""
        grains = self.model.grains
        n = away / np.hypot(*away)
        t = np.array([-n[1], n[0]])
        inverse = 1.0 / grains.mass[i] + 1.0 / grains.mass[j]
        slip = speed @ t - grains.radius[i] * self.spin[i] - grains.radius[j] * self.spin[j]
        p_n = -(1.0 + self.restitution) * (speed @ n) / inverse
        p_t = np.clip(-slip / (3.0 * inverse), -self.friction * p_n, self.friction * p_n)
        p = p_n * n + p_t * t
        self.velocity[i] += p / grains.mass[i]
        self.velocity[j] -= p / grains.mass[j]
        for k in (i, j):
            self.spin[k] -= p_t * grains.radius[k] / grains.inertia[k]
        self.impacts += 1


def misses(model, state, reference):
    """How far places, real velocities and spins are from those of the reference, over all images."""
    width, height, tilt = state.wall_position[0]
    off = state.position[:, :2] - reference.place
    up = np.round(off[:, 1] / height)
    off -= up[:, None] * (tilt, height)
    right = np.round(off[:, 0] / width)
    off[:, 0] -= right * width
    images = np.column_stack([right * width + up * tilt, up * height])
    velocity = real_velocity(model, state)
    fast = velocity[:, :2] - reference.velocity - mean_flow(images, state.wall_velocity[0])
    return np.abs(off).max(), np.abs(fast).max(), np.abs(velocity[:, 2] - reference.spin).max()


@pytest.mark.parametrize("dt", [0.3, 0.08])
@pytest.mark.parametrize(
    ("rate", "restitution", "friction"),
    [(0.0, 1.0, 0.0), (0.0, 0.8, 0.4), (0.15, 0.9, 0.0), (-0.1, 0.8, 0.4)],
)
def test_a_gas_is_that_of_an_event_driven_program(rate, restitution, friction, dt):
    """At rest and in simple shear, where ways are straight at any step: impact by impact."""
    laws = {"restitution": restitution, "friction": friction}
    model, state = thrown(rates=(0.0, 0.0, rate), **laws)
    reference = EventDriven(model, state, **laws)
    reference.advance(2.4)
    flow(model, state, orders(None, None, ("velocity", rate)), 2.4, dt=dt)
    assert reference.impacts > 60
    assert max(misses(model, state, reference)) < 1e-9
    books = state.named("books")
    assert books["closure"] < 1e-12
    if restitution == 1.0:
        assert books["impact_loss"] == pytest.approx(0.0, abs=1e-12 * books["kinetic"])


class Conducting(EventDriven):
    """Whose impacts conduct, between grains of these temperatures."""

    def __init__(self, model, state, laws, temperature):
        super().__init__(model, state, 0.9, 0.0)
        self.laws, self.temperature, self.heat = laws, temperature, np.zeros(temperature.size)

    def _hit(self, i, j, away, speed):
        (m, other), (a, b) = self.model.grains.mass[[i, j]], self.model.grains.radius[[i, j]]
        approach = -float(away @ speed) / np.hypot(*away)
        solid = self.laws.conductivity[0], self.laws.volumetric[0]
        heat = (self.temperature[j] - self.temperature[i]) * impact_exchange(
            m * other / (m + other), a * b / (a + b), self.laws.modulus[0, 0], approach,
            *solid, *solid,
        )  # fmt: skip
        self.heat[i] += heat
        self.heat[j] -= heat
        super()._hit(i, j, away, speed)


@pytest.mark.parametrize("dt", [0.3, 0.08])
@pytest.mark.parametrize("rate", [0.0, 0.15])
def test_a_gas_conducts_by_its_impacts(rate, dt):
    """Each with its own speed, however many a step holds."""
    model, cold = thrown(rates=(0.0, 0.0, rate), restitution=0.9, friction=0.0)
    temperature, laws = np.random.default_rng(2).uniform(300.0, 400.0, 60), make_heat_laws()
    model = with_heat(model, temperature, capacity=1e9)
    state = State.at_rest(model, cold.position[:, :2])
    state.velocity[:], state.wall_velocity[:] = cold.velocity, cold.wall_velocity
    state.wall_position[:] = cold.wall_position
    reference = Conducting(model, state, laws, temperature)
    reference.advance(2.4)
    heat = HeatSettings(laws, collisional=True, friction="none")
    engine = Engine(model, state, threads=1, heat=heat)
    engine.begin(orders(None, None, ("velocity", rate)))
    advance(engine, dt, round(2.4 / dt))
    assert reference.impacts > 60
    assert state.heat == pytest.approx(reference.heat, abs=1e-6 * np.abs(reference.heat).max())


def test_straining_is_of_second_order():
    """Where the width grows, real velocities of grains without forces do not stay."""
    rates, errors = (0.04, -0.03, 0.1), []
    start = thrown(20, seed=3, rates=rates, restitution=0.9, friction=0.2)[1]
    ends = []
    for dt in (0.2, 0.05, 0.0125):
        model, _ = thrown(20, seed=3, rates=rates, restitution=0.9, friction=0.2)
        state = State.from_dict({name: np.array(v) for name, v in start.as_dict().items()})
        flow(model, state, orders(*[("velocity", value) for value in rates]), 1.0, dt=dt)
        assert state.named("books")["closure"] < 1e-12
        ends.append(real_velocity(model, state)[:, :2])
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] > 8.0


def test_a_gas_presses_as_its_virial_says():
    """The stress of a gas at rest, impacts and all: Σ m c² and what impacts give over time."""
    model, state = thrown(80, restitution=1.0, friction=0.0)
    _, stress = flow(model, state, orders(), 60.0, dt=0.1)
    temperature = 0.5 * (model.grains.mass * (state.velocity[:, :2] ** 2).sum(axis=1)).sum() / 80
    area = state.wall_position[0, 0] * state.wall_position[0, 1]
    density = (np.pi * model.grains.radius**2).sum() / area
    at_contact = (1.0 - 7.0 / 16.0 * density) / (1.0 - density) ** 2
    expected = 80 * temperature / area * (1.0 + 2.0 * density * at_contact)
    assert stress[:2].mean() == pytest.approx(expected, rel=0.04)
    assert abs(stress[2]) < 0.05 * expected


def test_it_does_not_matter_where_the_sides_are():
    """Shifted, or told by other lattice vectors: the same impacts."""
    laws = {"restitution": 0.8, "friction": 0.3}
    found = []
    for shift, turned in ((0.0, 0.0), False), ((3.1, 5.7), False), ((0.0, 0.0), True):
        model, state = thrown(rates=(0.0, 0.0, 0.2), **laws)
        if turned:
            state.wall_position[0, 2] += state.wall_position[0, 0]
        state.position[:, :2] += shift
        flow(model, state, orders(None, None, ("velocity", 0.2)), 2.0, dt=0.1)
        found.append(state.velocity)
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)
    np.testing.assert_allclose(found[2], found[0], atol=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 2.2, -1.9])
def test_whether_two_meet_is_when_they_do(tilt):
    """Against all images, however far they come in a step."""
    random, nothing, ends = np.random.default_rng(3), np.empty(0, np.int32), []
    sides = np.array([[5.0, tilt], [0.0, 4.0]])
    images = np.array(list(itertools.product(range(-9, 10), repeat=2))) @ sides.T
    for _ in range(2000):
        place, bodies = random.uniform(0.0, 5.0, (2, 3)), random.normal(size=(2, 4))
        rates = random.normal(size=3) * 0.05
        scene = Scene(
            place, random.uniform(0.1, 0.6, 2), np.zeros(2, np.int32), nothing, nothing,
            np.empty((0, 4)), np.empty((0, 3)), 5.0, np.empty(0), 4.0, tilt,
        )  # fmt: skip
        air = Air(scene, rates, None, None, None, 1.0, place, bodies, np.ones(2, np.bool_))
        end = float(random.choice([0.02, 0.3, 2.0]))
        soon = discs_meet_soon(air, 0, 1, end)
        when = meets(air, 0, 1, 0.0, end)
        assert soon == (when < np.inf)
        away = place[0, :2] - place[1, :2] - images
        speed = bodies[0, :2] - bodies[1, :2] - mean_flow(images, rates)
        along, reach = (away * speed).sum(axis=1), scene.radius.sum()
        room = (away**2).sum(axis=1) - reach**2
        square = along**2 - (speed**2).sum(axis=1) * room
        comes = (along < 0.0) & (square > 0.0)
        wait = room[comes] / (np.sqrt(square[comes]) - along[comes])
        first = np.maximum(wait, 0.0).min(initial=np.inf)
        assert when == pytest.approx(first if first < end else np.inf, rel=1e-9, abs=1e-12)
        if 0.0 < when < np.inf:
            dx, dy, _, _ = relative(air, 0, 1, when)
            assert np.hypot(dx, dy) == pytest.approx(reach, rel=1e-9)
        ends.append(soon)
    assert 200 < sum(ends) < 1800


def test_where_a_stress_drives_the_cell_nobody_flies():
    """What gives way to all impacts at once cannot meet them one by one; books close all the same."""
    pressure = "stress", 0.3
    for order in (pressure, pressure, None), (None, pressure, ("velocity", 0.1)):
        model, state = thrown(60, restitution=0.8, friction=0.3)
        engine, _ = flow(model, state, orders(*order), 4.0, dt=0.1)
        assert not (np.signbit(engine.contacts().gap) & (engine.contacts().gap == 0.0)).any()
        assert state.named("books")["closure"] < 1e-12


@pytest.mark.parametrize("threads", [1, 2])
def test_a_gas_goes_on_to_the_same_bits(threads):
    """After a stop anywhere, on any number of threads."""
    shear, digests = orders(None, None, ("velocity", 0.2)), set()
    for stops in ((20,), (7, 13), (1, 18, 1)):
        model, state = thrown(60, rates=(0.0, 0.0, 0.2), restitution=0.8, friction=0.3)
        for k, steps in enumerate(stops):
            state = State.from_dict({name: np.array(v) for name, v in state.as_dict().items()})
            engine = Engine(model, state, threads=threads)
            (engine.resume if k else engine.begin)(shear)
            for _ in range(steps):
                engine.step(0.1, state.time)
        digests.add(state.digest())
    assert len(digests) == 1


def test_two_that_rebound_leave_the_cell_what_it_is():
    """Of a pair that meets head-on across a side the one flies back as the other came."""
    model, state = make_cell(
        [[0.3, 5.0], [9.6, 5.0]], np.full(2, 0.3), (10.0, 10.0), restitution=1.0, friction=0.0
    )
    state.velocity[:, 0] = -1.0, 1.0
    flow(model, state, orders(), 2.0, dt=0.4)
    np.testing.assert_allclose(state.velocity[:, 0], [1.0, -1.0], atol=1e-13)
    np.testing.assert_allclose(state.nonaffine[:, 0], [1.9, -1.9], atol=1e-12)

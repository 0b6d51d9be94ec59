"""Walls with a heat capacity: one temperature, changed by exchange with grains and friction."""

import numpy as np
import pytest
from heat_parts import advanced, coupled_engine, heat_book, make_heat_laws, on_floor, warm_model
from run_fakes import digests, in_pieces
from scenarios import plane, rows_of, scenario
from scene_parts import FLOOR, advance, begin
from scenes import WARM, changed, write_small

import multicor_cli as multicor
from multicor_cli.engine.heat import integration
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.packing import build
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.store import run_info

CAPACITY = 3.0
RATE = 2.0 ** (1.0 / 3.0)
"""H [W/K] between a grain of `on_floor` and the floor."""


@pytest.mark.parametrize(("integrator", "order"), [("explicit", 3), ("implicit", 2)])
def test_a_grain_and_a_body_reach_a_common_temperature(integrator, order, monkeypatch):
    """ΔT decays with τ = C_1 C_2/((C_1 + C_2) H); the mean by capacity stays."""
    monkeypatch.setattr(integration, "SHARPNESS", 1e-24)
    monkeypatch.setattr(integration, "EULER", 0.0)
    tau = CAPACITY / ((1.0 + CAPACITY) * RATE)
    mean = (300.0 + CAPACITY * 400.0) / (1.0 + CAPACITY)
    errors = []
    for count in (8, 16, 32, 64):
        body = WallHeat("capacity", capacity=CAPACITY)
        engine = on_floor(body, integrator=integrator, tolerance=1e9)
        state = engine.state
        state.wall_temperature[0] = 400.0
        (grain,), body = advanced(engine, tau, count), state.wall_temperature[0]
        errors.append(abs(grain - (mean - 75.0 * np.exp(-1.0))))
        assert grain + CAPACITY * body == pytest.approx(300.0 + CAPACITY * 400.0, rel=1e-14)
        error = abs(body - (mean + 25.0 * np.exp(-1.0)))
        assert error == pytest.approx(errors[-1] / CAPACITY, rel=1e-6, abs=1e-11)
        assert state.wall_heat[0].tolist() == pytest.approx([state.heat[0], 0.0], rel=1e-13)
        assert heat_book(state, "closure") < 1e-14
    ratios = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(ratios - order) < 0.15), ratios


@pytest.mark.parametrize("conduction", ["hertz", "none"])
def test_a_body_gets_its_share_of_the_heat_of_friction(conduction):
    """Sliding to rest or rolling on a body: lost energy is in both, half of it each at first."""
    model = warm_model([1e-2], shapes=FLOOR, friction=0.3, density=7500.0)
    engine = coupled_engine(
        model, [[0.0, 1e-2]], [[1.0, 0.0, 0.0]],
        [WallHeat("capacity", capacity=0.5, initial=310.0)],
        laws=make_heat_laws(), conduction=conduction,
    )  # fmt: skip
    begin(engine, is_new=np.array([True]))
    state = engine.state
    advance(engine, 1e-4, 2000)
    lost = 0.5 * float(model.grains.mass[0]) * (1.0 - 1.4 * float(state.velocity[0, 0]) ** 2)
    gained = float(state.heat[0]) + 0.5 * (float(state.wall_temperature[0]) - 310.0)
    assert gained == pytest.approx(lost, rel=1e-9)
    assert state.wall_heat[0, 1] == pytest.approx(0.5 * lost, rel=1e-9)
    if conduction == "none":
        assert state.wall_temperature[0] - 310.0 == pytest.approx(0.5 * lost / 0.5, rel=1e-9)


SINE = "{ temperature = { sine = { mean = 310.0, amplitude = 10.0, period = 0.05 } } }"
BODY = changed(
    WARM,
    ('name = "shake-again"\n', 'name = "shake-again"\nthermal.floor = { capacity = 2e-3 }\n'),
    (SINE, "{ capacity = 1e-3 }"),
    ('name = "cold"\n', 'name = "cold"\nthermal.floor = { capacity = 1e-3, initial = 350.0 }\n'),
)
"""A body, then of prescribed temperature, then a body that goes on from there, then a new one."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The run, and where its scenario is."""
    path = write_small(tmp_path_factory.mktemp("bodies"), BODY)
    assert multicor.run(path, path.parent / "run").is_finished
    return path.parent / "run"


def test_a_body_begins_and_goes_on_with_its_temperature(whole, tmp_path):
    with multicor.open_run(whole) as run:
        floor = {run.stages[frame.stage]: float(frame.wall_temperature[0]) for frame in run.frames}
    assert 293.15 < floor["shake"] < 300.0  # from that of [heat]; the grains are warmer
    assert floor["wait"] == 330.0
    assert 0.0 < abs(floor["shake-again"] - 330.0) < 5.0
    assert floor["cold"] == 350.0  # heat is off
    assert run_info(whole)["heat_closure"] < 1e-13
    path = write_small(tmp_path, BODY)
    assert in_pieces(path, tmp_path / "cut", 7, 29) == digests(whole)


@pytest.mark.parametrize(("condition", "words"), [
    ("{ capacity = 0.0 }", "must be positive"),
    ("{ capacity = 1.0, temperature = 300.0 }", "one of temperature, flow, capacity, insulated"),
    ("{ initial = 300.0 }", "exactly one of"),
    ("{ capacity = 1.0, initial = -20 }", "kelvin"),
])  # fmt: skip
def test_refused_bodies(condition, words):
    """A cold body is none of them."""
    with pytest.raises(ScenarioError, match=words):
        parse_scenario(changed(WARM, (SINE, condition)), "warm.toml")
    parse_scenario(changed(WARM, (SINE, "{ capacity = 1.0, initial = 20 }")), "warm.toml")


def test_a_plate_that_a_grain_hits_is_not_cooled_and_its_debt_goes_on(run):
    """A grain that rolls on a light plate is hit so that the plate's friction gains energy: the plate
    keeps its temperature, and another run knows how far it is ahead.
    """
    a = 1e-3
    reach = a * np.sqrt(2.0) + 1e-7
    rock = {
        "density": 2500.0, "young": 70e9, "poisson": 0.22, "conductivity": 1.0,
        "heat_capacity": 800.0,
    }  # fmt: skip
    told = {
        "materials": {"one": rock, "other": rock, "rock": rock},
        "contacts": [
            {"pair": ["*", "*"], "friction": 0.0}, {"pair": ["one", "rock"], "friction": 0.5},
        ],
        "walls": {"plate": {
            "geometry": plane(), "material": "rock", "thermal": {"capacity": 1e-6, "initial": 300.0},
        }},
        "heat": {"temperature": 300.0, "conduction": "none", "impact": True},
        "gravity": [0.0, 0.0], "dt": 1e-4, "frame_interval": 1e-4,
    }  # fmt: skip
    rolls = rows_of([[0.05, a, a, 0.5, 0.0]]) | {"name": "rolls", "material": "one"}
    hits = rows_of([[0.05 + reach, a + reach, a, -0.6, -0.6]]) | {
        "name": "hits",
        "material": "other",
    }
    first = run(scenario(particles=[rolls, hits], duration=3e-4, **told))
    ahead = first.series["heat_ahead"][-1]
    assert ahead > 1e-9
    assert [frame.wall_temperature[0] for frame in first.frames] == [300.0] * 4
    assert first.info["summary"]["heat_closure"] < 1e-15
    groups = [
        {"name": name, "material": material, "shape": "disc", "packing": {"kind": "start"}}
        for name, material in (("rolls", "one"), ("hits", "other"))
    ]
    told["walls"]["plate"]["thermal"] = {"capacity": 1e-6}
    _, state = build(
        scenario(particles=groups, start={"run": str(first.path)}, duration=1e-4, **told)
    )
    assert state.wall_ahead.tolist() == [pytest.approx(ahead, rel=1e-12)]

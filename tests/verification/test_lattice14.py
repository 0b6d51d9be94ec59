"""Study 4.1, one hot grain among 14: the scenario against closed forms and finite elements."""

import re
import tomllib

import numpy as np
import pytest
from benchmark_modules import benchmark_modules
from places import ROOT

import multicor_cli as multicor
from multicor_cli.store import run_info

CONFIG = ROOT / "configs" / "lattice14.toml"
CELSIUS = 273.15
FORCE, RADIUS = 1.0, 1e-3
WATCHED = [0, 4, 13]  # the paper's grains 1, 5 and 14
END = (100.0 + 13 * 20.0) / 14.0

# T of grains 1, 5, 14 at t = C/H and 5 C/H, by the eigenvectors of the network (theory §15.3).
CLOSED_FORM = {
    (2, 3, 4, 5): {1: (33.9873, 26.8225, 21.3015), 5: (25.8272, 25.7458, 25.5860)},
    (5, 4, 5): {1: (40.9333, 20.6569, 20.4906), 5: (26.3703, 25.0806, 25.0716)},
}
DIGIT = 5e-5  # the values above have four decimals


def hertz_numbers(force=FORCE):
    """H = 2 λ (3 F a*/(4 E*))^⅓ and C = ρ c_p π a² h of the scenario."""
    scenario = tomllib.loads(CONFIG.read_text())
    steel, group = scenario["materials"]["steel"], scenario["particles"][0]
    modulus = steel["young"] / (2.0 * (1.0 - steel["poisson"] ** 2))
    spot = (3.0 * force * 0.5 * RADIUS / (4.0 * modulus)) ** (1.0 / 3.0)
    capacity = steel["density"] * steel["heat_capacity"] * np.pi * RADIUS**2 * group["thickness"]
    return 2.0 * steel["conductivity"] * spot, capacity


def write_rows(path, rows):
    text = "x,y,radius\n"
    for row, count in enumerate(rows):
        height = float(RADIUS * (1.0 + np.sqrt(3.0) * (len(rows) - 1 - row)))
        for k in range(count):
            text += f"{RADIUS * (5 - count + 1 + 2 * k)!r},{height!r},{RADIUS!r}\n"
    path.write_text(text)


def conduct(directory, *overrides):
    """Times [s] and temperatures [°C] of all grains of the frames, and what `info` says."""
    multicor.run(multicor.load_scenario(CONFIG, overrides=list(overrides)), directory)
    with multicor.open_run(directory) as run:
        times = np.array([frame.time for frame in run.frames])
        temperatures = np.array([frame.temperature for frame in run.frames]) - CELSIUS
    return times, temperatures, run_info(directory)


def durations(count):
    """Overrides for a run of ``count`` times C/H with a frame after each."""
    conductance, capacity = hertz_numbers()
    unit = capacity / conductance
    return [f"loading.0.duration={count * unit!r}", f"output.frame_interval={unit!r}"]


@pytest.mark.parametrize("rows", CLOSED_FORM)
def test_closed_form_of_the_network(rows, tmp_path):
    """dT_i/dt = H/C Σ_j (T_j − T_i); the implicit method to its tolerance."""
    write_rows(tmp_path / "grains.csv", rows)
    grains = f'particles.0.packing.path="{tmp_path}/grains.csv"'
    tight = "heat.tolerance=1e-8"
    times, temperatures, info = conduct(tmp_path / "run", grains, tight, *durations(5))
    conductance, capacity = hertz_numbers()
    for unit, expected in CLOSED_FORM[rows].items():
        assert times[unit] == pytest.approx(unit * capacity / conductance, rel=1e-12)
        assert temperatures[unit, WATCHED] == pytest.approx(expected, abs=DIGIT + 1e-5)
    assert temperatures.mean(axis=1) == pytest.approx(END, abs=1e-10)
    assert info["heat_closure"] < 1e-12
    assert info["heat"]["max_biot"] == pytest.approx(conductance / (15.0 * RADIUS), rel=1e-12)


def test_all_grains_end_at_the_mean_temperature(tmp_path):
    _, temperatures, _ = conduct(tmp_path / "run", *durations(60))
    assert temperatures[-1] == pytest.approx(END, abs=1e-3)


def test_explicit_integration_stays_within_its_tolerance(tmp_path):
    """With frames only, and with Euler's short steps: each to its tolerance at t = C/H."""
    conductance, capacity = hertz_numbers()
    for steps, tolerance in ((1, 1e-4), (1, 1e-7), (2000, 1e-4)):
        overrides = ['heat.integrator="explicit"', f"heat.tolerance={tolerance}", *durations(1)]
        step = f"loading.0.dt={capacity / conductance / steps!r}"
        _, temperatures, info = conduct(tmp_path / f"{steps}-{tolerance}", step, *overrides)
        error = temperatures[1, WATCHED] - CLOSED_FORM[2, 3, 4, 5][1]
        assert np.abs(error).max() < 10.0 * tolerance * 80.0 + DIGIT
        assert 0.0 < info["heat"]["integration_error"] <= 20.0 * tolerance


@pytest.fixture(scope="module")
def finite_elements():
    """The stored curve (t, T1, T5, T14), and what it holds for: H, C, Bi, b/a."""
    text = (ROOT / "benchmarks" / "lattice14" / "finite_elements.csv").read_text().splitlines()
    head = [float(found[1]) for line in text if (found := re.search(r"^# .*: ([0-9.e+-]+)$", line))]
    rows = [[float(cell) for cell in line.split(",")] for line in text if line[0].isdigit()]
    return np.array(rows), head


def test_stored_curve_holds_for_the_shipped_scenario(finite_elements):
    rows, (conductance, capacity, biot, half_width) = finite_elements
    scenario = tomllib.loads(CONFIG.read_text())
    assert (conductance, capacity) == pytest.approx(hertz_numbers(), rel=1e-9)
    thickness = scenario["particles"][0]["thickness"]
    assert biot == pytest.approx(conductance / (15.0 * thickness), rel=1e-9)
    assert half_width == pytest.approx(np.pi / 48, rel=1e-8)
    assert rows[-1, 0] == scenario["loading"][0]["duration"]


def test_shipped_scenario_against_finite_elements(finite_elements, tmp_path):
    """Same conductance: 1.57 % of 80 K apart, as finite elements add the constriction in the discs.

    With that constriction in the conductance, H_eff = H/(1 + 2 Bi λ h R_0), R_0 = [ln(a/b) + 13/8 −
    ln 2]/(π λ h), the remaining difference is that of one temperature per grain: 0.092 % of 80 K.
    The force for H_eff follows from H ∝ F^⅓.
    """
    rows, (_, _, biot, half_width) = finite_elements
    times, temperatures, info = conduct(tmp_path / "same")
    assert times == pytest.approx(rows[:, 0], abs=1e-9)
    difference = np.abs(temperatures[:, WATCHED] - rows[:, 1:]).max() / 80.0
    assert difference == pytest.approx(0.0157, abs=0.0002)
    assert info["heat_closure"] < 1e-10

    share = 1.0 / (1.0 + 2.0 * biot * (np.log(1.0 / half_width) + 13.0 / 8.0 - np.log(2.0)) / np.pi)
    effective = f"heat.force.prescribed={float(FORCE * share**3)!r}"
    _, temperatures, _ = conduct(tmp_path / "effective", effective)
    assert np.abs(temperatures[:, WATCHED] - rows[:, 1:]).max() / 80.0 < 0.0010


@pytest.fixture
def finite_element_modules():
    pytest.importorskip("skfem")
    with benchmark_modules("lattice14"):
        yield


@pytest.mark.usefixtures("finite_element_modules")
def test_stored_curve_is_what_the_benchmark_computes(finite_elements):
    """With a quarter of the triangles; 10⁻⁴ of 80 K covers the difference (order 3 in the edge)."""
    from disc_mesh import MeshChoice
    from stored import stored_curve

    rows, _ = finite_elements
    _, computed = stored_curve(MeshChoice())
    assert computed == pytest.approx(rows, abs=1e-4 * 80.0)


@pytest.mark.usefixtures("finite_element_modules")
def test_resistances_inside_a_disc():
    """A meshed disc's constriction against its leading order in b, and two with an interface."""
    from constriction import effective_share, measured_resistance, measured_share, own_resistance
    from disc_mesh import MeshChoice
    from finite_elements import make_disc

    disc = make_disc(MeshChoice(halvings=1))
    assert measured_resistance(disc) == pytest.approx(own_resistance(disc.half_width), rel=3e-4)
    share = effective_share(0.1, disc.half_width)
    assert measured_share(disc, 0.1) == pytest.approx(share, rel=3e-4)

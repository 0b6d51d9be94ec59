"""The formulas of heat against the published and independently computed check values, to the digits
given there."""

from itertools import pairwise
from math import inf, pi, sqrt

import pytest
from scipy import integrate

from multicor_cli.engine.contact import law
from multicor_cli.engine.geometry.radii import effective_radius
from multicor_cli.engine.heat import convection, friction, gas, hertz, impacts, radiation

SIX_DIGITS = 5e-6
YOUNG, POISSON, CONDUCTIVITY, DENSITY, HEAT_CAPACITY = 193e9, 0.29, 15.0, 7500.0, 500.0
A = 1.5e-3
AIR = 0.026
VOLUMETRIC = DENSITY * HEAT_CAPACITY
MASS = DENSITY * 4.0 / 3.0 * pi * A**3
MODULUS = hertz.contact_modulus(YOUNG, POISSON, YOUNG, POISSON)
A_EFF = effective_radius(A, A)


def digits(value, rel=SIX_DIGITS):
    return pytest.approx(value, rel=rel, abs=0.0)


def spot(force):
    return hertz.contact_radius(force, A_EFF, MODULUS)


# ---- conduction


def test_contact_modulus_and_effective_radius():
    assert digits(1.05361e11) == MODULUS
    assert digits(0.75e-3, 1e-15) == A_EFF


@pytest.mark.parametrize(("force", "radius", "conductance", "biot"), [
    (1e-3, 1.74776e-6, 5.24327e-5, 0.00233), (1e-2, 3.76543e-6, 0.000112963, 0.005021),
    (0.1, 8.11237e-6, 0.000243371, 0.01082), (1.0, 1.74776e-5, 0.000524327, 0.0233),
    (10.0, 3.76543e-5, 0.00112963, 0.05021),
])  # fmt: skip
def test_hertz_spot_and_its_conductance(force, radius, conductance, biot):
    assert spot(force) == digits(radius)
    harmonic = hertz.harmonic_mean(CONDUCTIVITY, CONDUCTIVITY)
    h = hertz.hertz_conductance(harmonic, spot(force))
    assert h == digits(conductance)
    assert hertz.biot_number(h, CONDUCTIVITY * A) == digits(biot, 5e-4)


def peak_pressure(force):
    """p_0 = 3F/(2π a_c²), Johnson, eq. 4.24."""
    return 1.5 * force / (pi * spot(force) ** 2)


def test_spots_of_hertz_have_known_sizes():
    assert hertz.approach(spot(1.0), A_EFF) == digits(4.07287e-7)
    assert peak_pressure(1.0) == digits(1.56307e9)
    # Load at first yield: p_0 goes as F^⅓
    assert (1.6 * 215e6 / peak_pressure(1.0)) ** 3 == digits(0.0106595)
    # The deflection that is reported for rigid grains is that of the contact spot; δ = (3F/(4E*
    # √a*))^⅔
    delta = (3.0 / (4.0 * MODULUS * sqrt(A_EFF))) ** (2.0 / 3.0)
    assert hertz.relative_deflection(1.0, A, YOUNG, POISSON) == pytest.approx(
        delta / (2.0 * A), rel=1e-13
    )
    assert 2.0 * spot(1.0) / (2.0 * A) == digits(0.0116517)


def test_conductances_of_known_contacts():
    harmonic = hertz.harmonic_mean(15.0, 200.0)
    h = hertz.hertz_conductance(harmonic, spot(1.0))
    assert h == digits(0.000975492)
    assert h / (4.0 * 15.0 * 200.0 / 215.0 * sqrt(pi) * spot(1.0)) == pytest.approx(
        1.0 / 1.77245, rel=SIX_DIGITS
    )
    # R = 1.5 mm, overlap 55.28 nm, λ = 15: 2 λ a_c = 1.9316·10⁻⁴ W/K
    assert hertz.hertz_conductance(15.0, sqrt(A_EFF * 55.28e-9)) == digits(1.9316e-4, 5e-5)


# ---- gas


@pytest.mark.parametrize(("force", "ratio", "conductance", "share"), [
    (1e-3, 0.672214, 0.001618, 30.9), (1e-2, 1.44824, 0.00143, 12.7),
    (0.062, 2.66055, 0.001281, 6.17), (1.0, 6.72214, 0.001053, 2.01),
    (100.0, 31.2014, 0.0006773, 0.278),
])  # fmt: skip
def test_gas_around_a_contact(force, ratio, conductance, share):
    s = spot(force)
    h = gas.parallel_conductance(AIR, A, A, s, 0.0)
    assert gas.solid_to_gas_ratio(CONDUCTIVITY, s, AIR, A) == digits(ratio)
    assert h == digits(conductance, 5e-4)
    assert h / hertz.hertz_conductance(CONDUCTIVITY, s) == digits(share, 4e-3)


def test_gas_models_at_the_bottom_of_the_bed():
    s = spot(0.062)
    parallel = gas.parallel_conductance(AIR, A, A, s, 0.0)
    contact = hertz.hertz_conductance(CONDUCTIVITY, s)
    asymptotic = gas.batchelor_conductance(AIR, CONDUCTIVITY, A_EFF, s, 0.0)
    assert gas.vargas_conductance(AIR, A, s) == digits(0.00113658)
    assert contact == digits(0.000207523)
    assert asymptotic == digits(0.00131814)
    assert asymptotic + contact == digits(0.00152566)
    # Two independent models
    assert asymptotic + contact == pytest.approx(parallel + contact, rel=0.026)
    assert 0.1 * contact / (parallel / AIR) == digits(0.000421353)
    assert gas.batchelor_conductance(AIR, CONDUCTIVITY, A_EFF, 0.0, 0.0) == digits(0.00155792)


def sag(radius, r):
    return 0.0 if radius == inf else r * r / (radius + sqrt(radius**2 - r * r))


def parallel_flux(radius_i, radius_j, s, h):
    """∫ 2πρ dρ/(local gap) from the spot to the rim of the smaller sphere, decade by decade."""
    rim = min(radius_i, radius_j)
    edges = [s]
    while edges[-1] < 0.1 * rim:
        edges.append(10.0 * edges[-1])
    return sum(
        integrate.quad(
            lambda r: 2.0 * pi * r / (h + sag(radius_i, r) + sag(radius_j, r)),
            low,
            high,
            epsrel=1e-11,
            limit=200,
        )[0]
        for low, high in pairwise([*edges, rim])
    )


@pytest.mark.parametrize("h", [0.0, 1e-9, 1e-6, 1e-4, 6e-4])
def test_parallel_flux_is_the_integral(h):
    s = 6.917e-6
    assert gas.parallel_conductance(1.0, A, A, s, h) == pytest.approx(
        parallel_flux(A, A, s, h), rel=1e-9
    )
    assert gas.parallel_conductance_wall(1.0, A, s, h) == pytest.approx(
        parallel_flux(A, inf, s, h), rel=1e-9
    )


@pytest.mark.parametrize(
    ("size_ratio", "error"), [(1.5, 0.016), (2.0, 0.028), (3.0, 0.042), (1e6, 0.08)]
)
def test_parallel_flux_of_unequal_spheres_errs_as_stated(size_ratio, error):
    def excess(s, h):
        return (
            gas.parallel_conductance(1.0, A, size_ratio * A, s, h)
            / parallel_flux(A, size_ratio * A, s, h)
            - 1.0
        )

    open_gaps = [excess(1e-9, h * A) for h in (1e-4, 1e-3, 0.01, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)]
    touching = [excess(s * A, 0.0) for s in (1e-4, 1e-3, 0.01)]
    assert 0.0 < min(open_gaps) < max(open_gaps) < error
    assert 0.0 < min(touching) < max(touching) < 0.5 * error


# ---- radiation


def test_radiation_between_grains():
    emission = radiation.emission_factor(0.3, 0.3)
    area = radiation.sphere_area_factor(emission, A, A)
    assert radiation.linear_coefficient(area, 310.0, 310.0) == digits(8.42872e-6)
    assert radiation.linear_coefficient(area, 310.0, 310.0) == pytest.approx(
        pi * A * A * 4.0 * radiation.STEFAN_BOLTZMANN * 310.0**3 * 0.3 / 1.7, rel=1e-14
    )


def test_view_factor_is_the_crossed_strings():
    """Touching equal cylinders: ½ − 1/π; far ones see each other as a strip of their diameter
    would."""
    assert radiation.cylinder_view_factor(1.0, 1.0, 0.0) == pytest.approx(0.5 - 1.0 / pi, rel=1e-14)
    assert radiation.cylinder_view_factor(1.0, 3.0, 1e4) == pytest.approx(
        3.0 / (pi * 10004.0), rel=1e-6
    )
    one, two = (
        radiation.cylinder_view_factor(1.0, 2.5, 0.3),
        radiation.cylinder_view_factor(2.5, 1.0, 0.3),
    )
    assert one == pytest.approx(2.5 * two, rel=1e-12)  # reciprocity: area times view factor


# ---- rough contact


def test_rough_contact_nearly_doubles_the_resistance():
    radius, sigma, slope, hardness = spot(1.0), sqrt(2.0) * 1e-6, sqrt(2.0) * 0.1, 3e9
    pressure = peak_pressure(1.0)
    macro = 1.0 / hertz.hertz_conductance(CONDUCTIVITY, radius)
    micro = hertz.micro_resistance(radius, pressure, CONDUCTIVITY, sigma, slope, hardness)
    assert macro == digits(1907.21)
    assert micro == digits(1538.03)
    h = hertz.rough_conductance(1.0, radius, MODULUS, A_EFF, CONDUCTIVITY, sigma, slope, hardness)
    assert 1.0 / h == pytest.approx(macro + micro, rel=1e-14)


def test_flat_sides_that_are_rough():
    """Steel under 1 MPa, and squares of 3 mm, 1 mm thick, of it, side by side."""
    rough = sqrt(2.0) * 1e-6, sqrt(2.0) * 0.1, 3e9
    assert hertz.joint_coefficient(1e6, CONDUCTIVITY, *rough) == digits(932.69, 5e-6)
    area, way = 3e-6, 3e-3 / CONDUCTIVITY
    h = hertz.side_conductance(3.0, area, way, CONDUCTIVITY, *rough)
    assert 1.0 / h == pytest.approx(1.0 / (932.69 * area) + way / area, rel=5e-6)
    assert h == digits(0.00235817)


# ---- friction, partition, wear


def test_friction_partition_and_wear():
    assert friction.sliding_power(0.5, 1.0, -0.1) == pytest.approx(0.05, rel=1e-15)
    assert law.softened_friction(0.5, 1e-3, 498.15, 298.15, 0.0, 10.0) == pytest.approx(
        0.4, rel=1e-14
    )
    rock = pi * 1e-6 / 5e-6 * (4e6 * 700.0 / 3e9) ** 2  # Rice 2006, eq. 5
    assert rock == digits(0.547335)
    assert law.weakening_speed(rock, 993.15 - 350.0, 993.15, 293.15) == pytest.approx(0.25 * rock)
    assert law.weakened_friction(0.6, 0.1, rock, 2.0 * rock) == pytest.approx(0.35)
    steel, aluminum = (
        friction.effusivity(15.0, 7500.0, 500.0),
        friction.effusivity(200.0, 2700.0, 900.0),
    )
    assert (steel, aluminum) == (digits(7500.0), digits(22045.4))
    assert friction.first_share(steel, aluminum) == digits(0.253847)
    assert friction.first_share(15.0, 200.0) == digits(0.0697674)
    assert friction.electrothermal_share(15.0, 7.2e-7, 200.0, 2.8e-8) == digits(0.516167)
    assert friction.archard_volume(1e-4 / 2e9, 1.0 * 100.0) == pytest.approx(5e-12, rel=1e-14)


# ---- impacts


def test_impact_of_two_steel_grains():
    time = impacts.impact_time(0.5 * MASS, A_EFF, MODULUS, 0.1)
    radius = impacts.impact_radius(0.5 * MASS, A_EFF, MODULUS, 0.1)
    fo = impacts.fourier_number(CONDUCTIVITY, VOLUMETRIC, time, radius)
    assert time == digits(1.45732e-5)
    assert radius == digits(1.92647e-5)
    assert fo == digits(0.15707, 3e-5)
    assert impacts.impact_coefficient(fo, 1.0) == digits(0.93293)
    assert impacts.impact_coefficient(0.0, 1.0) == digits(0.901066)
    args = 0.5 * MASS, A_EFF, MODULUS, 0.1, CONDUCTIVITY, VOLUMETRIC, CONDUCTIVITY, VOLUMETRIC
    exchange = impacts.impact_exchange(*args)
    assert exchange == digits(1.55715e-8)
    assert exchange / (MASS * HEAT_CAPACITY) == digits(2.93723e-7)


def test_largest_spot_of_an_impact_stores_the_kinetic_energy():
    """½ m v² = (8/15) E* √a* δ^{5/2} with δ = R²/a*."""
    m, v = 0.5 * MASS, 0.1
    radius = impacts.impact_radius(m, A_EFF, MODULUS, v)
    energy = 8.0 / 15.0 * MODULUS * sqrt(A_EFF) * (radius * radius / A_EFF) ** 2.5
    assert energy == pytest.approx(0.5 * m * v * v, rel=1e-13)


def test_impact_of_two_flat_sides():
    """Of steel, 1 mm² and a gram each; without area there is none."""
    time = impacts.flat_time(5e-4, 1e-6, MODULUS)
    assert time == pytest.approx(pi * sqrt(5e-4 / (2.0 * MODULUS * sqrt(1e-6 / pi))), rel=1e-15)
    body = CONDUCTIVITY, VOLUMETRIC
    exchange = impacts.flat_exchange(5e-4, 1e-6, MODULUS, *body, *body)
    effusivity = sqrt(CONDUCTIVITY * VOLUMETRIC)
    assert exchange == pytest.approx(1e-6 * effusivity * sqrt(time / pi), rel=1e-14)
    assert impacts.flat_exchange(5e-4, 0.0, MODULUS, *body, *body) == 0.0


# ---- convection


def test_nusselt_and_reynolds_numbers():
    assert convection.ranz_marshall(100.0, 0.7) == digits(7.32742)
    assert convection.whitaker(100.0, 0.7) == digits(6.58895)
    assert convection.gunn(100.0, 0.7, 0.4) == digits(22.267, 3e-5)
    assert convection.li_mason(100.0, 0.7, 0.4, 3.5) == digits(2.21564)
    assert convection.coefficient_of(2.0, AIR, 2.0 * A) * 4.0 * pi * A * A == digits(0.000490088)
    assert convection.reynolds(-2.0, 3e-3, 1.5e-5) == pytest.approx(400.0)

"""The formulas of heat: limits, symmetry, continuity, and that kernels get what Python gets."""

import ast
from itertools import pairwise
from math import log, pi
from pathlib import Path

import pytest

from multicor_cli.engine.contact import law, rolling
from multicor_cli.engine.geometry import radii
from multicor_cli.engine.heat import (
    convection,
    films,
    friction,
    gas,
    hertz,
    impacts,
    radiation,
    views,
)
from multicor_cli.engine.jit.compile import kernel

AIR, STEEL, A = 0.026, 15.0, 1.5e-3


def test_limits_of_hertz_contacts():
    assert hertz.contact_radius(0.0, 1e-3, 1e11) == 0.0
    assert hertz.contact_radius(-1.0, 1e-3, 1e11) == 0.0
    assert hertz.rough_conductance(0.0, 0.0, 1e11, 1e-3, 15.0, 1e-6, 0.1, 3e9) == 0.0
    assert hertz.rough_conductance(-1.0, 0.0, 1e11, 1e-3, 15.0, 1e-6, 0.1, 3e9) == 0.0
    assert hertz.contact_modulus(1e11, 0.3, 1e11, 0.3) == pytest.approx(
        1e11 / (2.0 * 0.91), rel=1e-15
    )
    assert hertz.harmonic_mean(15.0, 15.0) == 15.0
    assert friction.first_share(3.0, 3.0) == 0.5
    assert friction.electrothermal_share(5.0, 2.0, 5.0, 2.0) == 0.5
    assert hertz.contact_modulus(1e11, 0.3, 1e30, 0.3) == pytest.approx(1e11 / 0.91, rel=1e-15)
    assert radii.effective_radius(A, 1e12) == pytest.approx(A, rel=1e-12)
    assert hertz.harmonic_mean(15.0, 1e-9) == pytest.approx(2e-9, rel=1e-9)


def test_a_circle_is_as_hollow_as_it_is():
    """1/a* = 1/a − 1/R: a plane if it is wide; bounded where the grain fills it."""
    assert radii.cup_radius(A, 4.0 * A) == pytest.approx(4.0 / 3.0 * A)
    assert radii.cup_radius(A, 1e12) == pytest.approx(A, rel=1e-12)
    for filled in (1.005, 1.0, 0.5):
        assert radii.cup_radius(A, filled * A) == radii.LARGEST_CUP * A
    assert radii.cup_radius(A, 1.0101 * A) == pytest.approx(radii.LARGEST_CUP * A, rel=1e-2)


def test_exchanging_the_bodies_changes_nothing():
    assert hertz.contact_modulus(1e11, 0.3, 7e10, 0.2) == hertz.contact_modulus(
        7e10, 0.2, 1e11, 0.3
    )
    assert gas.parallel_conductance(AIR, A, 3 * A, 1e-6, 0.0) == gas.parallel_conductance(
        AIR, 3 * A, A, 1e-6, 0.0
    )
    assert radiation.emission_factor(0.3, 0.8) == pytest.approx(
        radiation.emission_factor(0.8, 0.3), rel=1e-15
    )


@pytest.mark.parametrize(
    "other", [(200.0, 2.43e6), (15.0, 2.43e6), (200.0, 3.75e6), (15.0, 3.75e6)]
)
def test_what_one_body_gains_in_an_impact_the_other_loses(other):
    steel = (15.0, 3.75e6)
    one = impacts.impact_exchange(5e-5, 7.5e-4, 1e11, 0.1, *steel, *other)
    assert one == impacts.impact_exchange(5e-5, 7.5e-4, 1e11, 0.1, *other, *steel)
    assert one > 0.0


def test_impact_of_unlike_bodies_follows_its_parts():
    m, a_eff, modulus, v = 5e-5, 7.5e-4, 1e11, 0.1
    (k_1, v_1), (k_2, v_2) = (200.0, 2.43e6), (15.0, 3.75e6)
    time, radius = (
        impacts.impact_time(m, a_eff, modulus, v),
        impacts.impact_radius(m, a_eff, modulus, v),
    )
    factor = impacts.impact_coefficient(impacts.fourier_number(k_1, v_1, time, radius), v_1 / v_2)
    expected = factor * pi * radius**2 * time**0.5 / ((k_1 * v_1) ** -0.5 + (k_2 * v_2) ** -0.5)
    assert impacts.impact_exchange(m, a_eff, modulus, v, k_2, v_2, k_1, v_1) == pytest.approx(
        expected, rel=1e-13
    )


def test_slow_impacts_exchange_ever_less():
    args = 15.0, 3.75e6, 15.0, 3.75e6
    found = [
        impacts.impact_exchange(5e-5, 7.5e-4, 1e11, v, *args) for v in (0.0, 1e-12, 1e-6, 1e-3, 0.1)
    ]
    assert found[0] == 0.0
    assert found == sorted(found)
    assert impacts.impact_exchange(5e-5, 7.5e-4, 1e11, -0.1, *args) == 0.0
    assert impacts.impact_time(5e-5, 7.5e-4, 1e11, 0.0) == float("inf")


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.5, 0.5547779, 0.554778, 0.7, 1.0])
def test_impact_coefficient_rises_smoothly_with_the_fourier_number(ratio):
    """Also where the quotient of the published form is 0/0 (c = 0.55478), and where its root
    ends."""
    found = [impacts.impact_coefficient(0.05 * k, ratio) for k in range(1000)]
    assert 0.86 < found[0] < 0.91
    assert all(high >= low for low, high in pairwise(found))
    root = 1.0 / 0.435 * found[1]
    c_1 = -2.3 * ratio**2 + 8.909 * ratio - 4.235
    c_2 = 8.169 * ratio**2 - 33.770 * ratio + 24.885
    c_3 = -5.758 * ratio**2 + 24.464 * ratio - 20.511
    # The quadratic it solves
    assert c_1 * root**2 + 2.0 * c_2 * root == pytest.approx(4.0 * (0.05 - c_3), rel=1e-10)


# ---- gas


def test_gap_opens_continuously():
    for s in (0.0, 1e-6):
        touching, open_gap = (gas.parallel_conductance(AIR, A, A, s, h) for h in (0.0, 1e-18))
        assert open_gap == pytest.approx(touching, rel=1e-3)
    for wall in (0.0, -1e-7):
        assert gas.parallel_conductance_wall(AIR, A, 1e-6, wall) == gas.parallel_conductance_wall(
            AIR, A, 1e-6, 0.0
        )
        assert gas.parallel_conductance(AIR, A, A, 1e-6, wall) == gas.parallel_conductance(
            AIR, A, A, 1e-6, 0.0
        )
    assert gas.batchelor_conductance(AIR, STEEL, 0.5 * A, 0.0, 1e-12) == gas.batchelor_conductance(
        AIR, STEEL, 0.5 * A, 0.0, 0.0
    )


@pytest.mark.parametrize("model", ["parallel", "wall", "batchelor"])
def test_conductance_falls_with_the_gap(model):
    formula = {
        "parallel": lambda h: gas.parallel_conductance(AIR, A, 2 * A, 0.0, h),
        "wall": lambda h: gas.parallel_conductance_wall(AIR, A, 0.0, h),
        "batchelor": lambda h: gas.batchelor_conductance(AIR, STEEL, 0.5 * A, 0.0, h),
    }[model]
    found = [formula(1e-12 * 1.1**k) for k in range(240)]
    assert all(low >= high > 0.0 for low, high in pairwise(found))


def test_gas_between_planes_and_spheres():
    """A plane through the middle of a symmetric pair is isothermal: each half conducts twice as
    much."""
    for h in (0.0, 1e-6, 1e-4):
        pair, half = (
            gas.parallel_conductance(AIR, A, A, 1e-6, 2.0 * h),
            gas.parallel_conductance_wall(AIR, A, 1e-6, h),
        )
        assert half == pytest.approx(2.0 * pair, rel=1e-13)
    # h ≫ a: λ_f times the cross-section over the distance
    assert gas.parallel_conductance(AIR, A, A, 0.0, 1e3 * A) == pytest.approx(
        AIR * pi * A * A / (1e3 * A), rel=2e-3
    )


def batchelor_total(eta, ratio=STEEL / AIR):
    s = eta * A / ratio
    return gas.batchelor_conductance(AIR, STEEL, 0.5 * A, s, 0.0) + 2.0 * STEEL * s


def test_batchelor_and_obrien_between_their_limits():
    scale, ratio = pi * A * AIR, STEEL / AIR
    assert batchelor_total(0.5) == pytest.approx(scale * (0.17 * 0.25 + log(ratio**2)), rel=1e-13)
    assert batchelor_total(200.0) == pytest.approx(
        2.0 * scale * (200.0 / pi + log(ratio / 200.0)), rel=1e-13
    )
    found = [batchelor_total(1e-3 * 1.005**k) for k in range(2400)]
    jumps = [abs(high / low - 1.0) for low, high in pairwise(found)]
    assert max(jumps) < 5e-3  # continuous: no step larger than that of η
    # The stated dip at η = π
    assert min(found) > batchelor_total(1e-6) * (1.0 - 0.29 / log(ratio**2))
    assert batchelor_total(pi) < batchelor_total(1e-6)


def test_batchelor_and_obrien_of_separated_spheres():
    ratio = STEEL / AIR
    h = 0.05 * A
    assert gas.batchelor_conductance(AIR, STEEL, 0.5 * A, 0.0, h) == pytest.approx(
        pi * A * AIR * log(21.0), rel=1e-13
    )
    crossing = A / ratio**2  # Λ = 1
    near, far = (
        gas.batchelor_conductance(AIR, STEEL, 0.5 * A, 0.0, crossing * f) for f in (0.999, 1.001)
    )
    assert far == pytest.approx(near, rel=1e-4)


def test_no_gap_is_left_around_a_spot_as_large_as_the_grain():
    assert gas.parallel_conductance(AIR, A, 2 * A, A, 0.0) == 0.0
    assert gas.parallel_conductance_wall(AIR, A, 2 * A, 0.0) == 0.0
    assert gas.batchelor_conductance(AIR, STEEL, 0.5 * A, A, 0.0) == 0.0
    assert gas.vargas_conductance(AIR, A, A) == 0.0


# ---- rough contact


def test_smooth_surfaces_leave_the_hertz_conductance():
    radius = hertz.contact_radius(1.0, 7.5e-4, 1e11)
    smooth = hertz.hertz_conductance(STEEL, radius)
    assert hertz.rough_conductance(
        1.0, radius, 1e11, 7.5e-4, STEEL, 0.0, 0.1, 3e9
    ) == pytest.approx(smooth, rel=1e-15)
    assert hertz.rough_conductance(1.0, radius, 1e11, 7.5e-4, STEEL, 1e-6, 0.1, 3e9) < smooth


# ---- radiation


def exchange(area, T_i, T_j):
    return radiation.linear_coefficient(area, T_i, T_j) * (T_j - T_i)


def test_sides_are_pressed_as_footings_are():
    """No tension: all of a side within its kern, nothing under a force at its end."""
    for nearer, pressed in ((0.5, 1.0), (1.0 / 3.0, 1.0), (0.2, 0.6), (0.0, 0.0), (-1e-18, 0.0)):
        assert hertz.pressed_length(nearer, 1.0) == pytest.approx(pressed, rel=1e-15, abs=0.0)


def test_sides_conduct_by_their_area_and_smooth_ones_straight_through():
    side, rough = hertz.side_conductance, (1e-6, 0.1, 3e9)
    assert side(1.0, 0.0, 1.0, STEEL, *rough) == side(0.0, 1.0, 1.0, STEEL, *rough) == 0.0
    one = side(1.0, 1e-6, 2e-4, STEEL, *rough)
    assert side(2.0, 2e-6, 2e-4, STEEL, *rough) == pytest.approx(2.0 * one, rel=1e-14)
    smooth = side(1.0, 1e-6, 2e-4, STEEL, 0.0, 0.1, 3e9)
    assert smooth == pytest.approx(1e-6 / 2e-4, rel=1e-15)
    assert side(1.0, 1e-6, 2e-4, STEEL, 1e-15, 0.1, 3e9) == pytest.approx(smooth, rel=1e-6)
    # On the same area as a Hertz spot asperities are those of rough spheres, but for the exponent
    radius = hertz.contact_radius(1.0, 7.5e-4, 1e11)
    area, peak = pi * radius * radius, 1.5 / (pi * radius * radius)
    of_side = 1.0 / side(1.0, area, 0.0, STEEL, *rough)
    of_spot = hertz.micro_resistance(radius, peak, STEEL, *rough)
    assert of_side / of_spot == pytest.approx((peak / 1.5 / 3e9) ** 0.01, rel=5e-3)


def test_radiation_is_that_of_stefan_and_boltzmann_and_cancels_nothing():
    assert exchange(2.0, 300.0, 500.0) == -exchange(2.0, 500.0, 300.0)
    expected = 2.0 * radiation.STEFAN_BOLTZMANN * (500.0**4 - 300.0**4)
    assert exchange(2.0, 300.0, 500.0) == pytest.approx(expected, rel=1e-14)
    tiny = 300.0 + 2.0**-30
    assert exchange(1.0, 300.0, tiny) == pytest.approx(
        4.0 * radiation.STEFAN_BOLTZMANN * 300.0**3 * 2.0**-30, rel=1e-9
    )
    assert radiation.emission_factor(0.0, 0.5) == radiation.emission_factor(0.5, 0.0) == 0.0
    assert radiation.emission_factor(1.0, 1.0) == 1.0
    assert radiation.emission_factor(1.0, 0.3) == pytest.approx(0.3, rel=1e-15)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 7.0])
def test_view_factor_falls_with_the_gap(ratio):
    found = [radiation.cylinder_view_factor(1.0, ratio, h) for h in (-0.1, 0.0, 0.1, 1.0, 10.0)]
    assert found[0] == found[1]
    assert found[1:] == sorted(found[1:], reverse=True)
    assert 0.0 < found[-1] < found[0] < 0.5


# ---- convection


@pytest.mark.parametrize(
    "nusselt",
    [
        convection.ranz_marshall,
        convection.whitaker,
        lambda re, pr: convection.li_mason(re, pr, 0.4, 3.5),
    ],
)
def test_a_sphere_in_still_fluid(nusselt):
    assert nusselt(0.0, 0.7) == 2.0
    assert nusselt(50.0, 0.7) > nusselt(10.0, 0.7)


def test_gunn_without_grains_is_two():
    assert convection.gunn(0.0, 0.7, 1.0) == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize(
    ("re", "prandtl", "change"),
    [(200.0, 0.7, -0.0033), (1500.0, 0.7, 0.0038), (1500.0, 1.0, -0.109)],
)
def test_branches_of_li_and_mason_meet_as_stated(re, prandtl, change):
    below, above = (
        convection.li_mason(re * (1.0 - 1e-12), prandtl, 0.4, 4.75) - 2.0,
        convection.li_mason(re, prandtl, 0.4, 4.75) - 2.0,
    )
    assert above / below - 1.0 == pytest.approx(change, abs=5e-4)


# ---- friction and wear


def test_friction_is_cut_to_its_range_and_heats_either_way():
    assert law.softened_friction(0.5, 1e-3, 293.15, 293.15, 0.1, 1.0) == 0.5
    assert law.softened_friction(0.5, 1e-3, 5000.0, 293.15, 0.1, 1.0) == 0.1
    assert law.softened_friction(0.5, -1e-2, 5000.0, 293.15, 0.1, 1.0) == 1.0
    assert law.weakening_speed(0.5, 1200.0, 1200.0, 300.0) == 0.0
    assert law.weakened_friction(0.6, 0.1, 0.5, 0.5) == 0.6
    assert law.weakened_friction(0.6, 0.1, 0.0, 1e-9) == 0.1
    assert friction.sliding_power(0.5, 2.0, 0.1) == friction.sliding_power(0.5, 2.0, -0.1) > 0.0
    assert friction.rubbing_of(2.0, 0.1, 0.0, 0.0) == friction.rubbing_of(2.0, -0.1, 0.0, 0.0) > 0.0
    assert friction.rubbing_of(2.0, 0.1, -1e-9, 0.5) == 0.0  # rounding


# ---- compilation

SAMPLES = {
    "impacts.fourier_number": (15.0, 3.75e6, 1.4e-5, 1.9e-5),
    "impacts.impact_coefficient": (0.157, 0.8),
    "impacts.impact_exchange": (5e-5, 7.5e-4, 1e11, 0.1, 15.0, 3.75e6, 200.0, 2.43e6),
    "impacts.impact_radius": (5e-5, 7.5e-4, 1e11, 0.1),
    "impacts.impact_time": (5e-5, 7.5e-4, 1e11, 0.1),
    "impacts.flat_time": (5e-5, 3e-6, 1e11),
    "impacts.flat_exchange": (5e-5, 3e-6, 1e11, 15.0, 3.75e6, 200.0, 2.43e6),
    "hertz.biot_number": (5e-4, 15.0 * A),
    "hertz.contact_volume": (0.7, 7.5e-4, 1e11),
    "hertz.contact_radius": (0.7, 7.5e-4, 1e11),
    "radii.effective_radius": (A, 2e-3),
    "radii.cup_radius": (A, 4.0 * A),
    "hertz.hertz_conductance": (15.0, 1e-5),
    "convection.coefficient_of": (7.3, AIR, 3e-3),
    "convection.gunn": (100.0, 0.7, 0.4),
    "convection.li_mason": (700.0, 0.7, 0.4, 4.75),
    "convection.ranz_marshall": (100.0, 0.7),
    "convection.reynolds": (-0.3, 3e-3, 1.5e-5),
    "convection.whitaker": (100.0, 0.7),
    "friction.sliding_power": (0.5, 1.0, -0.1),
    "law.softened_friction": (0.5, 1e-3, 400.0, 293.15, 0.1, 1.0),
    "law.weakened_friction": (0.6, 0.1, 0.5, 1.2),
    "law.weakening_speed": (0.5, 500.0, 1000.0, 293.15),
    "gas.batchelor_conductance": (AIR, 15.0, 7.5e-4, 6.9e-6, 0.0),
    "gas.parallel_between": (AIR, A, 1e-5, 0.4 * A, 1e-5),
    "gas.parallel_conductance": (AIR, A, 2e-3, 6.9e-6, 1e-5),
    "gas.parallel_conductance_wall": (AIR, A, 6.9e-6, 1e-5),
    "films.between_lines": (1e-3, 1e-5, 2e-4),
    "films._of_spheres": (AIR, A, 2e-3, 0.0, A, 1.7e-3, 6.9e-6, 1e-5),
    "films._beside": (2e-3, 3e-3, 2e-2),
    "gas.solid_to_gas_ratio": (15.0, 6.9e-6, AIR, A),
    "gas.vargas_conductance": (AIR, A, 6.9e-6),
    "views._within_turn": (-17.3,),
    "radiation.cylinder_view_factor": (A, 2e-3, 1e-4),
    "radiation.linear_coefficient": (7e-6, 300.0, 450.0),
    "radiation.sphere_area_factor": (0.2, A, 2e-3),
    "hertz.pressed_length": (0.2, 1.0),
    "hertz.joint_coefficient": (1e6, 15.0, 1e-6, 0.1, 3e9),
    "hertz.side_conductance": (3.0, 3e-6, 2e-4, 15.0, 1e-6, 0.1, 3e9),
    "hertz.micro_resistance": (1.7e-5, 1.5e9, 15.0, 1e-6, 0.1, 3e9),
    "hertz.rough_conductance": (1.0, 1.7e-5, 1e11, 7.5e-4, 15.0, 1e-6, 0.1, 3e9),
    "friction.archard_volume": (1e-14, 100.0),
    "friction.rubbing_of": (1e-3, -0.1, 2e-5, 0.5),
    "rolling.solve_rolling": (1e-4, 0.1, 5e-5, 2e-4),
    "law.guard_plane": (0.011, 2e-3, -1.0, 0.3, 0.01, 5e-6, 5e-3),
    "law.bias": (1e-5, -0.1, 0.5, 1e-4),
    "law.bipotential_parameter": (1e-3, 3e-4),
    "law.predict_and_correct": (1e-4, 5e-5, -0.1, 0.2, 5e-4, 0.4),
    "law.project_on_cone": (1e-3, 2e-3, 0.4),
    "law.solve_bipotential": (1e-4, 5e-5, -0.1, 0.2, 1e-3, 3e-4, 0.4),
    "law.solve_exact": (1e-4, 5e-5, -0.1, 0.2, 1e-3, 3e-4, 0.4),
    "law._nearest_solution": (1e-4, 5e-5, 0.1, 0.2, 1e3, 2e3, 5e3, 0.8),
    "law._squared_change": (1e-4, -5e-5, 1e3, 200.0, 3e3),
    "law.solve_full": (1e-4, 5e-5, -0.1, 0.2, 1e3, 200.0, 3e3, 0.4),
}

MODULES = [
    convection, films, friction, gas, hertz, impacts, law, radiation, radii, rolling, views,
]  # fmt: skip


def is_scalar_formula(node):
    """Whether a node defines a function of numbers alone that kernels may call."""
    if not isinstance(node, ast.FunctionDef) or [
        ast.unparse(mark) for mark in node.decorator_list
    ] != ["formula"]:
        return False
    return not {ast.unparse(argument.annotation) for argument in node.args.args} - {"float", "int"}


def formulas():
    """Functions of numbers alone that kernels may call, by their names."""
    found = {}
    for module in MODULES:
        for node in ast.parse(Path(module.__file__).read_text()).body:
            if is_scalar_formula(node):
                found[f"{module.__name__.rpartition('.')[2]}.{node.name}"] = getattr(
                    module, node.name
                )
    return found


def test_every_formula_has_a_sample():
    assert set(formulas()) == set(SAMPLES)


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_kernels_get_the_same_bits(name):
    formula = formulas()[name]

    @kernel
    def call(*arguments):
        return formula(*arguments)

    value = formula(*SAMPLES[name])
    assert value != 0.0
    assert call(*SAMPLES[name]) == value

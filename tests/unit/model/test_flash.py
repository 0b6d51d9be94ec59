"""Flash temperatures against the limits of Jaeger, and against heat sources summed up."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy import integrate, special

from multicor_cli.model.flash import flash_rise, spot_conductance, spot_peclet, spot_temperature

STEEL, VOLUMETRIC = 15.0, 7500.0 * 500.0
ALUMINUM = 200.0, 2700.0 * 900.0
SPOT = 17.4776e-6  # of 1 N between steel spheres of 3 mm
BOTH = STEEL, VOLUMETRIC, STEEL, VOLUMETRIC


def moving_source(peclet):
    """ΔT λ/(q a) in the hottest point of a uniform circular source, summed over what it gave before.

    A point source that moves along x at v leaves ``exp(−v (r + x)/2κ)/(4π λ r)`` on the surface
    behind it, twice that on a half-space (Carslaw & Jaeger 1959); here over discs of radius 1,
    in polar coordinates around the point looked at.
    """

    def at(place):
        def along(angle):
            c, s = np.cos(angle), np.sin(angle)
            length = -place * c + sqrt(max(1.0 - (place * s) ** 2, 0.0))
            rate = peclet * (1.0 - c)  # of a source at r in this direction: r + x = r (1 - cos)
            return length * special.exprel(-rate * length) / (2.0 * pi)

        return integrate.quad(along, 0.0, 2.0 * pi, limit=200, epsabs=1e-10)[0]

    return max(at(place) for place in np.linspace(-0.999, 0.0, 60))


def test_a_slow_and_a_fast_spot():
    slow = flash_rise(0.05, SPOT, 0.0, *BOTH)
    assert slow == pytest.approx(0.05 / (pi * SPOT * 2.0 * STEEL), rel=1e-14)
    assert slow == pytest.approx(30.35, abs=0.005)  # docs/explanation/heat.md
    assert flash_rise(0.05, SPOT, 0.1, *BOTH) == pytest.approx(29.13, abs=0.005)
    assert spot_peclet(SPOT, 0.05, STEEL, VOLUMETRIC) == pytest.approx(0.109235, rel=1e-5)
    # Heat that flows straight in while the spot passes: 2 q √(t/π λ ρc), t = 2a/v
    fast, flux = 4e4, 1.0 / (pi * SPOT**2)
    rise = 2.0 * flux * sqrt(2.0 * SPOT / fast / (pi * STEEL * VOLUMETRIC))
    peclet = spot_peclet(SPOT, fast, STEEL, VOLUMETRIC)
    assert peclet > 1e4
    expected = rise / sqrt(1.0 + 4.0 / pi / peclet)
    assert 1.0 / spot_conductance(SPOT, fast, STEEL, VOLUMETRIC) == pytest.approx(expected)


@pytest.mark.parametrize("peclet", [0.0, 0.1, 0.5, 1.0, 2.0, 5.0, 10.0])
def test_between_the_limits_it_is_the_moving_source(peclet):
    """Tian and Kennedy fitted their formula to the integral of a moving source."""
    speed = 2.0 * peclet * STEEL / (VOLUMETRIC * SPOT)
    conductance = spot_conductance(SPOT, speed, STEEL, VOLUMETRIC)
    assert pi * SPOT * STEEL / conductance == pytest.approx(moving_source(peclet), rel=0.025)


def test_bodies_share_the_power():
    """Each takes what makes it as hot as the other; one that takes nothing leaves it all."""
    rise = flash_rise(0.05, SPOT, 0.1, STEEL, VOLUMETRIC, *ALUMINUM)
    into = [spot_conductance(SPOT, 0.05, *body) * rise for body in ((STEEL, VOLUMETRIC), ALUMINUM)]
    assert sum(into) == pytest.approx(0.05)
    swapped = flash_rise(0.05, SPOT, 0.1, *ALUMINUM, STEEL, VOLUMETRIC)
    assert rise == pytest.approx(swapped, rel=1e-15)
    alone = flash_rise(0.05, SPOT, 0.1, STEEL, VOLUMETRIC, 0.0, 0.0)
    assert alone == pytest.approx(2.0 * flash_rise(0.05, SPOT, 0.1, *BOTH))


def test_a_spot_is_equally_hot_in_both_bodies():
    """What flows into each, G_i (T − T_i), adds up to the power; without one, what flows out of the
    warm body flows into the other. To the bit the mean and the flash where both conduct alike.
    """
    for power in (0.0, 0.05):
        spot = spot_temperature(400.0, 300.0, power, SPOT, 0.1, STEEL, VOLUMETRIC, *ALUMINUM)
        into = [
            spot_conductance(SPOT, 0.05, *body) * (spot - warmth)
            for body, warmth in (((STEEL, VOLUMETRIC), 400.0), (ALUMINUM, 300.0))
        ]
        assert sum(into) == pytest.approx(power, abs=1e-13 * into[1])
    slow = spot_temperature(400.0, 300.0, 0.0, SPOT, 0.0, STEEL, VOLUMETRIC, *ALUMINUM)
    assert slow == pytest.approx((15.0 * 400.0 + 200.0 * 300.0) / 215.0, rel=1e-14)
    rise = flash_rise(0.05, SPOT, 0.1, *BOTH)
    assert spot_temperature(400.0, 310.0, 0.05, SPOT, 0.1, *BOTH) == 355.0 + rise
    alone = flash_rise(0.05, SPOT, 0.1, STEEL, VOLUMETRIC, 0.0, 0.0)
    of_one = spot_temperature(400.0, 300.0, 0.05, SPOT, 0.1, STEEL, VOLUMETRIC, 0.0, 0.0)
    assert of_one == pytest.approx(400.0 + alone, rel=1e-15)


def test_of_arrays_and_in_kernels_as_of_numbers():
    from multicor_cli.engine.jit.compile import kernel
    from multicor_cli.engine.jit.formulas import formula

    formula(spot_conductance)
    called = formula(flash_rise)

    @kernel
    def compiled(power, slip):
        return called(power, SPOT, slip, STEEL, VOLUMETRIC, STEEL, VOLUMETRIC)

    power, slip = np.array([0.01, 0.05]), np.array([0.0, 0.3])
    each = [
        flash_rise(p, SPOT, s, *BOTH) for p, s in zip(power.tolist(), slip.tolist(), strict=True)
    ]
    assert flash_rise(power, SPOT, slip, *BOTH).tolist() == each
    assert [compiled(p, s) for p, s in zip(power.tolist(), slip.tolist(), strict=True)] == each

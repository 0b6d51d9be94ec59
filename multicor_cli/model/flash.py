"""Flash temperature of a contact that slides: how hot its spot is, and how much by friction.

Formula: a body over which a spot of radius a moves at speed v, and into which the power P flows
evenly over the spot, is hotter in its hottest point by

    ΔT = 2 q a/(λ √(π (4/π + Pe))),   q = P/(π a²),   Pe = v a/2κ,   κ = λ/ρc.

Both bodies are equally hot there (Blok's postulate), which says how they share the power: of equal
warmth it is P/ΔT = G_i + G_j, with G = P/ΔT of each one. The spot of bodies of unlike warmth has
also the heat that flows through it: T = (G_i T_i + G_j T_j + P)/(G_i + G_j).

Source: X. Tian & F. E. Kennedy, J. Tribol. 116 (1994) 167 (uniform circular source, with 1.273 for
4/π), between the limits of J. C. Jaeger, Proc. R. Soc. NSW 76 (1942) 203: at rest q a/λ (Pe < 1
nearly), and 2 q a/(λ √(π Pe)) for a fast one (Pe > 5), which is heat that flows straight into a
half-space for the time 2a/v; it is within 2.5 % of the integral over a moving source between them.
H. Blok, Proc. Inst. Mech. Eng. 2 (1937) 222.

Validity: a half-space that has been heated for longer than a²/κ (steel: 0.1 ms for a spot of 20
µm), or than the spot takes to pass; smooth elastic bodies, whose spot is one. Of rough ones the
asperities are hotter still. The mean over the spot is 0.85 of the hottest point at rest, 0.61 of
it when fast. The spot is taken to move over both bodies at half of the sliding speed. Where one of
them carries it along, as a pin does, this is exact for slow spots, and too low by up to 1.4 times
in fast ones of one material.

The functions take numbers in kernels, and arrays as well: nothing here but + − × ÷ √.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import TypeVar

import numpy as np

from multicor_cli.model.model import Floats

Number = TypeVar("Number", float, Floats)

_HALF_SPACE = 0.5 * pi * sqrt(pi)


def spot_peclet(radius: Number, speed: Number, conductivity: Number, volumetric: Number) -> Number:
    """Péclet number of a spot ``Pe = v a/2κ``, ``κ = λ/ρc``.

    a [m]; v, at which the spot moves over the body [m/s]; λ [W/(m K)]; ρc [J/(m³ K)].
    """
    return 0.5 * volumetric * radius * speed / conductivity


def spot_conductance(
    radius: Number, speed: Number, conductivity: Number, volumetric: Number
) -> Number:
    """Power into a body per rise of its hottest point ``½ π^(3/2) a λ √(4/π + Pe)`` [W/K].

    Arguments as `spot_peclet`; 0 for a body that conducts nothing.
    """
    square = conductivity * (4.0 / pi * conductivity + 0.5 * volumetric * radius * speed)
    root: Number = np.sqrt(square)
    return _HALF_SPACE * radius * root


def flash_rise(
    power: Number, radius: Number, slip: Number, conductivity_i: Number, volumetric_i: Number,
    conductivity_j: Number, volumetric_j: Number,
) -> Number:  # fmt: skip
    """Rise of a contact over its bodies ``ΔT = P/(G_i + G_j)`` [K], in its hottest point.

    Power of friction P [W], radius of the spot a > 0 [m], sliding speed ≥ 0 [m/s], λ [W/(m K)] and
    ρc [J/(m³ K)] of both bodies. A body that takes no heat has λ = 0, not both.
    """
    speed = 0.5 * slip
    into_i = spot_conductance(radius, speed, conductivity_i, volumetric_i)
    into_j = spot_conductance(radius, speed, conductivity_j, volumetric_j)
    return power / (into_i + into_j)


def spot_temperature(
    first: Number, second: Number, power: Number, radius: Number, slip: Number,
    conductivity_i: Number, volumetric_i: Number, conductivity_j: Number, volumetric_j: Number,
) -> Number:  # fmt: skip
    """Hottest point of a spot ``(G_i T_i + G_j T_j + P)/(G_i + G_j)`` [K].

    T_i and T_j of the bodies [K], else as `flash_rise`; T_j counts nothing if λ_j = 0, and must be
    a number. Of bodies that conduct alike it is ½(T_i + T_j) + ΔT, to the bit.
    """
    speed = 0.5 * slip
    into_i = spot_conductance(radius, speed, conductivity_i, volumetric_i)
    into_j = spot_conductance(radius, speed, conductivity_j, volumetric_j)
    through = 0.5 * (into_i - into_j) * (first - second)
    return 0.5 * (first + second) + (through + power) / (into_i + into_j)

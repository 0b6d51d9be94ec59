"""Heat conducted during one elastic impact.

Formula: contact time ``t_c = 2.87 (m²/(a* E*² v))^⅕``, largest spot ``R = (15 m a*² v²/16E*)^⅕`` with the reduced mass m, and
the heat ``E/ΔT = C π R² √t_c/(b_1^−½ + b_2^−½)``, ``b = ρcλ``, where C(Fo, c) corrects the one-dimensional solution (C = 1
nearly) for the spreading of heat from a spot; ``Fo = λ_1 t_c/(ρ_1 c_1 R²)``, ``c = ρ_1 c_1/(ρ_2 c_2)``.

Source: J. Sun & M. M. Chen, Int. J. Heat Mass Transf. 31 (1988) 969; fit of C by Z. Y. Zhou, A. B. Yu & M. Horio, Chem. Eng. J.
139 (2008) 408.

Validity: elastic, smooth, head-on impact of spheres that touch nothing else meanwhile; Fo of order 1 or less (it is 0.16 for
steel grains of 3 mm at 0.1 m/s, and goes as 1/v). The fit is not symmetric in the two bodies; here body 1 is the one with the
smaller ρc, so that c ≤ 1, where C changes little, and what one body loses the other gains. For c well below 1 the square root
in the fit ends near Fo = 16; beyond, it is held at 0. Lasting contacts carry far more: 3·10⁻⁷ of the heat capacity of such a
grain per impact.
"""

from __future__ import annotations

from math import inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import power
from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.geometry.places import totals_of_places
from multicor_cli.engine.geometry.radii import hertz_radius
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.laws import HeatLaws
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import NORMAL
from multicor_cli.model.model import Floats, Ints


@formula
def impact_time(m_eff: float, a_eff: float, modulus: float, speed: float) -> float:
    """Duration of an elastic impact ``t_c = 2.87 (m²/(a* E*² v))^⅕`` [s] (Hertz); infinite for a speed that is not positive.

    Args:
        m_eff: Reduced mass m_i m_j/(m_i + m_j) [kg].
        a_eff: Effective radius a* [m].
        modulus: Contact modulus E* [Pa].
        speed: Speed of approach v [m/s].
    """
    if speed <= 0.0:
        return inf
    return 2.87 * power(m_eff * m_eff / (a_eff * modulus * modulus * speed), 0.2)


@formula
def impact_radius(m_eff: float, a_eff: float, modulus: float, speed: float) -> float:
    """Largest radius of the contact spot ``R = (15 m a*² v²/(16 E*))^⅕`` [m] (Hertz); arguments as `impact_time`."""
    return power(0.9375 * m_eff * a_eff * a_eff * speed * speed / modulus, 0.2)


@formula
def fourier_number(conductivity: float, volumetric: float, time: float, radius: float) -> float:
    """Fourier number ``Fo = λ t/(ρc R²)``.

    Args:
        conductivity: λ [W/(m K)].
        volumetric: ρ c [J/(m³ K)].
        time: t [s].
        radius: R [m].
    """
    return conductivity * time / (volumetric * radius * radius)


@formula
def impact_coefficient(fo: float, ratio: float) -> float:
    """Correction C of the one-dimensional solution (Zhou, Yu & Horio 2008) from the Fourier number and c = ρ_1 c_1/(ρ_2 c_2).

    ``C = 0.435 (√(C_2² − 4 C_1 (C_3 − Fo)) − C_2)/C_1`` with quadratic C_k(c). Where C_2 > 0 it is written with the conjugate
    root, which is the same number and finite where C_1 = 0.
    """
    c_1 = (-2.300 * ratio + 8.909) * ratio - 4.235
    c_2 = (8.169 * ratio - 33.770) * ratio + 24.885
    c_3 = (-5.758 * ratio + 24.464) * ratio - 20.511
    square = c_2 * c_2 - 4.0 * c_1 * (c_3 - fo)
    if square <= 0.0:
        return -0.435 * c_2 / c_1
    if c_2 > 0.0:
        return 1.74 * (fo - c_3) / (sqrt(square) + c_2)
    return 0.435 * (sqrt(square) - c_2) / c_1


@formula
def impact_exchange(
    m_eff: float,
    a_eff: float,
    modulus: float,
    speed: float,
    conductivity_i: float,
    volumetric_i: float,
    conductivity_j: float,
    volumetric_j: float,
) -> float:
    """Heat conducted by one impact per difference of temperature ``C π R² √t_c/(b_i^−½ + b_j^−½)`` [J/K] (Sun & Chen 1988).

    Symmetric in the two bodies: body 1 of the fit is that with the smaller ρc, at equal ρc that with the larger λ.

    Args:
        m_eff: Reduced mass [kg].
        a_eff: Effective radius a* [m].
        modulus: Contact modulus E* [Pa].
        speed: Speed of approach v [m/s]; 0 exchange if it is not positive.
        conductivity_i: λ_i [W/(m K)].
        volumetric_i: ρ_i c_i [J/(m³ K)].
        conductivity_j: λ_j [W/(m K)].
        volumetric_j: ρ_j c_j [J/(m³ K)].
    """
    if speed <= 0.0:
        return 0.0
    time = impact_time(m_eff, a_eff, modulus, speed)
    radius = impact_radius(m_eff, a_eff, modulus, speed)
    is_first = volumetric_i < volumetric_j or (volumetric_i == volumetric_j and conductivity_i > conductivity_j)
    k_1 = conductivity_i if is_first else conductivity_j
    v_1 = volumetric_i if is_first else volumetric_j
    ratio = v_1 / (volumetric_j if is_first else volumetric_i)
    correction = impact_coefficient(fourier_number(k_1, v_1, time, radius), ratio)
    depth = 1.0 / sqrt(conductivity_i * volumetric_i) + 1.0 / sqrt(conductivity_j * volumetric_j)
    return correction * pi * radius * radius * sqrt(time) / depth


@kernel
def collide(
    scene: Scene,
    mass: Floats,
    contacts: StepContacts,
    place: Ints,
    is_known: NDArray[np.bool_],
    laws: HeatLaws,
    dt: float,
    conductance: Floats,
) -> None:
    """Replace the conductance of contacts that are new in this step by that of an impact, spread over the step (Sun & Chen).

    A place is hit once: its contacts share the impact in proportion to their impulses. Circles of walls have the a* of Hertz.

    Args:
        scene: Shapes.
        mass: Masses of the grains [kg], shape ``(n,)``.
        contacts: Contacts with their impulses.
        place: Places of the contacts, shape ``(c,)``.
        is_known: Whether a place carried an impulse in the step before, shape ``(c,)``.
        laws: Properties of materials.
        dt: Time step [s].
        conductance: [W/K], shape ``(c,)``. **Modified.**
    """
    grains = scene.radius.size
    total = totals_of_places(place, contacts.impulse[:, NORMAL])
    for c in range(contacts.i.size):
        speed = -contacts.before[c, NORMAL]
        if contacts.impulse[c, NORMAL] > 0.0 and speed > 0.0 and not is_known[c]:
            i, j = contacts.i[c], contacts.j[c]
            a, b = scene.material[i], scene.material[j]
            m = mass[i] * mass[j] / (mass[i] + mass[j]) if j < grains else mass[i]
            exchange = impact_exchange(
                m, hertz_radius(scene, i, j), laws.modulus[a, b], speed, laws.conductivity[a], laws.volumetric[a],
                laws.conductivity[b], laws.volumetric[b],
            )  # fmt: skip
            conductance[c] = exchange / dt * (contacts.impulse[c, NORMAL] / total[c])

"""What the heat of a run needs to know of its materials: one record, for kernels and for all other code."""

from __future__ import annotations

from typing import NamedTuple

from multicor_cli.model.model import Floats


class HeatLaws(NamedTuple):
    """Thermal properties of ``k`` materials, and of their pairs.

    Attributes:
        conductivity: λ [W/(m K)], shape ``(k,)``.
        volumetric: ρ c_p [J/(m³ K)], shape ``(k,)``.
        modulus: Contact modulus E* with 1/E* = (1−ν_i²)/E_i + (1−ν_j²)/E_j [Pa], shape ``(k, k)``.
        harmonic: λ_h = 2 λ_i λ_j/(λ_i+λ_j) [W/(m K)], shape ``(k, k)``.
        share: β, the share of the heat of friction that goes into the first body, shape ``(k, k)``; ``β_ij + β_ji = 1``.
        emissivity: ε, shape ``(k,)``; 0 where not given.
        emission: Emission factor of radiation between two surfaces, shape ``(k, k)``.
        roughness: σ, root of the sum of the squared roughnesses of the two surfaces [m], shape ``(k, k)``; 0 where not given.
        slope: Root of the sum of the squared mean slopes of the asperities, shape ``(k, k)``.
        microhardness: Harmonic mean of the microhardnesses [Pa], shape ``(k, k)``.
        wear: Archard's coefficient over the hardness of the first material K/H_i [1/Pa], shape ``(k, k)``; 0: no wear.
    """

    conductivity: Floats
    volumetric: Floats
    modulus: Floats
    harmonic: Floats
    share: Floats
    emissivity: Floats
    emission: Floats
    roughness: Floats
    slope: Floats
    microhardness: Floats
    wear: Floats

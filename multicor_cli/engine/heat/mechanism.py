"""What a heat mechanism is: choices, and what they carry between near bodies or from outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.model.model import Floats, Ints, Model

Rows = NDArray[np.int64]
"""Some of the rows of a table."""


class HeatLaws(NamedTuple):
    """Thermal properties of ``k`` materials, and of their pairs.

    Attributes:
        conductivity: λ [W/(m K)], shape ``(k,)``.
        volumetric: ρ c_p [J/(m³ K)], shape ``(k,)``.
        modulus: Contact modulus E* with 1/E* = (1−ν_i²)/E_i + (1−ν_j²)/E_j [Pa], shape ``(k, k)``.
        harmonic: λ_h = 2 λ_i λ_j/(λ_i+λ_j) [W/(m K)], shape ``(k, k)``.
        share: β, the share of the heat of friction that goes into the first body, shape ``(k, k)``;
            ``β_ij + β_ji = 1``.
        emissivity: ε, shape ``(k,)``; 0 where not given.
        emission: Emission factor of radiation between two surfaces, shape ``(k, k)``.
        roughness: σ, root of the sum of the squared roughnesses of the two surfaces [m], shape
            ``(k, k)``; 0 where not given.
        slope: Root of the sum of the squared mean slopes of the asperities, shape ``(k, k)``.
        microhardness: Harmonic mean of the microhardnesses [Pa], shape ``(k, k)``.
        wear: Archard's coefficient over the hardness of the first material K/H_i [1/Pa], shape
            ``(k, k)``; 0: no wear.
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


class Outlines(Protocol):
    """Near pairs in which a grain is no disc, as mechanisms ask them: `network.NearOutlines`."""

    def is_of_discs(self) -> NDArray[np.bool_]: ...

    def add_films(
        self, laws: HeatLaws, gas: float, reach: float, i: Ints, j: Ints, spot: Floats,
        conductance: Floats,
    ) -> None: ...  # fmt: skip

    def put_views(self, laws: HeatLaws, i: Ints, j: Ints, gap: Floats, area: Floats) -> None: ...


@dataclass(frozen=True)
class NearPairs:
    """Pairs of bodies near each other, sorted by (i, j), in ``e`` rows of each array.

    A grain and a grain or wall shape, with their gap and the radius of their contact (0: none) [m];
    ``outlines`` of some of them, unless all grains are discs.
    """

    i: Ints
    j: Ints
    gap: Floats
    spot: Floats
    outlines: Outlines | None = None


@dataclass(frozen=True)
class PairTransfer:
    """What a mechanism carries between near bodies; whoever asks leaves out those beyond its reach.

    Attributes:
        conductance: H [W/K], shape ``(e,)``, or None.
        area: Area factor of radiation [m²], shape ``(e,)``, or None.
        gas_ratio: Smallest and largest λ_s s/(λ_f a) of a contact, of a gas; else None.
    """

    conductance: Floats | None = None
    area: Floats | None = None
    gas_ratio: tuple[float, float] | None = None


@dataclass(frozen=True)
class Outside:
    """Something of known temperature [K] outside, with which every grain exchanges heat by a book.

    H [W/K] and area factor of radiation [m²] of each grain have shape ``(n,)``, or are one number.
    """

    book: Literal["from_ambient", "from_surroundings"]
    temperature: float
    conductance: Floats | float = 0.0
    area: Floats | float = 0.0


@dataclass(frozen=True)
class Mechanism:
    """A mechanism of a run; its attributes are its choices, named as the keys of its table."""

    reach = 0.0
    """Largest gap that it crosses, over the smaller radius; 0: nothing goes between near bodies."""

    def between(self, near: NearPairs, scene: Scene, laws: HeatLaws, model: Model) -> PairTransfer:
        """What it carries between near bodies; asked only with a reach."""
        raise NotImplementedError

    def outside(self, velocity: Floats, laws: HeatLaws, model: Model) -> Outside | None:
        """What it exchanges with the outside, if anything; velocities ``(n, 2)`` [m/s]."""
        return None

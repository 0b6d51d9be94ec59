"""The constant part of a run: grains, walls, contact laws and domain, as plain arrays.

Numbering used everywhere: grains are *shapes* ``0 … n-1``; the wall shapes follow as ``n … n+m-1``.
A contact is a pair of shape numbers ``(i, j)`` with ``i < j``, so ``i`` is always a grain.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import mean
from multicor_cli.model.outlines import Outlines

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

LEAST_DIAMETERS = 4.0
"""Least period over the largest diameter: with less, a neighbor's image would be one too."""

LEAST_THROAT = 2.0
"""Narrowest passage between a disc of a wall and its image, over the largest diameter: with less, a
grain in it could meet both."""

SHAPE_FACTOR = {"disc": 2.0, "sphere": 2.5}
"""m a²/I by the shape of the grains."""


@dataclass(frozen=True)
class Grains:
    """Free grains; every array has shape ``(n,)``.

    Attributes:
        radius: Radius a [m]; of a grain that is no disc, how far it reaches from its center.
        mass: Mass m [kg].
        inertia: Moment of inertia about the center I [kg m²].
        material: Index of the material.
        group: Index of the ``[[particles]]`` table the grain comes from.
    """

    radius: Floats
    mass: Floats
    inertia: Floats
    material: Ints
    group: Ints


@dataclass(frozen=True)
class WallShapes:
    """Discs, lines and circles carried by the walls, in the frame of their wall.

    Attributes:
        kind: `multicor_cli.model.ShapeKind` of each shape, shape ``(m,)``.
        wall: Index of the wall that carries it, shape ``(m,)``.
        geometry: Four numbers whose meaning the kind gives [m], shape ``(m, 4)``.
        material: Index of the material, shape ``(m,)``.
    """

    kind: Ints
    wall: Ints
    geometry: Floats
    material: Ints


@dataclass(frozen=True)
class Walls:
    """Wall bodies; arrays have shape ``(w,)``.

    Attributes:
        names: Name of each wall.
        mass: Mass that a load moves [kg]; nan if none was given (then no force may drive the wall).
        inertia: Moment of inertia about the wall's reference point [kg m²]; nan likewise.
        has_gravity: Whether gravity acts on its force-driven degrees of freedom.
        length: Length over which a load spreads [m].
        runs: Whether a drive known at the start lets its surface run; of size 0 if none does.
        meets: Which groups of grains meet it, shape ``(w, g)``; the others pass through it. Of size
            0 if all groups meet all walls.
    """

    names: tuple[str, ...]
    mass: Floats
    inertia: Floats
    has_gravity: NDArray[np.bool_]
    length: Floats
    runs: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    meets: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))


_NONE, _NO_FLAGS = np.empty((0, 0)), np.empty((0, 0), np.uint8)

RANGE = 0.01
"""Range of adhesion where none is given, over the mean diameter."""


class ContactLaws(NamedTuple):
    """Friction, restitution, adhesion, rolling resistance of pairs of ``k`` materials, for kernels.

    Attributes:
        friction: Coefficient of friction μ, shape ``(k, k)``, symmetric; used where ``table`` is
            -1.
        restitution: Coefficient of normal restitution e, shape ``(k, k)``, symmetric.
        table: Number of the μ(sliding speed) table of the pair, or -1, shape ``(k, k)``.
        table_start: First row of each table in the two arrays below, shape ``(tables + 1,)``.
        table_speed: Sliding speeds [m/s], ascending within a table.
        table_friction: μ at these speeds; linear between, constant beyond.
        softening_rate: c of μ = μ₀ [1 − c (T − T_r)] [1/K], 0 for pairs whose friction does not
            depend on temperature, shape ``(k, k)``; this and the next three are of size 0 if there
            is no such pair.
        softening_start: T_r, the temperature at which μ = μ₀ [K].
        softening_lowest: Smallest μ.
        softening_highest: Largest μ.
        flash_speed: V_w of friction that weakens by flash heating, at T_r [m/s]; inf for pairs
            without it; this and the next three are of size 0 if there is no such pair.
        flash_weakened: f_w, to which μ falls.
        flash_limit: T_w at which V_w is 0 [K]; inf where V_w does not depend on temperature.
        flash_reference: T_r [K].
        adhesion: F_a, the tension that a contact bears [N], symmetric; of size 0 if no pair has it.
        adhesion_range: ℓ, the gap across which it ends [m], symmetric; this and the next are of
            size 0 without adhesion, and in runs of file formats before 1.7 (`with_ranges`).
        is_wet: 1 where adhesion is that of bridges of liquid, which begin when bodies touch.
        rolling: Coefficient of rolling resistance μ_r, symmetric; of size 0 if no pair has it.
    """

    friction: Floats
    restitution: Floats
    table: Ints
    table_start: Ints
    table_speed: Floats
    table_friction: Floats
    softening_rate: Floats = _NONE
    softening_start: Floats = _NONE
    softening_lowest: Floats = _NONE
    softening_highest: Floats = _NONE
    adhesion: Floats = _NONE
    rolling: Floats = _NONE
    adhesion_range: Floats = _NONE
    is_wet: NDArray[np.uint8] = _NO_FLAGS
    flash_speed: Floats = _NONE
    flash_weakened: Floats = _NONE
    flash_limit: Floats = _NONE
    flash_reference: Floats = _NONE

    @property
    def depends_on_temperature(self) -> bool:
        """Whether friction does, for any pair."""
        if self.softening_rate.size:
            return True
        return self.flash_limit.size > 0 and bool(np.isfinite(self.flash_limit).any())

    @property
    def are_plain(self) -> bool:
        """Whether there is but restitution, and friction that depends on the materials alone."""
        return not (
            self.adhesion.size
            or self.rolling.size
            or self.softening_rate.size
            or self.table_speed.size
            or self.flash_speed.size
        )

    def with_ranges(self, mean_diameter: float) -> ContactLaws:
        """The same; dry, with a range of `RANGE` mean diameters [m], if there is adhesion without.

        So runs of file formats before 1.7 go on, which know no ranges.
        """
        if self.adhesion_range.size or not self.adhesion.size:
            return self
        flags = np.zeros(self.adhesion.shape, np.uint8)
        return self._replace(
            adhesion_range=np.full(self.adhesion.shape, RANGE * mean_diameter), is_wet=flags
        )


@dataclass(frozen=True)
class Thermal:
    """What the grains' temperatures need that does not change; every array has shape ``(n,)``.

    The temperature of a grain is ``initial_temperature + State.heat / capacity``.

    Attributes:
        capacity: Heat capacity C = m c_p [J/K].
        initial_temperature: Temperature at the start of the run T₀ [K].
        surface: Area that meets fluid and surroundings [m²]: 4π a² of a sphere, 2π a h of a disc.
    """

    capacity: Floats
    initial_temperature: Floats
    surface: Floats


@dataclass(frozen=True)
class Model:
    """Everything about a run that does not change with time.

    Attributes:
        grains: The free grains.
        shapes: What the walls are made of.
        walls: The wall bodies.
        laws: Contact laws by pair of materials.
        materials: Names of the materials.
        groups: Names of the particle groups.
        period: Period in x [m]; 0 if the domain is not periodic.
        gravity: Acceleration of gravity [m/s²], shape ``(2,)``.
        shape_factor: m a²/I, one of `SHAPE_FACTOR`, the same for all grains.
        thermal: Heat capacities and initial temperatures, or None if the run has no heat.
        outlets: Names of the outlets, or None if no grain ever comes or goes.
        start_speed: Speed of the fastest grain, surface of a grain or wall at the start, but for
            the shear that walls impose [m/s].
        numbers: Numbers of the grains in messages, shape ``(n,)``; None: their places in arrays.
        height: Period in y at the start [m], of a cell that is periodic in both directions; else 0.
            Such a cell is the only wall of its model, without shapes, and ``period`` is its width
            at the start.
        expansion: Coefficient of linear thermal expansion α of each material [1/K], shape ``(k,)``;
            of size 0 if no grain expands. Else the radii of ``grains`` are those at the start.
        sheds: Whether grains lose the volume that they wear off; then there is ``expansion``, too,
            perhaps of 0.
        heat_gradient: Mean gradient of temperature in a cell G (x, y) [K/m]; the temperatures of
            its grains are those beside it, T − G·r.
        outlines: What grains look like, or None if all are discs.
    """

    grains: Grains
    shapes: WallShapes
    walls: Walls
    laws: ContactLaws
    materials: tuple[str, ...]
    groups: tuple[str, ...]
    period: float
    gravity: Floats
    shape_factor: float
    thermal: Thermal | None = None
    outlets: tuple[str, ...] | None = None
    start_speed: float = 0.0
    numbers: NDArray[np.int64] | None = None
    height: float = 0.0
    heat_gradient: tuple[float, float] = (0.0, 0.0)
    expansion: Floats = field(default_factory=lambda: np.zeros(0))
    sheds: bool = False
    outlines: Outlines | None = None

    @property
    def is_cell(self) -> bool:
        """Whether it is periodic in both directions."""
        return self.height > 0.0

    @property
    def grain_count(self) -> int:
        """Number of free grains n."""
        return self.grains.radius.size

    @property
    def shape_count(self) -> int:
        """Number of wall shapes m."""
        return self.shapes.kind.size

    @property
    def wall_count(self) -> int:
        """Number of wall bodies w."""
        return len(self.walls.names)

    @functools.cached_property
    def area(self) -> Floats:
        """Area of the grains in the plane [m²], shape ``(n,)``."""
        if self.outlines is not None:
            return self.outlines.area
        return math.pi * (self.grains.radius * self.grains.radius)

    @functools.cached_property
    def disc_radius(self) -> Floats:
        """Radius of discs with the area of the grains [m], shape ``(n,)``."""
        if self.outlines is None:
            return self.grains.radius
        return np.where(self.outlines.is_disc, self.grains.radius, np.sqrt(self.area / math.pi))

    @property
    def perimeter(self) -> Floats:
        """Length of the outline of the grains [m], shape ``(n,)``."""
        if self.outlines is not None:
            return self.outlines.perimeter
        return 2.0 * math.pi * self.grains.radius

    @functools.cached_property
    def spin_radius(self) -> Floats:
        """σ by which spins are speeds σω, and m σ²/I the same for all grains [m], shape ``(n,)``.

        That of a disc is its radius.
        """
        radius = self.grains.radius
        if self.outlines is None:
            return radius
        inertia = self.shape_factor * self.grains.inertia / self.grains.mass
        return np.where(self.outlines.is_disc, radius, np.sqrt(inertia))

    @functools.cached_property
    def material(self) -> Ints:
        """Index of the material of all shapes, grains first, shape ``(n + m,)``."""
        return np.concatenate([self.grains.material, self.shapes.material]).astype(np.int32)

    def worn_share(self, wear: Floats) -> Floats:
        """Which part of its volume at the start each grain has lost, if any is, shape ``(n,)``.

        ``wear`` is the volume worn off [m³], likewise. The surface of a sphere is three times its
        volume over its radius, that of a disc (without its faces) twice.
        """
        if not self.sheds or self.thermal is None:
            return np.zeros(wear.size)
        surface = self.thermal.surface
        volume = surface * self.grains.radius / self.dimension
        if self.outlines is not None:
            prisms = surface / self.perimeter * self.area
            volume = np.where(self.outlines.is_disc, volume, prisms)
        return wear / volume

    @property
    def dimension(self) -> float:
        """As which power of the radius volumes go: 3 of spheres, 2 of discs."""
        return 3.0 if self.shape_factor == SHAPE_FACTOR["sphere"] else 2.0

    def with_radius(self, radius: Floats, share: Floats) -> Model:
        """The same with grains of these radii [m] and without a share of their mass, ``(n,)``."""
        mass, ratio = self.grains.mass * (1.0 - share), radius / self.grains.radius
        inertia = self.grains.inertia * (1.0 - share) * ratio * ratio
        grains = replace(self.grains, radius=radius, mass=mass, inertia=inertia)
        outlines = None if self.outlines is None else self.outlines.scaled(ratio)
        return replace(self, grains=grains, outlines=outlines)

    def name_of(self, grain: int) -> str:
        """What messages call a grain."""
        return f"grain {grain if self.numbers is None else self.numbers[grain]}"

    def is_met(self, grain: NDArray[Any], shape: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether grains meet wall shapes, counted from 0: pairs of numbers of any equal shape."""
        meets = self.walls.meets
        if not meets.size:
            return np.ones(grain.shape, np.bool_)
        return np.asarray(meets[self.shapes.wall[shape], self.grains.group[grain]])

    def meeting_alike(self) -> Iterator[tuple[NDArray[np.int64], NDArray[np.bool_]]]:
        """Grains that meet the same walls: which, ascending, and which walls, shape ``(w,)``."""
        meets = self.walls.meets
        if not meets.size:
            meets = np.ones((self.wall_count, len(self.groups)), np.bool_)
        alike, kind = np.unique(meets, axis=1, return_inverse=True)
        of_grain = kind.reshape(-1)[self.grains.group]
        for k in range(alike.shape[1]):
            which = np.flatnonzero(of_grain == k)
            if which.size:
                yield which, alike[:, k]

    def with_grains(self, which: NDArray[np.int64]) -> Model:
        """The same with these grains alone, in this order; walls and laws are shared."""
        thermal = self.thermal
        return replace(
            self,
            grains=_rows_of(self.grains, which),
            thermal=None if thermal is None else _rows_of(thermal, which),
            outlets=None,
            numbers=which,
            outlines=None if self.outlines is None else self.outlines.of_grains(which),
        )

    @functools.cached_property
    def mean_diameter(self) -> float:
        """Mean diameter of the grains d̄ [m]."""
        return 2.0 * mean(self.grains.radius)


_Rows = TypeVar("_Rows", Grains, Thermal)


def _rows_of(table: _Rows, which: NDArray[np.int64]) -> _Rows:
    return type(table)(
        **{column.name: getattr(table, column.name)[which] for column in fields(table)}
    )

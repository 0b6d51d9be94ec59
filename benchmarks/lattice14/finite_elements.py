"""Heat conduction resolved inside touching discs: finite elements in space, an L-stable method of
second order in time.

With lengths in radii a and τ = α t/a² (α = λ/(ρ c_p)), each disc obeys ∂θ/∂τ = ∇²θ. Its rim is
insulated but for the contact arcs, of half-width b, where it faces its neighbor across an interface
of uniform conductance per area: −∂θ_i/∂n = Bi/(2b) (θ_i − θ_j), point by point. The whole arc then
conducts H (mean θ_i − mean θ_j) exactly, where H = Bi λ h is the conductance of the contact of
discs of thickness h. s = t H/C = τ Bi/π.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from arrangement import Contact, Floats, start_values
from disc_mesh import MeshChoice, build_disc
from scipy import sparse
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP2, FacetBasis
from skfem.helpers import dot, grad

_GAMMA = 1.0 - np.sqrt(0.5)  # SDIRK2 (Alexander 1977): L-stable, stiffly accurate
_SAME = 1e-9

Sparse: TypeAlias = sparse.csr_array


@BilinearForm
def _mass_form(u: Any, v: Any, _: Any) -> Any:
    return u * v


@BilinearForm
def _stiffness_form(u: Any, v: Any, _: Any) -> Any:
    return dot(grad(u), grad(v))


@dataclass(frozen=True)
class Disc:
    """Matrices of one disc of radius 1; all discs have the same.

    Attributes:
        nodes: Degrees of freedom (quadratic elements) [radii], shape ``(2, n)``.
        mass: ∫ u v, shape ``(n, n)``.
        stiffness: ∫ ∇u·∇v, shape ``(n, n)``.
        arcs: For each of the six directions, the degrees of freedom on its arc in ascending angle.
        arc_mass: For each direction, ∫ u v over the arc, dense, in the order of ``arcs``.
        half_width: Half-width b of an arc [radii].
        basis: The finite-element space, for figures.
    """

    nodes: Floats
    mass: Sparse
    stiffness: Sparse
    arcs: list[np.ndarray]
    arc_mass: list[Floats]
    half_width: float
    basis: Basis

    @property
    def size(self) -> int:
        """Degrees of freedom of one disc."""
        return int(self.nodes.shape[1])

    @property
    def average(self) -> Floats:
        """Weights w of the mean over the disc, ``w @ θ``, shape ``(n,)``."""
        weights = np.asarray(self.mass.sum(axis=0)).ravel()
        return np.asarray(weights / weights.sum())

    def arc_average(self, direction: int) -> Floats:
        """Weights of the mean over an arc, shape ``(n,)``."""
        weights = np.zeros(self.size)
        weights[self.arcs[direction]] = self.arc_mass[direction].sum(axis=0)
        return np.asarray(weights / weights.sum())


def make_disc(choice: MeshChoice) -> Disc:
    """Mesh a disc and assemble its matrices."""
    mesh = build_disc(choice)
    basis = Basis(mesh, ElementTriP2())
    facets = mesh.boundary_facets()
    ends = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)  # (2, facets): middle of each edge
    arcs, arc_mass = [], []
    for direction in range(6):
        rim = FacetBasis(
            mesh,
            ElementTriP2(),
            facets=facets[np.abs(_angles(ends, direction)) < choice.half_width],
        )
        dofs = np.unique(rim.get_dofs(rim.find).flatten())
        dofs = dofs[np.argsort(_angles(basis.doflocs[:, dofs], direction))]
        arcs.append(dofs)
        arc_mass.append(_mass_form.assemble(rim)[np.ix_(dofs, dofs)].toarray())
    return Disc(
        nodes=basis.doflocs,
        mass=sparse.csr_array(_mass_form.assemble(basis)),
        stiffness=sparse.csr_array(_stiffness_form.assemble(basis)),
        arcs=arcs,
        arc_mass=arc_mass,
        half_width=choice.half_width,
        basis=basis,
    )


def _angles(points: Floats, direction: int) -> Floats:
    """Angles of points against a contact direction, shape ``(m,)``."""
    return np.asarray(
        np.angle((points[0] + 1j * points[1]) * np.exp(-1j * np.pi / 3.0 * direction))
    )


def couple(disc: Disc, contacts: list[Contact], count: int, biot: float) -> tuple[Sparse, Sparse]:
    """Mass and conduction matrices of all discs with their interfaces.

    Args:
        disc: Matrices of one disc.
        contacts: Who touches whom.
        count: Number of discs.
        biot: Bi = H/(λ h).

    Returns:
        M and K of M dθ/dτ = −K θ, shape ``(count·n, count·n)``.
    """
    parts = [_interface(disc, contact, biot) for contact in contacts]
    rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    size = count * disc.size
    each = sparse.eye_array(count)
    interfaces = sparse.csr_array((values, (rows, columns)), shape=(size, size))
    return sparse.csr_array(sparse.kron(each, disc.mass)), sparse.csr_array(
        sparse.kron(each, disc.stiffness) + interfaces
    )


def _interface(disc: Disc, contact: Contact, biot: float) -> tuple[np.ndarray, np.ndarray, Floats]:
    """Entries (rows, columns, values) of Bi/(2b) ∫ (θ_i − θ_j)(v_i − v_j) over a contact arc."""
    here, there = contact.direction, (contact.direction + 3) % 6
    angles_here = _angles(disc.nodes[:, disc.arcs[here]], here)
    angles_there = -_angles(disc.nodes[:, disc.arcs[there]], there)[::-1]
    if not np.allclose(angles_here, angles_there, atol=_SAME):
        raise ValueError(
            "the nodes of two arcs that face each other do not coincide: the mesh is not symmetric"
        )
    dofs = np.concatenate(
        [contact.i * disc.size + disc.arcs[here], contact.j * disc.size + disc.arcs[there][::-1]]
    )
    block = (
        biot
        / (2.0 * disc.half_width)
        * np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), disc.arc_mass[here])
    )
    rows, columns = np.meshgrid(dofs, dofs, indexing="ij")
    return rows.ravel(), columns.ravel(), block.ravel()


BLOCKS = ((0.1, 20), (0.5, 20), (1.5, 40), (6.0, 45))
"""Time steps: end of a block in s, and number of equal steps in it."""


def time_steps(refinement: int = 1) -> list[tuple[float, int]]:
    """Blocks of equal steps (length in s, count), each step divided by ``refinement``."""
    ends = [0.0] + [end for end, _ in BLOCKS]
    counts = [count * refinement for _, count in BLOCKS]
    return [
        ((high - low) / count, count)
        for low, high, count in zip(ends[:-1], ends[1:], counts, strict=True)
    ]


def march(
    mass: Sparse, conduction: Sparse, start: Floats, rate: float, blocks: list[tuple[float, int]]
) -> Iterator[Floats]:
    """Solve M dθ/ds = −rate K θ with SDIRK2; yields θ at the start and after each step.

    Args:
        mass: M.
        conduction: K.
        start: θ at s = 0.
        rate: dτ/ds.
        blocks: Steps as from `time_steps`.
    """
    theta = start.copy()
    yield theta
    for step, count in blocks:
        factors = splu(
            sparse.csc_matrix(mass + _GAMMA * step * rate * conduction),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        for _ in range(count):
            first = factors.solve(-rate * (conduction @ theta))
            second = factors.solve(-rate * (conduction @ (theta + (1.0 - _GAMMA) * step * first)))
            theta = theta + step * ((1.0 - _GAMMA) * first + _GAMMA * second)
            yield theta


@dataclass(frozen=True)
class History:
    """What is kept of a run.

    Attributes:
        times: s, shape ``(m,)``.
        mean: Mean θ of each disc, shape ``(m, count)``.
        spread: Largest minus smallest θ inside grain 1, shape ``(m,)``.
        deviation: Root of the mean square of θ − mean θ inside grain 1, shape ``(m,)``.
        drift: Largest change of Σ mean θ, which is conserved.
        size: Degrees of freedom of all discs.
    """

    times: Floats
    mean: Floats
    spread: Floats
    deviation: Floats
    drift: float
    size: int


def solve_discs(
    disc: Disc, contacts: list[Contact], count: int, biot: float, refinement: int = 1
) -> History:
    """Temperatures of ``count`` discs of which the first starts at θ = 1, until s = 6.

    Args:
        disc: Matrices of one disc.
        contacts: Who touches whom.
        count: Number of discs.
        biot: Bi = H/(λ h).
        refinement: Divides the time steps.
    """
    mass, conduction = couple(disc, contacts, count, biot)
    blocks = time_steps(refinement)
    start = np.repeat(start_values(count), disc.size)
    means, spreads, deviations = [], [], []
    for theta in march(mass, conduction, start, np.pi / biot, blocks):
        each = theta.reshape(count, disc.size)
        mean = each @ disc.average
        inside = each[0] - mean[0]
        means.append(mean)
        spreads.append(np.ptp(inside))
        deviations.append(np.sqrt(max(inside @ (disc.mass @ inside), 0.0) / np.pi))
    times = np.concatenate(
        [[0.0], np.cumsum(np.concatenate([np.full(count, step) for step, count in blocks]))]
    )
    mean = np.array(means)
    drift = float(np.abs(mean.sum(axis=1) - mean[0].sum()).max())
    return History(times, mean, np.array(spreads), np.array(deviations), drift, len(start))

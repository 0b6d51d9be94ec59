"""Whether grains that are no discs make sense: pieces of clumps, and energy made in impacts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Prepared, Rule
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Piece
from multicor_cli.running.time_step import pair_friction
from multicor_cli.scenario.shapes import ClumpShape

# ---- Whether the pieces of clumps make one grain: none lies apart, is there twice, or is tiny


def _clumps(run: Prepared) -> Iterator[tuple[str, list[Piece]]]:
    """Names of the groups of clumps, and their pieces in the unit of the scenario."""
    for group in run.scenario.particles:
        if isinstance(group.outline, ClumpShape):
            yield group.name, [part.piece for part in group.outline.pieces]


def _extent(pieces: list[Piece]) -> float:
    """The longer side of the box around some pieces, along the axes."""
    low = np.min([corners.min(axis=0) - rounding for corners, rounding in pieces], axis=0)
    high = np.max([corners.max(axis=0) + rounding for corners, rounding in pieces], axis=0)
    return float((high - low).max())


def _gap(one: Piece, other: Piece) -> float:
    """Distance of two pieces, below 0 if they overlap: in the direction that parts them most.

    It is normal to a side, or leads from a corner to a corner. Corners are counter-clockwise.
    """
    (a, r_a), (b, r_b) = one, other
    sides = np.concatenate([np.roll(a, -1, axis=0) - a, b - np.roll(b, -1, axis=0)])
    ways = np.concatenate([sides[:, ::-1] * [1.0, -1.0], (b[None] - a[:, None]).reshape(-1, 2)])
    length = np.hypot(*ways.T)
    ways = (ways / np.where(length > 0.0, length, 1.0)[:, None])[length > 0.0]
    if not len(ways):  # two discs with one center
        return -(r_a + r_b)
    return float(((b @ ways.T).min(axis=0) - (a @ ways.T).max(axis=0)).max()) - r_a - r_b


def _widest_gap(pieces: list[Piece]) -> float:
    """The widest gap that stays if pieces are joined over the narrowest ones; 0 without any.

    The longest edge of the minimum spanning tree (Prim's algorithm).
    """
    near, widest = np.full(len(pieces), np.inf), 0.0
    left, k = np.ones(len(pieces), bool), 0
    for _ in range(len(pieces) - 1):
        left[k] = False
        for m in np.flatnonzero(left):
            near[m] = min(near[m], _gap(pieces[k], pieces[m]))
        k = int(np.argmin(np.where(left, near, np.inf)))
        widest = max(widest, float(near[k]))
    return widest


def _gaps(run: Prepared) -> Iterator[Measured]:
    for name, pieces in _clumps(run):
        yield Measured(_widest_gap(pieces) / _extent(pieces), name)


def _twice(run: Prepared) -> Iterator[Measured]:
    for name, pieces in _clumps(run):
        unlike = {(rounding, frozenset(map(tuple, at.tolist()))) for at, rounding in pieces}
        yield Measured(float(len(pieces) - len(unlike)), name)


def _smallest(run: Prepared) -> Iterator[Measured]:
    for name, pieces in _clumps(run):
        yield Measured(min(_extent([piece]) for piece in pieces) / _extent(pieces), name)


CLUMPS: tuple[Rule[Prepared], ...] = (
    Rule(
        "gaps in clumps", _gaps, unit="of the clump's length", warning=1e-6,
        meaning="Widest gap between pieces of a clump that nothing bridges. They move as one body "
            "all the same, and other grains may come in between.",
        remedy="Let the pieces touch, or put a rod between them; it may be meant.",
    ),
    Rule(
        "pieces twice in clumps", _twice, unit="pieces", warning=0.0,
        meaning="Pieces of a clump that are the same as another one. They change neither outline "
            "nor mass, and take their time in every contact.",
        remedy="Remove them, or correct their place.",
    ),
    Rule(
        "smallest piece of clumps", _smallest, unit="of the clump's length", least=1e-3,
        meaning="Length of the smallest piece of a clump over that of the clump. What is smaller "
            "than the overlap that contacts may have hardly takes part in them.",
        remedy="Give all pieces of a clump in the same unit, or leave small ones out.",
    ),
)  # fmt: skip
"""What is checked of clumps before a run; pieces of outlines in files are not given by anybody."""


# ---- Whether impacts can make energy
#
# Newton's law gives the normal velocity after an impact, u_n⁺ = −e u_n⁻; where a point is beside
# the center of mass, friction has a part in it (Kane & Levinson 1985). Of a single point with
# impulses p_n (1, s), |s| ≤ μ, as large as that law asks for, the energy changes by (theory §3.4;
# derived)
#
#     ΔE ≤ p_n²/(2 (1 + e)) [2 s |W_nt| − (1 + e) s² W_tt − (1 − e) W_nn],
#
# with equality where the point sticks. No friction makes energy if W_nt² ≤ (1 − e²) W_nn W_tt. What
# is said of a grain on something fixed holds of two grains, whose matrices add up: where neither
# can gain, both together cannot.

_PLACES = 17
"""Places along a side, and normals at a corner, that are looked at."""
_RATIOS = 64
_MOST_GRAINS = 200  # of a material; they are alike, or many


def largest_gain(normal: Floats, mixed: Floats, across: Floats, e: float, mu: float) -> float:
    """Largest energy that impacts gain over that of their approach; below 0 if all lose some.

    Args:
        normal: W_nn of the points, shape ``(k,)``.
        mixed: W_nt.
        across: W_tt.
        e: Coefficient of restitution.
        mu: Coefficient of friction.
    """
    a, c, s = normal[:, None], across[:, None], mu * np.arange(1, _RATIOS + 1) / _RATIOS
    b = np.abs(mixed)[:, None]
    made = (2.0 * s * b - (1.0 + e) * s * s * c - (1.0 - e) * a) / (2.0 * (1.0 + e))
    # Velocities before for p_n = 1, with u⁺ = (−e u_n⁻, 0), and their energy ½ u·W⁻¹u
    u_n, u_t = (a - s * b) / (1.0 + e), b - s * c
    energy = (c * u_n * u_n - 2.0 * b * u_n * u_t + a * u_t * u_t) / (2.0 * (a * c - b * b))
    can_be = u_n > 0.0
    return float(np.where(can_be, made / np.where(can_be, energy, 1.0), -1.0).max(initial=-1.0))


def _levers(pieces: list[Piece]) -> Floats:
    """Levers of points along the outlines of pieces, across and along their normals, ``(k, 2)``."""
    share = np.arange(_PLACES)[:, None] / (_PLACES - 1)
    found = []
    for corners, rounding in pieces:
        ends = np.roll(corners, -1, axis=0)
        x, y = (ends - corners).T
        angle = np.arctan2(-x, y)
        before = np.roll(angle, 1)
        turn = angle - before
        turn -= 2.0 * np.pi * np.floor(turn / (2.0 * np.pi))
        if len(corners) == 1:
            turn[:] = 2.0 * np.pi
        for place, normal in (
            (corners[None] + 0.0 * share[..., None], before + share * turn),
            (
                corners + share[..., None] * (ends - corners),
                np.broadcast_to(angle, (_PLACES, len(corners))),
            ),
        ):
            c, s = np.cos(normal), np.sin(normal)
            across = place[..., 0] * s - place[..., 1] * c
            along = place[..., 0] * c + place[..., 1] * s + rounding
            found.append(np.column_stack([across.ravel(), along.ravel()]))
    return np.concatenate(found)


def _gains(run: Prepared) -> Iterator[Measured]:
    model = run.model
    if model.outlines is None:
        return
    for stage, laws in run.laws:
        if not laws.restitution.any():
            continue
        for a in np.unique(model.grains.material[~model.outlines.is_disc]).tolist():
            for b in np.unique(model.material).tolist():
                e, mu = float(laws.restitution[a, b]), pair_friction(laws, a, b)
                if e > 0.0 and mu > 0.0:
                    about = (
                        f"e = {e:g}, μ = {mu:g} of {model.materials[a]} and {model.materials[b]}"
                    )
                    gain = largest_gain(*_matrices(model, a), e, mu)
                    yield Measured(max(gain, 0.0), f"{about}, {stage}" if stage else about)


def _matrices(model: Model, material: int) -> tuple[Floats, Floats, Floats]:
    """W_nn, W_nt and W_tt times the mass of points of the grains of a material."""
    assert model.outlines is not None  # only then it is asked for
    which = np.flatnonzero(~model.outlines.is_disc & (model.grains.material == material))
    which = which[:: -(-which.size // _MOST_GRAINS)]
    scaled = []
    for grain in which.tolist():
        gyration = np.sqrt(model.grains.inertia[grain] / model.grains.mass[grain])
        scaled.append(_levers(model.outlines.pieces(grain)) / gyration)
    across, along = np.concatenate(scaled).T
    return 1.0 + across * across, across * along, 1.0 + along * along


IMPACTS: tuple[Rule[Prepared], ...] = (
    Rule(
        "energy made in impacts", _gains, unit="of the energy of the approach", warning=0.0,
        meaning="Largest energy that an impact at a single point of a grain that is no disc can "
            "gain over what it had, with its worst direction. Newton's law of restitution makes "
            "energy where friction reverses the sliding of a point beside the center of mass, if "
            "2 s |W_nt| > (1 + e) s² W_tt + (1 − e) W_nn for an s up to μ; never where "
            "W_nt² is at most (1 − e²) W_nn W_tt.",
        remedy="Lower restitution or friction; or look at negative losses of the run, which say "
            "what such impacts made.",
    ),
)  # fmt: skip

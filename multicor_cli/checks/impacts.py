"""Whether impacts of grains that are no discs can make energy.

Newton's law gives the normal velocity after an impact, u_n⁺ = −e u_n⁻; where a point is beside the
center of mass, friction has a part in it (Kane & Levinson 1985). Of a single point with impulses
p_n (1, s), |s| ≤ μ, as large as that law asks for, the energy changes by (theory §3.4; derived)

    ΔE ≤ p_n²/(2 (1 + e)) [2 s |W_nt| − (1 + e) s² W_tt − (1 − e) W_nn],

with equality where the point sticks. No friction makes energy if W_nt² ≤ (1 − e²) W_nn W_tt. What
is said of a grain on something fixed holds of two grains, whose matrices add up: where neither can
gain, both together cannot.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Prepared, Rule
from multicor_cli.model import Model
from multicor_cli.model.model import ContactLaws, Floats
from multicor_cli.model.outlines import Piece

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
    stages = [(f"stage {stage.name}", stage.laws) for stage in run.plan.stages]
    for stage, laws in [("", model.laws), *stages]:
        if laws is None or not laws.restitution.any():
            continue
        for a in np.unique(model.grains.material[~model.outlines.is_disc]).tolist():
            for b in np.unique(model.material).tolist():
                e, mu = float(laws.restitution[a, b]), _friction(laws, a, b)
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


def _friction(laws: ContactLaws, a: int, b: int) -> float:
    """Largest coefficient of a pair of materials, at any speed."""
    table = int(laws.table[a, b])
    if table < 0:
        return float(laws.friction[a, b])
    first = int(laws.table_start[table])
    last = int(laws.table_start[table + 1])
    return float(laws.table_friction[first:last].max())


BEFORE_RUN: tuple[Rule[Prepared], ...] = (
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

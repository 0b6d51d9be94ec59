"""Contact forces: their network in one frame, and their distribution over sizes and directions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts, with_forces
from multicor_cli.post.grain_map import GrainScene, make_scene
from multicor_cli.post.source import (
    PostError,
    Run,
    Selection,
    bin_count,
    chosen_frames,
    frame_index,
    frames_of,
    frames_told,
    need_grains,
)
from multicor_cli.post.sums import scatter
from multicor_cli.post.table import Column, Table, values_of_quantities

# ---- The contact forces of one frame

NUMBERS = {
    "contacts": "contacts that carry a force",
    "wall_contacts": "  of these with walls",
    "normal_force_mean": "mean normal force [N]",
    "normal_force_max": "largest normal force [N]",
    "tangential_force_mean": "mean tangential force, without sign [N]",
    "coordination": "coordination number",
    "rattler_share": "share of rattlers (fewer than two contacts)",
    "points": "contact points per grain",
    "sliding_share": "share of sliding contacts",
}
"""Labels, with their units, of the numbers of a whole network."""
SUMMARY = tuple(NUMBERS)
"""Their names."""

_XY = ((0, "x"), (1, "y"))


class ForceNetwork(Table):
    """The contacts of a frame that carry a force; ``c`` of them.

    Attributes:
        scene: Where the grains and walls are.
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below the number of grains), shape ``(c,)``.
        normal: Unit normal from j to i, shape ``(c, 2)``.
        start: Center of the grain i [m], shape ``(c, 2)``.
        end: Center of grain j, free or glued, or where i touches a smooth wall [m], ``(c, 2)``.
        touch: Where i touches j [m], shape ``(c, 2)``.
        force: Normal and tangential force on i, mean of the last step [N], shape ``(c, 2)``.
        sliding: Whether the contact slides, shape ``(c,)``.
        is_wall: Whether a contact is one of a grain with a wall, shape ``(c,)``.
        frame: Index of the frame.
        time: Time of the frame [s].
        summary: The numbers of `SUMMARY`, by name; nan where there is no contact. Rattlers are
            grains with fewer than two contacts that carry a force, those with walls included; of
            grains that are no discs with fewer than two points.
    """


def force_network(source: Run, frame: int = -1) -> ForceNetwork:
    """The force network of one frame.

    Args:
        source: The run.
        frame: Index of the frame; negative counts from the last one.

    Raises:
        PostError: If there is no such frame, or no grain in it, or no contact forces belong to it.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    need_grains(source, np.array([index]))
    with_forces(source, np.array([index]))
    chosen = source.frames[index]
    loaded, scene = loaded_contacts(chosen, chosen.model), make_scene(source, chosen)
    sliding = loaded.sliding
    count, n, with_walls = len(loaded.force), loaded.grain_count, int(loaded.is_wall.sum())
    normal, tangential = loaded.force.T if count else (np.array([np.nan]),) * 2
    summary = {
        "contacts": count,
        "wall_contacts": with_walls,
        "normal_force_mean": float(normal.mean()),
        "normal_force_max": float(normal.max()),
        "tangential_force_mean": float(np.abs(tangential).mean()),
        "coordination": float(2 * count - with_walls) / n,
        "rattler_share": float(np.count_nonzero(loaded.point_counts < 2)) / n,
        "sliding_share": float(sliding.mean()) if count else np.nan,
    }
    if loaded.shaped is not None:
        summary["points"] = float(loaded.point_counts.sum()) / n
    columns, parts = lines_of(loaded, scene)
    columns += [Column(f"normal_{k}", "1", loaded.normal[:, a], f"normal {k}") for a, k in _XY]
    columns += [
        Column(f"{name}_force", "N", loaded.force[:, k], f"{name} force")
        for k, name in enumerate(("normal", "tangential"))
    ]
    return ForceNetwork(
        values_of_quantities([(NUMBERS[name], value) for name, value in summary.items()]),
        {"frame": index, "time": float(np.asarray(source.frames.time)[index]), **summary},
        [*columns, Column("slides", "", sliding.astype(np.int64), "sliding")],
        normal=loaded.normal, force=loaded.force, sliding=sliding, summary=summary, **parts,
    )  # fmt: skip


def lines_of(contacts: LoadedContacts, scene: GrainScene) -> tuple[list[Column], dict[str, Any]]:
    """Bodies and places of contacts as columns, and what is drawn of a network of any kind."""
    start = scene.center[contacts.i]
    touch = start + contacts.arm
    columns = [Column("i", "", contacts.i), Column("j", "", contacts.j)]
    columns += [Column(f"touch_{k}", "m", touch[:, a], k) for a, k in _XY]
    return columns, {
        "scene": scene, "start": start, "end": start - contacts.branch, "touch": touch,
        "is_wall": contacts.is_wall,
    }  # fmt: skip


# ---- How contact forces are distributed: over magnitudes, and over directions

MOMENTS = ("a_c", "a_n", "a_t", "theta_c", "theta_n", "theta_t")
"""Names of the moments of an `AngularDistribution`."""

BINS = 36
"""Bins of directions over the full circle, unless told otherwise."""

_KNOWN = 0.05  # singular value over the largest: directions within some 50° say nothing of others
_NOTHING = "no two grains press on each other in these frames"
_SMALLEST, _LARGEST = 1e-3, 20.0  # range of f/⟨f⟩ that is looked at


class ForceDistribution(Table):
    """Probability density of the forces of grain–grain contacts over their mean; ``b`` bins.

    Every frame counts with its own mean. Forces outside the bins count for the normalization, so
    that the densities integrate to the share of the forces inside.

    Attributes:
        edges: Edges of the bins in f/⟨f⟩, ``b + 1`` of them, a constant ratio apart.
        center: Geometric centers of the bins, shape ``(b,)``.
        normal: Density P(f_n/⟨f_n⟩) of the normal forces, shape ``(b,)``.
        tangential: The same of tangential forces, P(|f_t|/⟨|f_t|⟩); nan without any, ``(b,)``.
        count: Normal forces in each bin, shape ``(b,)``.
        mean, tangential_mean: Mean normal and tangential force without its sign [N].
        contacts: Number of contacts.
        normal_scatter, tangential_scatter: Standard deviations from frame to frame; nan with one.
    """


class AngularDistribution(Table):
    """Directions of grain–grain contacts and mean forces along them, full circle; ``b`` bins.

    A contact counts in both directions, as seen from either grain. The moments are those of E(θ) =
    (1 + a_c cos 2(θ − θ_c))/2π, ⟨f_n⟩(θ) = f₀ (1 + a_n cos 2(θ − θ_n)) and ⟨f_t⟩(θ) = −f₀ a_t sin
    2(θ − θ_t): Fourier coefficients, a_c from single contacts, the others fitted to bins that
    count alike, but for empty ones; f₀ is their mean over directions.

    Attributes:
        angle: Centers of the bins, counter-clockwise from x [rad], shape ``(b,)``.
        density: Density of contact directions [1/rad], shape ``(b,)``; it integrates to 1.
        normal: Mean normal force in each bin over that of all; nan without contacts, ``(b,)``.
        tangential: Mean tangential force over the mean normal force, shape ``(b,)``.
        moments: Anisotropies ``a_c, a_n, a_t`` and directions ``theta_c, theta_n, theta_t`` [°].
        moments_scatter, density_scatter, normal_scatter, tangential_scatter: Standard deviations
            from frame to frame; nan with one frame.
        contacts: Number of contacts.
    """


def force_distribution(
    source: Run, selection: Selection | None = None, bins: int = 40
) -> ForceDistribution:
    """Distribution of the contact forces over their magnitude, in logarithmic bins.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        bins: Number of bins.

    Raises:
        PostError: If no contact forces belong to these frames, or none is between grains.
        StoreError: If the run cannot be read.
    """
    chosen, contacts = _between_grains(source, selection)
    edges = np.geomspace(_SMALLEST, _LARGEST, bin_count(bins) + 1)
    normal, tangential = np.zeros(bins, np.int64), np.zeros(bins, np.int64)
    normal_sum, tangential_sum, count, tangential_count = 0.0, 0.0, 0, 0
    width = np.diff(edges)
    rows: list[Floats] = []
    for loaded in contacts:
        f, g = np.abs(loaded.force[~loaded.is_wall]).T
        normal_sum += float(f.sum())
        tangential_sum += float(g.sum())
        count += f.size
        own, across = _count(f / f.mean(), edges), np.full(bins, np.nan)
        normal += own
        if g.any():
            found = _count(g / g.mean(), edges)
            tangential += found
            tangential_count += g.size
            across = found / (g.size * width)
        rows.append(np.array([own / (f.size * width), across]))
    if not count:
        raise PostError(_NOTHING)
    facts = {
        **frames_told(source, chosen),
        "contacts": count,
        "normal_force_mean": normal_sum / count,
        "tangential_force_mean": tangential_sum / count,
        "edges": edges,
    }
    facts["normal"] = normal / (count * width)
    facts["tangential"] = np.full(bins, np.nan)
    if tangential_count:
        facts["tangential"] = tangential / (tangential_count * width)
    facts["count"] = normal
    facts["normal_scatter"], facts["tangential_scatter"] = scatter(np.array(rows))
    edge = {"low": edges[:-1], "high": edges[1:]}
    columns = [
        Column(name, unit, edge[name] if name in edge else facts[name], label, "")
        for name, unit, label in (
            ("low", "1", "f/<f> from"),
            ("high", "1", "to"),
            ("normal", "1", "P of normal forces"),
            ("normal_scatter", "1", "scatter of normal P"),
            ("tangential", "1", "P of tangential forces"),
            ("tangential_scatter", "1", "scatter of tangential P"),
            ("count", "", "normal forces"),
        )
    ]
    parts: dict[str, Any] = {"frames": chosen, "center": np.sqrt(edges[1:] * edges[:-1])}
    parts |= {"mean": normal_sum / count, "tangential_mean": tangential_sum / count}
    return ForceDistribution(columns, facts, **parts)


def angular_distribution(
    source: Run, selection: Selection | None = None, bins: int = BINS
) -> AngularDistribution:
    """Distribution of contact directions and of the forces over them.

    Args:
        source: The run.
        selection: Which frames with forces; default: the later half of the last stage.
        bins: Number of bins over the full circle; even: opposite directions have bins of their own.

    Raises:
        PostError: If these frames have no contact forces between grains, or ``bins`` is odd or < 4.
        StoreError: If the run cannot be read.
    """
    if bin_count(bins) < 4 or bins % 2:
        raise PostError(f"{bins} bins of directions: choose an even number, 4 or more")
    chosen, contacts = _between_grains(source, selection)
    half = bins // 2
    sums, wave = np.zeros((3, half)), 0j
    rows: list[Floats] = []
    single: list[dict[str, float]] = []
    for loaded in contacts:
        normal, force = loaded.normal[~loaded.is_wall], loaded.force[~loaded.is_wall]
        own, turned = sum_directions(normal, [*force.T], half)
        sums, wave = sums + own, wave + turned
        rows.append(np.array(_directions(own)))
        single.append(_moments_of(own, turned))
    count = int(sums[0].sum())
    if not count:
        raise PostError(_NOTHING)
    density, mean, shear = (np.tile(values, 2) for values in _directions(sums))
    scatters = [np.tile(values, 2) for values in scatter(np.array(rows))]
    center = (np.arange(bins) + 0.5) * np.pi / half
    moments, angle = _moments_of(sums, wave), center
    moments_scatter = {}
    for name, middle in moments.items():
        away = np.array([one[name] for one in single]) - middle
        if name.startswith("theta"):  # directions repeat every 180°
            away = (away + 90.0) % 180.0 - 90.0
        moments_scatter[name] = float(scatter(away))
    facts = {
        **frames_told(source, chosen),
        "contacts": count,
        **moments,
        "angle": angle,
        "moments_scatter": moments_scatter,
    }
    columns = [
        Column("degrees", "deg", np.degrees(angle), "direction", ""),
        Column("density", "1/rad", density, "density of contacts"),
        Column("density_scatter", "1/rad", scatters[0], "scatter of density"),
        Column("normal", "1", mean, "normal force over mean"),
        Column("normal_scatter", "1", scatters[1], "scatter of normal"),
        Column("tangential", "1", shear, "tangential over mean normal"),
        Column("tangential_scatter", "1", scatters[2], "scatter of tangential"),
    ]
    return AngularDistribution(columns, facts, frames=chosen, moments=moments)


def _directions(sums: Floats) -> tuple[Floats, Floats, Floats]:
    """Densities, and forces over the mean normal force, of sums over half a circle ``(3, b/2)``."""
    count, f, g = sums
    overall = f.sum() / count.sum()
    density = 0.5 * count / count.sum() * count.size / np.pi
    with np.errstate(invalid="ignore"):
        return density, f / count / overall, g / count / overall


def sum_directions(
    normal: Floats, carried: Sequence[Floats], half: int = BINS // 2
) -> tuple[Floats, complex]:
    """Sums over contacts by direction, of which `waves_of` makes anisotropies.

    Opposite directions belong to one contact, and what it carries is the same from either side.

    Args:
        normal: Unit normals, shape ``(c, 2)``.
        carried: What contacts carry, k arrays of shape ``(c,)``.
        half: Number of bins over half a circle.

    Returns:
        Number of contacts in each bin and sums of what they carry, shape ``(1 + k, half)``; and the
        sum of e^{2iθ} over all contacts.
    """
    place = np.arctan2(normal[:, 1], normal[:, 0]) % np.pi / np.pi * half
    bin_ = np.minimum(place.astype(np.int64), half - 1)
    sums = [np.bincount(bin_, weights, minlength=half) for weights in (None, *carried)]
    return np.array(sums, np.float64), complex(((normal[:, 0] + 1j * normal[:, 1]) ** 2).sum())


def waves_of(sums: Floats, wave: complex) -> dict[str, complex]:
    """Anisotropies with their directions, a e^{2iθ}, of what `sum_directions` gives.

    ``c`` of contacts, from single ones; ``n`` and ``t`` of their normal and tangential forces, and
    ``l`` and ``lt`` of their branches along normals and tangents if they have them, fitted to bins
    that count alike, unless empty: Fourier coefficients if none is, and of directions within some
    50° the fit of least norm. See `AngularDistribution`; ⟨ℓ⟩(θ) = ℓ₀ (1 + a_l cos 2(θ − θ_l)) and
    ⟨ℓ_t⟩(θ) = −ℓ₀ a_lt sin 2(θ − θ_lt).
    """
    count, half = sums[0], sums.shape[1]
    known, width = count > 0.0, np.pi / half
    twice = 2.0 * (np.flatnonzero(known) + 0.5) * width
    # a bin averages e^{2iθ} over its width w: sin(w)/w
    turned = np.exp(1j * twice) * (np.sin(width) / width)
    shapes = np.column_stack([np.ones(turned.size), turned.real, turned.imag])
    means = (sums[1:, known] / count[known]).T
    level, along, across = np.linalg.lstsq(shapes, means, _KNOWN)[0]
    level[1::2] = level[:-1:2]  # what lies across, over what lies along
    waves = dict(zip(("n", "t", "l", "lt"), (along + 1j * across) / level, strict=False))
    turned = {name: 1j * waves[name] for name in ("t", "lt") if name in waves}
    return {"c": 2.0 * wave / count.sum(), **waves, **turned}


def _moments_of(sums: Floats, wave: complex) -> dict[str, float]:
    """Anisotropies, and their directions in degrees."""
    waves = waves_of(sums, wave)
    moments = {f"a_{name}": float(abs(value)) for name, value in waves.items()}
    return moments | {f"theta_{name}": direction_of(value) for name, value in waves.items()}


def direction_of(wave: complex) -> float:
    """θ of a e^{2iθ} [°], 0 … 180."""
    return float(np.degrees(0.5 * np.angle(wave)) % 180.0)


def _count(values: Floats, edges: Floats) -> NDArray[np.int64]:
    """Values in each bin of edges a constant ratio apart; one on an edge is in the bin above."""
    inside = values[(values >= edges[0]) & (values < edges[-1])]
    count = edges.size - 1
    bin_ = (np.log(inside / edges[0]) * (count / np.log(edges[-1] / edges[0]))).astype(np.int64)
    return np.bincount(np.minimum(bin_, count - 1), minlength=count)


def _between_grains(
    source: Run, selection: Selection | None
) -> tuple[NDArray[np.int64], Iterator[LoadedContacts]]:
    """The frames that have forces, and the contacts of those that have any between grains."""
    chosen = with_forces(source, chosen_frames(source, selection))
    frames = frames_of(source, chosen)
    loaded = (loaded_contacts(frame, frame.model) for frame in frames)
    return chosen, (contacts for contacts in loaded if not contacts.is_wall.all())

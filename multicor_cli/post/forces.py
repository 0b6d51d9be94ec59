"""Contact forces: how large, how many and where in one frame, and how they are distributed over magnitudes and directions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import LoadedContacts, loaded_contacts, with_forces
from multicor_cli.post.grain_map import GrainScene, make_scene
from multicor_cli.post.source import FrameSource, PostError, Selection, Table, frame_index, model_of, need_grains, rows_of
from multicor_cli.post.sums import scatter

# ---- The contact forces of one frame

SUMMARY = (
    "contacts", "wall_contacts", "normal_force_mean", "normal_force_max", "tangential_force_mean", "coordination", "rattler_share",
    "sliding_share",
)  # fmt: skip
"""Names of the numbers of a whole network."""


@dataclass(frozen=True, repr=False)
class ForceNetwork(Table):
    """The contacts of a frame that carry a force; ``c`` of them.

    Attributes:
        scene: Where the grains and walls are.
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below the number of grains), shape ``(c,)``.
        normal: Unit normal from j to i, shape ``(c, 2)``.
        start: Center of the grain i [m], shape ``(c, 2)``.
        end: Center of the grain j next to it, free or glued, or where the grain touches a smooth wall [m], shape ``(c, 2)``.
        force: Normal and tangential force on i, mean of the last step [N], shape ``(c, 2)``.
        sliding: Whether the contact slides, shape ``(c,)``.
        frame: Index of the frame.
        time: Time of the frame [s].
    """

    scene: GrainScene
    i: NDArray[Any]
    j: NDArray[Any]
    normal: Floats
    start: Floats
    end: Floats
    force: Floats
    sliding: NDArray[np.bool_]
    frame: int
    time: float

    @property
    def headings(self) -> tuple[str, str]:
        """Names of the columns of `rows`."""
        return "quantity", "value"

    @property
    def is_wall(self) -> NDArray[np.bool_]:
        """Whether a contact is one of a grain with a wall, shape ``(c,)``."""
        return np.asarray(self.j >= self.scene.radius.size)

    @property
    def coordination(self) -> float:
        """Mean number of contacts of a grain that carry a force, Z; those with walls included."""
        return float(2 * self.i.size - np.count_nonzero(self.is_wall)) / self.scene.radius.size

    @property
    def rattler_share(self) -> float:
        """Share of the grains with fewer than two contacts that carry a force."""
        n = self.scene.radius.size
        contacts = np.bincount(self.i, minlength=n) + np.bincount(self.j[~self.is_wall], minlength=n)
        return float(np.count_nonzero(contacts < 2)) / n

    @property
    def summary(self) -> dict[str, float]:
        """The numbers of `rows` by name; nan where there is no contact."""
        normal, tangential = self.force.T
        none = not normal.size
        values = (
            normal.size,
            int(np.count_nonzero(self.is_wall)),
            np.nan if none else float(normal.mean()),
            np.nan if none else float(normal.max()),
            np.nan if none else float(np.abs(tangential).mean()),
            self.coordination,
            self.rattler_share,
            np.nan if none else float(self.sliding.mean()),
        )
        return dict(zip(SUMMARY, values, strict=True))

    @property
    def rows(self) -> list[tuple[str, float]]:
        """The numbers of `summary` with names for people."""
        return list(zip(_LABELS, self.summary.values(), strict=True))

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        return "i", "j", "x [m]", "y [m]", "normal x [1]", "normal y [1]", "normal force [N]", "tangential force [N]", "sliding"

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """One row per contact; x and y are the point where the grain i touches."""
        touch = self.start - self.normal * self.scene.radius[self.i][:, np.newaxis]
        return rows_of([self.i, self.j, *touch.T, *self.normal.T, *self.force.T, self.sliding.astype(np.int64)])

    def as_dict(self) -> dict[str, Any]:
        """The numbers of the whole network as JSON types; numbers may be nan."""
        return {"frame": self.frame, "time": self.time, **self.summary}


_LABELS = (
    "contacts that carry a force",
    "  of these with walls",
    "mean normal force [N]",
    "largest normal force [N]",
    "mean tangential force, without sign [N]",
    "coordination number Z",
    "share of rattlers (fewer than two contacts)",
    "share of sliding contacts",
)


def force_network(source: FrameSource, frame: int = -1) -> ForceNetwork:
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
    loaded = loaded_contacts(chosen, model_of(source, chosen))
    scene = make_scene(source, chosen)
    start = scene.center[loaded.i]
    return ForceNetwork(
        scene,
        loaded.i,
        loaded.j,
        loaded.normal,
        start,
        start - loaded.branch,
        loaded.force,
        np.asarray(chosen.contacts.sliding, np.bool_)[loaded.row],
        index,
        float(np.asarray(source.frames.time)[index]),
    )


# ---- How contact forces are distributed: over their magnitude, and over the directions of the contacts

FORCE_BINS = 40
"""Logarithmic bins of the force distribution."""

ANGLE_BINS = 36
"""Bins of the directions over the full circle."""

MOMENTS = ("a_c", "a_n", "a_t", "theta_c", "theta_n", "theta_t")
"""Names of the moments of an `AngularDistribution`."""

_SMALLEST, _LARGEST = 1e-3, 20.0  # range of f/⟨f⟩ that is looked at


@dataclass(frozen=True, repr=False)
class ForceDistribution(Table):
    """Probability density of the forces of grain–grain contacts over their mean; ``b`` bins.

    Every frame counts with its own mean. Forces outside the bins count for the normalization, so that the densities integrate to
    the share of the forces inside.

    Attributes:
        edges: Edges of the bins in f/⟨f⟩, ``b + 1`` of them, a constant ratio apart.
        normal: Density P(f_n/⟨f_n⟩) of the normal forces, shape ``(b,)``.
        tangential: Density P(|f_t|/⟨|f_t|⟩) of the tangential forces; nan if there are none, shape ``(b,)``.
        count: Normal forces in each bin, shape ``(b,)``.
        mean: Mean normal force over all frames [N].
        tangential_mean: Mean tangential force without its sign [N].
        contacts: Number of contacts.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
        normal_scatter: Standard deviation of the density of the normal forces from frame to frame; nan with one, shape ``(b,)``.
        tangential_scatter: The same of the tangential forces, shape ``(b,)``.
    """

    edges: Floats
    normal: Floats
    tangential: Floats
    count: NDArray[np.int64]
    mean: float
    tangential_mean: float
    contacts: int
    frames: NDArray[np.int64]
    times: tuple[float, float]
    normal_scatter: Floats
    tangential_scatter: Floats

    @property
    def center(self) -> Floats:
        """Geometric centers of the bins, shape ``(b,)``."""
        return np.asarray(np.sqrt(self.edges[1:] * self.edges[:-1]))

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows`."""
        return (
            "f/<f> from [1]", "to [1]", "P of normal forces [1]", "scatter of normal P [1]",
            "P of tangential forces [1]", "scatter of tangential P [1]", "normal forces",
        )  # fmt: skip

    @property
    def rows(self) -> list[tuple[float, ...]]:
        """One row per bin."""
        return rows_of(
            (
                self.edges[:-1], self.edges[1:], self.normal, self.normal_scatter,
                self.tangential, self.tangential_scatter, self.count,
            )
        )  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        return {
            "frame_count": int(self.frames.size),
            "times": list(self.times),
            "contacts": self.contacts,
            "normal_force_mean": self.mean,
            "tangential_force_mean": self.tangential_mean,
            "edges": self.edges.tolist(),
            "normal": self.normal.tolist(),
            "tangential": self.tangential.tolist(),
            "count": self.count.tolist(),
            "normal_scatter": self.normal_scatter.tolist(),
            "tangential_scatter": self.tangential_scatter.tolist(),
        }


@dataclass(frozen=True, repr=False)
class AngularDistribution(Table):
    """Directions of grain–grain contacts and the mean forces along them, over the full circle; ``b`` bins.

    A contact counts in both directions, as seen from either grain. The moments are those of E(θ) = (1 + a_c cos 2(θ − θ_c))/2π,
    ⟨f_n⟩(θ) = f₀ (1 + a_n cos 2(θ − θ_n)) and ⟨f_t⟩(θ) = −f₀ a_t sin 2(θ − θ_t): Fourier coefficients, a_c from the single
    contacts, the others from the bins, each weighted alike; f₀ is the mean over the bins.

    Attributes:
        angle: Centers of the bins, counter-clockwise from x [rad], shape ``(b,)``.
        density: Density of contact directions [1/rad], shape ``(b,)``; it integrates to 1.
        normal: Mean normal force of the contacts in each bin over that of all; nan where there is none, shape ``(b,)``.
        tangential: Mean tangential force over the mean normal force, shape ``(b,)``.
        moments: Anisotropies ``a_c, a_n, a_t`` and their directions ``theta_c, theta_n, theta_t`` [degrees].
        moments_scatter: Standard deviations of the moments from frame to frame; nan with one frame.
        density_scatter: The same of ``density``, shape ``(b,)``.
        normal_scatter: The same of ``normal``, shape ``(b,)``.
        contacts: Number of contacts.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    angle: Floats
    density: Floats
    normal: Floats
    tangential: Floats
    moments: dict[str, float]
    moments_scatter: dict[str, float]
    density_scatter: Floats
    normal_scatter: Floats
    contacts: int
    frames: NDArray[np.int64]
    times: tuple[float, float]

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows` with their units."""
        return (
            "direction [deg]",
            "density of contacts [1/rad]",
            "scatter of density [1/rad]",
            "normal force over mean [1]",
            "scatter of normal force [1]",
            "tangential force over mean normal [1]",
        )

    @property
    def rows(self) -> list[tuple[float, ...]]:
        """One row per bin."""
        return rows_of(
            (np.degrees(self.angle), self.density, self.density_scatter, self.normal, self.normal_scatter, self.tangential)
        )

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        return {
            "frame_count": int(self.frames.size),
            "times": list(self.times),
            "contacts": self.contacts,
            **self.moments,
            "angle": self.angle.tolist(),
            "moments_scatter": self.moments_scatter,
            "density": self.density.tolist(),
            "density_scatter": self.density_scatter.tolist(),
            "normal": self.normal.tolist(),
            "normal_scatter": self.normal_scatter.tolist(),
            "tangential": self.tangential.tolist(),
        }


def force_distribution(source: FrameSource, selection: Selection | None = None, bins: int = FORCE_BINS) -> ForceDistribution:
    """Distribution of the contact forces over their magnitude, in logarithmic bins.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage. Frames without contact forces are left out.
        bins: Number of bins.

    Raises:
        PostError: If no contact forces belong to these frames, or none is between grains.
        StoreError: If the run cannot be read.
    """
    chosen, contacts = _between_grains(source, selection)
    edges = np.geomspace(_SMALLEST, _LARGEST, bins + 1)
    normal, tangential = np.zeros(bins, np.int64), np.zeros(bins, np.int64)
    total, sliding, count, rubbing = 0.0, 0.0, 0, 0
    width = np.diff(edges)
    rows: list[Floats] = []
    for found in contacts:
        f, g = np.abs(_between(found, found.force)).T
        total, sliding, count = total + float(f.sum()), sliding + float(g.sum()), count + f.size
        own, rubbed = _count(f / f.mean(), edges), np.full(bins, np.nan)
        normal += own
        if g.any():
            slid = _count(g / g.mean(), edges)
            tangential += slid
            rubbing += g.size
            rubbed = slid / (g.size * width)
        rows.append(np.array([own / (f.size * width), rubbed]))
    _need_contacts(count)
    return ForceDistribution(
        edges,
        normal / (count * width),
        tangential / (rubbing * width) if rubbing else np.full(bins, np.nan),
        normal,
        total / count,
        sliding / count,
        count,
        chosen,
        _times(source, chosen),
        *scatter(np.array(rows)),
    )


def angular_distribution(source: FrameSource, selection: Selection | None = None, bins: int = ANGLE_BINS) -> AngularDistribution:
    """Distribution of contact directions and of the forces over them.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage. Frames without contact forces are left out.
        bins: Number of bins over the full circle; even, so that opposite directions have bins of their own.

    Raises:
        PostError: If no contact forces belong to these frames, none is between grains, or the number of bins is odd.
        StoreError: If the run cannot be read.
    """
    if bins < 4 or bins % 2:
        raise PostError(f"{bins} bins of directions: choose an even number, 4 or more")
    chosen, contacts = _between_grains(source, selection)
    half = bins // 2
    sums, wave = np.zeros((3, half)), 0j
    center = (np.arange(half) + 0.5) * np.pi / half
    rows: list[Floats] = []
    moments: list[dict[str, float]] = []
    for found in contacts:
        normal, force = (_between(found, rows) for rows in (found.normal, found.force))
        # Opposite directions belong to one contact, and its forces are the same seen from either side.
        bin_ = np.minimum((np.arctan2(normal[:, 1], normal[:, 0]) % np.pi / np.pi * half).astype(np.int64), half - 1)
        own = np.array([np.bincount(bin_, weights, minlength=half) for weights in (np.ones(bin_.size), *force.T)])
        turned = complex(((normal[:, 0] + 1j * normal[:, 1]) ** 2).sum())  # e^{2iθ}
        sums, wave = sums + own, wave + turned
        rows.append(np.array(_directions(own)[:2]))
        moments.append(_moments_of(own, turned, center))
    _need_contacts(int(sums[0].sum()))
    density, mean, shear = _directions(sums)
    found_moments = _moments_of(sums, wave, center)
    around = scatter(np.array(rows))
    return AngularDistribution(
        np.concatenate([center, center + np.pi]),
        np.tile(density, 2),
        np.tile(mean, 2),
        np.tile(shear, 2),
        found_moments,
        _scatter_of(moments, found_moments),
        np.tile(around[0], 2),
        np.tile(around[1], 2),
        int(sums[0].sum()),
        chosen,
        _times(source, chosen),
    )


def _directions(sums: Floats) -> tuple[Floats, Floats, Floats]:
    """Density of directions, normal and tangential force over the mean normal force, from sums over half a circle, ``(3, b/2)``."""
    count, f, g = sums
    overall = f.sum() / count.sum()
    with np.errstate(invalid="ignore"):
        return 0.5 * count / count.sum() * count.size / np.pi, f / count / overall, g / count / overall


def _moments_of(sums: Floats, wave: complex, center: Floats) -> dict[str, float]:
    count, f, g = sums
    with np.errstate(invalid="ignore"):
        return _moments(2.0 * wave / count.sum(), center, f / count, g / count)


def _scatter_of(frames: list[dict[str, float]], overall: dict[str, float]) -> dict[str, float]:
    """Standard deviations of moments from frame to frame; directions repeat every 180°."""
    found = {}
    for name, middle in overall.items():
        away = np.array([moments[name] for moments in frames]) - middle
        found[name] = float(scatter((away + 90.0) % 180.0 - 90.0 if name.startswith("theta") else away))
    return found


def _count(values: Floats, edges: Floats) -> NDArray[np.int64]:
    """Values in each bin of edges a constant ratio apart; a value on an edge belongs to the bin above it."""
    inside = values[(values >= edges[0]) & (values < edges[-1])]
    count = edges.size - 1
    bin_ = (np.log(inside / edges[0]) * (count / np.log(edges[-1] / edges[0]))).astype(np.int64)
    return np.bincount(np.minimum(bin_, count - 1), minlength=count)


def _moments(fabric: complex, angle: Floats, normal: Floats, tangential: Floats) -> dict[str, float]:
    """Anisotropies and directions; those of forces from the bins, weighted evenly; bins without contacts do not count."""
    known = np.isfinite(normal)
    width = np.pi / angle.size
    wave = np.exp(2j * angle[known]) * (width / np.sin(width))  # a bin averages e^{2iθ} over its width w: sin(w)/w
    level = normal[known].mean()
    forces = 2.0 * (normal[known] * wave).mean() / level, 2.0j * (tangential[known] * wave).mean() / level
    found = dict(zip("cnt", (fabric, *forces), strict=True))
    moments = {f"a_{name}": float(abs(value)) for name, value in found.items()}
    return moments | {f"theta_{name}": float(np.degrees(0.5 * np.angle(value)) % 180.0) for name, value in found.items()}


def _between_grains(source: FrameSource, selection: Selection | None) -> tuple[NDArray[np.int64], Iterator[LoadedContacts]]:
    """The frames that have forces, and the contacts of those that have any between grains."""
    chosen = with_forces(source, (selection or Selection()).indices(source.frames))
    found = (loaded_contacts(frame, model_of(source, frame)) for frame in (source.frames[int(k)] for k in chosen))
    return chosen, (contacts for contacts in found if not contacts.is_wall.all())


def _need_contacts(count: int) -> None:
    if not count:
        raise PostError("no two grains press on each other in these frames")


def _between(contacts: LoadedContacts, rows: Floats) -> Floats:
    """Those of rows with one per contact that belong to contacts between grains."""
    return np.asarray(rows[~contacts.is_wall])


def _times(source: FrameSource, chosen: NDArray[np.int64]) -> tuple[float, float]:
    times = np.asarray(source.frames.time)
    return float(times[chosen[0]]), float(times[chosen[-1]])

"""How a cell conducts heat: the contacts of its frames, and what flows and mixes in it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.books import GRADIENT_BOOKS
from multicor_cli.model.cell import over_windows
from multicor_cli.model.columns import XX, YY
from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.optional import library
from multicor_cli.post.contacts import (
    NOTHING_CONDUCTS,
    conducting_contacts,
    pressure_of,
    with_conduction,
)
from multicor_cli.post.lattice import lattice_of, strains_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bounds_of_intervals,
    chosen_frames,
    frames_of,
    left_out,
    need_grains,
    need_two,
    times_of,
)
from multicor_cli.post.table import Quantity, TimeTable, average_ratios, sums_between

# ---- A network of conductances that repeats in both directions


class Network(NamedTuple):
    """Links between nodes of a plane that is periodic in both directions; ``c`` links.

    Two nodes may have several links, through several images, and a node one to its own image.

    Attributes:
        i: First node, shape ``(c,)``.
        j: Second node, or one of its images, shape ``(c,)``.
        conductance: H > 0 [W/K], shape ``(c,)``.
        branch: From the image of j to i [m], shape ``(c, 2)``.
        nodes: Number of nodes n.
        area: Area of a period [m²].
    """

    i: NDArray[Any]
    j: NDArray[Any]
    conductance: Floats
    branch: Floats
    nodes: int
    area: float

    def clusters(self) -> tuple[Any, NDArray[np.int64]]:
        """Conductances as a sparse matrix ``(n, n)``, once per link, and the cluster of each node.

        Raises:
            MissingLibrary: If SciPy is not installed.
        """
        ends, shape = (self.i, self.j), (self.nodes, self.nodes)
        links = library("scipy.sparse").coo_array((self.conductance, ends), shape=shape).tocsr()
        _, cluster = library("scipy.sparse.csgraph").connected_components(links, directed=False)
        return links, cluster

    def square(self) -> Floats:
        """Conductances K of a square of the plane [W/K], shape ``(2, 2)``: mean flux −K ∇T per
        length.

        Under a mean gradient G temperatures are G·r + τ with a periodic τ, of which no node keeps
        heat: Σ_j H_ij (τ_i − τ_j + G·ℓ_ij) = 0. One node of each cluster has τ = 0; a cluster that
        does not reach its own images then has τ = −G·r but for a constant, and carries nothing.
        K_ab = Σ H Δ_a Δ_b/A, the heat dissipated: Δ_a are the differences over the links under the
        unit gradient along a. It is symmetric, and errors of τ enter squared.

        Raises:
            MissingLibrary: If SciPy is not installed.
        """
        links, cluster = self.clusters()
        is_free = np.ones(self.nodes, np.bool_)
        is_free[np.unique(cluster, return_index=True)[1]] = False
        pull = self.conductance[:, np.newaxis] * self.branch
        inflow = np.column_stack(
            [
                np.bincount(self.j, along, self.nodes) - np.bincount(self.i, along, self.nodes)
                for along in pull.T
            ]
        )
        periodic = _balanced(links, is_free, inflow)
        return self._dissipated(self.branch + periodic[self.i] - periodic[self.j])

    def between(self, hot: int, cold: int) -> tuple[float, Floats]:
        """Conductance from one node to another [W/K], and temperatures of all, shape ``(n,)``.

        The first node has the temperature 1, the second 0, all others keep no heat:
        Σ_j H_ij (T_i − T_j) = 0. Where no heat can come from or go to it is nan. The conductance is
        the heat dissipated, Σ H (T_i − T_j)².

        Raises:
            MissingLibrary: If SciPy is not installed.
        """
        links, cluster = self.clusters()
        is_known = np.isin(cluster, cluster[[hot, cold]])
        is_free = is_known.copy()
        is_free[[hot, cold]] = False
        inflow = np.zeros((self.nodes, 1))
        for near, far in ((self.i, self.j), (self.j, self.i)):
            inflow[:, 0] += np.bincount(far, self.conductance * (near == hot), self.nodes)
        temperature = _balanced(links, is_free, inflow)[:, 0]
        temperature[hot] = 1.0
        apart = temperature[self.i] - temperature[self.j]
        is_joined = cluster[hot] == cluster[cold]
        conductance = float((self.conductance * apart**2).sum()) if is_joined else 0.0
        return conductance, np.where(is_known, temperature, np.nan)

    def linear(self) -> Floats:
        """K [W/K], shape ``(2, 2)``, if temperatures were G·r: no less than that of `square`."""
        return self._dissipated(self.branch)

    def _dissipated(self, difference: Floats) -> Floats:
        found = np.einsum("c,ca,cb->ab", self.conductance, difference, difference)
        return np.asarray(found / self.area)


def _balanced(links: Any, is_free: NDArray[np.bool_], inflow: Floats) -> Floats:
    """Temperatures of nodes into which this heat comes from elsewhere, ``(n, k)``; 0 if not free.

    ``links`` are conductances, once per link, as `Network.clusters` gives them.
    """
    found = np.zeros(inflow.shape)
    if is_free.any():
        both = links + links.T
        balance = library("scipy.sparse").diags_array(both.sum(axis=1)) - both
        direct = library("scipy.sparse.linalg").splu(
            balance.tocsc()[:, is_free][is_free],
            permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True},
            panel_size=1,  # rows of networks in a plane are short
        )  # fmt: skip
        found[is_free] = direct.solve(inflow[is_free])
    return found


# ---- What is measured in a frame

_NOTHING = 1e-12
"""Part of K for linear temperatures below which K is rounding: errors of τ enter squared."""

_AXES = ((0, 0, "xx"), (1, 1, "yy"), (0, 1, "xy"))

_OF_FRAMES = (
    Quantity("solid_fraction", "solid fraction", r"\nu"),
    Quantity("coordination", "coordination number, of conducting contacts", "Z"),
    Quantity("connected", "share of grains in the largest cluster"),
    Quantity("pressure", "contact pressure", "p", "N/m"),
    *(
        Quantity(f"square_{k}", f"conductance of a square K_{k}", f"K_{{{k}}}", "W/K")
        for _, _, k in _AXES
    ),
)
_OF_DISCS = tuple(
    Quantity(f"conductivity_{k}", f"conductivity k_{k}", f"k_{{{k}}}", "W/(m K)")
    for _, _, k in _AXES
)
_RATIOS = (
    Quantity("anisotropy", "anisotropy (K_xx − K_yy)/(K_xx + K_yy)"),
    Quantity("contact_conductance", "mean conductance of a contact H", "H", "W/K"),
    Quantity("over_contact", "mean K over H", "K/H"),
    Quantity("over_linear", "mean K over that of linear temperatures", r"K/K_\mathrm{lin}"),
)
QUANTITIES = (*_OF_FRAMES, *_OF_DISCS, *_RATIOS)
"""What `conductivity` measures, in the order of the table; conductivities of discs of one thickness
only."""


class Conductivity(TimeTable):
    """Effective conductivity of the packings of a cell; ``f`` frames, which count alike in means.

    Of each frame the network of its contacts between grains is solved, with the conductances of the
    last step, as if all else stood still; see `Network.square`. Only contacts conduct: neither the
    gas in the gaps nor radiation is counted, as frames do not hold them.

    The conductance K of a square of the plane is what conducts from one side to the other, whatever
    its size [W/K]. Discs of one thickness h have the conductivity k = K/h; a layer of spheres has
    no thickness of its own. "Mean" K is ½(K_xx + K_yy). K_xy = K_yx is the flux along x under a
    gradient along y.

    Attributes:
        values: Each of `QUANTITIES` by name, nan where not known, shape ``(f,)``.
        width: Mean width of the cell [m].
        height: Mean height [m].
        thickness: That of the discs [m]; nan of spheres, and of discs of several thicknesses.
        left_out: What else conducts in the run, and is not counted; empty if nothing does.
    """


def conductivity(source: Run, selection: Selection | None = None) -> Conductivity:
    """The effective conductivity of the packings of a cell, frame by frame, without a transient.

    Args:
        source: The run, with heat.
        selection: Which frames; default: the later half of the last stage.

    Raises:
        PostError: If no frame is selected, the run has no heat or is none of a cell, or no contact
            conducts in these frames.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    model = source.model
    if not model.is_cell:
        raise PostError(
            "conductivity needs a cell that is periodic in x and y, where one gradient holds "
            'everywhere: give [domain] periodic = ["x", "y"]; between walls, see layer_conductivity'
        )
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    counted = with_conduction(source, chosen)
    rows = [_measure(frame.model, frame) for frame in frames_of(source, counted)]
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    if not values["coordination"].any():
        raise PostError(NOTHING_CONDUCTS)
    thickness = thickness_of(model)
    values |= {f"conductivity_{k}": values[f"square_{k}"] / thickness for _, _, k in _AXES}
    shown = QUANTITIES if np.isfinite(thickness) else (*_OF_FRAMES, *_RATIOS)
    return Conductivity.of_frames(
        source, counted, shown, values,
        **{name: float(values[name].mean()) for name in ("width", "height")},
        thickness=thickness, left_out=left_out(source),
    )  # fmt: skip


def _measure(model: Model, frame: Frame) -> dict[str, float]:
    """Width and height of the cell of a frame, and `QUANTITIES` but for conductivities."""
    lattice, (contacts, h) = lattice_of(model, frame), conducting_contacts(frame, model)
    n, area = model.grain_count, lattice.area
    network = Network(contacts.i, contacts.j, h, contacts.branch, n, area)
    square, contact = network.square(), float(h.mean()) if h.size else np.nan
    mean, linear = 0.5 * np.trace(square), 0.5 * np.trace(network.linear())
    is_carrying = mean > _NOTHING * linear
    return {
        "width": lattice.width, "height": lattice.height,
        "solid_fraction": np.pi * float((model.disc_radius**2).sum()) / area,
        "coordination": 2.0 * h.size / n,
        "connected": float(np.bincount(network.clusters()[1]).max()) / n,
        "pressure": pressure_of(frame, model, area),
        **{f"square_{k}": float(square[a, b]) for a, b, k in _AXES},
        "anisotropy": 0.5 * (square[0, 0] - square[1, 1]) / mean if is_carrying else np.nan,
        "contact_conductance": contact,
        "over_contact": mean / contact,
        "over_linear": mean / linear if linear > 0.0 else np.nan,
    }  # fmt: skip


def thickness_of(model: Model) -> float:
    """The thickness of the discs [m]; nan of spheres, and of discs of several thicknesses."""
    assert model.thermal is not None
    # The surface that exchanges heat is 2π a h of a disc
    thickness = model.thermal.surface / model.perimeter
    is_one = model.shape_factor == SHAPE_FACTOR["disc"] and np.ptp(thickness) < 1e-9 * thickness[0]
    return float(thickness[0]) if is_one else np.nan


# ---- Mean heat flux under a mean gradient of temperature: what conducts, and what mixes

WAYS = ("contacts", "gas", "radiation", "motion")
"""What carries heat."""

SHARES = tuple(Quantity(f"share_{way}", f"share of {way}") for way in WAYS)
"""What each has of the flux."""

_MEASURED = (
    Quantity("along", "heat flow along the gradient, over it", r"K_\parallel", "W/K"),
    Quantity("across", "heat flow across it, over the gradient", r"K_\perp", "W/K"),
)
_CONDUCTIVITY = (Quantity("conductivity", "effective conductivity", "k", "W/(m K)"),)
_MORE = (
    *SHARES,
    Quantity("diffusivity", "thermal diffusivity without motion", r"\alpha", "m2/s"),
    Quantity("mixing", "diffusivity by motion", r"D_T", "m2/s"),
    Quantity("self_diffusion", "self-diffusion of grains along the gradient", "D", "m2/s"),
    Quantity("peclet", "Péclet number (rate × d²/diffusivity)", r"\mathrm{Pe}"),
    Quantity("fluctuation", "temperature fluctuation over that of a diameter", r"T'/(|G|d)"),
)
FLUX_QUANTITIES = (*_MEASURED, *_CONDUCTIVITY, *_MORE)
"""What `mean_heat` measures, in the order of the table; the conductivity of discs of one thickness
only."""

FORGOTTEN = 1.0
"""Strain in which grains forget how they moved: over less they do not diffuse yet."""

_SUMS = (
    "window", "area", *(f"strain_{k}" for k in ("xx", "yy", "xy")),
    *(entry.name for entry in GRADIENT_BOOKS),
    "spreading", "lapse", "square", "grains",
)  # fmt: skip


class MeanHeat(TimeTable):
    """Mean heat flux of a cell with a mean gradient G; ``r`` intervals between frames.

    The flux is that of all steps, from the time series. K is the heat flow per length of the plane
    over |G|: positive along the gradient if heat flows down it, and across it if it flows to the
    right of that (under a gradient along x: K_xx and K_yx; along y: K_yy and −K_xy). Discs of one
    thickness h have the conductivity k = K/h along it. What grains carry is C (T − ⟨T⟩) times their
    velocity beside the mean flow.

    Diffusivities are K A/ΣC, α of all but motion. The Péclet number is the shear rate
    √((L_xx − L_yy)² + L_xy²) times d̄²/α. The self-diffusion D is half of what the mean square of
    the displacements beside the mean flow along G grows by in an interval, counted from some
    intervals before, in which the cell is strained by 1 (``counted_from`` of them): grains first
    have to forget how they moved. The fluctuation is the root mean square of T − ⟨T⟩ at the ends
    of the intervals.

    Attributes:
        values: Each of `FLUX_QUANTITIES` by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        gradient: G (x, y) [K/m].
        thickness: That of the discs [m]; nan of spheres, and of discs of several thicknesses.
        counted_from: How many intervals before each one displacements begin.
    """


def mean_heat(source: Run, selection: Selection | None = None) -> MeanHeat:
    """The mean heat flux under the mean gradient of a run, over time and on average.

    Args:
        source: The run, of a cell with ``heat.gradient``.
        selection: Which frames bound the intervals; default: the later half of the last stage.

    Raises:
        PostError: If the run has no mean gradient, or fewer than two frames are selected.
        StoreError: If the run cannot be read.
    """
    model = source.model
    if not any(model.heat_gradient):
        raise PostError(
            "the run has no mean gradient of temperature: give the [heat] of a cell a gradient, "
            "as [0.0, 1000.0], and run it again"
        )
    chosen = bounds_of_intervals(source, chosen_frames(source, selection))
    need_grains(source, chosen)
    need_two(chosen, "a mean flux needs two frames")
    times = times_of(source, chosen)
    of_series = _series_sums(source, times)
    back = intervals_to_forget(_shear_rate(*of_series[:, 2:5].T))
    sums = np.column_stack([of_series, _frame_sums(source, chosen, times, back)])
    found = average_ratios(lambda rows: _derive(model, rows), sums, times)
    thickness = thickness_of(model)
    shown = FLUX_QUANTITIES if np.isfinite(thickness) else (*_MEASURED, *_MORE)
    return MeanHeat.of_frames(
        source, chosen, shown, found, gradient=model.heat_gradient, thickness=thickness,
        counted_from=back
    )  # fmt: skip


def intervals_to_forget(strain: Floats) -> int:
    """How many intervals a flow has to be strained in for `FORGOTTEN`, at most half of them all.

    ``strain`` is that in each interval, shape ``(r,)``; of what is at rest 1.
    """
    mean, most = float(strain.mean()), max(1, (strain.size + 1) // 2)
    return int(np.clip(np.ceil(FORGOTTEN / mean), 1, most)) if mean > 0.0 else 1


def _series_sums(source: Run, times: Floats) -> Floats:
    """The sums `_SUMS` that the time series knows, in each interval, shape ``(r, …)``."""
    series = source.series
    time = np.asarray(series["time"])
    duration, sides = np.diff(time, prepend=0.0), np.asarray(series["wall_position"])[:, 0]
    area = over_windows(sides[:, XX] * sides[:, YY])
    books = np.column_stack([np.asarray(series[str(entry.series)]) for entry in GRADIENT_BOOKS])
    gained = np.diff(books, axis=0, prepend=np.zeros((1, books.shape[1])))
    strain = np.diff(strains_of(source).strain, axis=0, prepend=0.0)
    rows = np.column_stack([duration, duration * area, strain, gained])
    return sums_between(time, times, rows)


def _frame_sums(source: Run, chosen: NDArray[np.int64], times: Floats, back: int) -> Floats:
    """The others: what displacements spread by and the time of it, and squares of temperatures.

    Displacements begin ``back`` intervals before each interval; those without are left out.
    """
    gradient = np.array(source.model.heat_gradient)
    way, squares = [], []
    for frame in frames_of(source, chosen):
        way.append(frame.nonaffine @ gradient / np.hypot(*gradient))
        temperature = np.asarray(frame.temperature, np.float64)
        squares.append(((temperature - temperature.mean()) ** 2).sum())
    rows = []
    for k, (start, end) in enumerate(pairwise(times)):
        spreading = lapse = 0.0
        if k + 1 >= back:
            first, second = (((w - way[k + 1 - back]) ** 2).mean() for w in way[k : k + 2])
            spreading, lapse = 0.5 * (second - first), end - start
        rows.append((spreading, lapse, squares[k + 1], way[0].size))
    return np.array(rows)


def _shear_rate(xx: Floats, yy: Floats, xy: Floats) -> Floats:
    return np.asarray(np.hypot(xx - yy, xy))


def _derive(model: Model, sums: Floats) -> dict[str, Floats]:
    """Each of `FLUX_QUANTITIES` from rows of sums."""
    s = dict(zip(_SUMS, sums.T, strict=True))
    gx, gy = model.heat_gradient
    size = float(np.hypot(gx, gy))
    assert model.thermal is not None
    # Down the gradient, and to the right of that
    by = {
        way: 0.0 - (gx * s[f"{way}_x"] + gy * s[f"{way}_y"]) / (size**2 * s["window"])
        for way in WAYS
    }
    to_the_right = sum(-gy * s[f"{way}_x"] + gx * s[f"{way}_y"] for way in WAYS)
    along = np.sum([*by.values()], axis=0)
    to_diffusivity = s["area"] / s["window"] / model.thermal.capacity.sum()
    diffusivity = (along - by["motion"]) * to_diffusivity
    rate = _shear_rate(s["strain_xx"], s["strain_yy"], s["strain_xy"]) / s["window"]
    return {
        "along": along,
        "across": -to_the_right / (size**2 * s["window"]),
        "conductivity": along / thickness_of(model),
        **{f"share_{way}": by[way] / along for way in WAYS},
        "diffusivity": diffusivity,
        "mixing": by["motion"] * to_diffusivity,
        "self_diffusion": s["spreading"] / s["lapse"],
        "peclet": rate * model.mean_diameter**2 / diffusivity,
        "fluctuation": np.sqrt(s["square"] / s["grains"]) / (size * model.mean_diameter),
    }

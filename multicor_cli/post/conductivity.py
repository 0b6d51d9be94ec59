"""Effective conductivity of the packings of a cell, from the contacts of its frames."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.optional import library
from multicor_cli.post.contacts import (
    NOTHING_CONDUCTS,
    conducting_contacts,
    has_forces,
    loaded_contacts,
    with_conduction,
)
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    left_out,
    model_of,
    need_grains,
)
from multicor_cli.post.table import Quantity, TimeTable

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
        time: Times of the frames [s], shape ``(f,)``.
        values: Each of `QUANTITIES` by name, nan where not known, shape ``(f,)``.
        width: Mean width of the cell [m].
        height: Mean height [m].
        thickness: That of the discs [m]; nan of spheres, and of discs of several thicknesses.
        left_out: What else conducts in the run, and is not counted; empty if nothing does.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "width", "height", "thickness", "left_out", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


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
    chosen = (selection or Selection()).indices(source.frames)
    need_grains(source, chosen)
    counted = with_conduction(source, chosen)
    rows = [_measure(model_of(source, frame), frame) for frame in frames_of(source, counted)]
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    if not values["coordination"].any():
        raise PostError(NOTHING_CONDUCTS)
    thickness = thickness_of(model)
    values |= {f"conductivity_{k}": values[f"square_{k}"] / thickness for _, _, k in _AXES}
    shown = QUANTITIES if np.isfinite(thickness) else (*_OF_FRAMES, *_RATIOS)
    facts = {
        **{name: float(values[name].mean()) for name in ("width", "height")},
        "thickness": thickness, "left_out": left_out(source), **frames_told(source, counted),
    }  # fmt: skip
    times = np.asarray(source.frames.time, np.float64)[counted]
    quantities = [q.over_time(values[q.name]) for q in shown]
    return Conductivity(times, quantities, facts, frames=counted)


def _measure(model: Model, frame: Frame) -> dict[str, float]:
    """Width and height of the cell of a frame, and `QUANTITIES` but for conductivities."""
    lattice, (contacts, h) = lattice_of(model, frame), conducting_contacts(frame, model)
    n, area = model.grain_count, lattice.area
    network = Network(contacts.i, contacts.j, h, contacts.branch, n, area)
    square, contact = network.square(), float(h.mean()) if h.size else np.nan
    mean, linear = 0.5 * np.trace(square), 0.5 * np.trace(network.linear())
    is_carrying = mean > _NOTHING * linear
    pressure = np.nan
    if has_forces(frame):
        loaded = loaded_contacts(frame, model)
        pressure = 0.5 * float((loaded.virial(0, 0) + loaded.virial(1, 1)).sum()) / area
    return {
        "width": lattice.width, "height": lattice.height,
        "solid_fraction": np.pi * float((model.disc_radius**2).sum()) / area,
        "coordination": 2.0 * h.size / n,
        "connected": float(np.bincount(network.clusters()[1]).max()) / n,
        "pressure": pressure,
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

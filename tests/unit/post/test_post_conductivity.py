"""Conductivity of lattices, chains and packings of a cell, against closed forms and dense solves."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cells import THICKNESS, square_of_discs
from made_up_frames import contacts_of
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, conductivity
from multicor_cli.post.conductivity import QUANTITIES, Network
from multicor_cli.post.lattice import Lattice

ALL = Selection(start=0.0)


def network(links, nodes, area):
    """Links are rows of i, j, conductance and branch, x and y."""
    i, j, h, *branch = np.array(links, float).T
    return Network(i.astype(int), j.astype(int), h, np.column_stack(branch), nodes, area)


def packing(lattice, position, reach):
    """Links between all images of nodes that are nearer than ``reach``; conductances differ."""
    links = []
    for up in (-1, 0, 1):
        for right in range(-3, 4):
            shift = np.array([right * lattice.width + up * lattice.tilt, up * lattice.height])
            for i in range(len(position)):
                for j in range(i + 1, len(position)):
                    branch = position[i] - position[j] - shift
                    if np.hypot(*branch) < reach:
                        links.append((i, j, 1.0 + (0.37 * i + 0.61 * j) % 1.0, *branch))
    return network(links, len(position), lattice.area)


def scattered(lattice, count=40, seed=3):
    right, up = lattice.corners[1], lattice.corners[3]
    part = np.random.default_rng(seed).random((count, 2))
    return part[:, :1] * right + part[:, 1:] * up


LATTICE = Lattice(6.0, 5.0, 1.3)
REACH = 1.0


@pytest.mark.parametrize("size", [1, 7])
def test_a_square_lattice(size):
    """K = H: a square of n by n has n chains of n contacts, whatever its size."""
    place = np.arange(size * size).reshape(size, size)
    links = [
        (place[y, x], place[(y - up) % size, (x - right) % size], 0.3, 2.0 * right, 2.0 * up)
        for y in range(size)
        for x in range(size)
        for right, up in ((1, 0), (0, 1))
    ]
    found = network(links, size * size, 4.0 * size**2)
    np.testing.assert_allclose(found.square(), 0.3 * np.eye(2), atol=1e-15)


@pytest.mark.parametrize("size", [1, 7])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_triangular_lattice(size, angle):
    """K = √3 H in all directions."""
    place = np.arange(size * size).reshape(size, size)
    links = []
    for k, (right, up) in enumerate(((1, 0), (0, 1), (-1, 1))):
        towards = np.array([np.cos(angle + k * np.pi / 3.0), np.sin(angle + k * np.pi / 3.0)])
        links += [
            (place[y, x], place[(y - up) % size, (x - right) % size], 0.3, *(2.0 * towards))
            for y in range(size)
            for x in range(size)
        ]
    found = network(links, size * size, 2.0 * np.sqrt(3.0) * size**2)
    np.testing.assert_allclose(found.square(), np.sqrt(3.0) * 0.3 * np.eye(2), atol=1e-14)


def test_chains_in_series_and_in_parallel():
    """Along x two chains of two contacts, 1/(1/1 + 1/3) + 1/(1/2 + 1/2) over a cell of 4 by 5;
    along y nothing, and what ends blindly or stands alone carries nothing."""
    links = [
        (0, 1, 1.0, 2.0, 0.0), (1, 0, 3.0, 2.0, 0.0),
        (2, 3, 2.0, 1.0, 0.5), (3, 2, 2.0, 3.0, -0.5),
        (4, 1, 7.0, 0.0, 1.0), (5, 6, 9.0, 1.0, 1.0), (6, 7, 2.0, 0.0, 1.0), (7, 5, 4.0, -1.0, -2.0),
    ]  # fmt: skip
    found = network(links, 9, 20.0)
    along = (0.75 + 1.0) * 4.0 / 5.0
    np.testing.assert_allclose(found.square(), [[along, 0.0], [0.0, 0.0]], atol=1e-15)


def test_a_packing_against_a_dense_solve():
    """Fluxes, as they are defined, of temperatures found with singular values."""
    found = packing(LATTICE, scattered(LATTICE), REACH)
    i, j, h, branch, n, area = found
    balance, heat = np.zeros((n, n)), np.zeros((n, 2))
    for a, b, c, way in zip(i, j, h, branch, strict=True):
        balance[[a, b], [a, b]] += c
        balance[[a, b], [b, a]] -= c
        heat[a] -= c * way
        heat[b] += c * way
    tau = np.linalg.lstsq(balance, heat, rcond=None)[0]
    flux = np.einsum("c,ca,cb->ab", h, branch, branch + tau[i] - tau[j]) / area
    assert np.unique(found.clusters()[1]).size > 1
    np.testing.assert_allclose(found.square(), flux, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(flux, flux.T, atol=1e-13)
    above = np.linalg.eigvalsh(found.linear() - found.square())
    assert above.min() > 0.1


def test_it_does_not_matter_how_a_packing_is_told():
    """Shifted, in other order, in a cell of another lattice vector, or in four cells."""
    at = scattered(LATTICE)
    expected = packing(LATTICE, at, REACH).square()
    same = {"rtol": 1e-12, "atol": 1e-13}
    leaning = LATTICE._replace(tilt=LATTICE.tilt + LATTICE.width)
    for lattice in (LATTICE, leaning, LATTICE._replace(tilt=LATTICE.tilt - LATTICE.width)):
        moved = packing(lattice, lattice.wrapped(at + np.array([2.1, 3.7])), REACH)
        links = sorted(zip(moved.i, moved.j, strict=True))
        assert links == sorted(zip(*packing(LATTICE, at, REACH)[:2], strict=True))
        np.testing.assert_allclose(moved.square(), expected, **same)
    once = packing(LATTICE, at, REACH)
    n, parts = once.nodes, []
    crosses = np.rint((at[once.i] - at[once.j] - once.branch)[:, 1] / LATTICE.height).astype(int)
    for k in (0, 1):  # twice as high
        parts += [
            (i + k * n, j + (k + up) % 2 * n, h, *branch)
            for i, j, h, branch, up in zip(*once[:4], crosses, strict=True)
        ]
    np.testing.assert_allclose(network(parts, 2 * n, 2.0 * once.area).square(), expected, **same)


# --- tables of frames


def test_what_is_in_a_table():
    table = conductivity(square_of_discs([0.3, 0.5]), ALL)
    assert [quantity.name for quantity in QUANTITIES] == [*table.mean]
    expected = {
        "solid_fraction": np.pi * 1.01 / 4.0, "coordination": 16 / 5, "connected": 4 / 5,
        "pressure": 1.0, "anisotropy": 0.0, "over_contact": 1.0, "over_linear": 1.0,
        "contact_conductance": 0.4, "square_xx": 0.4, "square_yy": 0.4, "square_xy": 0.0,
        "conductivity_xx": 1.6, "conductivity_yy": 1.6, "conductivity_xy": 0.0,
    }  # fmt: skip
    assert table.mean == pytest.approx(expected, abs=1e-14)
    np.testing.assert_allclose(table.values["square_yy"], [0.3, 0.5])
    data = table.as_dict()
    assert (data["width"], data["height"], data["thickness"]) == (2.0, 2.0, THICKNESS)
    assert (data["frame_count"], data["times"], data["left_out"]) == (2, [0.0, 1.0], "")
    assert len(table.detail_rows) == 2


def test_conductivities_need_one_thickness():
    source = square_of_discs([0.3])
    model = source.model
    for other in (
        square_of_discs([0.3], thickness=np.array([1.0, 1.0, 1.0, 1.0, 2.0])).model,
        replace(model, shape_factor=2.5),
    ):
        source.model = other
        table = conductivity(source, ALL)
        assert "conductivity_xx" not in table.mean
        assert np.isnan(table.thickness)
        assert table.mean["square_xx"] == pytest.approx(0.3)


def test_what_is_left_out_is_said():
    air = "[heat]\ngas = { conductivity = 0.026 }\n"
    seen = "[heat.radiation]\nneighbors = true\n"
    said = [
        conductivity(square_of_discs([0.3], scenario_resolved=text), ALL).left_out
        for text in (air, seen, air + seen, "[heat.radiation]\nsurroundings = 300.0\n")
    ]
    assert said == [
        "the gas in the gaps",
        "radiation between neighbors",
        "the gas in the gaps and radiation between neighbors",
        "",
    ]


def test_frames_without_contacts_do_not_count():
    """Not recorded, or of the start; but one in which nothing touches does."""
    source = square_of_discs([0.3, 0.3, 0.5, 0.7])
    source.frames[0].step = 0
    source.frames[1].contacts = contacts_of(recorded=False)
    source.frames[3].contacts.conductance = np.zeros(8)
    table = conductivity(source, ALL)
    assert table.frames.tolist() == [2, 3]
    np.testing.assert_allclose(table.values["square_xx"], [0.5, 0.0])
    np.testing.assert_array_equal(table.values["anisotropy"], [0.0, np.nan])
    with pytest.raises(PostError, match="no contact conducts in these frames"):
        conductivity(source, Selection(frames=slice(3, None)))
    with pytest.raises(PostError, match="these frames have no contacts"):
        conductivity(source, Selection(frames=slice(0, 2)))


def test_a_cluster_that_ends_carries_nothing():
    """Two contacts of a chain that does not reach its image: no anisotropy of rounding."""
    source = square_of_discs([0.3, 0.3])
    source.frames[1].contacts.conductance = np.array([1.0, 0, 0, 0, 1.0, 0, 0, 0])
    table = conductivity(source, ALL)
    assert table.values["square_xx"][1] == pytest.approx(0.0, abs=1e-20)
    assert np.isnan(table.values["anisotropy"][1])
    assert table.values["connected"][1] == 3 / 5


def test_wrong_runs_are_refused():
    between_walls = SimpleNamespace(model=make_model([0.5]))
    with pytest.raises(PostError, match=r'needs a cell .* give \[domain\] periodic = \["x", "y"\]'):
        conductivity(between_walls, ALL)
    with pytest.raises(PostError, match="the run has no heat"):
        conductivity(square_of_discs([0.3], heat=False), ALL)

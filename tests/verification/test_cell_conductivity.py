"""How a packing in a cell conducts: with the pressure, and against the decay of temperatures."""

import csv
import io
import json

import numpy as np
import pytest
from command_line import call
from scenes import CONDUCTING
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import eigsh

from multicor_cli.post import Selection, conductivity
from multicor_cli.post.contacts import conducting_contacts
from multicor_cli.store import open_run
from multicor_cli.studies.observing import take_one
from multicor_cli.studies.study_file import Observable

PRESSURES = (10.0, 80.0, 640.0)


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    """A run in which frictionless discs bear three pressures, one after the other."""
    folder = tmp_path_factory.mktemp("cell")
    (folder / "packing.toml").write_text(CONDUCTING)
    done = call("run", "packing.toml", "-o", "run", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "run"


@pytest.fixture(scope="module")
def run(directory):
    with open_run(directory) as run:
        yield run


def test_it_grows_with_the_cube_root_of_the_pressure(run):
    """Forces grow in proportion to it, spots of smooth elastic grains with F^⅓ (discs count as
    spheres there). Rigid discs keep their places, but for what overlaps of 10⁻⁴ allow."""
    ends = [np.flatnonzero(run.frames.stage == stage)[-1] for stage in (1, 2, 3)]
    tables = [conductivity(run, Selection(frames=slice(k, k + 1))) for k in ends]
    assert [t.mean["pressure"] for t in tables] == pytest.approx(PRESSURES, rel=1e-3)
    square = np.array([[t.mean["square_xx"], t.mean["square_yy"]] for t in tables])
    exponent = np.log(square[1:] / square[0]) / np.log([[8.0], [64.0]])
    print("exponents", exponent.round(5).tolist())
    np.testing.assert_allclose(exponent, 1.0 / 3.0, atol=0.01)
    ratio = [t.mean["over_contact"] for t in tables]
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.02)


def test_what_stands_still_conducts_as_before(run):
    """In a frozen stage contacts and their conductances are those of the step before."""
    still = conductivity(run, Selection(frames=slice(-2, None)))
    before = np.flatnonzero(run.frames.stage == 3)[-1]
    moving = conductivity(run, Selection(frames=slice(before, before + 1)))
    assert np.ptp(still.values["square_xx"]) == 0.0
    for name in ("square_xx", "square_yy", "contact_conductance", "coordination", "pressure"):
        assert still.mean[name] == pytest.approx(moving.mean[name], rel=1e-6), name


def test_long_waves_of_temperature_decay_as_it_says(run):
    """Rate K q² A/C of the slowest wave in 4, 8 and 16 copies of the packing side by side, from the
    heat balances of the grains; grains without contacts do not take part. In fewer copies a grain
    that hardly touches another is slower."""
    table = conductivity(run, Selection(frames=slice(-1, None)))
    frame, model = run.frames[-1], run.model
    contacts, h = conducting_contacts(frame, model)
    i, j = contacts.i, contacts.j
    place, (width, height, _) = np.asarray(frame.position)[:, :2], frame.wall_position[0]
    to_the_right = np.rint((place[i] - place[j] - contacts.branch)[:, 0] / width).astype(int)
    touching = np.unique([i, j])
    capacity = model.thermal.capacity[touching]
    i, j, n = np.searchsorted(touching, i), np.searchsorted(touching, j), touching.size
    found = []
    for copies in (4, 8, 16):
        first = np.concatenate([i + k * n for k in range(copies)])
        second = np.concatenate([j + (k + to_the_right) % copies * n for k in range(copies)])
        links = coo_array((np.tile(h, copies), (first, second)), shape=(copies * n,) * 2).tocsr()
        links = links + links.T
        scale = diags_array(1.0 / np.sqrt(np.tile(capacity, copies)))
        balance = scale @ (diags_array(links.sum(axis=1)) - links) @ scale
        rates = eigsh(balance.tocsc(), k=3, sigma=-1e-6, return_eigenvectors=False)
        wave = 2.0 * np.pi / (copies * width)
        expected = table.mean["square_xx"] * wave**2 * width * height / capacity.sum()
        found.append(np.sort(rates)[1] / expected)
    print("rate over that of the continuum", np.round(found, 5).tolist())
    assert found[0] < found[1] < found[2] < 1.0
    assert found[2] > 0.999


def test_a_study_takes_it(directory, run):
    row = {"name": "k", "post": "conductivity", "value": "conductivity_xx", "after": {"time": 1.5}}
    found = take_one(directory, Observable.model_validate(row), {})
    assert found.value == conductivity(run, Selection(start=1.5)).mean["conductivity_xx"]


def test_how_it_leaves_the_program(directory, tmp_path):
    words = ("post", "conductivity", directory, "--network", "--frames", "-8:")
    said = call(*words, cwd=tmp_path)
    assert "; not counted: the gas in the gaps" in said.stderr
    assert "conductivity k_xx [W/(m K)]" in " ".join(said.stdout.split())
    data = json.loads(call(*words, "--json", cwd=tmp_path).stdout)
    rows = [*csv.DictReader(io.StringIO(call(*words, "--csv", cwd=tmp_path).stdout))]
    assert [float(row["square_xx [W/K]"]) for row in rows] == data["values"]["square_xx"]
    assert data["thickness"] == pytest.approx(1e-3)
    assert data["mean"]["conductivity_xx"] == pytest.approx(1e3 * data["mean"]["square_xx"])
    for figure in ("k.png", "term"):
        done = call(*words, "--plot", figure, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "k.png").stat().st_size > 10_000
    assert "of a square [W/K]" in done.stderr

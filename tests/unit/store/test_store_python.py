"""What a run is in Python and in a notebook: a line, a picture, DataFrames, and what its grains
are."""

import io
import sys

import numpy as np
import pytest
from scenes import SMALL, WARM

from multicor_cli import open_run, picture, run
from multicor_cli.optional import MissingLibrary
from multicor_cli.scenario import parse_scenario


def computed(text, path):
    scenario = parse_scenario(text, "scenario.toml").with_({"loading.0.duration": 4e-3})
    run(scenario, path)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("python")
    computed(WARM, path / "warm")
    computed(SMALL, path / "small")
    return path


@pytest.fixture
def warm(folder):
    with open_run(folder / "warm") as found:
        yield found


@pytest.fixture
def small(folder):
    with open_run(folder / "small") as found:
        yield found


def test_everything_says_in_a_line_what_it_is(small):
    last, time = small.frames[-1], f"{small.frames.time[-1]:.6g}"
    count = len(last.contacts)
    assert count > 1
    assert (
        repr(small)
        == f"<Run {small.path}: finished, 60 grains, t = {time} s, {len(small.frames)} frames>"
    )
    assert repr(small.frames) == f"<{len(small.frames)} frames, t = 0 to {time} s>"
    assert repr(last) == f"<Frame {last.index}: 60 grains, t = {time} s, step {last.step}, stage 2>"
    assert repr(last.contacts) == f"<Contacts of frame {last.index}: {count} contacts>"
    assert (
        repr(small.series)
        == f"<Series: {small.series.row_count} points of {len(small.series)} quantities>"
    )
    low, high = small.model.grains.radius.min(), small.model.grains.radius.max()
    assert repr(small.grains) == f"<Grains: 60 grains, radius {low:.4g} to {high:.4g} m>"


def test_grains_have_names_and_sizes(small):
    grains = small.grains
    assert set(grains.group) == {"grains"}
    assert set(grains.material) == {"glass"}
    assert len(grains) == 60
    np.testing.assert_allclose(grains.mass, 2500.0 * 1e-3 * np.pi * grains.radius**2, rtol=1e-12)
    np.testing.assert_allclose(grains.inertia, 0.5 * grains.mass * grains.radius**2, rtol=1e-12)
    np.testing.assert_array_equal(small.frames[0].grains.radius, grains.radius)


def test_grains_are_a_table(warm):
    pytest.importorskip("pandas")
    frame = warm.frames[-1]
    table = frame.to_pandas()
    assert table.index.name == "grain"
    np.testing.assert_array_equal(table.index, np.arange(len(frame.position)))
    for names, values in {
        ("x", "y"): frame.position,
        ("velocity_x", "velocity_y"): frame.velocity,
    }.items():
        np.testing.assert_array_equal(table[list(names)], values)
    np.testing.assert_array_equal(table["spin"], frame.spin)
    np.testing.assert_array_equal(table["temperature"], frame.temperature)
    np.testing.assert_array_equal(table["radius"], warm.grains.radius)
    units = table.attrs["units"]
    assert (units["velocity_x"], units["spin"], units["mass"], units["temperature"]) == (
        "m/s", "rad/s", "kg", "K",
    )  # fmt: skip


def test_contacts_are_a_table(warm):
    pytest.importorskip("pandas")
    contacts = warm.frames[-1].contacts
    table = contacts.to_pandas()
    assert len(table) == len(contacts) > 0
    np.testing.assert_array_equal(table[["i", "j"]], np.stack([contacts.i, contacts.j], axis=1))
    np.testing.assert_array_equal(table[["normal_impulse", "tangential_impulse"]], contacts.impulse)
    np.testing.assert_array_equal(table["conductance"], contacts.conductance)
    assert table.attrs["units"]["conductance"] == "W/K"
    assert len(table[table.sliding]) == contacts.sliding.sum()


def test_the_series_is_a_table(small):
    pytest.importorskip("pandas")
    table = small.series.to_pandas()
    np.testing.assert_array_equal(table.index, small.series["time"])
    np.testing.assert_array_equal(table["kinetic"], small.series["kinetic"])
    wall = small.wall_names.index("top")
    np.testing.assert_array_equal(
        table[["top: force_x", "top: force_y", "top: torque"]], small.series["wall_force"][:, wall]
    )
    assert table.attrs["units"]["top: torque"] == "N m"


def test_without_pandas_a_message_says_what_to_install(small, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    for what in (small.series, small.frames[0], small.frames[0].contacts):
        with pytest.raises(
            MissingLibrary,
            match=(
                r"DataFrames need pandas, which is not installed: pip install "
                r"'multicor-cli\[study\]'"
            ),
        ):
            what.to_pandas()


def test_a_notebook_shows_a_map_where_it_can_be_drawn(warm, small, monkeypatch):
    image = pytest.importorskip("matplotlib.image")
    for shown in (warm, warm.frames[0], small):
        drawn = picture(shown)
        pixels = image.imread(io.BytesIO(drawn), format="png")
        assert len(np.unique(pixels.reshape(-1, pixels.shape[2]), axis=0)) > 20
    monkeypatch.setattr("multicor_cli.plots.grain_map.find_spec", lambda name: None)
    assert picture(small) is None

"""Runs as Python users see them: short names, DataFrames, pictures in a notebook."""

import sys

import numpy as np
import pytest

from multicor_cli.plots.notebook import picture
from multicor_cli.store import open_run


def test_what_is_shown_is_short_and_says_what_it_is(finished):
    with open_run(finished) as run:
        frame = run.frames[-1]
        shown = [repr(part) for part in (run, run.frames, frame, frame.contacts, run.series)]
        assert all(len(text) < 200 or text.startswith("<Series") for text in shown)
        assert shown[0].endswith(f"finished, {run.model.grain_count} grains, {len(run.frames)} frames>")
        assert f"{frame.time:g} s" in shown[2]
        assert "0x" not in "".join(shown)


def test_grains_are_where_people_look_for_them(finished):
    with open_run(finished) as run:
        assert run.grains.radius is run.model.grains.radius
        assert run.frames[0].grains.mass.shape == run.frames[0].velocity[:, 0].shape


def test_data_frames_hold_what_the_arrays_do(finished):
    pytest.importorskip("pandas")
    with open_run(finished) as run:
        frame = run.frames[-1]
        grains, contacts, series = frame.to_pandas(), frame.contacts.to_pandas(), run.series.to_pandas()
        assert np.array_equal(grains[["x", "y"]].to_numpy(), frame.position)
        assert np.array_equal(grains["velocity_y"], frame.velocity[:, 1])
        assert np.array_equal(grains["radius"], run.grains.radius)
        assert grains.attrs["units"]["velocity_y"] == "m/s"
        assert len(contacts) == len(frame.contacts)
        assert np.array_equal(contacts["i"], frame.contacts.i)
        assert np.array_equal(series.index, run.series["time"])
        assert np.array_equal(series["kinetic"], run.series["kinetic"])


def test_without_pandas_it_is_said_what_is_missing(finished, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with open_run(finished) as run, pytest.raises(ImportError, match="pip install"):
        run.frames[0].to_pandas()


def test_a_notebook_shows_a_map(finished):
    pytest.importorskip("matplotlib")
    with open_run(finished) as run:
        assert picture(run).startswith(b"\x89PNG")
        assert picture(run.frames[0]).startswith(b"\x89PNG")

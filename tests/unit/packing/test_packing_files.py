"""Grains from files and from runs; what is wrong with a file is named with its row."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import scene_parts
from store_support import make_model, run_whole

from multicor_cli.packing import file
from multicor_cli.packing.file import read_frame, read_grains
from multicor_cli.packing.overlap import CROWD, Groups, overlap_problems, thin_crowds
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import Refused


def csv(tmp_path, text, name="grains.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def hdf5(tmp_path, **columns):
    path = tmp_path / "grains.h5"
    with h5py.File(path, "w") as out:
        for name, values in columns.items():
            if isinstance(values, dict):
                out.create_dataset(name, **values)
            else:
                out[name] = values
    return path


def refused(path, words):
    with pytest.raises(Refused, match=words) as caught:
        read_grains(path, (0.0, 0.0))
    assert caught.value.where == ("packing", "path")


def test_csv_with_all_columns_in_any_order(tmp_path):
    head = "# made by hand\nradius, x ,y,spin,angle,vx,vy\n"
    text = f"{head}1e-3,0.01,0.02,3,0.5,-1,2\n\n2e-3,0.03,0.04,0,0,0,0\n"
    grains = read_grains(csv(tmp_path, text), (0.1, -0.01))
    np.testing.assert_array_equal(grains.radius, [1e-3, 2e-3])
    np.testing.assert_allclose(grains.position, [[0.11, 0.01, 0.5], [0.13, 0.03, 0.0]])
    np.testing.assert_array_equal(grains.velocity, [[-1, 2, 3], [0, 0, 0]])


def test_csv_with_byte_order_mark_and_one_row(tmp_path):
    grains = read_grains(csv(tmp_path, "\ufeffx,y,radius\r\n0.01,0.02,1e-3\r\n"), (0.0, 0.0))
    np.testing.assert_array_equal(grains.position, [[0.01, 0.02, 0.0]])
    np.testing.assert_array_equal(grains.velocity, np.zeros((1, 3)))


def test_hdf5(tmp_path):
    path = hdf5(tmp_path, x=[0.01, 0.02], y=np.float32([1, 2]), radius=[1e-3, 1e-3], vx=[1, 2])
    grains = read_grains(path, (0.0, 0.5))
    np.testing.assert_array_equal(grains.position, [[0.01, 1.5, 0.0], [0.02, 2.5, 0.0]])
    np.testing.assert_array_equal(grains.velocity[:, 0], [1.0, 2.0])


BAD_CSV = {
    "empty": ("", "is empty"),
    "no rows": ("x,y,radius\n", "holds no grains"),
    "missing column": ("x,y\n1,2\n", "no column radius"),
    "unknown column": ("x,y,radius,spinn\n1,2,3,4\n", "did you mean 'spin'"),
    "double column": ("x,y,radius,x\n1,2,3,4\n", "'x' twice"),
    "semicolons": ("x;y;radius\n1;2;3\n", "semicolons between its columns"),
    "no header": ("0.1,0.2,0.3\n", "no column x, y, radius"),
    "not a number": ("x,y,radius\n1,2,3\n1,two,3\n", "line 3: y = 'two' is not a number"),
    "short row": ("x,y,radius\n1,2,3\n\n1,2\n", "line 4: 2 values for 3 columns"),
    "nan": ("x,y,radius\n# comment\nnan,2,3\n", "line 3: x = nan is not finite"),
    "radius": ("x,y,radius\n1,2,3\n1,2,-3\n1,2,0\n", "line 3: radius = -3 m.*line 4: radius = 0 m"),
    "far away": ("x,y,radius\n1e9,2,3\n", "line 2: x = 1e.09 m is not between"),
    "underflow": ("x,y,radius\n1,2,1e-300\n1,2,1e-60\n1,2,1e-12\n",
        "line 2: radius = 1e-300 m.*line 3: .*line 4: radius = 1e-12 m"),
    "large": ("x,y,radius\n1,2,1e5\n", "radius = 100000 m is not between 1e-09 and 10000 m"),
    "fast": ("x,y,radius,vx\n1,2,1,1\n1,2,1,-1e13\n", "line 3: vx = -1e.13 is not between"),
    "many": ("x,y,radius\n" + "a,b,c\n" * 20, "line 6: .*; and more"),
    "no text": (b"x,y,radius\n1,2,\xff\xfe\n", "UTF-8"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_CSV)
def test_bad_csv_is_refused_with_its_line(tmp_path, case):
    text, words = BAD_CSV[case]
    refused(csv(tmp_path, text), words)


def test_missing_foreign_and_huge_files(tmp_path, monkeypatch):
    (tmp_path / "folder.csv").mkdir()
    refused(tmp_path / "none.csv", "no file")
    refused(tmp_path / "folder.csv", "it is a directory")
    refused(csv(tmp_path, "", "a.xls"), "kind of file")
    refused(csv(tmp_path, "this is no HDF5 file", "grains.h5"), "cannot be read")
    monkeypatch.setattr(file, "MAX_GRAINS", 3)
    refused(csv(tmp_path, "x,y,radius\n" + "1,2,3\n" * 9), "holds 4 grains")
    monkeypatch.setattr(file, "MAX_BYTES", 10)
    refused(csv(tmp_path, "x,y,radius\n1,2,3\n"), r"larger than 10 B \(\d+ B\)")


ONE = {"x": [1.0], "y": [1.0], "radius": [1.0]}
HUGE = {"shape": (10**13,), "chunks": (1000,), "dtype": "f8"}
FILLED = {"shape": (10**7,), "chunks": (1000,), "dtype": "f8", "fillvalue": 0.1}
# HDF5 unpacks a chunk whole, however few of its values belong to the dataset
BOMB = {"maxshape": (None,), "chunks": (2**22,), "compression": "gzip", "data": np.ones(3)}
BAD_HDF5 = {
    "missing": ({"x": [1.0], "y": [1.0]}, "no dataset radius"),
    "lengths": ({"x": [1.0, 2], "y": [1.0, 2], "radius": [1.0]}, "radius has 1 values and x has 2"),
    "text": (ONE | {"radius": ["a"]}, "not a one-dimensional array of numbers"),
    "shape": (ONE | {"x": [[1.0]]}, "x is not a one-dimensional"),
    "row": ({"x": [1.0, 2], "y": [1, np.inf], "radius": [1.0, 1]}, "row 1: y = inf is not finite"),
    "result": ({"particles/x": [1.0], "model/radius": [1.0]}, "result of a run"),
    "link": (ONE | {"radius": h5py.ExternalLink("other.h5", "x")}, "not a dataset stored in this"),
    "huge": (dict.fromkeys(ONE, HUGE), "more values than are stored"),
    "filled": (dict.fromkeys(ONE, FILLED), "more values than are stored"),
    "bomb": ({"x": np.arange(3.0), "y": np.arange(3.0), "radius": BOMB},
        "radius is stored in chunks of 4194304 values"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_HDF5)
def test_bad_hdf5_is_refused(tmp_path, case):
    columns, words = BAD_HDF5[case]
    hdf5(tmp_path, **ONE).rename(tmp_path / "other.h5")
    refused(hdf5(tmp_path, **columns), words)


@pytest.mark.parametrize("kind", ["a time", "a float of 256 bits"])
def test_hdf5_with_types_that_numpy_lacks(tmp_path, kind):
    path = hdf5(tmp_path, y=np.zeros(5), radius=np.ones(5))
    with h5py.File(path, "r+") as out:
        wide = h5py.h5t.IEEE_F64LE.copy()
        wide.set_size(32)
        wide.set_precision(256)
        wide.set_fields(255, 224, 31, 0, 224)
        number = h5py.h5t.UNIX_D32LE if kind == "a time" else wide
        h5py.h5d.create(out.id, b"x", number, h5py.h5s.create_simple((5,)))
    refused(path, "cannot read")


@pytest.fixture(scope="module")
def cold(tmp_path_factory):
    """A run, and its last state."""
    path = tmp_path_factory.mktemp("cold") / "run"
    return path, run_whole(path, steps=20)


def test_frame_of_a_run(cold):
    path, state = cold
    grains = read_frame(path, -1)
    np.testing.assert_array_equal(grains.radius, make_model().grains.radius)
    np.testing.assert_array_equal(grains.position, state.position)
    np.testing.assert_array_equal(grains.velocity, state.velocity)
    assert grains.temperature is None
    assert not np.array_equal(read_frame(path, 0).position, state.position)


def test_temperatures_of_a_frame(tmp_path):
    model = make_model(heat=True)
    state = run_whole(tmp_path / "warm", model, steps=20)
    temperature = read_frame(tmp_path / "warm", -1).temperature
    np.testing.assert_array_equal(temperature, state.temperature(model.thermal))
    assert temperature.dtype == float


def test_missing_run_or_frame(cold, tmp_path):
    with pytest.raises(Refused, match=r"no frame 5.*the run has 5, from 0 to 4") as caught:
        read_frame(cold[0], 5)
    assert caught.value.where == ("packing", "frame")
    with pytest.raises(Refused, match="cannot be read"):
        read_frame(tmp_path / "nothing", -1)


@pytest.mark.parametrize(("path", "where", "value", "message"), [
    ("particles/position", (-1, 1), np.nan, r"row \d+: y = nan is not finite"),
    ("particles/position", (-1, 1), 1e300, "y = 1e.300 m is not between"),
    ("particles/velocity", (-1, 1), np.inf, "vy = inf is not finite"),
    ("model/radius", -1, -1.0, "model/radius holds values out of range"),
])  # fmt: skip
def test_frames_hold_no_absurd_values(cold, tmp_path, path, where, value, message):
    results = Path(shutil.copy(cold[0] / "results.h5", tmp_path))
    results.chmod(0o644)
    with h5py.File(results, "r+") as out:
        out[path][where] = value
    with pytest.raises(Refused, match=message):
        read_frame(results, -1)


def test_coincident_grains_are_refused_in_bounded_memory():
    """All pairs of them would need 40 GB."""
    count = 100_000
    center, radius = np.full((count, 2), 0.01), np.full(count, 1e-4)
    assert thin_crowds(center, radius).size == CROWD
    model = scene_parts.make_model(radius)
    groups = Groups([SimpleNamespace(packing=None, name="g")], model.grains.group)
    problems = overlap_problems(center, model, Obstacles.none(), np.arange(count), groups)
    assert "pairs at least" in str(problems[0])
    scattered = np.random.default_rng(1).uniform(0.0, 1.0, (count, 2))
    assert thin_crowds(scattered, np.full(count, 1e-3)).size == count

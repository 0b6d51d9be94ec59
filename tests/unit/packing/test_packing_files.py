"""Grains from files and from runs; what is wrong with a file is named with its row."""

import h5py
import numpy as np
import pytest
from store_support import make_model, run_whole

from multicor_cli.packing import file
from multicor_cli.packing.file import read_grains
from multicor_cli.packing.other_run import read_frame
from multicor_cli.packing.overlap import CROWD, overlap_problems, thin_crowds
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import Refused


def csv(tmp_path, text, name="grains.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


def hdf5(tmp_path, **columns):
    path = tmp_path / "grains.h5"
    with h5py.File(path, "w") as out:
        for name, values in columns.items():
            out[name] = values
    return path


def test_csv_with_all_columns_in_any_order(tmp_path):
    text = (
        "# made by hand\nradius, x ,y,spin,angle,vx,vy\n1e-3,0.01,0.02,3,0.5,-1,2\n\n"
        "2e-3,0.03,0.04,0,0,0,0\n"
    )
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
    "no header": ("0.1,0.2,0.3\n", "no column x, y, radius"),
    "not a number": ("x,y,radius\n1,2,3\n1,two,3\n", "line 3: y = 'two' is not a number"),
    "short row": ("x,y,radius\n1,2,3\n\n1,2\n", "line 4: 2 values for 3 columns"),
    "nan": ("x,y,radius\n# comment\nnan,2,3\n", "line 3: x = nan is not finite"),
    "radius": ("x,y,radius\n1,2,3\n1,2,-3\n1,2,0\n", "line 3: radius = -3 m.*line 4: radius = 0 m"),
    "far away": ("x,y,radius\n1e9,2,3\n", "line 2: x = 1e.09 m is not between"),
    "underflow": (
        "x,y,radius\n1,2,1e-300\n1,2,1e-60\n1,2,1e-12\n",
        "line 2: radius = 1e-300 m.*line 3: .*line 4: radius = 1e-12 m",
    ),
    "large": (
        "x,y,radius\n1,2,1e5\n",
        "line 2: radius = 100000 m is not between 1e-09 and 10000 m",
    ),
    "fast": ("x,y,radius,vx\n1,2,1,1\n1,2,1,-1e13\n", "line 3: vx = -1e.13 is not between"),
    "many": ("x,y,radius\n" + "a,b,c\n" * 20, "line 6: .*; and more"),
}


@pytest.mark.parametrize("case", BAD_CSV)
def test_bad_csv_is_refused_with_its_line(tmp_path, case):
    text, words = BAD_CSV[case]
    with pytest.raises(Refused, match=words) as caught:
        read_grains(csv(tmp_path, text), (0.0, 0.0))
    assert caught.value.where == ("packing", "path")


def test_bytes_that_are_no_text(tmp_path):
    path = tmp_path / "grains.csv"
    path.write_bytes(b"x,y,radius\n1,2,\xff\xfe\n")
    with pytest.raises(Refused, match="UTF-8"):
        read_grains(path, (0.0, 0.0))


def test_missing_foreign_and_huge_files(tmp_path, monkeypatch):
    (tmp_path / "folder.csv").mkdir()
    cases = {"none.csv": "no file", "folder.csv": "it is a directory", "a.xls": "kind of file"}
    csv(tmp_path, "", "a.xls")
    for path, words in ((tmp_path / name, words) for name, words in cases.items()):
        with pytest.raises(Refused, match=words):
            read_grains(path, (0.0, 0.0))
    monkeypatch.setattr(file, "MAX_BYTES", 10)
    with pytest.raises(Refused, match=r"larger than 10 B \(\d+ B\)"):
        read_grains(csv(tmp_path, "x,y,radius\n1,2,3\n"), (0.0, 0.0))


def test_too_many_grains_are_refused_before_they_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(file, "MAX_GRAINS", 3)
    with pytest.raises(Refused, match="holds 4 grains"):
        read_grains(csv(tmp_path, "x,y,radius\n" + "1,2,3\n" * 9), (0.0, 0.0))
    with h5py.File(tmp_path / "big.h5", "w") as out:
        for name in ("x", "y", "radius"):
            out.create_dataset(name, shape=(10**13,), chunks=(1000,), dtype="f8")
    with pytest.raises(Refused, match="more values than are stored"):
        read_grains(tmp_path / "big.h5", (0.0, 0.0))


def test_chunks_that_would_fill_the_memory_are_refused(tmp_path):
    """HDF5 unpacks a chunk whole, however few of its values belong to the dataset."""
    with h5py.File(tmp_path / "bomb.h5", "w") as out:
        for name in ("x", "y"):
            out[name] = np.arange(3.0)
        out.create_dataset(
            "radius",
            shape=(3,),
            maxshape=(None,),
            chunks=(2**22,),
            dtype="f8",
            compression="gzip",
            data=np.ones(3),
        )
    with pytest.raises(Refused, match="radius is stored in chunks of 4194304 values"):
        read_grains(tmp_path / "bomb.h5", (0.0, 0.0))


BAD_HDF5 = {
    "missing": ({"x": [1.0], "y": [1.0]}, "no dataset radius"),
    "lengths": (
        {"x": [1.0, 2.0], "y": [1.0, 2.0], "radius": [1.0]},
        "radius has 1 values and x has 2",
    ),
    "text": ({"x": [1.0], "y": [1.0], "radius": ["a"]}, "not a one-dimensional array of numbers"),
    "shape": ({"x": [[1.0]], "y": [1.0], "radius": [1.0]}, "x is not a one-dimensional"),
    "row": (
        {"x": [1.0, 2.0], "y": [1.0, np.inf], "radius": [1.0, 1.0]},
        "row 1: y = inf is not finite",
    ),
    "result": ({"particles/x": [1.0], "model/radius": [1.0]}, "result of a run"),
}


@pytest.mark.parametrize("case", BAD_HDF5)
def test_bad_hdf5_is_refused(tmp_path, case):
    columns, words = BAD_HDF5[case]
    with pytest.raises(Refused, match=words):
        read_grains(hdf5(tmp_path, **columns), (0.0, 0.0))


def test_hdf5_links_to_other_files_are_not_followed(tmp_path):
    hdf5(tmp_path, x=[1.0], y=[1.0], radius=[1.0]).rename(tmp_path / "other.h5")
    with h5py.File(tmp_path / "grains.h5", "w") as out:
        out["x"] = out["y"] = [1.0]
        out["radius"] = h5py.ExternalLink("other.h5", "radius")
    with pytest.raises(Refused, match="not a dataset stored in this file"):
        read_grains(tmp_path / "grains.h5", (0.0, 0.0))


def test_damaged_hdf5(tmp_path):
    with pytest.raises(Refused, match="cannot be read"):
        read_grains(csv(tmp_path, "this is no HDF5 file", "grains.h5"), (0.0, 0.0))


def test_frame_of_a_run(tmp_path):
    state = run_whole(tmp_path / "run", steps=20)
    grains = read_frame(tmp_path / "run", -1)
    np.testing.assert_array_equal(grains.radius, make_model().grains.radius)
    np.testing.assert_array_equal(grains.position, state.position)
    np.testing.assert_array_equal(grains.velocity, state.velocity)
    assert not np.array_equal(read_frame(tmp_path / "run", 0).position, state.position)


def test_temperatures_of_a_frame(tmp_path):
    model = make_model(heat=True)
    state = run_whole(tmp_path / "warm", model, steps=20)
    temperature = read_frame(tmp_path / "warm", -1).temperature
    np.testing.assert_array_equal(temperature, state.temperature(model.thermal))
    assert temperature.dtype == float
    run_whole(tmp_path / "cold", steps=20)
    assert read_frame(tmp_path / "cold", -1).temperature is None


def test_missing_run_or_frame(tmp_path):
    run_whole(tmp_path / "run", steps=20)
    with pytest.raises(Refused, match=r"no frame 5.*the run has 5, from 0 to 4") as caught:
        read_frame(tmp_path / "run", 5)
    assert caught.value.where == ("packing", "frame")
    with pytest.raises(Refused, match="cannot be read"):
        read_frame(tmp_path / "nothing", -1)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("particles/position", np.nan, r"row \d+: y = nan is not finite"),
        ("particles/position", 1e300, "y = 1e.300 m is not between"),
        ("particles/velocity", np.inf, "vy = inf is not finite"),
        ("model/radius", -1.0, "model/radius holds values out of range"),
    ],
)
def test_frames_hold_no_absurd_values(tmp_path, path, value, message):
    run_whole(tmp_path / "run")
    results = tmp_path / "run" / "results.h5"
    results.chmod(0o644)
    with h5py.File(results, "r+") as out:
        data = out[path]
        if data.ndim == 2:
            data[-1, 1] = value
        else:
            data[-1] = value
    with pytest.raises(Refused, match=message):
        read_frame(results, -1)


@pytest.mark.parametrize("kind", ["a time", "a float of 256 bits", "values that are not stored"])
def test_hdf5_with_types_that_numpy_lacks(tmp_path, kind):
    path = hdf5(tmp_path, y=np.zeros(5), radius=np.ones(5))
    with h5py.File(path, "r+") as out:
        if kind == "values that are not stored":
            del out["y"], out["radius"]
            for name in ("x", "y", "radius"):
                out.create_dataset(name, (10_000_000,), float, chunks=(1000,), fillvalue=0.1)
        else:
            wide = h5py.h5t.IEEE_F64LE.copy()
            wide.set_size(32)
            wide.set_precision(256)
            wide.set_fields(255, 224, 31, 0, 224)
            number = h5py.h5t.UNIX_D32LE if kind == "a time" else wide
            h5py.h5d.create(out.id, b"x", number, h5py.h5s.create_simple((5,)))
    with pytest.raises(Refused, match=r"cannot read|more values than are stored"):
        read_grains(path, (0.0, 0.0))


def test_coincident_grains_are_refused_in_bounded_memory():
    """All pairs of them would need 40 GB."""
    count = 100_000
    center, radius = np.full((count, 2), 0.01), np.full(count, 1e-4)
    assert thin_crowds(center, radius).size == CROWD
    problems = overlap_problems(
        center, radius, np.zeros(count, np.int32), Obstacles.none(), np.zeros(0, np.int32), [], 0.0
    )
    assert "pairs at least" in str(problems[0])
    scattered = np.random.default_rng(1).uniform(0.0, 1.0, (count, 2))
    assert thin_crowds(scattered, np.full(count, 1e-3)).size == count

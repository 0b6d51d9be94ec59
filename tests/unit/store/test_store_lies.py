"""Files that come from elsewhere: foreign, hostile, or whole by their digests and wrong; refused
before memory is taken."""

import json
import re
import shutil
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
from run_fakes import StopAt
from scenarios import scenario
from store_support import make_model, replace, run_whole, set_text, set_value

from multicor_cli import run
from multicor_cli.store import DamagedRun, open_run, schema, verify
from multicor_cli.store.atomic import file_digest
from multicor_cli.store.documents import document_line, parse_document
from multicor_cli.store.hdf5 import write_text

ANGLE = "particles/angle"


def gone(path):
    return lambda file: file.__delitem__(path)


def text(name, value):
    return lambda file: set_text(file, name, value)


def value(path, row, number):
    return lambda file: set_value(file, path, row, number)


def undigested(path, row, number):
    return lambda file: file[path].__setitem__(row, number)


def of_variable_length(path, name):
    return lambda file: file[path].attrs.__setitem__(name, file[path].attrs[name].decode())


def lose_one_digest(file):
    digests = json.loads(file.attrs["attribute_digests"])
    del digests["summary"]
    write_text(file, "attribute_digests", json.dumps(digests))


def hostile(put):
    """Another dataset of angles, with the attributes of the former; ``elsewhere.h5`` is beside."""

    def change(file):
        rows, attributes = len(file[ANGLE]), dict(file[ANGLE].attrs)
        elsewhere = str(Path(file.filename).with_name("elsewhere.h5"))
        with h5py.File(elsewhere, "w") as other:
            other["x"] = np.zeros(rows)
        del file[ANGLE]
        put(file, rows, elsewhere)
        if isinstance(file.get(ANGLE, getlink=True), h5py.HardLink):
            file[ANGLE].attrs.update(attributes)

    return change


def virtual(file, rows, elsewhere):
    layout = h5py.VirtualLayout(shape=(rows,), dtype="f8")
    layout[:] = h5py.VirtualSource(elsewhere, "x", shape=(rows,))
    file.create_virtual_dataset(ANGLE, layout)


HOSTILE = {
    "missing": lambda file, rows, elsewhere: None,
    "huge": lambda file, rows, elsewhere: file.create_dataset(ANGLE, (10**12,), "f8", chunks=(10**4,)),
    "type": lambda file, rows, elsewhere: file.create_dataset(ANGLE, data=np.zeros(rows, "i8")),
    "rows": lambda file, rows, elsewhere: file.create_dataset(ANGLE, data=np.zeros(rows - 1)),
    "shape": lambda file, rows, elsewhere: file.create_dataset(ANGLE, data=np.zeros((rows, 1))),
    "group": lambda file, rows, elsewhere: file.create_group(ANGLE),
    "external": lambda file, rows, elsewhere: file.__setitem__(ANGLE, h5py.ExternalLink(elsewhere, "x")),
    "soft": lambda file, rows, elsewhere: file.__setitem__(ANGLE, h5py.SoftLink("/particles/spin")),
    "raw": lambda file, rows, elsewhere: file.create_dataset(ANGLE, (rows,), "f8", external=[(elsewhere, 0, 8 * rows)]),
    "virtual": virtual,
}  # fmt: skip


def angle(run):
    return run.frames[0].angle


def contact(name):
    return lambda run: getattr(next(f for f in run.frames if len(f.contacts)).contacts, name)


LIES = {
    # No digest, or where HDF5 has no checksum and may search forever
    **{
        f"{name} of variable length": (of_variable_length(*where), "fixed length", None)
        for name, where in {
            "text": ("/", "run_id"), "digests": ("/", "attribute_digests"),
            "digest": ("model/radius", "blake2b"), "digest of the view": ("VTKHDF", "blake2b"),
        }.items()
    },
    "texts without digests": (lambda file: file.attrs.__delitem__("attribute_digests"), "attribute_digests", None),
    "text without digest": (lose_one_digest, "summary", None),
    "dataset without digest": (lambda file: file["model/radius"].attrs.__delitem__("blake2b"), "blake2b", None),
    "no view": (gone("VTKHDF"), "VTKHDF", None),
    **{
        f"view: {name}": (undigested(f"VTKHDF/{name}", 1, 99), "VTKHDF", None)
        for name in ("PointData/radius", "Lines/Connectivity", "Steps/PointOffsets")
    },
    # Datasets that are not what the schema says
    **{name: (hostile(put), f"{ANGLE}|particle_offset", angle) for name, put in HOSTILE.items()},
    **{
        f"offsets {values}": (undigested("steps/particle_offset", rows, values), "particle_offset", angle)
        for rows, values in (
            (slice(3), [0, 5, 3]), (slice(3), [1, 5, 10]), (-1, 10**9), (slice(3), [0, -5, 10]),
        )
    },
    # Right digests, wrong values
    "not finite": (value("particles/spin", 3, np.nan), "not finite", None),
    "no shape": (value("contacts/j", 0, 99), "shape that does not exist", None),
    "kind": (value("contacts/kind", 0, 1), "does not fit", None),
    "sliding": (value("contacts/sliding", 0, 2), "outside 0", None),
    "steps": (value("steps/step", 3, 0), "does not ascend", None),
    "stage": (value("steps/stage", 0, 2), "outside 0", None),
    "value": (undigested("particles/spin", 3, 0.7), "do not match their digest", None),
    "wall of a shape": (value("model/shapes/wall", 0, 5), "model/shapes/wall", lambda run: run.model),
    **{
        f"{name} = {number}": (undigested(f"contacts/{name}", ..., number), f"contacts/{name}", contact(name))
        for name, numbers in {"i": (-1, 10**6), "j": (-3, 10**6)}.items()
        for number in numbers
    },
}  # fmt: skip
"""What is done to a ``results.h5``; what `verify` says of it; what a reader asks for, and is
refused in the same words."""

HEATED = {
    **{
        f"without {spec.path}": (gone(spec.path), spec.path)
        for spec in schema.RESULTS_TABLE
        if spec.only_with
        not in (
            None,
            "exchange",
            "surface",
            "groups",
            "motion",
            "cell",
            "gradient",
            "expansion",
            "outlines",
        )
    },
    **{
        f"features {said}": (text("features", said), "feature|do not match their digest")
        for said in ("[]", '["softening"]', "nonsense", "[1]")
    },
    # Only the walls may have no temperature
    "temperature": (value("particles/temperature", 3, np.nan), "not finite"),
}
"""The same for a run with heat."""


SHAPED = {
    **{
        f"without {spec.path}": (gone(spec.path), spec.path)
        for spec in schema.RESULTS_TABLE
        if spec.only_with == "outlines"
    },
    **{
        f"{name} {row}: {number}": (value(f"model/outlines/{name}", row, number), "model/outlines")
        for name, row, number in (
            ("piece", 0, 1), ("piece", 2, 1), ("piece", 9, 99), ("start", 0, -1), ("start", 3, 2),
            ("start", -1, 10**6), ("rounding", 0, -0.1), ("area", 3, 0.0), ("corner", 4, np.nan),
            ("perimeter", 0, np.inf),
        )
    },
    # Farther than the grain reaches, by what its radius says
    "corner": (value("model/outlines/corner", 5, [0.3, 0.0]), "model/outlines/corner"),
    "radius": (value("model/radius", 1, 0.1), "model/outlines/corner"),
    "arm": (value("contacts/arm", 0, [np.nan, 0.0]), "contacts/arm"),
}  # fmt: skip
"""The same for a run of grains of any shape."""


def check_verdict(results, target, change, named):
    """`verify` finds one thing, and names it."""
    shutil.copy(results, target)
    with h5py.File(target, "r+") as file:
        change(file)
    (finding,) = verify(target)
    assert finding.severity == "error"
    assert re.search(named, finding.message), finding.message


@pytest.mark.parametrize("lie", LIES)
def test_results_that_lie_are_refused(finished, tmp_path, lie):
    change, named, asked = LIES[lie]
    check_verdict(finished / "results.h5", tmp_path / "results.h5", change, named)
    if asked is not None:
        with pytest.raises(DamagedRun, match=named), open_run(tmp_path / "results.h5") as run:
            asked(run)


@pytest.mark.parametrize("lie", HEATED)
def test_results_with_heat_that_lie_are_refused(heated, tmp_path, lie):
    check_verdict(heated / "results.h5", tmp_path / "results.h5", *HEATED[lie])


@pytest.mark.parametrize("lie", SHAPED)
def test_results_of_grains_of_any_shape_that_lie_are_refused(shaped, tmp_path, lie):
    check_verdict(shaped / "results.h5", tmp_path / "results.h5", *SHAPED[lie])


def test_only_walls_may_have_no_temperature(heated):
    with h5py.File(heated / "results.h5") as file:
        assert np.isnan(file["walls/temperature"][:, 1]).all()
    assert verify(heated) == []


@contextmanager
def lying(run):
    """The first segment, to be changed; the manifest then says what it is."""
    file, manifest = (run / "segments" / name for name in ("000000.h5", "MANIFEST.jsonl"))
    replace(file, file.read_bytes())
    with h5py.File(file, "r+") as data:
        yield data
    lines = [parse_document(line, "test") for line in manifest.read_bytes().splitlines()]
    lines[0] |= {"size": file.stat().st_size, "blake2b": file_digest(file)}
    replace(manifest, b"".join(map(document_line, lines)))


def heat(path):
    run_whole(path, make_model(heat=True), steps=10, checkpoint_every=5, finish=False)


def outlet(path):
    hole = {"name": "hole", "region": {"min": [0.0, 0.0], "max": [0.1, 0.01]}}
    assert not run(scenario(outlets=[hole]), path, observer=StopAt(20)).is_finished


def twice_as_many(path, data):
    values, digest = np.repeat(data[path][...], 2, axis=1), data[path].attrs["blake2b"]
    del data[path]
    data[path] = values
    data[path].attrs["blake2b"] = digest
    set_value(data, path, 0, values[0])


@pytest.mark.parametrize(("make", "change", "named"), [
    (heat, text("features", "[]"), "features"),
    (outlet, partial(twice_as_many, "series/outlet_flow"), "outlet_flow"),
], ids=["features", "outlets"])  # fmt: skip
def test_segment_that_does_not_fit_the_model_is_damaged(tmp_path, make, change, named):
    make(tmp_path / "run")
    assert verify(tmp_path / "run") == []
    with lying(tmp_path / "run") as data:
        change(data)
    (finding,) = (one for one in verify(tmp_path / "run") if one.file.endswith("000000.h5"))
    assert named in finding.message

"""Everything that is written is read back: frames, series, model, state; from segments and from
results.h5."""

import dataclasses
import shutil

import h5py
import numpy as np
import pytest
import shaped_run
from page_tables import FORMATS, with_tables
from store_support import (
    RESOLVED,
    SOURCE,
    advance,
    contact_rows,
    drive,
    make_model,
    make_run,
    run_whole,
    start,
)

from multicor_cli.model import BOOK_NAMES, HEAT_BOOK_NAMES
from multicor_cli.model.books import BOOKS, HEAT_BOOKS
from multicor_cli.model.state import find_misfit
from multicor_cli.store import (
    Contacts,
    Frame,
    Snapshot,
    StorageError,
    open_run,
    run_info,
    schema,
    summarize,
    verify,
)
from multicor_cli.store.checkpoint import _complete
from multicor_cli.store.results import model_digest
from multicor_cli.store.segments import columns_of


def assert_same(left, right):
    """The same arrays, of the same type, in all parts."""
    assert type(left) is type(right)
    if isinstance(left, np.ndarray):
        assert left.dtype == right.dtype
        np.testing.assert_array_equal(left, right)
    elif dataclasses.is_dataclass(left):
        for field in dataclasses.fields(left):
            assert_same(getattr(left, field.name), getattr(right, field.name))
    elif isinstance(left, tuple):
        for a, b in zip(left, right, strict=True):
            assert_same(a, b)
    else:
        assert left == right


def check_content(path, model, steps, *, tolerance=0.0):
    """Compare all frames and the series with the states that made them."""
    state = start(model)
    with open_run(path) as run:
        assert len(run.frames) == steps // 5 + 1
        assert run.series.row_count == steps // 2 + 1
        for step in range(steps + 1):
            if step:
                advance(state, model)
            if step % 2 == 0:
                check_row(run.series, step // 2, state, model)
                state.window[:] = 0.0
                state.window_wall_impulse[:] = 0.0
            if step % 5 == 0:
                check_frame(run.frames[step // 5], state, tolerance)
                check_heat(run.frames[step // 5], state, model, tolerance)
        assert_same(run.model, model)
        assert run.wall_names == model.walls.names
        assert run.stages == ("load", "shear")
        assert run.scenario_source == SOURCE
        assert run.scenario_resolved == RESOLVED
        final = run.state()
        assert final.digest() == state.digest()


def check_row(series, row, state, model):
    assert series["step"][row] == state.step
    for name, value in zip(BOOK_NAMES, state.books, strict=True):
        assert series[name][row] == value
    rows = schema.select(schema.SERIES, schema.features_of(model))
    assert list(series) == [row.name for row in rows]
    for name, column in zip(series, columns_of(rows, Snapshot(state, model)).values(), strict=True):
        np.testing.assert_array_equal(series[name][row], column[0])


def check_frame(frame, state, tolerance):
    def same(found, expected):
        np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance)

    for name, kept in {"step": "step", "time": "time", "dt": "last_dt", "stage": "stage"}.items():
        assert getattr(frame, name) == getattr(state, kept)
    same(frame.position, state.position[:, :2])
    same(frame.angle, state.position[:, 2])
    same(frame.velocity, state.velocity[:, :2])
    same(frame.spin, state.velocity[:, 2])
    same(frame.unwrapped[:, 0], state.position[:, 0] + 0.1 * state.image)
    same(frame.wall_position, state.wall_position)
    same(frame.wall_velocity, state.wall_velocity)
    np.testing.assert_array_equal(frame.image, state.image)
    rows, contacts = contact_rows(state), frame.contacts
    assert contacts.recorded
    assert contacts.count == len(rows.i)
    for name in ("i", "j", "sliding"):
        np.testing.assert_array_equal(getattr(contacts, name), getattr(rows, name))
    for name in ("normal", "gap", "impulse", "slip"):
        same(getattr(contacts, name), getattr(rows, name))
    np.testing.assert_array_equal(contacts.kind, rows.j >= len(state.position))
    if state.step:
        same(contacts.force, rows.impulse / state.last_dt)


def check_heat(frame, state, model, tolerance):
    """Temperatures and heat are exact in single precision too; only those of contacts are
    rounded."""
    names = ("temperature", "generated", "wear", "wall_temperature", "wall_heat", "wall_wear")
    if model.thermal is None:
        assert [getattr(frame, name) for name in names] == [None] * len(names)
        assert (frame.contacts.heat, frame.contacts.conductance) == (None, None)
        return
    expected = [state.temperature(model.thermal), *(getattr(state, name) for name in names[1:])]
    for name, values in zip(names, expected, strict=True):
        np.testing.assert_array_equal(getattr(frame, name), values, err_msg=name)
    rows = contact_rows(state)
    np.testing.assert_allclose(frame.contacts.heat, rows.heat, rtol=tolerance)
    np.testing.assert_allclose(frame.contacts.conductance, rows.conductance, rtol=tolerance)


@pytest.mark.parametrize("grains", [1, 5])
@pytest.mark.parametrize("walls", [True, False])
@pytest.mark.parametrize("heat", [True, False])
def test_finished_run_reads_back(tmp_path, grains, walls, heat):
    model = make_model(grains, walls=walls, heat=heat)
    run_whole(tmp_path / "run", model)
    check_content(tmp_path / "run", model, 40)
    assert not (tmp_path / "run" / "segments").exists()
    assert verify(tmp_path / "run") == []


@pytest.mark.parametrize("heat", [True, False])
def test_running_run_reads_back(tmp_path, heat):
    model = make_model(heat=heat)
    with make_run(tmp_path / "run") as run:
        drive(run, model, steps=40, checkpoint_every=15, finish=False)
        check_content(tmp_path / "run", model, 40)
        with open_run(tmp_path / "run") as reader:
            assert reader.status == "running"
            assert len(reader._parts.parts) > 1
        assert verify(tmp_path / "run") == []
    with open_run(tmp_path / "run") as reader:
        assert reader.status == "interrupted"


def test_results_file_alone_is_enough(copy, tmp_path):
    (copy / "results.h5").rename(tmp_path / "mailed.h5")
    with open_run(tmp_path / "mailed.h5") as run:
        assert run.status == "finished"
        assert len(run.frames) == 9
        assert run.scenario_source == SOURCE
        assert run.info["summary"]["step"] == 40
        assert run.state() is None
    assert verify(tmp_path / "mailed.h5") == []
    assert run_info(tmp_path / "mailed.h5")["grain_count"] == 5


def test_single_precision_halves_the_rows(tmp_path):
    model = make_model(heat=True)
    run_whole(tmp_path / "run", model, precision="single")
    check_content(tmp_path / "run", model, 40, tolerance=1e-6)
    with h5py.File(tmp_path / "run" / "results.h5") as file:
        for path in ("particles/position", "contacts/impulse", "contacts/heat"):
            assert file[path].dtype == np.float32
        for path in ("steps/time", "walls/position", "series/kinetic", "particles/temperature"):
            assert file[path].dtype == np.float64


@pytest.mark.parametrize("finish", [True, False])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_grains_of_any_shape_read_back(tmp_path, finish, precision):
    """Outlines of the model, points of contact of the state and of frames, also if contacts are not
    recorded."""
    model, path = shaped_run.shaped_model(), tmp_path / "run"
    state = shaped_run.write_shaped_run(path, model=model, precision=precision, finish=finish)
    rows = shaped_run.contact_rows(state)
    with open_run(path) as run:
        assert_same(run.model, model)
        assert_same(run.state().contact_point, state.contact_point)
        assert run.state().digest() == state.digest()
        for frame in run.frames:
            np.testing.assert_allclose(frame.contacts.arm, rows.arm, rtol=1e-7)
            assert frame.contacts.i.tolist() == rows.i.tolist()
    assert verify(path) == []
    shaped_run.write_shaped_run(tmp_path / "silent", model=model, recorded=False)
    with open_run(tmp_path / "silent") as run:
        assert run.frames[-1].contacts.arm.shape == (0, 2)
    assert verify(tmp_path / "silent") == []


def test_states_of_grains_of_any_shape_may_have_several_points_of_a_pair(shaped):
    with open_run(shaped) as run:
        model, state = run.model, run.state()
    assert find_misfit(state, model) is None
    said = "contact_i and contact_j are not pairs of shapes in ascending order"
    assert find_misfit(state, dataclasses.replace(model, outlines=None)) == said
    state.contact_j[:2] = state.contact_j[2:4]
    assert find_misfit(state, model) is None
    state.contact_i[1] = 0
    assert find_misfit(state, model) == said
    state.contact_i[1] = state.contact_i[0]
    state.contact_point = state.contact_point[:-1]
    said = "contact_i, contact_j and contact_point have different lengths"
    assert find_misfit(state, model) == said


def test_runs_of_discs_say_nothing_of_outlines(finished):
    with h5py.File(finished / "results.h5") as file:
        assert "outlines" not in file["model"]
        assert "arm" not in file["contacts"]
    with open_run(finished) as run:
        assert run.model.outlines is None
        assert run.frames[1].contacts.arm is None
        assert not run.state().contact_point.size


def test_frames_without_recorded_contacts(tmp_path):
    model = make_model()
    with make_run(tmp_path / "run") as run:
        writer, state = run.writer(model), start(model)
        writer.frame(Snapshot(state, model))
        run.checkpoint(state, writer)
        run.finish("finished")
    with open_run(tmp_path / "run") as reader:
        assert not reader.frames[0].contacts.recorded
        assert reader.frames[0].contacts.normal.shape == (0, 2)
        assert reader.series["virial_rate"].shape == (0, 2, 2)
    assert verify(tmp_path / "run") == []


def test_frames_are_a_sequence(finished):
    with open_run(finished) as run:
        assert run.frames[-1].step == 40
        assert [frame.step for frame in run.frames[2:4]] == [10, 15]
        assert [frame.index for frame in run.frames] == list(range(9))
        assert run.frames.step.tolist() == list(range(0, 41, 5))
        assert run.frames.time[-1] == run.frames[-1].time
        with pytest.raises(IndexError):
            run.frames[9]
        with pytest.raises(KeyError):
            run.series["nothing"]


def test_every_dataset_has_unit_long_name_and_checksum(heated):
    with h5py.File(heated / "results.h5") as file:
        for spec in schema.select(
            schema.RESULTS_TABLE, {"heat", "softening", "adhesion", "rolling", "range", "flash"}
        ):
            dataset = file[spec.path]
            assert dataset.fletcher32, spec.path
            assert dataset.attrs["unit"] == spec.unit
            assert dataset.attrs["long_name"] == spec.meaning
        assert not file["particles/position"][:, 2].any()
        assert file["walls/position"].shape == (9, 2, 3)


def test_texts_that_are_read_have_a_fixed_length(finished):
    """HDF5 searches a damaged heap of the others forever."""
    with h5py.File(finished / "results.h5") as file:
        texts = [(file, name) for name in file.attrs] + [
            (file[spec.path], "blake2b") for spec in schema.RESULTS_TABLE if spec.path in file
        ]
        kinds = [
            h5py.check_string_dtype(node.attrs.get_id(name).dtype)
            for node, name in [*texts, (file["VTKHDF"], "blake2b")]
        ]
    assert sum(kind is not None for kind in kinds) > 20
    assert all(kind is None or kind.length is not None for kind in kinds)


def test_equal_runs_have_equal_data_digests(finished, tmp_path):
    run_whole(tmp_path / "b", checkpoint_every=7)
    assert run_info(finished)["data_digest"] == run_info(tmp_path / "b")["data_digest"]
    run_whole(tmp_path / "c", steps=42)
    assert run_info(finished)["data_digest"] != run_info(tmp_path / "c")["data_digest"]


def test_many_frames_are_split_into_segments(tmp_path):
    model = make_model()
    with make_run(tmp_path / "run") as run:
        drive(run, model, steps=700, checkpoint_every=1000, finish=False)
        with open_run(tmp_path / "run") as reader:
            assert [part.dims["frame"] for part in reader._parts.parts] == [64, 64, 13]
            assert reader.frames.step.tolist() == list(range(0, 701, 5))
        run.finish("finished")
    check_content(tmp_path / "run", model, 700)


def test_run_finished_while_it_is_read(tmp_path):
    model = make_model()
    with make_run(tmp_path / "run") as run:
        drive(run, model, steps=40, checkpoint_every=15, finish=False)
        with open_run(tmp_path / "run") as reader:
            early = reader.frames[1].position.copy()
            run.finish("finished")
            reader.close()
            np.testing.assert_array_equal(reader.frames[1].position, early)
            assert reader.frames[-1].step == 40
            assert reader.series["time"].shape == (21,)
            assert_same(reader.model, model)


def test_run_finished_while_it_is_opened(tmp_path, monkeypatch):
    """The segments go between the moment when ``run.json`` is read and that when the manifest
    is."""
    from multicor_cli.store import reader

    read, path = reader.read_run_document, tmp_path / "run"
    with make_run(path) as run:
        drive(run, make_model(), steps=40, checkpoint_every=15, finish=False)

        def finish_meanwhile(path):
            document = read(path)
            if run.status == "running":
                run.finish("finished")
            return document

        monkeypatch.setattr(reader, "read_run_document", finish_meanwhile)
        with open_run(path) as opened:
            assert len(opened.frames) == 9


def test_info_has_what_the_command_line_promises(finished):
    info = run_info(finished)
    with open_run(finished) as run:
        state = run.state()
    assert info["status"] == "finished"
    sizes = (info["grain_count"], info["frame_count"], info["step"], info["time"])
    assert sizes == (5, 9, 40, state.time)
    assert info["state_digest"] == state.digest()
    assert info["energy_closure"] == state.named("books")["closure"]
    assert (info["heat_closure"], info["heat"]) == (None, None)
    assert info["solver"]["sweeps_mean"] == 10.0
    assert {"residual_rms_max", "unconverged_steps"} <= info["solver"].keys()
    assert info["walls"] == ["bottom", "dessus-é"]
    assert info["max_overlap"] == 0.0
    # Two spheres of radius 1 mm under 1 N, E* = 2e11/(2·0.91), a* = 0.5 mm: δ = (3/(4E*√a*))^⅔.
    delta = (3.0 / (4.0 * 2e11 / 1.82 * np.sqrt(5e-4))) ** (2.0 / 3.0)
    assert info["hertz_deflection"] == pytest.approx(delta / 2e-3, rel=1e-12)


def test_info_of_a_run_with_heat(heated):
    info = run_info(heated)
    with open_run(heated) as run:
        state, model = run.state(), run.model
    assert model.thermal is not None
    books, heat = dict(zip(HEAT_BOOK_NAMES, state.heat_books.tolist(), strict=True)), info["heat"]
    assert info["heat_closure"] == heat["books"]["closure"] == books["closure"]
    assert heat["books"] == {name: books[name] for name in (*HEAT_BOOK_NAMES[:11], "ahead")}
    assert heat["sub_steps"] == 80
    assert all(heat[name] == books[name] for name in ("max_biot", "solid_gas_max"))
    temperature, capacity = state.temperature(model.thermal), model.thermal.capacity
    mean = (temperature * capacity).sum() / capacity.sum()
    assert heat["temperature"]["mean"] == pytest.approx(mean, rel=1e-14)
    ends = (heat["temperature"]["min"], heat["temperature"]["max"])
    assert ends == (temperature.min(), temperature.max())
    state.heat_books[:] = 0.0
    assert summarize(state, model)["heat"]["solid_gas_max"] is None


def test_contacts_of_which_no_heat_was_computed_have_none(tmp_path):
    model = make_model(heat=True)
    with make_run(tmp_path / "run") as run:
        writer, state = run.writer(model), start(model)
        advance(state, model)
        rows = dataclasses.replace(contact_rows(state), heat=None, conductance=None)
        writer.frame(Snapshot(state, model, rows))
        writer.flush()
        with open_run(tmp_path / "run") as reader:
            contacts = reader.frames[0].contacts
            assert contacts.count == 4
            assert contacts.heat.tolist() == contacts.conductance.tolist() == [0.0] * 4


def test_names_of_the_series_are_known_before_anything_is_written(tmp_path):
    with make_run(tmp_path / "run") as run:
        with open_run(tmp_path / "run") as reader:
            assert "heat_stored" not in reader.series
        run.writer(make_model(heat=True))
        with open_run(tmp_path / "run") as reader:
            assert reader.series["heat_stored"].shape == (0,)


def test_model_without_friction_by_temperature_has_none(tmp_path):
    """A run with heat whose friction does not depend on temperature."""
    model = make_model(heat=True)
    none = dict.fromkeys(("softening_rate", "flash_speed", "flash_limit"), np.empty((0, 0)))
    plain = dataclasses.replace(model, laws=model.laws._replace(**none))
    assert model_digest(plain) != model_digest(model) != model_digest(make_model())
    run_whole(tmp_path / "run", plain, steps=10)
    with open_run(tmp_path / "run") as run:
        assert not run.model.laws.depends_on_temperature
        assert run.features == {"heat", "flux", "adhesion", "rolling", "range"}
        assert run.frames[-1].temperature is not None
    assert verify(tmp_path / "run") == []


def test_runs_of_older_formats_are_whole_without_younger_datasets(tmp_path, monkeypatch):
    younger = ("particles/wear", "walls/wear", "contacts/slip", "series/max_biot", "series/strain")
    major, minor = schema.FORMAT_VERSION
    for path in younger:
        monkeypatch.setitem(vars(schema.DATASETS[path]), "since", (major, minor + 1))
    run_whole(tmp_path / "run", make_model(heat=True), steps=10)
    with open_run(tmp_path / "run") as run:
        assert verify(tmp_path / "run") == []
        frame = run.frames[-1]
        assert (frame.wear, frame.wall_wear, frame.contacts.slip) == (None, None, None)
        assert (frame.generated is None, frame.contacts.gap is None) == (False, False)
        assert {"max_biot", "strain"} & set(run.series) == set()
        assert run.series["heat_stored"].size


def test_what_older_checkpoints_lack_is_zero():
    rows = {row.name: row for row in schema.CHECKPOINT}
    assert _complete(None, rows["wall_heat"], {"heat_wall": 2}).tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert _complete(None, rows["stage_step"], {}).tolist() == 0
    assert _complete(np.ones(2), rows["tallies"], {"tally": 4}).tolist() == [1.0, 1.0, 0.0, 0.0]


def test_frames_say_what_they_hold_and_cannot_be_changed(finished):
    assert Frame.wall_heat.__doc__ == (
        "Heat given to the grains; heat of friction and impacts received [J], shape ``(w, 2)``; "
        "None in a run without heat"
    )
    assert (
        Contacts.impulse.__doc__
        == "Normal and tangential impulse on i in the last step [N s], shape ``(c, 2)``"
    )
    with open_run(finished) as run, pytest.raises(AttributeError, match="spin is read from a file"):
        run.frames[0].spin = np.zeros(3)


def test_arrays_that_are_kept_cannot_be_written_to(heated):
    """Who converts units in place would change what all tables find later."""
    with open_run(heated) as run:
        frame = run.frames[-1]
        kept = (
            run.series["time"], run.series["kinetic"], run.frames.time, run.grains.radius,
            frame.position, frame.temperature, frame.wall_position, frame.contacts.impulse,
            frame.grains.mass,
        )  # fmt: skip
        for values in kept:
            with pytest.raises(ValueError, match="read-only"):
                values *= 2.0
        assert frame.unwrapped.flags.writeable
        with pytest.raises(TypeError):
            run.frames[1.0]
        assert run.frames[np.int64(1)].index == 1
        with pytest.raises(KeyError, match="has no 'kinetc'; did you mean 'kinetic'"):
            run.series["kinetc"]
        assert run.series.get("kinetc") is None


def test_a_run_is_found_wherever_the_process_works_later(finished, monkeypatch, tmp_path):
    copy = shutil.copytree(finished, tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    with open_run("run") as run:
        monkeypatch.chdir("/")
        assert str(run.path) == "run"
        assert run.frames[-1].position.size
        assert run.state() is not None
        assert run.scenario_resolved
        shutil.rmtree(copy)
        with pytest.raises(StorageError, match="is not there any more"):
            run.state()


def test_info_of_a_run_that_has_just_begun(tmp_path):
    with make_run(tmp_path / "run"):
        info = run_info(tmp_path / "run")
    assert (info["status"], info["frame_count"], info["walls"]) == ("running", 0, [])
    assert (info["step"], info["state_digest"]) == (None, None)
    assert verify(tmp_path / "run") == []


def test_table_of_checkpoints_covers_the_state():
    state = start(make_model())
    assert [row.name for row in schema.CHECKPOINT] == list(state.as_dict())
    assert {entry.series for entry in BOOKS + HEAT_BOOKS} <= {row.name for row in schema.SERIES}
    written = {row for row in schema.RESULTS_TABLE if row.value is None}
    assert written == {*schema.SCENARIO, *schema.OFFSETS}


@pytest.mark.parametrize("page", FORMATS, ids=lambda page: page.stem)
def test_format_pages_hold_the_tables_of_the_schema(page):
    text = page.read_text(encoding="utf-8")
    assert (
        text.count("<!-- table ") == {"results": 5, "checkpoint": 1, "run-directory": 0}[page.stem]
    )
    assert with_tables(text) == text


def test_model_digest_depends_on_every_array():
    model = make_model()
    digest = model_digest(model)
    grains = dataclasses.replace(model.grains, mass=model.grains.mass * (1 + 1e-15))
    assert model_digest(dataclasses.replace(model, grains=grains)) != digest
    assert model_digest(dataclasses.replace(model, groups=("others",))) != digest
    assert model_digest(make_model()) == digest


@pytest.mark.parametrize(("field", "value", "message"), [
    ("velocity", np.nan, "particles/velocity is not finite in row 3"),
    ("wall_velocity", np.inf, "walls/velocity is not finite"),
])  # fmt: skip
def test_writer_refuses_values_that_are_not_finite(tmp_path, field, value, message):
    model = make_model()
    with make_run(tmp_path / "run") as run:
        state = start(model)
        getattr(state, field)[3 % len(getattr(state, field)), 0] = value
        with pytest.raises(ValueError, match=message):
            run.writer(model).frame(Snapshot(state, model))


def test_writer_refuses_wrong_shapes_steps_and_contacts(tmp_path):
    model, other = make_model(), start(make_model(4))
    with make_run(tmp_path / "run") as run:
        writer, state = run.writer(model), start(model)
        with pytest.raises(ValueError, match="has shape"):
            writer.frame(Snapshot(other, model))
        advance(state, model)
        rows = contact_rows(state)
        with pytest.raises(ValueError, match="shape that does not exist"):
            writer.frame(Snapshot(state, model, dataclasses.replace(rows, j=rows.j + 100)))
        with pytest.raises(ValueError, match="contacts/gap has shape"):
            writer.frame(Snapshot(state, model, dataclasses.replace(rows, gap=rows.gap[:-1])))
        writer.frame(Snapshot(state, model, rows))
        with pytest.raises(ValueError, match="after one at step 1"):
            writer.frame(Snapshot(state, model, rows))


def test_frames_are_copied(tmp_path):
    model = make_model()
    with make_run(tmp_path / "run") as run:
        writer, state = run.writer(model), start(model)
        writer.frame(Snapshot(state, model))
        before = state.position[:, :2].copy()
        state.position += 1.0
        state.image += 1
        writer.flush()
        with open_run(tmp_path / "run") as reader:
            np.testing.assert_array_equal(reader.frames[0].position, before)
            assert not reader.frames[0].image.any()

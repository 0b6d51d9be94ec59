"""The report: what is packed is what the run holds, it keeps to its size, and no text of the user
becomes markup."""

import base64
import hashlib
import os
import re
import shutil
import sys
import warnings
import zlib
from html import unescape
from pathlib import Path

import h5py
import numpy as np
import pytest
from heat_run import GRAINS, write_heated_run
from report_run import EVIL, decode, read_looks, read_page, write_evil_run
from shaped_run import ANGLE, DISC, GROWING, LOWER, PLACES, UPPER, write_shaped_run
from store_support import drive, make_model, make_run, run_whole

from multicor_cli.export import ExportRefused
from multicor_cli.post import QUANTITIES, PostError, force_network, rheology
from multicor_cli.post.energy import HEAT, EnergyTable
from multicor_cli.post.quantities import color_range
from multicor_cli.post.rings import rings_of
from multicor_cli.report import default_path, pack, write_report
from multicor_cli.report.figures import _book_lines, _Thinning
from multicor_cli.report.page import (
    ReportRow,
    _solids,
    describe_forces,
    describe_rheology,
    describe_run,
    describe_stages,
    pretty,
)
from multicor_cli.store import RunDirectory, StoreError, open_run, run_info
from multicor_cli.store.documents import StageEnd


@pytest.mark.parametrize("spacing", ["even", "square", "signed"])
@pytest.mark.parametrize("width", [1, 2])
def test_codes_are_as_fine_as_they_say(spacing, width):
    code = pack.Code(-2.0, 6.0, width, spacing)
    values = np.random.default_rng(1).uniform(-2.0, 6.0, 5000)
    error = np.abs(code.decode(code.encode(values)) - values)
    assert 0.3 * code.resolution * 8.0 < error.max() <= 0.5 * code.resolution * 8.0 * (1.0 + 1e-9)
    beyond = code.decode(code.encode(np.array([-2.0, 6.0, -9.0, 9.0])))
    assert beyond.tolist() == [-2.0, 6.0, -2.0, 6.0]
    assert np.isnan(code.decode(code.encode(np.array([np.nan])))).all()


@pytest.mark.parametrize(
    ("code", "values", "found"),
    [
        # To better than 1 %, where even steps of a byte see nothing
        (pack.Code(0.0, 1.0, 2, "square"), [1e-4], pytest.approx([1e-4], rel=0.01)),
        (pack.Code(0.0, 1.0, 1), [1e-4], [0.0]),
        # Of both signs, and zero
        (pack.Code(-1.0, 1.0, 1, "signed"), [-0.01, 0, 0.01], pytest.approx([-0.01, 0, 0.01], rel=0.05, abs=0.0)),
        (pack.Code(-1.0, 1.0, 1), [0.003], [0.0]),
        # A constant
        (pack.Code(3.0, 3.0, 2), [3.0, np.nan], pytest.approx([3.0, np.nan], nan_ok=True)),
    ],
)  # fmt: skip
def test_codes_resolve_small_values(code, values, found):
    assert code.decode(code.encode(np.array(values))).tolist() == found


def test_pages_hold_compressed_bytes_of_chosen_frames_and_contacts():
    arrays = [
        np.array([0x0102, 0x0304], "<u2"), np.array([7], np.uint8), np.array([1 << 24], "<u4"),
    ]  # fmt: skip
    assert list(zlib.decompress(pack.compress(arrays))) == [2, 4, 1, 3, 7, 0, 0, 0, 1]
    assert pack.thin_frames(5, 9).tolist() == [0, 1, 2, 3, 4]
    assert pack.thin_frames(101, 3).tolist() == [0, 50, 100]
    assert pack.thin_frames(100, 1).tolist() == [99]
    force = np.array([5.0, 1.0, 4.0, 3.0], np.float32)
    contacts = pack.ContactsView(4, np.arange(4), np.arange(4) + 1, np.zeros(4, np.float32), force)
    assert contacts.strongest(2).i.tolist() == [0, 2]
    assert contacts.strongest(0).i.size == 0
    assert contacts.strongest(9) is contacts


@pytest.fixture
def no_figures(monkeypatch):
    """Figures take most of the time of a report."""
    monkeypatch.setattr("multicor_cli.report.make_figures", lambda run, books: [])


def written(run, **options):
    """The page of a run, beside it."""
    return write_report(run, **options).path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(evil):
    target = evil.parent / "page.html"
    summary = write_report(evil, target)
    assert (summary.frames, summary.frame_count, summary.has_figures) == (6, 6, True)
    assert summary.size == target.stat().st_size
    return target.read_text(encoding="utf-8")


def test_packed_numbers_are_those_of_the_run(evil, page):
    meta, frames, radii = read_page(page)
    with open_run(evil) as run:
        assert radii == pytest.approx(run.model.grains.radius, rel=1e-6)
        for about, arrays in zip(meta["frames"], frames, strict=True):
            frame = run.frames[about["index"]]
            assert (about["time"], about["step"]) == (frame.time, frame.step)
            for name, values, error in (
                ("x", frame.position[:, 0], 4.0 / 65534), ("y", frame.position[:, 1], 1.0 / 65534),
                ("speed", np.hypot(*frame.velocity.T), 2e-4), ("spin", frame.spin, 1e-3),
                ("temperature", frame.temperature, 1e-5),
            ):  # fmt: skip
                assert decode(meta, name, arrays[name]) == pytest.approx(values, abs=error)
            assert about["walls"] == frame.wall_position.tolist()


def test_packed_contacts_are_those_of_the_run(page):
    """Grain k presses on k + 1 with k + 1 newtons, the last one on the wall above it (90 degrees: a
    quarter of 1024)."""
    meta, frames, _ = read_page(page)
    assert "contact_step" not in frames[0]  # no step was done before
    last = frames[-1]
    assert np.cumsum(last["contact_step"]).tolist() == list(range(GRAINS))
    assert last["contact_end"].tolist() == [*range(1, GRAINS), GRAINS + 256]
    assert decode(meta, "contact", last["contact_force"]) == pytest.approx(
        1.0 + np.arange(GRAINS), rel=1e-4
    )
    assert decode(meta, "force", last["force"]) == pytest.approx(1.0 + np.arange(GRAINS), rel=1e-4)
    assert [frame["contactCount"] for frame in meta["frames"]] == [None, *[GRAINS] * 5]


def test_heat_is_a_rate_and_temperatures_count_from_a_round_one(page):
    meta, frames, _ = read_page(page)
    assert "heat" not in frames[0]
    assert decode(meta, "heat", frames[3]["heat"]) == pytest.approx(
        1e-3 * np.arange(GRAINS), abs=1e-6
    )
    meta, _, _ = read_page(page)
    reference = {field["name"]: field["reference"] for field in meta["fields"]}
    assert reference["temperature"] == 300.0
    assert reference["speed"] is None


def test_largest_force_of_a_grain(evil):
    with open_run(evil) as run:
        force = QUANTITIES["force"]
        assert pack.values_of(force, run, 2) == pytest.approx(1.0 + np.arange(GRAINS))
        assert pack.values_of(force, run, 0) is None


def test_nothing_of_the_user_becomes_markup(page):
    assert EVIL not in page
    assert "<img" not in page
    assert page.count("<script") == page.count("</script>") == 3 + 6  # JSON, radii, program; frames
    text = unescape(re.sub(
        r"<script.*?</script>|<style.*?</style>|<svg.*?</svg>|<[^>]*>", "", page, flags=re.DOTALL,
    ))  # fmt: skip
    # name twice (title, heading), description, wall, stage, command; three times in each of two
    # scenarios
    assert text.count(EVIL) == 6 + 6
    meta, _, _ = read_page(page)
    assert meta["groups"][0] == meta["frames"][0]["stage"] == EVIL


def test_page_asks_for_nothing_from_anywhere(page):
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page).group(1)
    program = re.search(r"<script>(.*)</script>", page, re.DOTALL).group(1)
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode()
    assert policy.startswith(f"default-src 'none'; script-src 'sha256-{digest}';")
    assert not re.search(r"https?://", page)
    assert not re.search(r"""\b(src|href)=["'](?!#)""", page)
    assert "@import" not in page
    assert "url(" not in re.sub(r"url\(#", "", page)


def test_page_names_what_was_run_and_how_good_it_is(page):
    for words in (
        "What was run", "Checks", "Contact solver", "Energy books", "Books of heat",
        "heat closure", "energy closure", "All 6 frames of the run",
    ):  # fmt: skip
        assert words in page
    for title in ("Temperature over time", "Work of the solver", "Contacts that carry a force"):
        assert f'aria-label="{title}' in page
    assert "Energy books over time" not in page  # they are empty, as those of heat
    assert (
        'steps not converged</th><td dir="auto">0 of the steps (0 of 5) <span class="ok">ok '
        "[none, bad above 0.05]"
    ) in page
    assert page.index("multicor report") < 400


@pytest.mark.usefixtures("no_figures")
def test_grains_of_any_shape_are_packed_as_they_are(shaped, tmp_path):
    text = written(shaped, path=tmp_path / "p.html")
    meta, frames, radii = read_page(text)
    looks = read_looks(text)
    with open_run(shaped) as run:
        rings = rings_of(run.model.outlines)
        for grain, look in enumerate(looks):
            own = [ring for ring, of in zip(rings, rings.grain, strict=True) if of == grain]
            assert len(look) == (len(own) if grain != DISC else 0)
            for found, ring in zip(look, own, strict=False):
                assert found * radii[grain] == pytest.approx(ring, abs=4e-6)
        for about, arrays in zip(meta["frames"], frames, strict=True):
            frame = run.frames[about["index"]]
            assert decode(meta, "angle", arrays["angle"]) == pytest.approx(frame.angle, abs=1e-4)
    last = frames[-1]
    arm = [decode(meta, "arm", last[f"contact_arm_{axis}"]) for axis in "xy"]
    touch = dict(zip(zip(np.cumsum(last["contact_step"]).tolist(), last["contact_end"].tolist(),
                         strict=True), np.transpose(arm), strict=True))  # fmt: skip
    down = len(PLACES) + 768
    assert touch[ANGLE, down] == pytest.approx([0.0, -0.11], abs=1e-5)
    assert touch[LOWER, UPPER][1] == pytest.approx(0.08, abs=1e-5)


def test_grains_that_are_alike_but_for_their_size_share_a_look(shaped):
    with open_run(shaped) as run:
        found = pack.looks_of(run.model.outlines)
    counts = {name: count for name, _, count in found.arrays}
    assert (counts["look"], counts["rings"]) == (9, 7)  # two squares, and a disc without any


@pytest.mark.usefixtures("no_figures")
def test_frames_have_the_radii_of_grains_that_grow(tmp_path):
    write_shaped_run(tmp_path / "run", growth=0.25)
    meta, frames, radii = read_page(written(tmp_path / "run", path=tmp_path / "p.html"))
    for k, arrays in enumerate(frames):
        known = np.array(radii, np.float64)
        known[GROWING] *= 1.0 + 0.25 * k
        assert decode(meta, "radius", arrays["radius"]) == pytest.approx(known, abs=1e-5)
    assert meta["codes"]["arm"]["high"] == pytest.approx(max(known))


@pytest.mark.usefixtures("no_figures")
def test_a_page_without_room_for_outlines_says_so(shaped, tmp_path, monkeypatch):
    monkeypatch.setattr("multicor_cli.report.pack._LOOKS_SHARE", 0.0)
    text = written(shaped, path=tmp_path / "p.html")
    assert read_page(text)[0]["looks"] is None
    assert "Grains are circles here" in text


@pytest.mark.usefixtures("no_figures")
def test_discs_need_no_looks(evil, tmp_path):
    text = written(evil, path=tmp_path / "p.html")
    meta, frames, _ = read_page(text)
    assert meta["looks"] is None
    assert "Grains are circles here" not in text
    assert not {"angle", "radius", "contact_arm_x"} & set(frames[-1])


@pytest.mark.usefixtures("no_figures")
def test_small_budget_thins_frames_and_contacts_and_says_so(tmp_path, monkeypatch):
    write_evil_run(tmp_path / "run", frames=40)
    monkeypatch.setattr("multicor_cli.report.pack._CONTACT_SHARE", 0.1)
    with open_run(tmp_path / "run") as run:
        whole = pack.pack_frames(run, 10**6)
        assert (len(whole.chunks), whole.contact_limit, whole.codes["speed"].width) == (40, None, 2)
        small = pack.pack_frames(run, whole.size // 5)
    assert small.size <= whole.size // 5
    assert 1 < len(small.chunks) < 20
    assert small.chunks[-1].index == 39
    assert small.codes["speed"].width == 1
    assert small.contact_limit < GRAINS
    assert len(small.walls) == len(small.chunks)
    monkeypatch.setattr("multicor_cli.report.SIZE_LIMIT", 2_000_000 + whole.size // 4)
    text = written(tmp_path / "run")
    assert re.search(r"\d+ of 40 frames of the run, with the \d+ strongest contacts of each", text)
    meta, frames, _ = read_page(text)
    forces = decode(meta, "contact", frames[-1]["contact_force"])
    assert forces == pytest.approx(np.arange(GRAINS - forces.size, GRAINS) + 1.0, rel=0.02)


@pytest.mark.usefixtures("no_figures")
def test_frames_can_be_limited(evil, tmp_path):
    calls = []
    done = write_report(
        evil, tmp_path / "p.html", frames=2, progress=lambda k, total: calls.append((k, total))
    )
    assert (done.frames, done.frame_count, calls) == (2, 6, [(1, 2), (2, 2)])
    assert [
        frame["index"] for frame in read_page((tmp_path / "p.html").read_text())[0]["frames"]
    ] == [0, 5]


@pytest.mark.usefixtures("no_figures")
def test_files_are_not_overwritten(evil, tmp_path):
    target = tmp_path / "page.html"
    write_report(evil, target)
    with pytest.raises(ExportRefused, match="--overwrite"):
        write_report(evil, target)
    write_report(evil, target, is_overwriting=True)
    target.write_text("<!doctype html><title>mine</title>")
    with pytest.raises(ExportRefused, match="not a report"):
        write_report(evil, target, is_overwriting=True)
    assert "mine" in target.read_text()
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]


def test_default_file_lies_beside_the_run(tmp_path):
    assert default_path(tmp_path / "runs" / "shear") == tmp_path / "runs" / "shear-report.html"
    (tmp_path / "results.h5").touch()
    assert default_path(tmp_path / "results.h5") == tmp_path.with_name(
        f"{tmp_path.name}-report.html"
    )


@pytest.mark.parametrize(
    "options",
    [{"heat": False}, {"contacts": False}, {"frames": 1}],
    ids=["no heat", "no contacts", "one frame"],
)
def test_runs_that_lack_something(options, tmp_path):
    write_heated_run(tmp_path / "run", **options)
    text = written(tmp_path / "run")
    assert ("The only frame of the run." in text) == (options.get("frames") == 1)
    meta, frames, _ = read_page(text)
    names = [field["name"] for field in meta["fields"]]
    assert ("temperature" in names) == options.get("heat", True)
    assert ("contact_step" in frames[-1]) == ("heat" in options)


def test_every_frame_says_where_it_is(page):
    meta, _, _ = read_page(page)
    boxes = np.array([frame["box"] for frame in meta["frames"]])
    assert boxes[:, 0].min(axis=0) == pytest.approx(meta["box"][0])
    assert boxes[:, 1].max(axis=0) == pytest.approx(meta["box"][1])


def test_run_without_walls_with_one_grain(tmp_path):
    run_whole(tmp_path / "run", make_model(1, walls=False), steps=10)
    meta, frames, _ = read_page(written(tmp_path / "run"))
    assert meta["shapes"] == []
    assert decode(meta, "x", frames[-1]["x"]).shape == (1,)


@pytest.mark.parametrize(("name", "values", "grains", "expected"), [
    ("speed", np.zeros(9), 9, (0.0, 1.0)),  # nothing moves: no negative speeds
    # The one hot grain of few is what matters
    ("temperature", np.append(np.full(999, 300.0), 400.0), 10, (300.0, 400.0)),
    # an outlier is not
    ("temperature", np.append(np.linspace(300.0, 310.0, 1999), 900.0), 2000, (300.0, 309.95)),
    # Nothing is gained by leaving out ends
    ("temperature", np.linspace(300.0, 310.0, 1999), 2000, (300.0, 310.0)),
    ("spin", np.linspace(-1.0, 3.0, 9), 9, (-3.0, 3.0)),
    ("speed", np.array([np.nan, 2.0, np.inf, 1e305]), 4, (0.0, 2.0)),
    ("heat", np.array([np.nan]), 1, (0.0, 1.0)),
])  # fmt: skip
def test_colors_span(name, values, grains, expected):
    assert color_range(QUANTITIES[name], pack._sane(values), grains) == pytest.approx(
        expected, abs=0.01
    )


def test_books_of_rounding_errors_are_not_drawn_but_those_that_do_not_close_are():
    time = np.linspace(0.0, 1.0, 5)
    books = EnergyTable(
        (), {"books": {"heat_stored": 1e-15 * time, "heat_imbalance": 1e-15 * time}}
    )
    assert _book_lines(books, HEAT, _Thinning(time), np.full(5, 1e-15)) == []
    assert len(_book_lines(books, HEAT, _Thinning(time), np.full(5, 1e-3))) == 2


@pytest.mark.parametrize(("value", "text"), [
    (0.0, "0"), (-2.08123e-6, "−2.081·10⁻⁶"), (1.5e20, "1.5·10²⁰"), (0.25, "0.25"),
    (-1600, "−1,600"),
])  # fmt: skip
def test_numbers_for_people(value, text):
    assert pretty(value) == text


ABSURD = {
    "particles/position": [(3, 1, 1e308), (14, 0, np.nan), (25, 1, -np.inf)],
    "particles/velocity": [(33, 0, 1.7e308), (34, 0, np.nan)],
    "particles/temperature": [(41, None, np.inf), (42, None, np.nan)],
    "contacts/impulse": [(31, 0, 1e308), (32, 0, np.nan)],
    "contacts/normal": [(33, 0, np.nan)],
    "series/heat_stored": [(3, None, 1e308)],
    "walls/position": [(2, 0, np.nan)],
}


def test_absurd_numbers_of_a_damaged_file_spoil_nothing_else(evil, tmp_path):
    """Scales, the place of everything else and the figures stay as they are, and nothing complains
    on the way."""
    file = Path(shutil.copy(evil / "results.h5", tmp_path / "damaged.h5"))
    with h5py.File(file, "r+") as opened:
        for path, changes in ABSURD.items():
            for row, column, value in changes:
                opened[path][(row, column) if column is not None else row] = value
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_report(file, tmp_path / "page.html")
    meta, frames, _ = read_page((tmp_path / "page.html").read_text(encoding="utf-8"))
    with open_run(evil) as run:
        last = run.frames[-1]
        assert np.isfinite(meta["box"]).all()
        assert decode(meta, "y", frames[-1]["y"]) == pytest.approx(last.position[:, 1], abs=1e-4)
        assert decode(meta, "speed", frames[-1]["speed"]) == pytest.approx(
            np.hypot(*last.velocity.T), abs=1e-3
        )
        assert decode(meta, "contact", frames[-1]["contact_force"]) == pytest.approx(
            1.0 + np.arange(GRAINS), rel=1e-3
        )
    assert np.isnan(decode(meta, "temperature", frames[4]["temperature"])[2])


def test_ends_ignore_what_is_no_number():
    assert pack._ends([np.array([1.0, np.nan]), np.array([np.inf, -3.0, 1e301]), np.zeros(0)]) == (
        -3.0,
        1.0,
    )
    assert pack._ends([np.array([np.nan])]) == (0.0, 0.0)


@pytest.mark.usefixtures("no_figures")
def test_endless_names_are_cut_and_texts_keep_their_direction(tmp_path):
    name = "שלום\u202e" + "x" * 10_000
    source = f"[scenario]\nname = '{name}'\ndescription = '{name}'\n"
    model = make_model()
    with RunDirectory.create(
        tmp_path / "run", source, source, {"seed": 1}, stages=(name, "b")
    ) as run:
        drive(run, model, steps=20, checkpoint_every=10, finish=False)
        run.finish("failed", stop_reason=f"grain 3 is lost {name}", exit_code=4)
    text = written(tmp_path / "run")
    heading = re.search(r'<h1 dir="auto">(.*?)</h1>', text).group(1)
    assert (len(heading), heading[-1]) == (200, "…")
    assert '<p data-status="failed" dir="auto">grain 3 is lost' in text
    assert max(map(len, re.findall(r'<td dir="auto">(.*?)</td>', text))) <= 200
    assert len(read_page(text)[0]["frames"][-1]["stage"]) == 200
    assert text.count(name) == 2 * 2  # whole in the two scenarios only


def test_page_says_how_stages_ended(tmp_path):
    with make_run(tmp_path / "run") as run:
        what = ("the mean force in y on lid", 3.0, "at least", 5.0, "N")
        end = StageEnd(0, "<i>wait</i>", "timeout", 20, 0.5, 0.5, *what)
        run.stage_ended(end)
        drive(run, make_model(), steps=40, checkpoint_every=15)
    assert describe_stages(run_info(tmp_path / "run")) == [ReportRow(end.name, end.text)]
    text = written(tmp_path / "run")
    assert "Ends of the stages" in text
    words = (
        "t = 0.5 s, step 20: timed out after 0.5 s; the mean force in y on lid was 3 N, asked for "
        "was at least 5 N"
    )
    assert f'&lt;i&gt;wait&lt;/i&gt;</th><td dir="auto">{words}' in text


def test_a_version_that_is_not_known_is_left_out():
    known = {"status": "running", "stages": [], "walls": [], "provenance": {}}
    counts = {"frame_count": 1, "series_count": 1}
    names = [
        "stop_reason", "time", "step", "grain_count", "started", "finished", "duration",
        "state_digest",
    ]  # fmt: skip
    rows = describe_run({**dict.fromkeys(names), **known, **counts})
    assert "version" not in [row.name for row in rows]


@pytest.mark.usefixtures("no_figures")
def test_files_of_a_run_links_and_devices_are_refused(evil, tmp_path):
    for name in ("results.h5", "model.h5", "checkpoints/step-00000000005.h5", "segments/page.html"):
        with pytest.raises(ExportRefused, match="file of the run"):
            write_report(evil, evil / name, is_overwriting=True)
    (tmp_path / "link.html").symlink_to("nowhere")
    os.mkfifo(tmp_path / "pipe.html")
    for is_overwriting in (False, True):
        for name in ("link.html", "pipe.html"):
            with pytest.raises(ExportRefused):
                write_report(evil, tmp_path / name, is_overwriting=is_overwriting)
    assert (tmp_path / "link.html").is_symlink()
    assert not (tmp_path / "nowhere").exists()
    assert (tmp_path / "pipe.html").is_fifo()


@pytest.mark.usefixtures("no_figures")
def test_run_that_was_interrupted(tmp_path):
    write_evil_run(tmp_path / "run", is_finished=False)
    text = written(tmp_path / "run")
    assert '<span class="badge" data-status="interrupted">' in text
    assert len(read_page(text)[1]) == 6


@pytest.mark.usefixtures("no_figures")
def test_run_that_is_going_on(tmp_path):
    model = make_model(heat=True)
    with RunDirectory.create(tmp_path / "run", "", "", {"seed": 1}, stages=("a", "b")) as run:
        drive(run, model, steps=20, checkpoint_every=10, finish=False)
        text = written(tmp_path / "run")
    assert '<span class="badge" data-status="running">' in text
    assert len(read_page(text)[1]) == 5


def test_run_without_frames_and_directory_without_run(tmp_path):
    with (
        RunDirectory.create(tmp_path / "run", "", "", {"seed": 1}, stages=("a",)),
        pytest.raises((PostError, StoreError)),
    ):
        write_report(tmp_path / "run", tmp_path / "page.html")
    (tmp_path / "empty").mkdir()
    with pytest.raises(StoreError):
        write_report(tmp_path / "empty", tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_without_matplotlib_the_page_says_so(evil, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert not write_report(evil, tmp_path / "page.html").has_figures
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "has no matplotlib" in text
    assert "<svg" not in text


def test_checks_stand_above_all_and_open_where_something_is_wrong(page):
    above, _, rest = page.partition('id="canvas"')
    assert "<summary>Checks: " in above
    assert "<summary>Checks: " not in rest


def test_rheology_and_forces_are_told_where_there_are_any(tmp_path):
    write_heated_run(tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        rows = {row.name: row.value for row in describe_rheology(run)}
        assert rows["solid fraction in the bulk"].startswith(
            pretty(rheology(run).mean["solid_fraction"])
        )
        forces = {row.name: row.value for row in describe_forces(run)}
        assert forces["contacts that carry a force"] == pretty(force_network(run).rows[0][1])
    run_whole(tmp_path / "other")
    with open_run(tmp_path / "other") as run:
        assert describe_rheology(run) == []


def test_solid_polygons_are_found_wall_by_wall():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    sides = np.stack([square, np.roll(square, -1, axis=0)], axis=1)
    found = list(_solids(np.repeat([0, 2], 4), np.concatenate([sides, sides + 5.0])))
    assert [wall for wall, _ in found] == [0, 2]
    assert found[1][1].tolist() == (square + 5.0).tolist()

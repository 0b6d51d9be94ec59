"""The report: what is packed is what the run holds, it keeps to its size, and no text of the user becomes markup."""

from __future__ import annotations

import re
import sys
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from heat_run import GRAINS, write_heated_run
from report_run import EVIL, decode, read_page, write_evil_run
from store_support import drive, make_model, run_whole

from multicor_cli.post import PostError
from multicor_cli.report import ReportExists, write_report
from multicor_cli.report.collect import ContactsView, choose_frames
from multicor_cli.report.fields import largest_forces
from multicor_cli.report.pack import pack_frames
from multicor_cli.report.quantize import Code, compress
from multicor_cli.report.write import default_path
from multicor_cli.store import RunDirectory, StoreError, open_run


@pytest.mark.parametrize("spacing", ["even", "square"])
@pytest.mark.parametrize("width", [1, 2])
def test_codes_are_as_fine_as_they_say(spacing, width: int) -> None:
    code = Code(-2.0, 6.0, width, spacing)
    values = np.random.default_rng(1).uniform(-2.0, 6.0, 5000)
    error = np.abs(code.decode(code.encode(values)) - values)
    assert 0.3 * code.resolution * 8.0 < error.max() <= 0.5 * code.resolution * 8.0 * (1.0 + 1e-9)
    assert code.decode(code.encode(np.array([-2.0, 6.0, -9.0, 9.0]))).tolist() == [-2.0, 6.0, -2.0, 6.0]
    assert np.isnan(code.decode(code.encode(np.array([np.nan])))).all()


def test_square_codes_resolve_small_values() -> None:
    """1e-4 of the largest value to better than 1 %, where even steps of a byte see nothing."""
    assert Code(0.0, 1.0, 2, "square").decode(Code(0.0, 1.0, 2, "square").encode(np.array([1e-4]))) == pytest.approx(
        [1e-4], rel=0.01
    )
    assert Code(0.0, 1.0, 1).encode(np.array([1e-4])).tolist() == [0]


def test_codes_of_a_constant() -> None:
    code = Code(3.0, 3.0, 2)
    assert code.decode(code.encode(np.array([3.0, np.nan]))).tolist() == [3.0, pytest.approx(np.nan, nan_ok=True)]


def test_compression_separates_bytes() -> None:
    import zlib

    data = zlib.decompress(compress([np.array([0x0102, 0x0304], "<u2"), np.array([7], np.uint8), np.array([1 << 24], "<u4")]))
    assert list(data) == [2, 4, 1, 3, 7, 0, 0, 0, 1]


def test_chosen_frames_are_evenly_spaced_and_end_with_the_last() -> None:
    assert choose_frames(5, 9).tolist() == [0, 1, 2, 3, 4]
    assert choose_frames(101, 3).tolist() == [0, 50, 100]
    assert choose_frames(100, 1).tolist() == [99]


def test_strongest_contacts_stay_in_order() -> None:
    force = np.array([5.0, 1.0, 4.0, 3.0], np.float32)
    contacts = ContactsView(np.arange(4), np.arange(4) + 1, np.zeros(4, np.float32), force)
    assert contacts.strongest(2).i.tolist() == [0, 2]
    assert contacts.strongest(0).i.size == 0
    assert contacts.strongest(9) is contacts


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures take most of the time of a report."""
    monkeypatch.setattr("multicor_cli.report.write.make_figures", lambda run, books: [])


@pytest.fixture(scope="module")
def evil(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("evil") / "run"
    write_evil_run(path)
    return path


@pytest.fixture(scope="module")
def page(evil: Path) -> str:
    target = evil.parent / "page.html"
    summary = write_report(evil, target)
    assert (summary.frames, summary.frame_count, summary.has_figures) == (6, 6, True)
    assert summary.size == target.stat().st_size
    return target.read_text(encoding="utf-8")


def test_packed_numbers_are_those_of_the_run(evil: Path, page: str) -> None:
    meta, frames, radii = read_page(page)
    with open_run(evil) as run:
        assert radii == pytest.approx(run.model.grains.radius, rel=1e-6)
        for about, arrays in zip(meta["frames"], frames, strict=True):
            frame = run.frames[about["index"]]
            assert (about["time"], about["step"]) == (frame.time, frame.step)
            assert decode(meta, "x", arrays["x"]) == pytest.approx(frame.position[:, 0], abs=4.0 / 65534)
            assert decode(meta, "y", arrays["y"]) == pytest.approx(frame.position[:, 1], abs=1.0 / 65534)
            assert decode(meta, "speed", arrays["speed"]) == pytest.approx(np.hypot(*frame.velocity.T), abs=2e-4)
            assert decode(meta, "spin", arrays["spin"]) == pytest.approx(frame.spin, abs=1e-3)
            assert decode(meta, "temperature", arrays["temperature"]) == pytest.approx(frame.temperature, abs=1e-5)
            assert about["walls"] == frame.wall_position.tolist()


def test_packed_contacts_are_those_of_the_run(page: str) -> None:
    """Grain k presses on k + 1 with k + 1 newtons, the last one on the wall above it (90 degrees: a quarter of 1024)."""
    meta, frames, _ = read_page(page)
    assert "contact_step" not in frames[0]  # no step was done before
    last = frames[-1]
    assert np.cumsum(last["contact_step"]).tolist() == list(range(GRAINS))
    assert last["contact_end"].tolist() == [*range(1, GRAINS), GRAINS + 256]
    assert decode(meta, "contact", last["contact_force"]) == pytest.approx(1.0 + np.arange(GRAINS), rel=1e-4)
    assert decode(meta, "force", last["force"]) == pytest.approx(1.0 + np.arange(GRAINS), rel=1e-4)
    assert [frame["contactCount"] for frame in meta["frames"]] == [None, *[GRAINS] * 5]


def test_heat_is_a_rate_and_missing_in_the_first_frame(page: str) -> None:
    meta, frames, _ = read_page(page)
    assert "heat" not in frames[0]
    assert decode(meta, "heat", frames[3]["heat"]) == pytest.approx(1e-3 * np.arange(GRAINS), abs=1e-6)


def test_temperatures_that_hardly_differ_count_from_a_round_one(page: str) -> None:
    meta, _, _ = read_page(page)
    reference = {field["name"]: field["reference"] for field in meta["fields"]}
    assert reference["temperature"] == 300.0
    assert reference["speed"] is None


def test_largest_force_of_a_grain(evil: Path) -> None:
    with open_run(evil) as run:
        assert largest_forces(run, 2) == pytest.approx(1.0 + np.arange(GRAINS))
        assert largest_forces(run, 0) is None


def test_nothing_of_the_user_becomes_markup(page: str) -> None:
    assert EVIL not in page
    assert "<img" not in page
    assert page.count("<script") == page.count("</script>") == 3 + 6  # JSON, radii, program; frames
    text = unescape(re.sub(r"<script.*?</script>|<style.*?</style>|<svg.*?</svg>|<[^>]*>", "", page, flags=re.DOTALL))
    # name twice (title, heading), description, wall, stage, command; three times in each of two scenarios
    assert text.count(EVIL) == 6 + 6
    meta, _, _ = read_page(page)
    assert meta["groups"][0] == meta["frames"][0]["stage"] == EVIL


def test_page_asks_for_nothing_from_anywhere(page: str) -> None:
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page).group(1)
    assert policy.startswith("default-src 'none';")
    assert not re.search(r"https?://", page)
    assert not re.search(r"""\b(src|href)=["'](?!#)""", page)
    assert "@import" not in page
    assert "url(" not in re.sub(r"url\(#", "", page)


def test_page_names_what_was_run_and_how_good_it_is(page: str) -> None:
    for words in ("What was run", "How good it is", "Energy books", "Books of heat", "heat closure", "energy closure"):
        assert words in page
    assert "All 6 frames of the run" in page
    assert page.count("<figure") >= 5
    assert page.index("multicor report") < 400


@pytest.mark.usefixtures("no_figures")
def test_small_budget_thins_frames_and_contacts_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_evil_run(tmp_path / "run", frames=40)
    with open_run(tmp_path / "run") as run:
        whole = pack_frames(run, 10**6)
        assert (len(whole.chunks), whole.contact_limit, whole.codes["speed"].width) == (40, None, 2)
        small = pack_frames(run, whole.size // 5)
    assert small.size <= whole.size // 5
    assert 1 < len(small.chunks) < 20
    assert small.chunks[-1].index == 39
    assert small.codes["speed"].width == 1
    assert small.contact_limit < GRAINS
    assert len(small.walls) == len(small.chunks)
    monkeypatch.setattr("multicor_cli.report.write.SIZE_LIMIT", 2_000_000 + whole.size // 4)
    write_report(tmp_path / "run", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert re.search(r"\d+ of 40 frames of the run, with the \d+ strongest contacts of each", text)
    meta, frames, _ = read_page(text)
    forces = decode(meta, "contact", frames[-1]["contact_force"])
    assert forces == pytest.approx(np.arange(GRAINS - forces.size, GRAINS) + 1.0, rel=0.02)


@pytest.mark.usefixtures("no_figures")
def test_frames_can_be_limited(evil: Path, tmp_path: Path) -> None:
    calls = []
    done = write_report(evil, tmp_path / "p.html", frames=2, progress=lambda k, total: calls.append((k, total)))
    assert (done.frames, done.frame_count, calls) == (2, 6, [(1, 2), (2, 2)])
    assert [frame["index"] for frame in read_page((tmp_path / "p.html").read_text())[0]["frames"]] == [0, 5]


@pytest.mark.usefixtures("no_figures")
def test_files_are_not_overwritten(evil: Path, tmp_path: Path) -> None:
    target = tmp_path / "page.html"
    write_report(evil, target)
    with pytest.raises(ReportExists, match="--overwrite"):
        write_report(evil, target)
    write_report(evil, target, is_overwriting=True)
    target.write_text("<!doctype html><title>mine</title>")
    with pytest.raises(ReportExists, match="no report"):
        write_report(evil, target, is_overwriting=True)
    assert "mine" in target.read_text()
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]


def test_default_file_lies_beside_the_run(tmp_path: Path) -> None:
    assert default_path(tmp_path / "runs" / "shear") == tmp_path / "runs" / "shear-report.html"
    (tmp_path / "results.h5").touch()
    assert default_path(tmp_path / "results.h5") == tmp_path.with_name(f"{tmp_path.name}-report.html")


@pytest.mark.parametrize(
    "options", [{"heat": False}, {"contacts": False}, {"frames": 1}], ids=["no heat", "no contacts", "one frame"]
)
def test_runs_that_lack_something(options: dict, tmp_path: Path) -> None:
    write_heated_run(tmp_path / "run", **options)
    write_report(tmp_path / "run", tmp_path / "page.html")
    meta, frames, _ = read_page((tmp_path / "page.html").read_text(encoding="utf-8"))
    names = [field["name"] for field in meta["fields"]]
    assert ("temperature" in names) == options.get("heat", True)
    assert ("contact_step" in frames[-1]) == ("heat" in options)


def test_run_without_walls_with_one_grain(tmp_path: Path) -> None:
    run_whole(tmp_path / "run", make_model(1, walls=False), steps=10)
    write_report(tmp_path / "run", tmp_path / "page.html")
    meta, frames, _ = read_page((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert meta["shapes"]["kind"] == []
    assert decode(meta, "x", frames[-1]["x"]).shape == (1,)


@pytest.mark.usefixtures("no_figures")
def test_run_that_was_interrupted(tmp_path: Path) -> None:
    write_evil_run(tmp_path / "run", is_finished=False)
    write_report(tmp_path / "run", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert '<span class="badge" data-status="interrupted">' in text
    assert len(read_page(text)[1]) == 6


@pytest.mark.usefixtures("no_figures")
def test_run_that_is_going_on(tmp_path: Path) -> None:
    model = make_model(heat=True)
    with RunDirectory.create(tmp_path / "run", "", "", {"seed": 1}, stages=("a", "b")) as run:
        drive(run, model, steps=20, checkpoint_every=10, finish=False)
        write_report(tmp_path / "run", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert '<span class="badge" data-status="running">' in text
    assert len(read_page(text)[1]) == 5


def test_run_without_frames_and_directory_without_run(tmp_path: Path) -> None:
    with RunDirectory.create(tmp_path / "run", "", "", {"seed": 1}, stages=("a",)), pytest.raises((PostError, StoreError)):
        write_report(tmp_path / "run", tmp_path / "page.html")
    (tmp_path / "empty").mkdir()
    with pytest.raises(StoreError):
        write_report(tmp_path / "empty", tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_without_matplotlib_the_page_says_so(evil: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert not write_report(evil, tmp_path / "page.html").has_figures
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "has no matplotlib" in text
    assert "<svg" not in text

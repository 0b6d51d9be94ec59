"""Films: all pictures alike but for the grains, and the file appears whole or not at all."""

import itertools
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from multicor_cli.plots import PlotError
from multicor_cli.plots.animate import _draw_all, _find_stage, film_path, write_film
from multicor_cli.plots.style import house_style
from multicor_cli.post import grain_map
from multicor_cli.store import open_run


@pytest.fixture(scope="module")
def run(evil):
    return open_run(evil)


def maps(run, of="velocity"):
    return lambda: (grain_map(run, of, k) for k in range(6))


def test_all_pictures_share_part_of_the_plane_and_colors(run):
    with house_style():
        stage = _find_stage(maps(run)(), 6)
        pictures = [picture.copy() for picture in _draw_all(maps(run)(), stage, 600)]
    boxes = np.array([table.scene.box for table in maps(run)()])
    assert stage.box.tolist() == [*map(list, (boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))]
    assert (stage.scale[0].vmin, stage.scale[0].vmax) == pytest.approx((-0.9, 0.9))
    assert len({picture.shape for picture in pictures}) == 1
    height, width, _ = pictures[0].shape
    assert (height % 2, width % 2) == (0, 0)
    assert 300 < width <= 602
    changed = (pictures[0] != pictures[-1]).any(axis=2)
    assert changed.any()
    assert not changed[int(0.85 * height) :].any()  # the color bar below stays as it is
    assert not changed[:, : int(0.07 * width)].any()  # and so do the labels at the left


def test_grains_of_any_shape_move_in_films(shaped, tmp_path):
    with open_run(shaped) as shapes, house_style():
        tables = [grain_map(shapes, "speed", k) for k in range(3)]
        stage = _find_stage(tables, 3)
        pictures = [picture.copy() for picture in _draw_all(tables, stage, 400)]
    assert len({picture.shape for picture in pictures}) == 1
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))


def test_nothing_stays_if_drawing_fails(run, tmp_path):
    def failing():
        yield grain_map(run, "spin", 1)
        if list(tmp_path.iterdir()):
            raise ValueError
        yield grain_map(run, "spin", 2)

    with pytest.raises(ValueError, match=r"^$"):
        write_film(failing, 2, tmp_path / "film.gif")
    assert list(tmp_path.iterdir()) == []


def test_films_have_names_and_endings(tmp_path, monkeypatch):
    with pytest.raises(PlotError, match=r"\.mp4 or \.gif"):
        write_film(lambda: iter([None]), 1, tmp_path / "film.avi")
    with pytest.raises(PlotError, match="no frame"):
        write_film(lambda: iter([None]), 1, tmp_path / "film.gif")
    assert film_path(Path("a.gif")) == Path("a.gif")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert film_path(Path("a.mp4")) == Path("a.gif")


@pytest.mark.skipif(
    not (shutil.which("ffmpeg") and shutil.which("ffprobe")), reason="needs ffmpeg and ffprobe"
)
def test_mp4_has_every_frame(run, tmp_path):
    told, path = [], tmp_path / "film.mp4"
    film = write_film(maps(run), 6, path, rate=5.0, progress=lambda *done: told.append(done))
    assert (film.path, film.frames, film.skipped) == (path, 6, 0)
    assert told[-1] == (6, 6)
    command = "ffprobe -v error -count_frames -of csv=p=0 -show_entries"
    entries = "stream=nb_read_frames,r_frame_rate"
    said = subprocess.run(
        [*command.split(), entries, film.path], capture_output=True, text=True, check=True
    ).stdout
    assert said.strip() == "5/1,6"


def test_what_ffmpeg_says_is_passed_on(run, tmp_path, monkeypatch):
    (tmp_path / "ffmpeg").write_text("#!/bin/sh\necho 'no codec' >&2\nexit 3\n")
    (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PlotError, match="no codec"):
        write_film(maps(run), 6, tmp_path / "film.mp4")
    assert [file.name for file in tmp_path.iterdir()] == ["ffmpeg"]

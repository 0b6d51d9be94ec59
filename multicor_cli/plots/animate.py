"""Films of maps: frames drawn as `multicor post map` does, with one color scale for all."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.grain_map import color_scale, draw_bar, draw_values, place_scene
from multicor_cli.plots.style import PAGE, PlotError, house_style, name_frame
from multicor_cli.post.grain_map import GrainMap
from multicor_cli.store.atomic import storage_errors
from multicor_cli.store.layout import Progress, no_progress

SUFFIXES = (".mp4", ".gif")
"""Formats of films."""

_SIDES = {".mp4": 1200, ".gif": 800}  # pixels of the longer side of a picture
_SAMPLE = 2_000_000  # values that the color scale is made from, at most


@dataclass(frozen=True)
class Film:
    """A film that was written: its file, which may be another (`film_path`), its frames, and those
    that were skipped without the quantity, as the first frame has no heat since the one before.
    """

    path: Path
    frames: int
    skipped: int


def film_path(path: Path) -> Path:
    """The file that `write_film` writes: ``.gif`` instead of ``.mp4`` where ffmpeg is missing."""
    can_be = path.suffix.lower() != ".mp4" or shutil.which("ffmpeg")
    return path if can_be else path.with_suffix(".gif")


def write_film(
    maps: Callable[[], Iterator[GrainMap | None]],
    count: int,
    path: Path,
    *,
    rate: float = 20.0,
    progress: Progress = no_progress,
) -> Film:
    """Draw maps one after the other into a film. It appears under its name when it is complete.

    ``maps`` gives ``count`` maps in order each time it is called, None for a frame without the
    quantity: once for the colors and the part of the plane that all have in common, once to be
    drawn. ``rate`` is in pictures per second.

    Raises:
        MissingLibrary: If matplotlib is not installed.
        PlotError: If the ending is not known, no map is left, or ffmpeg fails.
        StorageError: If the file cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise PlotError(f"{path}: the name of a film ends in {' or '.join(SUFFIXES)}")
    target = film_path(path)
    with house_style():
        stage = _find_stage(maps(), count)
        if stage is None:
            raise PlotError(f"{path}: no frame has this quantity")
        skipped: list[int] = []

        def present() -> Iterator[GrainMap]:
            for number, table in enumerate(maps()):
                if table is None:
                    skipped.append(number)
                else:
                    yield table
                progress(number + 1, count)

        pictures = _draw_all(present(), stage, _SIDES[target.suffix.lower()])
        with storage_errors(target):
            _write(pictures, target, rate)
    return Film(target, count - len(skipped), len(skipped))


class _Stage(NamedTuple):
    """What all pictures have in common: the part of the plane and the color scale."""

    box: Floats
    scale: tuple[Any, str]


def _find_stage(maps: Iterable[GrainMap | None], count: int) -> _Stage | None:
    found: list[Floats] = []
    boxes: list[Floats] = []
    last, most = None, max(_SAMPLE // count, 1000)
    for table in maps:
        if table is not None:
            last, value = table, table.value[np.isfinite(table.value)]
            boxes.append(table.scene.box)
            if value.size > most:  # some of them, the smallest and the largest among them
                some = value[:: -(-value.size // most)]
                value = np.concatenate([some, [value.min(), value.max()]])
            found.append(value)
    if last is None:
        return None
    low, high = np.swapaxes(boxes, 0, 1)
    box = np.array([low.min(axis=0), high.max(axis=0)])
    return _Stage(box, color_scale(last.with_(value=np.concatenate(found))))


def _draw_all(maps: Iterable[GrainMap], stage: _Stage, most: int) -> Iterator[Any]:
    """Pictures of one size as RGBA bytes, shape ``(height, width, 4)`` with even numbers."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure: Any = Figure(dpi=100.0)
    canvas: Any = FigureCanvasAgg(figure)
    place = None
    for table in maps:
        shown = table.with_(scene=replace(table.scene, box=stage.box))
        is_first = place is None
        if place is None:
            place = place_scene(figure, shown.scene, width=PAGE)
            # even numbers of pixels, the larger of them ``most``
            sides = figure.get_size_inches()
            figure.dpi = most / max(sides)
            pixels = [2.0 * round(0.5 * figure.dpi * side) + 1e-3 for side in sides]
            figure.set_size_inches([number / figure.dpi for number in pixels])
        for artist in [*place.axes.collections, *place.axes.patches]:
            artist.remove()
        discs = draw_values(place.axes, shown, stage.scale[0], has_streamlines=False)
        if is_first:
            draw_bar(place.bar, shown, discs, stage.scale[1])
        name_frame(place.axes, shown.time, shown.frame)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())


def _write(pictures: Iterator[Any], target: Path, rate: float) -> None:
    handle, name = tempfile.mkstemp(
        prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent
    )
    os.close(handle)
    temporary = Path(name)
    mask = os.umask(0)
    os.umask(mask)
    temporary.chmod(0o666 & ~mask)
    try:
        (_write_mp4 if target.suffix.lower() == ".mp4" else _write_gif)(pictures, temporary, rate)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _write_mp4(pictures: Iterator[Any], path: Path, rate: float) -> None:
    first = next(pictures)
    height, width = first.shape[:2]
    raw = f"-f rawvideo -pix_fmt rgba -s {width}x{height} -r {rate:g} -i - -an"
    coding = f"{raw} -c:v libx264 -crf 18 -pix_fmt yuv420p -movflags +faststart"
    command = ["ffmpeg", "-y", "-loglevel", "error", *coding.split(), str(path)]
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors
        )
        assert process.stdin is not None
        try:
            process.stdin.write(first.tobytes())
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # ffmpeg has given up; its message says why
        except BaseException:
            process.kill()
            raise
        finally:
            code = process.wait()
        if code:
            errors.seek(0)
            said = errors.read().decode("utf-8", "replace").strip().splitlines()
            raise PlotError(
                f"ffmpeg failed: {said[-1] if said else f'exit code {code}'}; a .gif needs no "
                "ffmpeg"
            )


def _write_gif(pictures: Iterator[Any], path: Path, rate: float) -> None:
    from PIL import Image  # matplotlib brings it

    images = (Image.fromarray(picture).convert("RGB").quantize(256) for picture in pictures)
    # GIF counts in 1/100 s; most viewers slow down what is faster than 50 per second.
    next(images).save(
        path, save_all=True, append_images=images, duration=max(round(1000.0 / rate), 20), loop=0
    )

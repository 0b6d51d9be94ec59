"""Runs and frames in a notebook: a map of their grains, where matplotlib is installed."""

from __future__ import annotations

import io
from importlib.util import find_spec
from typing import Any

import numpy as np

from multicor_cli.plots.grain_map import draw_map, place_scene
from multicor_cli.plots.style import house_style
from multicor_cli.post.grain_map import grain_map

_DPI = 150  # of a notebook


def picture(shown: Any) -> bytes | None:
    """A map of the last frame of a run, or of a frame, as PNG; None where there is nothing to draw or to draw with.

    Temperatures where there is heat, else speeds.

    Args:
        shown: `Run` or `Frame`.
    """
    run: Any = shown if hasattr(shown, "frames") else _Single(shown)
    if not len(run.frames.time) or not len(run.frames[-1].position) or find_spec("matplotlib") is None:
        return None
    table = grain_map(run, "temperature" if run.frames[-1].has_heat else "speed")
    with house_style():
        from matplotlib.figure import Figure

        figure, buffer = Figure(), io.BytesIO()
        draw_map(place_scene(figure, table.scene), table)
        figure.savefig(buffer, dpi=_DPI, format="png", bbox_inches="tight", pad_inches=0.05)
    return buffer.getvalue()


class _Single:
    """A frame as a run of one frame."""

    def __init__(self, frame: Any) -> None:
        self.model, self.frames = frame.model, self
        self.time, self.stage, self._frame = np.array([frame.time]), np.array([frame.stage]), frame

    def __getitem__(self, index: int) -> Any:
        return self._frame

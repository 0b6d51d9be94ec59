"""Runs and frames in a notebook: a map of their grains, where matplotlib is installed."""

from __future__ import annotations

import contextlib
import io
from typing import Any

import numpy as np


def picture(shown: Any) -> bytes | None:
    """A map of the last frame of a run, or of a frame, as PNG; None where there is nothing to draw or to draw with.

    Temperatures where there is heat, else speeds.

    Args:
        shown: `Run` or `Frame`.
    """
    with contextlib.suppress(ImportError):
        from matplotlib.figure import Figure

        from multicor_cli.plots.grain_map import draw_map
        from multicor_cli.plots.scene import place_scene
        from multicor_cli.post import grain_map

        run: Any = shown if hasattr(shown, "frames") else _Single(shown)
        if not len(run.frames.time):
            return None
        table = grain_map(run, "temperature" if run.frames[-1].has_heat else "speed")
        figure, buffer = Figure(), io.BytesIO()
        draw_map(place_scene(figure, table.scene), table)
        figure.savefig(buffer, dpi=100, format="png")
        return buffer.getvalue()
    return None


class _Single:
    """A frame as a run of one frame."""

    def __init__(self, frame: Any) -> None:
        self.model, self.frames = frame.model, self
        self.time, self.stage, self._frame = np.array([frame.time]), np.array([frame.stage]), frame

    def __getitem__(self, index: int) -> Any:
        return self._frame

"""Grains in a terminal: what matplotlib draws, as cells of two colors, or as letters where there are no colors."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.plots.style import house_style
from multicor_cli.post.scene import GrainScene

_DPI = 72.0  # a pixel is a point: lines are at least a pixel wide
_RAMP = " .:-=+*#%@"  # from white to black


@dataclass(frozen=True)
class Terminal:
    """What a terminal can show.

    Attributes:
        columns: Letters in a line.
        rows: Lines.
        colors: Its color system as rich names it ("truecolor", "256", "standard"); None without colors.
    """

    columns: int = 80
    rows: int = 40
    colors: str | None = None


def draw_picture(scene: GrainScene, draw: Callable[[Any], Any], terminal: Terminal) -> str:
    """A scene as lines of text that fit into a terminal; a letter is two pixels high and one wide.

    Args:
        scene: The grains and walls; its box is what is shown.
        draw: Draws them into axes of matplotlib.
        terminal: What the terminal can show.

    Raises:
        MissingLibrary: If matplotlib is not installed.
    """
    across, upwards = (scene.box[1] - scene.box[0]).tolist()
    most = min(terminal.columns, 2.0 * terminal.rows * across / upwards)
    width, lines = max(int(most), 4), max(round(0.5 * most * upwards / across), 2)
    pixels = _render(draw, width, 2 * lines)
    return _in_letters(pixels) if terminal.colors is None else _in_colors(pixels, terminal.colors)


def _render(draw: Callable[[Any], Any], width: int, height: int) -> NDArray[np.uint8]:
    """What ``draw`` draws as pixels, shape ``(height, width, 3)``."""
    with house_style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
        canvas: Any = FigureCanvasAgg(figure)
        axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        draw(axes)
        axes.set_axis_off()
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[:, :, :3]


def _in_letters(pixels: NDArray[np.uint8]) -> str:
    """Darkness as letters."""
    light = pixels.reshape(len(pixels) // 2, 2, -1, 3).mean(axis=(1, 3)) / 255.0
    rank = np.rint((1.0 - light) * (len(_RAMP) - 1)).astype(int)
    return "\n".join("".join(_RAMP[k] for k in row).rstrip() for row in rank)


def _in_colors(pixels: NDArray[np.uint8], colors: str) -> str:
    """Half blocks: the upper pixel is the color of the letter, the lower one that of its background."""
    from rich.color import Color
    from rich.console import Console
    from rich.segment import Segment, Segments
    from rich.style import Style

    lines: list[Segment] = []
    for upper, lower in zip(pixels[::2].tolist(), pixels[1::2].tolist(), strict=True):
        cells = zip(upper, lower, strict=True)
        lines += [Segment("▀", Style(color=Color.from_rgb(*a), bgcolor=Color.from_rgb(*b))) for a, b in cells]
        lines.append(Segment.line())
    text = io.StringIO()
    console: Any = Console  # its types know color systems only as literals
    console(file=text, force_terminal=True, color_system=colors, width=pixels.shape[1] + 1).print(Segments(lines), end="")
    return text.getvalue().rstrip("\n")

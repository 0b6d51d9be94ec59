"""Tables drawn into figures of matplotlib that nobody sees."""

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

from multicor_cli.plots.grain_map import draw_map, place_scene
from multicor_cli.plots.style import house_style


def figure_of(draw: Callable[..., Any], table: Any) -> Any:
    """The figure that is drawn into a figure."""
    with house_style():
        figure = Figure(layout="constrained")
        draw(figure, table)
    return figure


def panel_of(draw: Callable[..., Any], table: Any) -> Any:
    """The axes into which a table is drawn."""
    return figure_of(lambda figure, table: draw(figure.add_subplot(), table), table).axes[0]


def map_of(table: Any, **options: Any) -> Any:
    """The axes of a map; its color bar is the second axes of the figure."""
    with house_style():
        place = place_scene(Figure(layout="constrained"), table.scene)
        draw_map(place, table, **options)
    return place.axes

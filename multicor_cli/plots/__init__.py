"""Figures of the tables that `post` makes, `plot` and `show` draw any of them."""

from multicor_cli.plots.style import PlotError as PlotError
from multicor_cli.plots.style import Terminal as Terminal
from multicor_cli.plots.style import plot as plot
from multicor_cli.plots.style import show as show

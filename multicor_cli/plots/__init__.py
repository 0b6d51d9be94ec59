"""Figures of the tables that `post` makes."""

from multicor_cli.plots.profile import draw_profile, plot_profile
from multicor_cli.plots.style import PlotError

__all__ = ["PlotError", "draw_profile", "plot_profile"]

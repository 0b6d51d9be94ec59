"""Figures of the tables that `post` makes."""

from multicor_cli.plots.forces import draw_forces, plot_forces
from multicor_cli.plots.grain_map import draw_map, plot_map
from multicor_cli.plots.profile import draw_profile, plot_profile
from multicor_cli.plots.style import PlotError
from multicor_cli.plots.theta_eta import draw_theta_eta, plot_theta_eta

__all__ = [
    "PlotError",
    "draw_forces",
    "draw_map",
    "draw_profile",
    "draw_theta_eta",
    "plot_forces",
    "plot_map",
    "plot_profile",
    "plot_theta_eta",
]

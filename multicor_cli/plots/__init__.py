"""Figures of the tables that `post` makes, `plot` and `show` draw any of them."""

from multicor_cli.plots.forces import draw_angles, draw_distribution, draw_forces
from multicor_cli.plots.grain_map import Place, draw_map, place_scene
from multicor_cli.plots.over_time import draw_energy, draw_region, draw_rheology
from multicor_cli.plots.profile import draw_comparison, draw_profile, draw_theta_eta
from multicor_cli.plots.style import PlotError, Terminal, plot, show

__all__ = [
    "Place",
    "PlotError",
    "Terminal",
    "draw_angles",
    "draw_comparison",
    "draw_distribution",
    "draw_energy",
    "draw_forces",
    "draw_map",
    "draw_profile",
    "draw_region",
    "draw_rheology",
    "draw_theta_eta",
    "place_scene",
    "plot",
    "show",
]

"""Figures of the tables that `post` makes, each in a module of the same name; `plot` and `show` draw any of them."""

from multicor_cli.plots.compare import draw_comparison
from multicor_cli.plots.energy import draw_energy
from multicor_cli.plots.forces import draw_angles, draw_distribution, draw_forces
from multicor_cli.plots.grain_map import Place, draw_map, place_scene
from multicor_cli.plots.profile import draw_profile
from multicor_cli.plots.region import draw_region
from multicor_cli.plots.rheology import draw_rheology
from multicor_cli.plots.style import PlotError, Terminal, plot, show
from multicor_cli.plots.theta_eta import draw_theta_eta

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

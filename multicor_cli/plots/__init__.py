"""Figures of the tables that `post` makes, `plot` and `show` draw any of them."""

from multicor_cli.plots.forces import draw_angles as draw_angles
from multicor_cli.plots.forces import draw_distribution as draw_distribution
from multicor_cli.plots.forces import draw_forces as draw_forces
from multicor_cli.plots.grain_map import Place as Place
from multicor_cli.plots.grain_map import draw_map as draw_map
from multicor_cli.plots.grain_map import place_scene as place_scene
from multicor_cli.plots.over_time import draw_energy as draw_energy
from multicor_cli.plots.over_time import draw_region as draw_region
from multicor_cli.plots.over_time import draw_rheology as draw_rheology
from multicor_cli.plots.profile import draw_comparison as draw_comparison
from multicor_cli.plots.profile import draw_profile as draw_profile
from multicor_cli.plots.profile import draw_theta_eta as draw_theta_eta
from multicor_cli.plots.style import PlotError as PlotError
from multicor_cli.plots.style import Terminal as Terminal
from multicor_cli.plots.style import plot as plot
from multicor_cli.plots.style import show as show

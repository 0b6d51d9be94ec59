"""Commands ``post …``: tables and figures from a run."""

from __future__ import annotations

from typing import Any

import typer

from multicor_cli.cli.animate_command import animate
from multicor_cli.cli.post_contact_commands import forces, rheology
from multicor_cli.cli.post_grain_commands import map_grains, profile, theta_eta
from multicor_cli.cli.post_run_commands import compare, energy

post = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

COMMANDS = {
    "profile": profile,
    "theta-eta": theta_eta,
    "map": map_grains,
    "forces": forces,
    "rheology": rheology,
    "energy": energy,
    "compare": compare,
    "animate": animate,
}
"""Commands by name."""


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    for name, command in COMMANDS.items():
        post.command(name)(wrap(command))
    app.add_typer(post, name="post")

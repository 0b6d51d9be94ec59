"""Commands ``post …``: tables and figures from a run."""

from __future__ import annotations

from typing import Any

import typer

from multicor_cli.cli import (
    animate_command,
    post_contact_commands,
    post_fields_command,
    post_grain_commands,
    post_region_command,
    post_run_commands,
    post_series_command,
)
from multicor_cli.cli.listing import ListingCommand

post = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

COMMANDS = {
    **post_grain_commands.COMMANDS,
    **post_contact_commands.COMMANDS,
    **post_region_command.COMMANDS,
    **post_fields_command.COMMANDS,
    **post_run_commands.COMMANDS,
    **post_series_command.COMMANDS,
    **animate_command.COMMANDS,
}
"""Commands by name."""


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    for name, command in COMMANDS.items():
        post.command(name, cls=ListingCommand)(wrap(command))
    app.add_typer(post, name="post")

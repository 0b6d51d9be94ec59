"""Commands ``post …``: tables and figures from a run."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

from multicor_cli.cli import animate_command, post_contact_commands, post_grain_commands, post_run_commands

post = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

COMMANDS = {
    **post_grain_commands.COMMANDS,
    **post_contact_commands.COMMANDS,
    **post_run_commands.COMMANDS,
    **animate_command.COMMANDS,
}
"""Commands by name."""


class _Command(TyperCommand):
    """A command whose help names the quantities that there are: asked for only then, since they take numpy to load."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        for parameter in self.params:
            text = getattr(parameter, "help", None) or ""
            if "{" in text:
                parameter.help = _named(text)  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)


def _named(text: str) -> str:
    """A help text with the names of the quantities."""
    from multicor_cli.post import MAPPED, PROFILE_GROUPS, PROFILED

    return text.format(profiled=", ".join(PROFILED), groups=", ".join(PROFILE_GROUPS), mapped=", ".join(MAPPED))


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    for name, command in COMMANDS.items():
        post.command(name, cls=_Command)(wrap(command))
    app.add_typer(post, name="post")

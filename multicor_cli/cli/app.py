"""The command ``multicor``; ``--help`` is quick, since only commands import what is heavy."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from typer.core import TyperGroup

from multicor_cli import __version__
from multicor_cli.cli import (
    bench_command,
    post_commands,
    reading_commands,
    scenario_commands,
    study_commands,
)
from multicor_cli.cli.guard import USAGE_ERROR, guarded
from multicor_cli.cli.options import ListingCommand
from multicor_cli.text import brief, printable, unwrapped


class _Commands(TyperGroup):
    """All commands. Messages about a command line quote what was typed, shortened."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        with _brief_usage_errors():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        with _brief_usage_errors():
            return super().invoke(ctx)


@contextlib.contextmanager
def _brief_usage_errors() -> Iterator[None]:
    try:
        yield
    except USAGE_ERROR as error:
        error.message = brief(printable(error.message).replace("\n", "\\n"))
        raise


app = typer.Typer(
    cls=_Commands,
    name="multicor",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Thermomechanics of two-dimensional granular flows, driven by TOML files.",
    epilog=(
        "Results go to stdout, everything else to stderr. A run can be stopped at any time; the "
        "same command continues it."
    ),
)


def _show_version(is_wanted: bool) -> None:
    if is_wanted:
        print(f"multicor {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Options before a command."""


def _add(commands: Mapping[str, Any], to: typer.Typer) -> None:
    """Add commands: what fails is a message, and help is as wide as the terminal."""
    for name, function in commands.items():
        command = guarded(function)
        command.__doc__ = unwrapped(function.__doc__ or "")
        to.command(name, cls=ListingCommand)(command)


_add(scenario_commands.COMMANDS | reading_commands.COMMANDS | {"bench": bench_command.bench}, app)
for name, group, commands in (
    ("study", study_commands.group, study_commands.COMMANDS),
    ("post", post_commands.group, post_commands.COMMANDS),
    ("export", reading_commands.export, reading_commands.EXPORTS),
):
    _add(commands, group)
    app.add_typer(group, name=name)


def main() -> None:
    """Entry point of the command ``multicor``."""
    # None if they were closed
    sys.stdout, sys.stderr = sys.stdout or _nowhere(), sys.stderr or _nowhere()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without UTF-8 must not end a run
    guarded(app)(prog_name="multicor")


def _nowhere() -> TextIO:
    return Path(os.devnull).open("w")

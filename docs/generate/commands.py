"""The pages about the commands, from what Typer knows of them."""

from __future__ import annotations

from enum import Enum
from typing import Any, get_args

import typer.main

from multicor_cli.cli.app import app
from multicor_cli.cli.options import filled
from multicor_cli.running.outcome import ExitCode

FOLDER = "reference/commands"


def command_pages() -> dict[str, str]:
    """The pages, as Markdown by their paths in the documentation: one for a command or a group of
    commands.
    """
    root = typer.main.get_command(app)
    commands: dict[str, Any] = root.commands  # type: ignore[attr-defined]
    rows = [
        f"| [`multicor {name}`]({name}.md) | {_short(command)} |"
        for name, command in commands.items()
    ]
    about = (
        "Results go to stdout, everything else to stderr. `multicor COMMAND --help` says what "
        "stands here."
    )
    codes = [f"| {int(code)} | {code.meaning} |" for code in ExitCode]
    head = ["# Commands", "", about, "", "| command | what it does |", "|---|---|", *rows, ""]
    index = [*head, "## Exit codes", "", "| code | meaning |", "|---|---|", *codes, ""]
    pages = {f"{FOLDER}/index.md": "\n".join(index)}
    for name, command in commands.items():
        pages[f"{FOLDER}/{name}.md"] = _page(name, command)
    return pages


def _page(name: str, command: Any) -> str:
    lines = [f"# multicor {name}", ""]
    inner = getattr(command, "commands", None)
    if inner is None:
        return "\n".join(lines + _described(f"multicor {name}", command))
    lines += [_prose(command.help), ""]
    for sub, inner_command in inner.items():
        lines += [f"## {sub}", "", *_described(f"multicor {name} {sub}", inner_command)]
    return "\n".join(lines)


def _described(path: str, command: Any) -> list[str]:
    arguments = [param for param in command.params if param.param_type_name == "argument"]
    options = [
        param
        for param in command.params
        if param.param_type_name == "option" and param.name != "help" and not param.hidden
    ]
    usage = " ".join(
        [path, *(_usage(param) for param in arguments), "[OPTIONS]" if options else ""]
    ).strip()
    lines = [_prose(command.help), "", "```sh", usage, "```", ""]
    if arguments:
        lines += [
            "| argument | |",
            "|---|---|",
            *(f"| `{_usage(param)}` | {_cell(filled(param.help or ''))} |" for param in arguments),
            "",
        ]
    if options:
        lines += ["| option | | default |", "|---|---|---|", *map(_option, options), ""]
    return [*lines, _prose(command.epilog), ""] if command.epilog else lines


def _usage(param: Any) -> str:
    name = (param.metavar or param.name.upper()) + ("..." if param.nargs == -1 else "")
    return name if param.required else f"[{name}]"


def _option(param: Any) -> str:
    names = ", ".join(f"`{name}`" for name in [*param.opts, *param.secondary_opts])
    value = "" if param.is_flag else f" `{param.metavar or _kind(param)}`"
    default = param.show_default if isinstance(param.show_default, str) else param.default
    is_shown = not callable(default) and default not in (None, (), [], "", False)
    return (
        f"| {names}{value.replace('|', '&#124;')} | {_cell(filled(param.help or ''))} | "
        f"{f'`{default}`' if is_shown else ''} |"
    )


def _kind(param: Any) -> str:
    """What an option takes: its choices, or the name of its type."""
    annotation = param.type_descriptor.annotation
    choices = (
        [member.value for member in annotation]
        if isinstance(annotation, type(Enum))
        else get_args(annotation)
    )
    return (
        "|".join(map(str, choices))
        if choices and not isinstance(choices[0], type)
        else annotation.__name__.upper()
    )


def _short(command: Any) -> str:
    return _cell(command.get_short_help_str(limit=200))


def _cell(text: str | None) -> str:
    return (
        " ".join((text or "").split())
        .replace("|", "\\|")
        .replace("<", "\\<")
        .replace("*", "\\*")
        .replace("[", "\\[")
    )


def _prose(text: str | None) -> str:
    return (text or "").replace("*", "\\*").replace("<", "\\<")

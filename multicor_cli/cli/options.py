"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Optional

import typer


def output_option(*, metavar: str, help: str, show_default: str | bool = False) -> Any:  # noqa: A002  (Typer's name)
    """The option ``-o``, which names what is written."""
    remedy = "write . for the current directory" if metavar.startswith("DIR") else "give one"

    def named_path(text: str) -> Path:
        """A path as it was given; an empty one, as of a variable of the shell that is not set, would mean the current directory."""
        if not text.strip():
            raise typer.BadParameter(f"the name is empty; {remedy}")
        return Path(text)

    return typer.Option("--output", "-o", parser=named_path, metavar=metavar, help=help, show_default=show_default)


ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="Scenario file.", show_default=False)]

RunPath = Annotated[Path, typer.Argument(metavar="DIR", help="Run directory, or a results.h5 on its own.", show_default=False)]

Overrides = Annotated[
    Optional[list[str]],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the scenario, as loading.1.duration=2.0 (indices from 0); may be given several times.",
        show_default=False,
    ),
]

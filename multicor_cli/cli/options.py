"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

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

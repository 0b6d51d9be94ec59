"""Going on from another run: where the grains of a scenario are at its start, and what groups they belong to."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from multicor_cli.files import read_regular
from multicor_cli.scenario.base import Table, refuse
from multicor_cli.scenario.packings import FilePath

RECORD = "scenario.resolved.toml"
"""The scenario of a run in its directory, with all defaults (docs/reference/formats/run-directory.md)."""

KIND = "start"
"""Kind of packing of the groups whose grains come from the run of ``[start]``."""

LARGEST_RECORD = 64 << 20
"""Longer records are not read [bytes]: no scenario that was accepted is nearly as long when it is resolved."""

_KEPT = ("name", "material", "shape", "thickness", "sizes")
"""What a group is; the other keys said how its grains were placed."""


class Start(Table):
    """``[start]``: the run from which this one goes on."""

    run: FilePath = Field(description="directory of the run to go on from, relative to the scenario file")
    at: Literal["end"] | None = Field(
        None, description='"end" (default): where the run stands, its last checkpoint, exactly; or give frame'
    )
    frame: int | None = Field(
        None, ge=-(10**9), le=10**9, description="index of a frame of the run to go on from; -1 is the last one"
    )

    @model_validator(mode="after")
    def _one_moment(self) -> Self:
        if self.at is not None and self.frame is not None:
            raise refuse('both at = "end" and frame are given', "give one of them", "frame")
        return self


def take_groups(document: dict[str, Any], directory: Path) -> bool:
    """Give a document with ``[start]`` and without ``[[particles]]`` the groups of the run that it names.

    What is wrong with the run is not said here but where its grains are read: a run that goes on needs neither any more. Until
    then a document whose run cannot be read has no groups.

    Args:
        document: The parsed document. **Modified.**
        directory: That of its file.

    Returns:
        Whether the groups come from the run.
    """
    start = document.get("start")
    if not isinstance(start, dict) or "particles" in document:
        return False
    path = start.get("run")
    document["particles"] = _groups_of(directory / path) if isinstance(path, str) else []
    return True


def _groups_of(run: Path) -> list[dict[str, Any]]:
    try:
        groups = tomllib.loads(read_regular(run / RECORD, LARGEST_RECORD).decode())["particles"]
        return [{key: group[key] for key in _KEPT if key in group} | {"packing": {"kind": KIND}} for group in groups]
    except (OSError, ValueError, RecursionError, LookupError, TypeError):
        return []

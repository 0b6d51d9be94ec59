"""The scenario that a steered run has carried out: the one that it began with, and the stages that a program has ended and added.

It is a scenario like any other. Run without the program it gives the same bits.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from pydantic import Field, Strict, StrictBool

Count = Annotated[int, Strict(), Field(ge=0, lt=2**63)]
"""A number of something in a document, or of one among several."""


@dataclass(frozen=True)
class Decision:
    """A program has ended a stage.

    Attributes:
        stage: Index of the stage, those counted that were added before.
        step: Steps done since the start of the run.
        stage_steps: Steps done in the stage.
        dt: Time step of the stage [s].
        then: The stage added behind it, as a table of ``[[loading]]``; None if the next one of the scenario follows.
        ends_run: Whether no stage follows at all.
    """

    stage: Count
    step: Count
    stage_steps: Count
    dt: Annotated[float, Strict()]
    then: dict[str, Any] | None = None
    ends_run: StrictBool = False

    def as_document(self) -> dict[str, Any]:
        """As JSON types."""
        return asdict(self)


def steered_document(document: dict[str, Any], decisions: Sequence[Decision]) -> dict[str, Any]:
    """The document of a scenario with its stages as they were carried out; the steps of ended stages are their durations."""
    loading: list[dict[str, Any]] = list(document["loading"])
    for decision in decisions:
        ended = {**loading[decision.stage], "duration": decision.stage_steps * decision.dt, "dt": decision.dt}
        ended.pop("on_timeout", None)
        if "strain" not in (
            ended.get("until") or {}
        ):  # a strain is recorded while it is waited for; else a condition leaves no trace
            ended.pop("until", None)
        then = [] if decision.then is None else [decision.then]
        rest = [] if decision.ends_run else loading[decision.stage + 1 :]
        loading = [*loading[: decision.stage], ended, *then, *rest]
    return {**document, "loading": loading}


def steered_text(resolved: str, decisions: Sequence[Decision]) -> str:
    """As `steered_document`, of the TOML of a scenario to TOML."""
    if not decisions:
        return resolved
    import tomli_w

    return tomli_w.dumps(steered_document(tomllib.loads(resolved), decisions))

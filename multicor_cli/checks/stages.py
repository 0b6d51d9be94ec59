"""Whether the stages of a run ended as they were meant to."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.recorded import Recorded
from multicor_cli.store.stage_ends import StageEnd


def _timed_out(run: Recorded) -> Iterator[Measured]:
    ends = [StageEnd.of_document(document) for document in run.info["stage_ends"]]
    late = [f"{end.name}: {end.why}" for end in ends if end.has_timed_out]
    if ends:
        yield Measured(len(late), "; ".join(late))


RULES: tuple[Rule[Recorded], ...] = (
    Rule(
        "stages timed out", _timed_out, warning=0.0,
        meaning="Stages whose duration was over before the condition of their until held: what they waited for did not happen.",
        remedy='Give them a longer duration or another goal; with on_timeout = "stop" the run ends there.',
    ),
)  # fmt: skip
"""What is checked of the stages that are over."""

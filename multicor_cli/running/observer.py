"""What a run tells about itself while it runs. The command line shows it; the Python interface ignores it unless asked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from multicor_cli.engine.contact.step_report import StepReport
from multicor_cli.model import State


@dataclass(frozen=True)
class Status:
    """Where a run is after a step.

    Attributes:
        state: The state; not to be kept or changed.
        stage: Name of the loading stage of the step.
        stage_count: Number of stages.
        report: What the contact solver did.
        progress: Share of the run that is done, 0 to 1.
        speed: Recent speed, compilation left out [steps/s]; None at the beginning.
        remaining: Estimated seconds left; None at the beginning.
    """

    state: State
    stage: str
    stage_count: int
    report: StepReport
    progress: float
    speed: float | None
    remaining: float | None


class Observer(Protocol):
    """Listens to a run; it sees everything and changes nothing, so that results are the same with it and without."""

    def message(self, text: str) -> None:
        """Something happened that a person may want to know."""

    def warning(self, text: str) -> None:
        """Something happened that a person should know."""

    def stepped(self, status: Status) -> None:
        """A step was done. Called for every step: return at once if there is nothing to show."""

    def closed(self) -> None:
        """No more steps follow; called however the run ends."""


class SilentObserver:
    """Shows nothing."""

    def message(self, text: str) -> None:
        """Ignore it."""

    def warning(self, text: str) -> None:
        """Ignore it."""

    def stepped(self, status: Status) -> None:
        """Ignore it."""

    def closed(self) -> None:
        """Ignore it."""

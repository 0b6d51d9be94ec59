"""From which moment a run goes on, and why and when its stages ended: what ``run.json`` and ``results.h5`` keep of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal

# ---- From which moment of which run a run goes on: what `run.json` and `results.h5` keep of it


@dataclass(frozen=True)
class Origin:
    """A moment of another run.

    Attributes:
        run: Directory of the run.
        run_id: Identity of the run.
        frame: Index of the frame, from 0; None: its last checkpoint.
        step: Steps that it had done.
        time: Time since its start [s].
        digest: Digest of what was taken: that of the state of a checkpoint (`multicor_cli.model.State.digest`), or of the frame.
        walls: Walls that have their place and velocity from it.
        new_walls: Walls that it does not have: they are where the scenario puts them.
        lost_walls: Walls of it that the scenario does not have: they are gone.
    """

    run: str
    run_id: str
    frame: int | None
    step: int
    time: float
    digest: str
    walls: tuple[str, ...] = ()
    new_walls: tuple[str, ...] = ()
    lost_walls: tuple[str, ...] = ()

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> Origin:
        """The origin that a document tells of; `is_origin` says whether it does."""
        values: dict[str, Any] = {field.name: document[field.name] for field in fields(cls)}
        return cls(**values | {name: tuple(values[name]) for name in ("walls", "new_walls", "lost_walls")})

    def as_document(self) -> dict[str, Any]:
        """As JSON types."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}

    @property
    def text(self) -> str:
        """From where, in words."""
        moment = "its end" if self.frame is None else f"frame {self.frame}"
        return f"{self.run}, {moment}: step {self.step}, t = {self.time:.6g} s, digest {self.digest}"

    @property
    def wall_texts(self) -> list[str]:
        """What happens to walls that only one of the two runs has, in words."""
        new = [f"new, not in that run: {', '.join(self.new_walls)}"] if self.new_walls else []
        lost = [f"gone, not in this scenario: {', '.join(self.lost_walls)}"] if self.lost_walls else []
        return new + lost


def is_origin(document: Any) -> bool:
    """Whether a value read from a file is an `Origin.as_document`."""
    return isinstance(document, dict) and all(is_right(document.get(name)) for name, is_right in _RIGHT_ORIGIN.items())


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


_RIGHT_ORIGIN: dict[str, Callable[[Any], bool]] = {
    "run": _is_text,
    "run_id": _is_text,
    "frame": lambda value: value is None or _is_count(value),
    "step": _is_count,
    "time": lambda value: isinstance(value, float) or _is_count(value),
    "digest": _is_text,
    "walls": _are_names,
    "new_walls": _are_names,
    "lost_walls": _are_names,
}


# ---- Why and when each loading stage of a run ended, and how people are told

Reason = Literal["duration", "condition", "timeout", "steered"]
REASONS: tuple[Reason, ...] = ("duration", "condition", "timeout", "steered")


@dataclass(frozen=True)
class StageEnd:
    """The end of a loading stage.

    Attributes:
        stage: Index of the stage.
        name: Name of the stage.
        reason: ``duration``: it lasted as long as it was to; ``condition``: its condition held; ``timeout``: its duration was over
            before its condition held; ``steered``: the program that steers the run has ended it.
        step: Steps done since the start of the run.
        time: Time since the start of the run [s].
        duration: Time since the start of the stage [s].
        quantity: What its condition looks at, in words, and why it has no value if it has none; empty without condition.
        value: Value of this quantity at the end; None if there is none.
        relation: How the value had to be: ``at least`` or ``at most``; empty without condition.
        goal: Value asked for; None without condition.
        unit: SI unit of value and goal; ``1`` if dimensionless.
    """

    stage: int
    name: str
    reason: Reason
    step: int
    time: float
    duration: float
    quantity: str = ""
    value: float | None = None
    relation: str = ""
    goal: float | None = None
    unit: str = "1"

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> StageEnd:
        """The end that a document tells of; `is_stage_end` says whether it does."""
        return cls(**{field.name: document[field.name] for field in fields(cls)})

    def as_document(self) -> dict[str, Any]:
        """As JSON types."""
        return asdict(self)

    @property
    def has_timed_out(self) -> bool:
        """Whether the stage waited for its condition in vain."""
        return self.reason == "timeout"

    @property
    def text(self) -> str:
        """When and why it ended, in words."""
        return f"t = {self.time:.6g} s, step {self.step}: {self.why}"

    @property
    def why(self) -> str:
        """Why it ended, in words."""
        if self.reason == "duration":
            return f"its duration of {self.duration:.6g} s was over"
        if self.reason == "steered":
            return f"ended by the program that steers the run, after {self.duration:.6g} s"
        reached = f"{self._reached}, {self._goal}"
        return reached if self.reason == "condition" else f"timed out after {self.duration:.6g} s; {reached}"

    @property
    def _reached(self) -> str:
        return f"{self.quantity} never had a value" if self.value is None else f"{self.quantity} was {self._number(self.value)}"

    @property
    def _goal(self) -> str:
        return f"asked for was {self.relation} {self._number(self.goal if self.goal is not None else math.nan)}"

    def _number(self, value: float) -> str:
        return f"{value:.5g}" + (f" {self.unit}" if self.unit != "1" else "")


def is_stage_end(document: Any) -> bool:
    """Whether a value read from a file is a `StageEnd.as_document`."""
    return isinstance(document, dict) and all(is_right(document.get(name)) for name, is_right in _RIGHT_END.items())


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or _is_count(value)


_RIGHT_END: dict[str, Callable[[Any], bool]] = {
    "stage": _is_count,
    "name": _is_text,
    "reason": lambda value: value in REASONS,
    "step": _is_count,
    "time": _is_number,
    "duration": _is_number,
    "quantity": _is_text,
    "value": lambda value: value is None or _is_number(value),
    "relation": _is_text,
    "goal": lambda value: value is None or _is_number(value),
    "unit": _is_text,
}

"""From which moment of which run a run goes on: what ``run.json`` and ``results.h5`` keep of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any


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
    return isinstance(document, dict) and all(is_right(document.get(name)) for name, is_right in _RIGHT.items())


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


_RIGHT: dict[str, Callable[[Any], bool]] = {
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

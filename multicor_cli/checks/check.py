"""What a check is: a number, its limits, and what follows if it is beyond them.

A `Rule` is one kind of check, with everything about it in one place: how its number is found, its
limits, what it means, what to do. Judging a subject by it gives a `Check`. The page
docs/reference/checks.md is made of the rules.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, Generic, NamedTuple, TypeVar

S = TypeVar("S")


class Verdict(Enum):
    """How a check came out."""

    OK = "ok"
    WARNING = "warning"  # to be known, and often meant
    BAD = "bad"  # results are not to be relied on, or the run will not get through


_ORDER = list(Verdict)
_LONGEST = 110  # letters of what a number belongs to: names may be of any length


class Measured(NamedTuple):
    """A number to be judged, and what it belongs to: a stage, a material, a wall."""

    value: float
    about: str = ""


@dataclass(frozen=True)
class Check:
    """The outcome of one check.

    Attributes:
        name: What is checked.
        value: The number; of several (stages, materials) the one farthest beyond its limits.
        text: The number for people, with its unit and what it belongs to.
        limit: Its limits, in words.
        verdict: How it came out.
        meaning: What the number says.
        remedy: What to do if it is beyond its limits.
    """

    name: str
    value: float
    text: str
    limit: str
    verdict: Verdict
    meaning: str
    remedy: str

    def as_dict(self) -> dict[str, Any]:
        """As JSON types."""
        return {**asdict(self), "verdict": self.verdict.value}


@dataclass(frozen=True)
class Rule(Generic[S]):
    """One kind of check.

    Attributes:
        name: What is checked.
        measure: Finds the numbers in a subject; none if the check does not apply to it.
        meaning: What the number says.
        remedy: What to do if it is beyond its limits.
        unit: What stands behind the number.
        warning: Largest value without a warning.
        bad: Largest value that is not bad; None: no value is.
        least: Smallest value without a warning; None: there is no such limit.
    """

    name: str
    measure: Callable[[S], Iterable[Measured]]
    meaning: str
    remedy: str
    unit: str = ""
    warning: float = math.inf
    bad: float | None = None
    least: float | None = None

    @property
    def limit(self) -> str:
        """The limits in words."""
        if self.least is not None:
            has_top = self.warning < math.inf
            return f"{self.least:g} to {self.warning:g}" if has_top else f"at least {self.least:g}"
        if self.bad == self.warning:
            return f"bad above {self.bad:g}"
        normal = "none" if self.warning == 0.0 else f"at most {self.warning:g}"
        return normal if self.bad is None else f"{normal}, bad above {self.bad:g}"

    def judge(self, subject: S) -> Check | None:
        """The check of a subject; None if it does not apply."""
        found = list(self.measure(subject))
        if not found:
            return None
        value, about = max(
            found, key=lambda it: (_ORDER.index(self._verdict(it.value)), self._excess(it.value))
        )
        text = f"{value:.3g} {self.unit}".strip()
        if about:
            text += f" ({about if len(about) <= _LONGEST else about[: _LONGEST - 1] + '…'})"
        verdict = self._verdict(value)
        return Check(self.name, value, text, self.limit, verdict, self.meaning, self.remedy)

    def _verdict(self, value: float) -> Verdict:
        # What is not a number is beyond every limit.
        if self.bad is not None and not value <= self.bad:
            return Verdict.BAD
        is_normal = value <= self.warning and (self.least is None or value >= self.least)
        return Verdict.OK if is_normal else Verdict.WARNING

    def _excess(self, value: float) -> float:
        """How far a number is towards its limits: the larger, the nearer or the farther beyond."""
        if self.least is None:
            return value
        return max(value / self.warning, self.least / value if value > 0.0 else math.inf)


def judge_all(rules: Sequence[Rule[S]], subject: S) -> list[Check]:
    """The checks of a subject, in the order of the rules; those that do not apply are left out."""
    return [check for rule in rules if (check := rule.judge(subject)) is not None]


def worst_verdict(checks: Iterable[Check]) -> Verdict:
    """The worst verdict of some checks; ok if there are none."""
    return max((check.verdict for check in checks), key=_ORDER.index, default=Verdict.OK)

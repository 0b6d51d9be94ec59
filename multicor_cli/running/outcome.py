"""What a run tells: to an observer while it runs, and how it has ended."""

from __future__ import annotations

import signal
import warnings
from dataclasses import dataclass
from enum import Enum, IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self

if TYPE_CHECKING:
    from multicor_cli.engine.orders import StepReport
    from multicor_cli.model import State
    from multicor_cli.store.documents import StageEnd

# ---- While it runs. The command line shows it; the Python interface warns, no more unless asked


@dataclass(frozen=True)
class Status:
    """Where a run is after a step.

    Attributes:
        state: The state; not to be kept or changed.
        stage: Name of the loading stage of the step; there are ``stage_count`` of them.
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
    """Listens to a run; it sees everything and changes nothing: results are the same without it."""

    def message(self, text: str) -> None:
        """Something happened that a person may want to know."""

    def warning(self, text: str) -> None:
        """Something happened that a person should know."""

    def stepped(self, status: Status) -> None:
        """A step was done. Called for every step: return at once if there is nothing to show."""

    def closed(self) -> None:
        """No more steps follow; called however the run ends."""


class QuietObserver:
    """Gives the warnings of Python, and shows nothing else."""

    def warning(self, text: str) -> None:
        warnings.warn(text, stacklevel=2)

    def _ignore(self, *_: Any, **__: Any) -> None:
        pass

    message = stepped = closed = _ignore


STEERED, OBSERVED = "the program that steers the run", "the observer"
"""Notes on errors (`BaseException.add_note`) that come from what the user has written."""


# ---- How it has ended


class ExitCode(IntEnum):
    """Exit codes of the command line, in ``run.json`` too; errors have theirs as ``exit_code``.

    Attributes:
        meaning: What the documentation says of it.
    """

    meaning: str

    def __new__(cls, value: int, meaning: str = "") -> Self:
        """A code with its meaning; ``ExitCode(3)`` finds the one that there is."""
        code = int.__new__(cls, value)
        code._value_, code.meaning = value, meaning
        return code

    DONE = 0, "done, or already finished"
    BUG = 1, "an internal error; the traceback is in `crash.txt`"
    USAGE = 2, "the command line is wrong"
    SCENARIO = 3, "the scenario is invalid, or not the one that the run began with"
    PHYSICS = (
        4,
        (
            "non-finite state, no admissible positions; by request: solver failed, a stage timed "
            "out, bad check"
        ),
    )
    ENVIRONMENT = (
        5,
        (
            "disk full, no permission, out of memory, missing library, environment variable with "
            "a wrong value"
        ),
    )
    OCCUPIED = 6, "the output exists, or another live run holds it"
    DAMAGED = 7, "data damaged, or made by an incompatible version"
    STOPPED = 75, "time limit reached, resumable (EX_TEMPFAIL: schedulers may requeue)"
    HUNG_UP = 129, "SIGHUP: the terminal was closed, after a checkpoint"
    INTERRUPTED = 130, "Ctrl-C, after a checkpoint"
    TERMINATED = 143, "SIGTERM, after a checkpoint"


def exit_code_of(error: BaseException) -> ExitCode:
    """Exit code for an error: that of its class, or of what the system raises; else a bug."""
    code = getattr(error, "exit_code", None)
    if code is not None:
        return ExitCode(code)
    if isinstance(error, KeyboardInterrupt):
        return ExitCode.INTERRUPTED
    return ExitCode.ENVIRONMENT if isinstance(error, OSError | MemoryError) else ExitCode.BUG


class StageTimeout(Exception):
    """The duration of a stage was over before its condition held, and the run is to stop then.

    The last checkpoint is of this moment. The same command says the same again; with
    ``on_timeout = "go on"`` it goes on from here.
    """

    exit_code = ExitCode.PHYSICS

    def __init__(self, end: StageEnd) -> None:
        super().__init__(end)
        self.end = end

    def __str__(self) -> str:
        end = self.end
        again = (
            f"the same command with --set 'loading.{end.stage}.on_timeout=go on' goes on from here"
        )
        return f"stage {end.name}: {end.text}; {again}"


class StopReason(Enum):
    """Why a run stopped, and with which exit code; the value is what ``run.json`` says."""

    exit_code: ExitCode

    def __new__(cls, value: str, exit_code: ExitCode) -> Self:
        reason = object.__new__(cls)
        reason._value_, reason.exit_code = value, exit_code
        return reason

    FINISHED = "finished", ExitCode.DONE
    ALREADY_FINISHED = "already finished", ExitCode.DONE
    INTERRUPTED = "interrupted (SIGINT)", ExitCode.INTERRUPTED
    TERMINATED = "terminated (SIGTERM)", ExitCode.TERMINATED
    HUNG_UP = "terminal closed (SIGHUP)", ExitCode.HUNG_UP
    TIME_LIMIT = "time limit reached", ExitCode.STOPPED

    @classmethod
    def of_signal(cls, number: int) -> StopReason:
        reasons = {signal.SIGTERM: cls.TERMINATED, signal.SIGHUP: cls.HUNG_UP}
        return reasons.get(signal.Signals(number), cls.INTERRUPTED)

    @property
    def is_end(self) -> bool:
        return self.exit_code is ExitCode.DONE


@dataclass(frozen=True)
class RunOutcome:
    """Result of `multicor_cli.run`.

    Attributes:
        reason: Why it stopped.
        directory: The run directory.
        step: Steps done since the start of the run.
        time: Time since the start of the run [s].
        unconverged_steps: Steps that hit the cap on sweeps.
        stage_ends: How the stages ended that are over.
    """

    reason: StopReason
    directory: Path
    step: int
    time: float
    unconverged_steps: int
    stage_ends: tuple[StageEnd, ...] = ()

    @property
    def is_finished(self) -> bool:
        """Whether the run is complete; otherwise the same call continues it."""
        return self.reason.is_end

    def __str__(self) -> str:
        where = f"step {self.step}, t = {self.time:.6g} s, in {self.directory}"
        rest = "" if self.is_finished else "; the same command continues"
        return f"{self.reason.value}: {where}{rest}"

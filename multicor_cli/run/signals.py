"""Signals as flags: the controller looks at them between two steps, where the state can be saved.

SIGINT and SIGTERM ask for a checkpoint and a stop, SIGUSR1 for a checkpoint. A second SIGINT or SIGTERM ends the process at
once, which the commit protocol of the files survives. While kernels compile there is no "between two steps" for half a minute:
an `impatient` switchboard then raises `StopRequested` out of the handler.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopRequested(BaseException):
    """A signal arrived where nothing has to be saved; no `Exception`, so that no library swallows it.

    Attributes:
        signal: Number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.signal = number


class Switchboard:
    """Collects the signals that arrive during a run.

    Attributes:
        stop_signal: The first SIGINT or SIGTERM, or None.
        is_checkpoint_wanted: Whether SIGUSR1 has arrived since this was last cleared.
        impatient: Whether a stop signal raises `StopRequested` instead of waiting to be looked at.
    """

    def __init__(self) -> None:
        self.stop_signal: int | None = None
        self.is_checkpoint_wanted = False
        self.impatient = False
        self._is_installed = False

    def should_stop(self) -> bool:
        """Whether SIGINT or SIGTERM has arrived."""
        return self.stop_signal is not None

    @contextmanager
    def installed(self) -> Iterator[Switchboard]:
        """Handle the signals while the context lasts.

        Outside the main thread Python does not allow it, and inside such a context it is done already: then nothing happens.
        """
        if self._is_installed or threading.current_thread() is not threading.main_thread():
            yield self
            return
        self._is_installed = True
        before = {number: signal.signal(number, self._on_stop) for number in STOP_SIGNALS}
        before[signal.SIGUSR1] = signal.signal(signal.SIGUSR1, self._on_checkpoint)
        try:
            yield self
        finally:
            self._is_installed = False
            for number, handler in before.items():
                signal.signal(number, handler if handler is not None else signal.SIG_DFL)

    @contextmanager
    def raising(self) -> Iterator[None]:
        """While the context lasts a stop signal raises `StopRequested` at once; so does one that has come already."""
        if self.stop_signal is not None:
            raise StopRequested(self.stop_signal)
        hook = sys.unraisablehook

        def on_swallowed(event: sys.UnraisableHookArgs) -> None:
            # The exception came out where Python drops exceptions, in a destructor. There is nothing to save: leave at once.
            if isinstance(event.exc_value, StopRequested):
                _exit_now(event.exc_value.signal)
            hook(event)

        sys.unraisablehook = on_swallowed
        self.impatient = True
        try:
            yield
        finally:
            self.impatient = False
            sys.unraisablehook = hook

    def _on_stop(self, number: int, _frame: FrameType | None) -> None:
        if self.stop_signal is not None:
            _exit_now(number)
        self.stop_signal = number
        if self.impatient:
            raise StopRequested(number)

    def _on_checkpoint(self, _number: int, _frame: FrameType | None) -> None:
        self.is_checkpoint_wanted = True


def _exit_now(number: int) -> None:
    if sys.stderr.isatty():
        os.write(sys.stderr.fileno(), b"\x1b[?25h\n")  # a progress bar hides the cursor
    os._exit(128 + number)

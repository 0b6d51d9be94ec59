"""Signals as flags: the controller looks at them between two steps, where the state can be saved.

SIGINT, SIGTERM and SIGHUP ask for a checkpoint and a stop, SIGUSR1 for a checkpoint. A second
request to stop ends a process that is ours at once, which the commit protocol of the files
survives; another, such as that of a notebook, waits for what the first has asked for. While
kernels compile there is no "between two steps" for half a minute, nor is there anything to save:
inside `exit_at_once` a signal then ends the process out of the handler. (An exception that is
raised there would have to find its way through the machine code of a compiler, which crashes now
and then.)
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopSignals:
    """Collects the signals that arrive during a run.

    Attributes:
        stop_signal: The first signal that asked for a stop, or None.
        is_checkpoint_wanted: Whether SIGUSR1 has arrived since this was last cleared.
        on_exit: What is done with the number of a stop signal before the process ends at once.
    """

    def __init__(self, *, may_exit: bool = False) -> None:
        """Set up; ``may_exit``: the process is ours to end, else no signal ends it at once."""
        self.stop_signal: int | None = None
        self.is_checkpoint_wanted = False
        self.on_exit: Callable[[int], None] = lambda number: None
        self._may_exit = may_exit
        self._is_impatient = False
        self._is_installed = False

    def should_stop(self) -> bool:
        return self.stop_signal is not None

    @contextmanager
    def installed(self) -> Iterator[StopSignals]:
        """Handle the signals while the context lasts; SIGHUP stays ignored if it was (``nohup``).

        Outside the main thread Python does not allow it, and inside such a context it is done
        already: then nothing happens.
        """
        if self._is_installed or threading.current_thread() is not threading.main_thread():
            yield self
            return
        self._is_installed = True
        handlers = dict.fromkeys((*STOP_SIGNALS, signal.SIGUSR1), self._on_signal)
        if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
            del handlers[signal.SIGHUP]
        before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
        try:
            yield self
        finally:
            self._is_installed = False
            for number, handler in before.items():
                signal.signal(number, handler if handler is not None else signal.SIG_DFL)

    @contextmanager
    def exit_at_once(self) -> Iterator[None]:
        """While nothing has to be saved: a stop signal, or one that has come, ends the process."""
        self._is_impatient = self._may_exit
        try:
            if self._is_impatient and self.stop_signal is not None:
                self._leave(self.stop_signal)
            yield
        finally:
            self._is_impatient = False

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGUSR1:
            self.is_checkpoint_wanted = True
            return
        if self.stop_signal is not None:
            if self._may_exit:
                _exit_now(number)
            return
        self.stop_signal = number
        if self._is_impatient:
            self._leave(number)

    def _leave(self, number: int) -> NoReturn:
        # a full disk: that the run was stopped is then found out from its lock
        with contextlib.suppress(Exception):
            self.on_exit(number)
        _exit_now(number)


def _exit_now(number: int) -> NoReturn:
    if sys.stderr.isatty():
        os.write(sys.stderr.fileno(), b"\x1b[?25h\n")  # a progress bar hides the cursor
    os._exit(128 + number)

"""What happens when a command fails: one clear message and the right exit code, no traceback."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any

import typer

from multicor_cli.cli.console import complain, say
from multicor_cli.running.outcome import ExitCode, exit_code_of
from multicor_cli.store import layout
from multicor_cli.store.atomic import commit_bytes
from multicor_cli.store.errors import StoreError
from multicor_cli.store.lock import was_taken

USAGE_ERROR: Any = typer.BadParameter.__mro__[-4]
"""What Typer raises: the class right below Exception, whose name depends on the version."""

_crash_directory: Path | None = None


def guarded(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a command: errors become messages and exit codes; a closed pipe ends it quietly."""

    @wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> None:
        with _failures(), _terminable():
            function(*args, **kwargs)
            sys.stdout.flush()

    return wrapper


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM and SIGHUP act as Ctrl-C: temporary files go; ``run`` has handlers of its own."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    both = (signal.SIGTERM, signal.SIGHUP)
    numbers = [number for number in both if signal.getsignal(number) is signal.SIG_DFL]
    for number in numbers:
        signal.signal(number, lambda number, _frame: sys.exit(128 + number))
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


def set_crash_directory(path: Path | None) -> None:
    """Where ``crash.txt`` goes if the command has locked this directory; else a temporary one."""
    global _crash_directory  # noqa: PLW0603  (one command per process)
    _crash_directory = path


@contextlib.contextmanager
def _failures() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        # No one reads stdout anymore: discard its buffer, and what Python flushes at exit
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(ExitCode.DONE) from None
    except SystemExit as error:
        # Rich has met it first, and calls it a failure
        if isinstance(error.__context__, BrokenPipeError):
            raise SystemExit(ExitCode.DONE) from None
        raise
    except (KeyboardInterrupt, Exception) as error:
        # the command-line library leaves a command by these, or formats them itself
        if isinstance(error, typer.Exit | typer.Abort | USAGE_ERROR):
            raise
        code = exit_code_of(error)
        _report(error, code)
        raise SystemExit(code) from None


def _report(error: BaseException, code: ExitCode) -> None:
    if code is ExitCode.BUG:
        what = f"internal error ({type(error).__name__}), sorry: this is a bug"
        complain(f"{what}. Please report it with {_write_crash(error)}")
    elif code is ExitCode.SCENARIO:
        for problem in error.problems:  # type: ignore[attr-defined]
            say(str(problem))
            if problem.excerpt():
                say(problem.excerpt())
    elif code is ExitCode.INTERRUPTED:
        complain("interrupted")
    elif isinstance(error, MemoryError):
        complain("not enough memory")
    else:
        complain(_describe(error))


def _describe(error: BaseException) -> str:
    """The message of an error; of one of the system: the file and what is wrong with it."""
    if isinstance(error, OSError) and error.strerror:
        # Files are named
        is_full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        is_output = error.filename is None and is_full
        where = "standard output" if is_output else error.filename
        return f"{where}: {error.strerror}" if where is not None else error.strerror
    return str(error)


def _write_crash(error: BaseException) -> str:
    """Save the traceback, in the run directory if there is one; returns the name of the file."""
    text = "".join(traceback.format_exception(error))
    command = " ".join(sys.argv)
    content = f"multicor crashed\ncommand: {command}\n\n{text}".encode(errors="backslashreplace")
    if _crash_directory is not None and was_taken(_crash_directory / layout.LOCK):
        with contextlib.suppress(StoreError):
            commit_bytes(_crash_directory / layout.CRASH, "crash", content)
            return str(_crash_directory / layout.CRASH)
    try:
        handle, name = tempfile.mkstemp(prefix="multicor-crash-", suffix=".txt")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
    except OSError:
        say(text)
        return "the lines above"
    return name

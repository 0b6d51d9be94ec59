"""The command line: in the process of the tests, or in one of its own."""

import contextlib
import functools
import io
import json
import os
import subprocess
import sys
from unittest import mock

import typer.main
from places import ROOT

from multicor_cli.cli.app import main
from multicor_cli.cli.guard import set_crash_directory

_parser = functools.cache(typer.main.get_command)
"""The commands as typer parses them, made once: that takes as long as most commands."""


def environment(**extra):
    """The environment of a command: this source tree, and nothing of the terminal."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ("NO_COLOR", "FORCE_COLOR", "NUMBA_NUM_THREADS")
    }
    return {**kept, "PYTHONPATH": str(ROOT), "COLUMNS": "120", **extra}


def command(*arguments):
    return [sys.executable, "-m", "multicor_cli", *map(str, arguments)]


_ASKED_INSIDE = {"COLUMNS", "_MULTICOR_COMPLETE", "COMP_WORDS", "COMP_CWORD"}
"""Variables of the environment that are read at each call, not when modules are loaded."""


def call(*arguments, cwd, **extra):
    """Run a command to its end: in this process, or, to be different, in one of its own."""
    if extra.keys() - _ASKED_INSIDE or "--threads" in arguments:
        return call_outside(*arguments, cwd=cwd, **extra)
    words, out, err = ["multicor", *map(str, arguments)], io.StringIO(), io.StringIO()
    set_crash_directory(None)
    with (
        contextlib.chdir(cwd),
        mock.patch.dict(os.environ, environment(**extra), clear=True),
        mock.patch.object(sys, "argv", words),
        mock.patch.object(typer.main, "get_command", _parser),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            code = 0
        except SystemExit as leave:
            code = leave.code if isinstance(leave.code, int) else int(leave.code is not None)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def call_outside(*arguments, cwd, **extra):
    """Run a command to its end in a process of its own."""
    return python(*command(*arguments)[1:], cwd=cwd, **extra)


def python(*words, cwd, given=None, timeout=1800.0, **extra):
    """Run Python to its end, in the environment of a command."""
    return subprocess.run(
        [sys.executable, *map(str, words)], cwd=cwd, env=environment(**extra), input=given,
        capture_output=True, text=True, timeout=timeout, check=False,
    )  # fmt: skip


def start(*arguments, cwd, **extra):
    return subprocess.Popen(
        command(*arguments), cwd=cwd, env=environment(**extra), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def read_info(directory):
    """``run_info`` as the command line prints it."""
    done = call("info", directory, "--json", cwd=directory.parent)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)

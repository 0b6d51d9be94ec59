"""How every Python process that this program starts begins: without the working directory on its path."""

from __future__ import annotations

import os
import site
import sys
import threading
from pathlib import Path


def python_child(*words: str, **variables: str) -> tuple[list[str], dict[str, str]]:
    """Command and environment of a Python process that finds modules where this one does, but never in the working directory.

    ``python -c`` and ``python -m`` put the working directory first: a file ``random.py`` there, of the user or of a folder from
    somewhere, would be run in place of the library's. ``-P`` keeps it out, ``PYTHONSAFEPATH`` out of what the child starts in turn.
    ``-I`` would keep out ``PYTHONPATH`` and the user's own packages too, where libraries may be installed; of ``PYTHONPATH`` only
    the parts go that mean the working directory.

    Args:
        words: What follows the interpreter: ``-m``, ``-c``, or a file, and arguments.
        variables: Further variables of the environment.

    Returns:
        The command and all of its environment.
    """
    path = [part for part in os.environ.get("PYTHONPATH", "").split(os.pathsep) if os.path.normpath(part) != "."]
    root = str(Path(__file__).resolve().parents[2])
    if root not in (*path, *site.getsitepackages(), site.getusersitepackages()):
        path.append(root)  # a source tree that is not installed
    safe = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(path)}
    return [sys.executable, "-I" if sys.flags.isolated else "-P", *words], {**os.environ, **safe, **variables}


def end_with_parent() -> None:
    """End this process when the other end of its standard input is closed; returns at once."""

    def wait() -> None:
        while sys.stdin.buffer.read(4096):
            pass
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()

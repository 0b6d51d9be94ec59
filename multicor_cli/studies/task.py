"""What a Dask worker does with a case: it starts a process for it, waits, and stops it when asked."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections import deque
from pathlib import Path
from typing import Any

from multicor_cli.store.layout import LOCK

BEAT = 15.0
"""How often the lock of a case is touched while its process lives [s]."""

_TAIL = 2000
_running: dict[str, subprocess.Popen[bytes]] = {}
_lock = threading.Lock()
_stopping: set[str] = set()


def run_case(task: dict[str, Any]) -> dict[str, Any]:
    """Run a case in a process of its own; see `multicor_cli.studies.child.run_task`.

    Args:
        task: As there, with ``study`` and ``name``.

    Returns:
        As there; what the process did not say itself (killed, out of memory) is a failure with the end of its messages.
    """
    name = f"{task['study']}/{task['name']}"
    with _lock:
        if task["study"] in _stopping:
            return {"status": "stopped", "reason": "not begun", "exit_code": 75, "step": 0}
        child = subprocess.Popen(
            [sys.executable, "-m", "multicor_cli.studies.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the client, which stops cases in order
        )
        _running[name] = child
    try:
        said, errors = _Listener(child.stdout), _Listener(child.stderr)
        with contextlib.suppress(BrokenPipeError):
            assert child.stdin is not None
            child.stdin.write(json.dumps(task).encode() + b"\n")
            child.stdin.flush()
        code = _wait(child, Path(task["directory"]) / LOCK)
    finally:
        with _lock:
            _running.pop(name, None)
    for line in reversed(said.lines()):
        with contextlib.suppress(ValueError):
            found = json.loads(line)
            if isinstance(found, dict) and "status" in found:
                return found
    return _unsaid(code, b"".join(errors.lines())[-_TAIL:].decode(errors="replace").strip())


def _wait(child: subprocess.Popen[bytes], lock: Path) -> int:
    """Wait for the process; meanwhile show other machines that it is alive: the time of its lock moves on."""
    while True:
        try:
            return child.wait(BEAT)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(OSError):
                if lock.stat().st_size:
                    os.utime(lock)


class _Listener:
    """Keeps the last lines of a stream."""

    def __init__(self, stream: Any) -> None:
        self._lines: deque[bytes] = deque(maxlen=50)
        self._thread = threading.Thread(target=lambda: self._lines.extend(stream), daemon=True)
        self._thread.start()

    def lines(self) -> list[bytes]:
        """What the process has said last, once it has ended."""
        self._thread.join(5.0)
        return list(self._lines)


def _unsaid(code: int, said: str) -> dict[str, Any]:
    """The outcome of a process that said nothing."""
    if code in (-signal.SIGTERM, -signal.SIGINT, -signal.SIGHUP, 128 + signal.SIGTERM, 128 + signal.SIGINT, 128 + signal.SIGHUP):
        return {"status": "stopped", "reason": "stopped before its first step", "exit_code": abs(code), "step": 0}
    last = said.splitlines()[-1] if said else ""
    if code == -signal.SIGKILL:
        return {"status": "killed", "reason": "its process was killed (out of memory?)", "exit_code": 137, "step": 0}
    return {"status": "failed", "reason": last or f"its process ended with exit code {code}", "exit_code": abs(code), "step": 0}


def stop_cases(study: str) -> int:
    """Ask the cases of a study that this worker runs to stop with a checkpoint; returns how many there are."""
    with _lock:
        _stopping.add(study)
        found = [child for name, child in _running.items() if name.startswith(f"{study}/")]
    for child in found:
        child.send_signal(signal.SIGTERM)
    return len(found)

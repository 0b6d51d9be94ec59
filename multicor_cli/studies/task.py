"""What a Dask worker does with a case: it starts a process for it, waits, and stops it when asked."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from typing import Any

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
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stderr is not None
        errors: list[bytes] = []
        listener = threading.Thread(target=_keep_tail, args=(child.stderr, errors), daemon=True)
        listener.start()
        try:
            child.stdin.write(json.dumps(task).encode() + b"\n")
            child.stdin.flush()
            lines = child.stdout.read().splitlines()
        except BrokenPipeError:
            lines = []
        code = child.wait()
        listener.join(5.0)
    finally:
        with _lock:
            _running.pop(name, None)
    for line in reversed(lines):
        try:
            found = json.loads(line)
        except ValueError:
            continue
        if isinstance(found, dict) and "status" in found:
            return found
    return _unsaid(code, b"".join(errors)[-_TAIL:].decode(errors="replace").strip())


def _keep_tail(stream: Any, into: list[bytes]) -> None:
    for line in stream:
        into.append(line)
        del into[:-50]


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

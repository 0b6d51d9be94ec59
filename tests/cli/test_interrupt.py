"""Ctrl-C in commands that compile and compute without a run: one line, exit code 130, nothing left behind."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

from command_line import command, environment


def test_a_benchmark_ends_with_its_processes(tmp_path: Path) -> None:
    words = command("bench", "bed", "--grains", "1000", "--threads", "1")
    process = subprocess.Popen(
        words, cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("bed, about"):
            break
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)  # its processes hold the pipes until they have ended, too
    assert process.returncode == 130
    assert said.splitlines()[-1] == "multicor: interrupted"
    assert "Traceback" not in said

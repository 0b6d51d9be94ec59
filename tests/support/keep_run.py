"""Makes the archive of a run in the file format of now, once for each version of it.

python tests/support/keep_run.py

`tests/data/format-MAJOR.MINOR.tar.xz` holds a scenario with heat, friction that depends on it and,
from 1.12 on, grains that are no discs (nearly every dataset of the format), a finished run of it,
and one that was killed at step 60 of 75, after a checkpoint at step 55.
"""

import os
import signal
import socket
import sys
import tarfile
import tempfile
from pathlib import Path

from places import DATA, ROOT

sys.path.insert(0, str(ROOT))

from digest_cases import CASES

from multicor_cli import run
from multicor_cli.running.outcome import QuietObserver, Status
from multicor_cli.store.schema import FORMAT_VERSION


class Killed(QuietObserver):
    def stepped(self, status: Status) -> None:
        if status.state.step == 55:
            signal.raise_signal(signal.SIGUSR1)  # asks for a checkpoint
        if status.state.step == 60:
            os.kill(os.getpid(), signal.SIGKILL)


def main() -> None:
    socket.gethostname = lambda: "example"
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("kept.toml").write_text(CASES["law-shapes"].source, encoding="utf-8")
        if os.fork() == 0:  # before there are threads
            run("kept.toml", "unfinished", observer=Killed())
        os.wait()
        run("kept.toml", "finished")
        with tarfile.open(
            DATA / f"format-{'.'.join(map(str, FORMAT_VERSION))}.tar.xz", "w:xz"
        ) as archive:
            for name in ("kept.toml", "finished", "unfinished"):
                archive.add(name, filter=_kept)


def _kept(entry: tarfile.TarInfo) -> tarfile.TarInfo | None:
    """What the archive takes, without owner: no lock, which names a process, no heartbeat."""
    if Path(entry.name).name in ("lock", "progress.json"):
        return None
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = "root"
    return entry


if __name__ == "__main__":
    main()

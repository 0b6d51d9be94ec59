"""Names of the files of a run directory, and which of them may be removed."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from pathlib import Path

from multicor_cli.store.errors import DirectoryRefused

RUN = "run.json"
LOCK = "lock"
SOURCE = "scenario.toml"
RESOLVED = "scenario.resolved.toml"
MODEL = "model.h5"
RESULTS = "results.h5"
VTKHDF = "results.vtkhdf"
PROGRESS = "progress.json"
CRASH = "crash.txt"
SEGMENTS = "segments"
CHECKPOINTS = "checkpoints"

_FILES = {RUN, LOCK, SOURCE, RESOLVED, MODEL, RESULTS, VTKHDF, PROGRESS, CRASH}
_IN_DIRECTORY = {
    SEGMENTS: re.compile(r"(\d{6,}\.h5(\.tmp|(\.\d+)?\.orphan)?|MANIFEST\.jsonl(\.tmp)?)"),
    CHECKPOINTS: re.compile(r"step-\d{11,}(\.\d+)?\.(h5|json)(\.tmp)?"),
}


_FORMER = re.compile(r"scenario(\.resolved)?\.\d+\.toml(\.tmp)?")
"""Scenarios of a run before stages were added to it."""


def former_name(name: str, number: int) -> str:
    """Name by which a scenario file is kept as it was before the extension ``number``, from 1."""
    return f"{name.removesuffix('.toml')}.{number}.toml"


def former_files(path: Path) -> list[Path]:
    """Former versions of a scenario file of a run, the newest last."""
    numbered = {}
    for file in path.parent.glob(f"{path.name.removesuffix('.toml')}.*.toml"):
        number = file.name.split(".")[-2]
        if _FORMER.fullmatch(file.name) and file.name == former_name(path.name, int(number)):
            numbered[int(number)] = file
    return [numbered[number] for number in sorted(numbered)]


def is_file_name(name: str) -> bool:
    """Whether a run has a file or a directory of this name in its directory."""
    return name in _IN_DIRECTORY or _is_file(name)


def _is_file(name: str) -> bool:
    return name in _FILES or _FORMER.fullmatch(name) is not None


def survey(directory: Path) -> tuple[list[Path], list[str]]:
    """All files of a run but ``run.json`` and the lock; and names of what is not of a run.

    Links to other directories are not.
    """
    known, foreign = [], []
    for entry in sorted(directory.iterdir()):
        is_directory = entry.is_dir() and not entry.is_symlink()
        if is_directory and entry.name in _IN_DIRECTORY:
            for file in sorted(entry.iterdir()):
                if _IN_DIRECTORY[entry.name].fullmatch(file.name):
                    known.append(file)
                else:
                    foreign.append(f"{entry.name}/{file.name}")
        elif is_directory or not _is_file(entry.name.removesuffix(".tmp")):
            foreign.append(entry.name)
        elif entry.name not in (RUN, LOCK):
            known.append(entry)
    return known, foreign


def own_files(directory: Path, name: str) -> list[Path]:
    """Files in `SEGMENTS` or `CHECKPOINTS` that only this program makes; none through a link."""
    inner = directory / name
    if inner.is_symlink() or not inner.is_dir():
        return []
    return [
        entry
        for entry in sorted(inner.iterdir())
        if _IN_DIRECTORY[name].fullmatch(entry.name) and not entry.is_dir()
    ]


def temporaries(directory: Path) -> list[Path]:
    """Files that interrupted commits of this program have left in a run directory."""
    inside = [*own_files(directory, SEGMENTS), *own_files(directory, CHECKPOINTS)]
    former = [
        file for file in sorted(directory.glob("scenario.*.tmp")) if _FORMER.fullmatch(file.name)
    ]
    return [
        *(directory / f"{name}.tmp" for name in sorted(_FILES)),
        *former,
        *(file for file in inside if file.name.endswith(".tmp")),
    ]


def no_run(path: Path) -> DirectoryRefused:
    """What is said of a place where a run should be and is none."""
    if not path.exists():
        return DirectoryRefused(f"{path}: there is no such directory")
    inside: list[str] = []
    with contextlib.suppress(OSError):
        inside = sorted(str(run.parent) for run in path.glob(f"*/{RUN}"))
    shown = ", ".join(inside[:4]) + (" …" if len(inside) > 4 else "")
    return DirectoryRefused(
        f"{path}: holds no run" + (f"; name one of those in it: {shown}" if inside else "")
    )


# ---- Telling whoever waits how many frames of a run have been read, drawn or written

Progress = Callable[[int, int], None]
"""Is told how many frames are done, and of how many."""


def no_progress(done: int, total: int) -> None:
    """Report nothing."""

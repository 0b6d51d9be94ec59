"""Damaged, missing, foreign and swapped files: noticed and named, or harmless; never a wrong
number, a crash or a traceback.
"""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command_line import environment
from places import ROOT, SUPPORT
from store_support import continue_run, killed_at
from trials import trials

WHOLE_FILES = ("empty", "gone", "foreign", "another run's", "sibling's")
KINDS = ("finished", "interrupted", "unfinished", "alone")
Case = tuple[str, str, str, int]
"""Kind of run, file, damage and seed."""

MOST_FAULTS = 5
"""With so many no more damages are tried."""

PATIENCE = 60.0
"""Time after which one damage counts as never answered [s]."""

CODES = {0, 5, 6, 7}
"""What the command line may say: fine, cannot be read, is no run, damaged."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs: finished, killed between segment and checkpoint, killed before ``results.h5``; that
    file alone; and others.
    """
    directory = tmp_path_factory.mktemp("runs")
    for group in ("these", "others"):
        (directory / group).mkdir()
        continue_run(directory / group / "finished")
        assert killed_at(directory / group / "interrupted", "checkpoint.after_tmp:3")
        assert killed_at(directory / group / "unfinished", "results.before_rename")
        for path in (directory / group).rglob("*.tmp"):
            path.unlink()
        (directory / group / "alone").mkdir()
        shutil.copy(directory / group / "finished" / "results.h5", directory / group / "alone")
    return directory


def files_of(run: Path) -> list[str]:
    """Files that hold data: not the lock, and not the link to ``results.h5``."""
    files = (
        path
        for path in run.rglob("*")
        if path.is_file() and not path.is_symlink() and path.name != "lock"
    )
    return sorted(str(path.relative_to(run)) for path in files)


def outcomes(runs: Path, scratch: Path, cases: list[Case]) -> Iterator[tuple[Case, dict[str, Any]]]:
    """What comes of the cases, one after the other; nothing more is tried if the next is not asked
    for.
    """
    log, wanted = scratch / "log", "".join(f"{json.dumps(case)}\n" for case in cases)
    (scratch / "cases").write_text(wanted)
    with (scratch / "cases").open() as source, log.open("w") as errors:
        worker = subprocess.Popen(
            [
                sys.executable,
                SUPPORT / "damage_worker.py",
                runs / "these",
                runs / "others",
                scratch / "run",
            ],
            stdin=source,
            stdout=subprocess.PIPE,
            stderr=errors,
            env={**environment(), "PYTHONPATH": f"{SUPPORT}:{ROOT}"},
            text=True,
        )
    assert worker.stdout is not None
    try:
        for case in cases:
            watch = threading.Timer(PATIENCE, worker.kill)
            watch.start()
            line = worker.stdout.readline()
            watch.cancel()
            assert line, f"{case}: {worker.wait()}\n{log.read_text()}"
            yield case, json.loads(line)
    finally:
        worker.kill()
        worker.wait()
        worker.stdout.close()


def faults(case: Case, found: dict[str, Any]) -> list[str]:
    """What is wrong with an outcome."""
    wrong = []
    if not set(found["codes"]) <= CODES:
        wrong.append("another exit code than those of damage")
    if not found["same"]:
        wrong.append("a wrong number was read")
    if not found["same_end"]:
        wrong.append("the run went on to another end")
    # Lines after the newest checkpoint: as if never written
    is_tail = case[1].endswith("MANIFEST.jsonl") and found["same"]
    is_pruned = (
        case[1].startswith("checkpoints/")
        and case[2] == "gone"
        and found["same"]
        and found["same_end"]
    )  # an older one is there
    # Bytes that hold nothing: no other file knows a digest of the whole
    is_beside = case[0] == "alone" and found["same"]
    if found["changed"] and not found["noticed"] and not (is_tail or is_pruned or is_beside):
        wrong.append("verify did not notice")
    return wrong


def is_thorough(kind: str, name: str) -> bool:
    """Whether a file gets all of the damages: one of each sort; the others get a tenth."""
    once = {
        "finished": ("results.h5", "run.json", "scenario.toml", "scenario.resolved.toml"),
        "interrupted": ("model.h5", "MANIFEST.jsonl"),
        "alone": ("results.h5",),
    }
    newest = {
        "interrupted": (
            "segments/000001.h5",
            "checkpoints/step-00000000030.h5",
            "checkpoints/step-00000000030.json",
        )
    }
    return name.endswith(once.get(kind, ())) or name in newest.get(kind, ())


@pytest.mark.parametrize("kind", KINDS)
@trials(short=1, long=200)
def test_damaged_files(runs: Path, tmp_path: Path, kind: str, count: int) -> None:
    """``count`` bits flipped in a file, a quarter as many cuts, pages zeroed and bytes inserted,
    and whole files replaced.
    """
    cases: list[Case] = []
    for name in files_of(runs / "these" / kind):
        flips = count if is_thorough(kind, name) else max(1, count // 10)
        cases += [(kind, name, "flip", seed) for seed in range(flips)]
        cases += [
            (kind, name, how, seed)
            for how in ("cut", "zero", "shift")
            for seed in range(max(1, flips // 4))
        ]
        # Which is whole
        cases += [
            (kind, name, how, 0) for how in WHOLE_FILES if kind != "alone" or how != "another run's"
        ]
    random.Random(0).shuffle(cases)  # so that a safeguard that is missing shows soon
    if count < 10:
        del cases[5:]
    tried, noticed, wrong = 0, 0, []
    for case, result in outcomes(runs, tmp_path, cases):
        tried, noticed = tried + 1, noticed + result["noticed"]
        wrong += [(case, why, result) for why in faults(case, result)]
        if len(wrong) >= MOST_FAULTS:
            break
    print(f"{tried} damages, {noticed} noticed, {len(wrong)} wrong")
    assert not wrong, "\n".join(map(str, wrong))
    shutil.rmtree(tmp_path / "run", ignore_errors=True)

"""Damaged, missing, foreign and swapped files: noticed and named, or harmless; never a wrong
number, a crash or a traceback."""

import json
import random
import shutil
import subprocess
import sys
import threading

import pytest
from command_line import environment
from places import ROOT, SUPPORT
from store_support import continue_run, killed_at
from trials import trials

WHOLE_FILES = ("empty", "gone", "foreign", "another run's", "sibling's")
KINDS = ("finished", "interrupted", "unfinished", "alone")

MOST_FAULTS = 5
"""With so many no more damages are tried."""

PATIENCE = 60.0
"""Time after which one damage counts as never answered [s]."""

CODES = {0, 5, 6, 7}
"""What the command line may say: fine, cannot be read, is no run, damaged."""

THOROUGH = {
    "finished": ("results.h5", "run.json", "scenario.toml", "scenario.resolved.toml"),
    "interrupted": (
        "model.h5", "MANIFEST.jsonl", "segments/000001.h5",
        "checkpoints/step-00000000030.h5", "checkpoints/step-00000000030.json",
    ),
    "unfinished": (),
    "alone": ("results.h5",),
}  # fmt: skip
"""Files that get all of the damages, one of each sort; the others get a tenth."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs: finished, killed between segment and checkpoint, killed before ``results.h5``; that
    file alone; and others."""
    directory = tmp_path_factory.mktemp("runs")
    for group in (directory / "these", directory / "others"):
        group.mkdir()
        continue_run(group / "finished")
        assert killed_at(group / "interrupted", "checkpoint.after_tmp:3")
        assert killed_at(group / "unfinished", "results.before_rename")
        for path in group.rglob("*.tmp"):
            path.unlink()
        (group / "alone").mkdir()
        shutil.copy(group / "finished" / "results.h5", group / "alone")
    return directory


def files_of(run):
    """Files that hold data: not the lock, and not the link to ``results.h5``."""
    return sorted(
        str(path.relative_to(run))
        for path in run.rglob("*")
        if path.is_file() and not path.is_symlink() and path.name != "lock"
    )


def outcomes(runs, scratch, cases):
    """What comes of the cases ``(kind of run, file, damage, seed)``, one after the other; nothing
    more is tried if the next is not asked for."""
    log = scratch / "log"
    (scratch / "cases").write_text("".join(f"{json.dumps(case)}\n" for case in cases))
    with (scratch / "cases").open() as source, log.open("w") as errors:
        worker = subprocess.Popen(
            [sys.executable, SUPPORT / "damage_worker.py", runs / "these", runs / "others",
             scratch / "run"],
            stdin=source, stdout=subprocess.PIPE, stderr=errors, text=True,
            env={**environment(), "PYTHONPATH": f"{SUPPORT}:{ROOT}"},
        )  # fmt: skip
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


def faults(case, found):
    """What is wrong with an outcome."""
    kind, name, how, _ = case
    wrong = []
    if not set(found["codes"]) <= CODES:
        wrong.append("another exit code than those of damage")
    if not found["same"]:
        wrong.append("a wrong number was read")
    if not found["same_end"]:
        wrong.append("the run went on to another end")
    # An older one is there
    is_pruned = name.startswith("checkpoints/") and how == "gone" and found["same_end"]
    # Lines after the newest checkpoint: as if never written; bytes that hold nothing: no other file
    # knows a digest of the whole
    is_harmless = name.endswith("MANIFEST.jsonl") or is_pruned or kind == "alone"
    if found["changed"] and not found["noticed"] and not (is_harmless and found["same"]):
        wrong.append("verify did not notice")
    return wrong


@pytest.mark.parametrize("kind", KINDS)
@trials(short=1, long=200)
def test_damaged_files(runs, tmp_path, kind, count):
    """``count`` bits flipped in a file, a quarter as many cuts, pages zeroed and bytes inserted,
    and whole files replaced."""
    cases = []
    for name in files_of(runs / "these" / kind):
        flips = count if name.endswith(THOROUGH[kind]) else max(1, count // 10)
        cases += [(kind, name, "flip", seed) for seed in range(flips)]
        for how in ("cut", "zero", "shift"):
            cases += [(kind, name, how, seed) for seed in range(max(1, flips // 4))]
        # Another run's file alone is whole
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

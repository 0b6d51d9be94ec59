"""What one message advises, the next command can do: a state, the command that speaks, the advice,
and what follows it.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from command_line import call
from test_moments import RUN, SCENARIO, killed_at
from trials import thinned


def cut(file: Path) -> None:
    data = file.read_bytes()[:100]
    file.unlink()
    file.write_bytes(data)


def shorten_manifest(run: Path) -> None:
    file = run / "segments" / "MANIFEST.jsonl"
    file.write_bytes(file.read_bytes().split(b"\n")[0] + b"\n")


def newest(run: Path, pattern: str) -> Path:
    return sorted(run.glob(pattern))[-1]


def spoil_scenario(run: Path) -> None:
    shutil.copy(run / "scenario.toml", run.parent / "kept.toml")
    (run / "scenario.toml").write_text("x")


def link_lock(run: Path) -> None:
    (run / "lock").unlink()
    (run / "lock").symlink_to("elsewhere")


def add_stage(run: Path) -> None:
    file = run.parent / "small.toml"
    file.write_text(f'{file.read_text()}\n[[loading]]\nname = "more"\nduration = 0.004\n')


class Row(NamedTuple):
    """A piece of advice.

    Attributes:
        spoil: Makes the state.
        says: The command that gives the advice.
        advice: What it says, as a pattern.
        follow: What the user then does with the run directory by hand.
        does: The command that must then end with exit code 0.
    """

    spoil: Callable[[Path], object]
    says: tuple[str, ...]
    advice: str
    does: tuple[str, ...]
    follow: Callable[[Path], object] = lambda run: None


VERIFY, AGAIN, ANEW = ("verify", "run"), RUN, (*RUN, "--overwrite")
ELSEWHERE = ("run", "small.toml", "-o", "other", "-q")
ROWS = {
    "segments gone": Row(
        lambda r: shutil.rmtree(r / "segments"),
        VERIFY,
        "begin again with the same command and --overwrite",
        ANEW,
    ),
    "segments gone, elsewhere": Row(
        lambda r: shutil.rmtree(r / "segments"), AGAIN, "in another directory with -o", ELSEWHERE
    ),
    "manifest gone": Row(
        lambda r: (r / "segments/MANIFEST.jsonl").unlink(),
        VERIFY,
        "continue the run to repair it",
        AGAIN,
    ),
    "manifest short": Row(shorten_manifest, VERIFY, "continue the run to repair it", AGAIN),
    "first segment cut": Row(
        lambda r: cut(r / "segments/000000.h5"), AGAIN, "begin again .* --overwrite", ANEW
    ),
    "all checkpoints cut": Row(
        lambda r: [cut(p) for p in r.glob("checkpoints/*.h5")],
        AGAIN,
        "begin again .* --overwrite",
        ANEW,
    ),
    "last segment gone": Row(
        lambda r: newest(r, "segments/*.h5").unlink(),
        AGAIN,
        "going back to an older checkpoint",
        VERIFY,
    ),
    "newest checkpoint cut": Row(
        lambda r: cut(newest(r, "checkpoints/*.h5")),
        AGAIN,
        "going back to an older checkpoint",
        VERIFY,
    ),
    "left by a kill": Row(lambda r: None, VERIFY, "the next start removes it", AGAIN),
    "scenario changed": Row(
        spoil_scenario,
        AGAIN,
        "put the original back",
        AGAIN,
        lambda r: shutil.copy(r.parent / "kept.toml", r / "scenario.toml"),
    ),
    "scenario changed, another": Row(spoil_scenario, AGAIN, "or start another run", ELSEWHERE),
    "other tolerance": Row(
        lambda r: None,
        (*RUN, "--set", "solver.tolerance_rms=2e-3"),
        "undo the change to continue the run",
        AGAIN,
    ),
    "other tolerance, elsewhere": Row(
        lambda r: None,
        (*RUN, "--set", "solver.tolerance_rms=2e-3"),
        "choose another directory with -o",
        (*ELSEWHERE, "--set", "solver.tolerance_rms=2e-3"),
    ),
    "other tolerance, anew": Row(
        lambda r: None,
        (*RUN, "--set", "solver.tolerance_rms=2e-3"),
        "start anew with --overwrite",
        (*ANEW, "--set", "solver.tolerance_rms=2e-3"),
    ),
    "more stages": Row(add_stage, AGAIN, "give --extend to add them", (*RUN, "--extend")),
    "more stages, anew": Row(add_stage, AGAIN, "start anew with --overwrite", ANEW),
    "no run to extend": Row(
        shutil.rmtree, (*RUN, "--extend"), "leave --extend out to begin one", AGAIN
    ),
    "lock of another machine": Row(
        lambda r: (r / "lock").write_text('{"pid": 1, "host": "elsewhere"}'),
        AGAIN,
        "delete run/lock",
        AGAIN,
        lambda r: (r / "lock").unlink(),
    ),
    "lock is a link": Row(
        link_lock, AGAIN, "run/lock: .*; remove it", AGAIN, lambda r: (r / "lock").unlink()
    ),
    "foreign file": Row(
        lambda r: (r / "notes.txt").write_text("x"),
        ANEW,
        r"\(notes.txt\); move them away",
        ANEW,
        lambda r: (r / "notes.txt").rename(r.parent / "n"),
    ),
    "run.json gone": Row(
        lambda r: (r / "run.json").unlink(), AGAIN, "choose another with -o", ELSEWHERE
    ),
    "run.json gone, emptied": Row(
        lambda r: (r / "run.json").unlink(),
        AGAIN,
        "or empty it",
        AGAIN,
        lambda r: (shutil.rmtree(r), r.mkdir()),
    ),
    "no file": Row(
        lambda r: (r.parent / "small.toml").unlink(),
        AGAIN,
        "make one with: multicor new NAME",
        ("new", "small", "--overwrite"),
    ),
    "scenario there": Row(
        lambda r: None, ("new", "small"), "give --overwrite", ("new", "small", "--overwrite")
    ),
    "export there": Row(
        lambda r: call("export", "csv", "run", "-o", "out", cwd=r.parent),
        ("export", "csv", "run", "-o", "out"),
        "or give --overwrite",
        ("export", "csv", "run", "-o", "out", "--overwrite"),
    ),
    "only begun": Row(
        lambda r: (shutil.rmtree(r), killed_at(r.parent, "runjson.after_rename")),
        ("info", "run"),
        "give the command that began it",
        AGAIN,
    ),
    "nothing stored": Row(
        lambda r: (shutil.rmtree(r), killed_at(r.parent, "model.mid_tmp")),
        ("post", "series", "run"),
        "give the command that began it",
        AGAIN,
    ),
    "stopped": Row(shutil.rmtree, (*RUN, "--max-hours", "0"), "the same command continues", AGAIN),
}


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was killed while it wrote its results."""
    directory = tmp_path_factory.mktemp("killed")
    (directory / "small.toml").write_text(SCENARIO)
    killed_at(directory, "results.mid_tmp")
    return directory


@pytest.mark.parametrize("row", thinned(ROWS, 4))
def test_advice_can_be_followed(tmp_path: Path, killed: Path, row: Row) -> None:
    shutil.copytree(killed, tmp_path / "a", symlinks=True)
    run = tmp_path / "a" / "run"
    row.spoil(run)
    said = call(*(word for word in row.says if word != "-q"), cwd=run.parent)
    text = said.stdout + said.stderr
    assert re.search(row.advice, text), text
    row.follow(run)
    done = call(*row.does, cwd=run.parent)
    assert done.returncode == 0, done.stderr
    if row.does[0] == "run":
        assert call("verify", row.does[row.does.index("-o") + 1], cwd=run.parent).returncode == 0


def test_what_comes_next_can_be_given(tmp_path: Path, killed: Path) -> None:
    """The commands that a finished run proposes."""
    shutil.copytree(killed, tmp_path / "a", symlinks=True)
    done = call(*(word for word in RUN if word != "-q"), cwd=tmp_path / "a")
    proposed = re.findall(r"^(?:next:|     ) +multicor (.+)$", done.stderr, re.MULTILINE)
    assert len(proposed) > 1
    for words in proposed:
        assert call(*words.split(), cwd=tmp_path / "a").returncode == 0, words

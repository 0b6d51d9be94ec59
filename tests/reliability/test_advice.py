"""What one message advises, the next command can do: a state, the command that speaks, the advice,
and what follows it."""

import re
import shutil

import pytest
from command_line import call
from test_moments import RUN, SCENARIO, killed_at
from trials import thinned


def cut(file):
    data = file.read_bytes()[:100]
    file.unlink()
    file.write_bytes(data)


def shorten_manifest(run):
    file = run / "segments" / "MANIFEST.jsonl"
    file.write_bytes(file.read_bytes().split(b"\n")[0] + b"\n")


def newest(run, pattern):
    return sorted(run.glob(pattern))[-1]


def spoil_scenario(run):
    shutil.copy(run / "scenario.toml", run.parent / "kept.toml")
    (run / "scenario.toml").write_text("x")


def link_lock(run):
    (run / "lock").unlink()
    (run / "lock").symlink_to("elsewhere")


def add_stage(run):
    file = run.parent / "small.toml"
    file.write_text(f'{file.read_text()}\n[[loading]]\nname = "more"\nduration = 0.004\n')


def begin_again_until(run, point):
    shutil.rmtree(run)
    killed_at(run.parent, point)


def remove_lock(run):
    (run / "lock").unlink()


def lose_segments(run):
    shutil.rmtree(run / "segments")


def lose_document(run):
    (run / "run.json").unlink()


def nothing(run):
    pass


VERIFY, AGAIN, ANEW, ELSEWHERE = "verify run", " ".join(RUN), " ".join(RUN) + " --overwrite", (
    "run small.toml -o other -q"
)  # fmt: skip
TOLERANCE = " --set solver.tolerance_rms=2e-3"
CSV, OLDER = "export csv run -o out", "going back to an older checkpoint"
ROWS = {
    "segments gone": (lose_segments, VERIFY, "begin again with the same command and --overwrite", ANEW),
    "segments gone, elsewhere": (lose_segments, AGAIN, "in another directory with -o", ELSEWHERE),
    "manifest gone": (lambda r: (r / "segments/MANIFEST.jsonl").unlink(), VERIFY, "continue the run to repair it", AGAIN),
    "manifest short": (shorten_manifest, VERIFY, "continue the run to repair it", AGAIN),
    "first segment cut": (lambda r: cut(r / "segments/000000.h5"), AGAIN, "begin again .* --overwrite", ANEW),
    "all checkpoints cut": (lambda r: [cut(p) for p in r.glob("checkpoints/*.h5")], AGAIN, "begin again .* --overwrite", ANEW),
    "last segment gone": (lambda r: newest(r, "segments/*.h5").unlink(), AGAIN, OLDER, VERIFY),
    "newest checkpoint cut": (lambda r: cut(newest(r, "checkpoints/*.h5")), AGAIN, OLDER, VERIFY),
    "left by a kill": (nothing, VERIFY, "the next start removes it", AGAIN),
    "scenario changed": (spoil_scenario, AGAIN, "put the original back", AGAIN, lambda r: shutil.copy(r.parent / "kept.toml", r / "scenario.toml")),
    "scenario changed, another": (spoil_scenario, AGAIN, "or start another run", ELSEWHERE),
    "other tolerance": (nothing, AGAIN + TOLERANCE, "undo the change to continue the run", AGAIN),
    "other tolerance, elsewhere": (nothing, AGAIN + TOLERANCE, "choose another directory with -o", ELSEWHERE + TOLERANCE),
    "other tolerance, anew": (nothing, AGAIN + TOLERANCE, "start anew with --overwrite", ANEW + TOLERANCE),
    "more stages": (add_stage, AGAIN, "give --extend to add them", AGAIN + " --extend"),
    "more stages, anew": (add_stage, AGAIN, "start anew with --overwrite", ANEW),
    "no run to extend": (shutil.rmtree, AGAIN + " --extend", "leave --extend out to begin one", AGAIN),
    "lock of another machine": (lambda r: (r / "lock").write_text('{"pid": 1, "host": "elsewhere"}'), AGAIN, "delete run/lock", AGAIN, remove_lock),
    "lock is a link": (link_lock, AGAIN, "run/lock: .*; remove it", AGAIN, remove_lock),
    "foreign file": (lambda r: (r / "notes.txt").write_text("x"), ANEW, r"\(notes.txt\); move them away", ANEW, lambda r: (r / "notes.txt").rename(r.parent / "n")),
    "run.json gone": (lose_document, AGAIN, "choose another with -o", ELSEWHERE),
    "run.json gone, emptied": (lose_document, AGAIN, "or empty it", AGAIN, lambda r: (shutil.rmtree(r), r.mkdir())),
    "no file": (lambda r: (r.parent / "small.toml").unlink(), AGAIN, "make one with: multicor new NAME", "new small --overwrite"),
    "scenario there": (nothing, "new small", "give --overwrite", "new small --overwrite"),
    "export there": (lambda r: call(*CSV.split(), cwd=r.parent), CSV, "or give --overwrite", CSV + " --overwrite"),
    "only begun": (lambda r: begin_again_until(r, "runjson.after_rename"), "info run", "give the command that began it", AGAIN),
    "nothing stored": (lambda r: begin_again_until(r, "model.mid_tmp"), "post series run", "give the command that began it", AGAIN),
    "stopped": (shutil.rmtree, AGAIN + " --max-hours 0", "the same command continues", AGAIN),
}  # fmt: skip
"""What makes the state, the command that gives the advice, what it says (a pattern), the command
that must then end with exit code 0; and what the user does by hand before it."""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """A run that was killed while it wrote its results."""
    directory = tmp_path_factory.mktemp("killed")
    (directory / "small.toml").write_text(SCENARIO)
    killed_at(directory, "results.mid_tmp")
    return directory


@pytest.mark.parametrize("row", thinned(ROWS, 4))
def test_advice_can_be_followed(tmp_path, killed, row):
    spoil, says, advice, does, *by_hand = row
    shutil.copytree(killed, tmp_path / "a", symlinks=True)
    run = tmp_path / "a" / "run"
    spoil(run)
    said = call(*(word for word in says.split() if word != "-q"), cwd=run.parent)
    assert re.search(advice, said.stdout + said.stderr), said.stdout + said.stderr
    for follow in by_hand:
        follow(run)
    words = does.split()
    done = call(*words, cwd=run.parent)
    assert done.returncode == 0, done.stderr
    if words[0] == "run":
        assert call("verify", words[words.index("-o") + 1], cwd=run.parent).returncode == 0


def test_what_comes_next_can_be_given(tmp_path, killed):
    """The commands that a finished run proposes."""
    shutil.copytree(killed, tmp_path / "a", symlinks=True)
    done = call(*(word for word in RUN if word != "-q"), cwd=tmp_path / "a")
    proposed = re.findall(r"^(?:next:|     ) +multicor (.+)$", done.stderr, re.MULTILINE)
    assert len(proposed) > 1
    for words in proposed:
        assert call(*words.split(), cwd=tmp_path / "a").returncode == 0, words

"""Runs that versions of the file format have left, kept in ``tests/data``: read, verified and
continued to the bit.

Each archive is made once for its version, by ``tests/support/keep_run.py``: a scenario, a finished
run of it, and one that was killed at step 60 of 75, after a checkpoint at step 55.
"""

import tarfile

import pytest
from command_line import call, read_info
from digest_run import digests_of
from keep_run import DATA

from multicor_cli.model.state import VARIABLE, nudge_seed
from multicor_cli.store import open_run, verify
from multicor_cli.store.schema import FORMAT_VERSION

VERSIONS = sorted(
    path.name.removeprefix("format-").removesuffix(".tar.xz")
    for path in DATA.glob("format-*.tar.xz")
)

ENDS = {
    "1.0": {"state": "e550575b2347e087d0bcf2226bb5a246", "data": "bf50d636cc36569577229f613c953f6b"},
    "1.1": {"state": "7bf3fca532ded7eb589b09853b62d66a", "data": "174abe0830ed702fbfc29af6789f7890"},
    "1.2": {"state": "7bf3fca532ded7eb589b09853b62d66a", "data": "7d6790329945ef354a12c5cf31702b51"},
    "1.3": {"state": "7bf3fca532ded7eb589b09853b62d66a", "data": "c10768afb8d4e5f0864deab199690285"},
    "1.4": {"state": "f4f9b71f78b8dbf31e609f26f2163357", "data": "9b7b460766dd4e5176bd542e431878c1"},
    "1.5": {"state": "e6ee03635d2d3800fa48be0859565f75", "data": "3ec24035af600c480ec85c91c67785ce"},
    "1.6": {"state": "4f34fec43c2cad83460aec2f58ab5e0e", "data": "1d1eab821b5ac79cd5fbeeefea7cd505"},
    "1.7": {"state": "c82fad2be43ef5b26d357ade398f362b", "data": "da3338cfa9b1bef0fc48a2f823d17535"},
    "1.8": {"state": "b77a2be7adb5f62412389517d7835bca", "data": "1773865e228b1ba413a68de32aa0e453"},
    "1.9": {"state": "b77a2be7adb5f62412389517d7835bca", "data": "1773865e228b1ba413a68de32aa0e453"},
    "1.10": {"state": "b77a2be7adb5f62412389517d7835bca", "data": "693ab8e7aa5a73c13c3d1752985e50a1"},
    "1.11": {"state": "f50688a5f905f683e1b67349bc1b1355", "data": "5ba68e69931a94d77805c3507edf2094"},
    "1.12": {"state": "244bc0d383e812f2aec1abe14a5ce43b", "data": "176679df54f772f09055a88caf84cd82"},
}  # fmt: skip
"""Digests with which the unfinished run of each version ends, whose files stay of that version.
They are frozen anew when results change (CHANGELOG.md), the archive stays."""


@pytest.fixture(params=VERSIONS)
def version(request):
    return request.param


@pytest.fixture
def kept(version, tmp_path):
    with tarfile.open(DATA / f"format-{version}.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path


def test_the_version_of_now_is_kept():
    assert ".".join(map(str, FORMAT_VERSION)) in VERSIONS


def test_finished_runs_are_read(kept):
    assert verify(kept / "finished") == []
    info = read_info(kept / "finished")
    assert (info["status"], info["step"]) == ("finished", 75)
    with open_run(kept / "finished") as run:
        assert run.features - {"motion", "flux", "outlines"} == {"heat", "softening"}
        assert run.frames.step.tolist() == [0, 25, 50, 75]
        assert run.model.grain_count == 120
        assert run.frames[-1].contacts.conductance.any()
        assert run.series["heat_stored"][-1] != 0.0


def test_finished_runs_are_extended_and_gone_on_from(kept):
    """Files of an earlier version become those of a longer run of that version; a new run takes its
    state from them."""
    text = (kept / "kept.toml").read_text(encoding="utf-8")
    begin, end = text.index("[[particles]]"), text.index("[[walls]]")
    new = text[:begin] + '[start]\nrun = "finished"\n' + text[end:]
    (kept / "new.toml").write_text(new, encoding="utf-8")
    assert call("run", "new.toml", "-o", "new", cwd=kept).returncode == 0
    stage = "\n[[loading]]\nduration = 0.002\n"
    (kept / "longer.toml").write_text(
        text.replace("[solver]", f"{stage}[solver]"), encoding="utf-8"
    )
    done = call("run", "longer.toml", "-o", "finished", "--extend", cwd=kept)
    assert done.returncode == 0, done.stderr
    assert verify(kept / "finished") == []
    with open_run(kept / "finished") as run, open_run(kept / "new") as second:
        assert run.frames.step.tolist()[:4] == [0, 25, 50, 75]
        assert len(run.frames) > 4
        assert second.info["origin"]["step"] == 75
        assert second.info["summary"]["heat_closure"] < 1e-12


@pytest.mark.skipif(
    nudge_seed() is not None, reason=f"{VARIABLE} moves the positions whose bits are frozen"
)
def test_unfinished_runs_are_continued(version, kept):
    assert verify(kept / "unfinished") == []
    done = call("run", "kept.toml", "-o", "unfinished", cwd=kept)
    assert done.returncode == 0, done.stderr
    assert "continuing from step 55" in done.stderr
    assert verify(kept / "unfinished") == []
    assert digests_of(kept / "unfinished") == ENDS[version]

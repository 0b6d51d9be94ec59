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
    "1.0": {"state": "7540f9cb8a217f1d10a91079a8f55768", "data": "40164334f7707553c1dcbdffc7698da6"},
    "1.1": {"state": "9fa1d344b0236a08012b74b61ff86acb", "data": "d3cf47f0458e77e43fee87dedc4dfe49"},
    "1.2": {"state": "9fa1d344b0236a08012b74b61ff86acb", "data": "692f8f2acc16a27e3e931c4fcb52c79b"},
    "1.3": {"state": "9fa1d344b0236a08012b74b61ff86acb", "data": "6029e4907ca65749234762da7bac187d"},
    "1.4": {"state": "be5ef042500c25e398f305e5416a503d", "data": "815b4d3cf934b1f3b5046844e2b4d3c7"},
    "1.5": {"state": "0b33ddc6bcaeb981ea68678d9cbaba08", "data": "fc89579558ca1f6de11bb9e891ea653f"},
    "1.6": {"state": "7fe14505acc72e3d7e45fd4fdae8e113", "data": "aa3503c9597b0fcc676ea065f4ed8d13"},
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
        assert run.features - {"motion"} == {"heat", "softening"}
        assert run.frames.step.tolist() == [0, 25, 50, 75]
        assert run.model.grain_count == 120
        assert run.frames[-1].contacts.conductance.any()
        assert run.series["heat_stored"][-1] != 0.0


def test_finished_runs_are_extended_and_gone_on_from(kept):
    """Files of an earlier version become those of a longer run of that version; a new run takes its
    state from them.
    """
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

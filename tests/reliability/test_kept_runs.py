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
    "1.0": {"state": "2ae3f500353ecbb8613d2b8e9c9dc17d", "data": "0c8bfcff2d8d38b311a92bb1e5cbe290"},
    "1.1": {"state": "a140d97d08ee2e17966525b8847bc218", "data": "9396a85e97d7a9a6dbc5f0a36035deee"},
    "1.2": {"state": "a140d97d08ee2e17966525b8847bc218", "data": "cb483710705c0a45181747fd9b89858e"},
    "1.3": {"state": "a140d97d08ee2e17966525b8847bc218", "data": "4494cbc7af1b56efee3636843be94f1c"},
    "1.4": {"state": "dfdb5e315fa04a47d42fc1f74e1b868e", "data": "fbe65dac14f4bafe871cb87f003f7557"},
    "1.5": {"state": "8dc97564c954a3a34022099709bcdd0f", "data": "b4bd5b118105d11a345726e646f8fb5a"},
    "1.6": {"state": "78f457677568740a0c3aa2776527bd80", "data": "cc213d2391c55ee46d96bdbe67865cf7"},
    "1.7": {"state": "a083f81193bb2f21fdbe9ef30b74a4eb", "data": "76ef174568cb2cb41e21522a70bd62b1"},
    "1.8": {"state": "09e403bb139a797a9d4747edc8d06726", "data": "d618de367df62ea7dac57e9a42590767"},
    "1.9": {"state": "09e403bb139a797a9d4747edc8d06726", "data": "d618de367df62ea7dac57e9a42590767"},
    "1.10": {"state": "09e403bb139a797a9d4747edc8d06726", "data": "58866ef7cd5d3a32ae6ddaf511c9e75a"},
    "1.11": {"state": "2b4257971964b56be4c808d36d5da940", "data": "61c6f30eadb3a87e8d94b5097d322af2"},
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

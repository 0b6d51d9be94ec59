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
    "1.0": {"state": "0321226d1420d32a8f7af1734aa42a40", "data": "ab86d5dbb8220918d2a62792599e71d9"},
    "1.1": {"state": "43aac17c393292f2791a294100696c08", "data": "5edf75fa3b7bd464290c873d5ad7710c"},
    "1.2": {"state": "43aac17c393292f2791a294100696c08", "data": "14bf6f56800a8516ce1dc2484939edbe"},
    "1.3": {"state": "43aac17c393292f2791a294100696c08", "data": "3c6883d0914de68b0c87f0118711c04a"},
    "1.4": {"state": "4f215ede2509f6d59f1d94c9f6a79a23", "data": "23248a2e65ca5b49b3323b2e9ca1a06e"},
    "1.5": {"state": "cb1386b46f7048b17b972003338fd846", "data": "556427b02d1db6eefaa3748457d6247a"},
    "1.6": {"state": "354365f7a973edfb676b413845e5f33b", "data": "3c68c78f69d1de6e0fca48df9139adad"},
    "1.7": {"state": "c415c94f0b9e6ce53a064284f4794432", "data": "eaa788cda9cf47fe8f5b07a1437b5dba"},
    "1.8": {"state": "01ae0d5676f4996104a6fb6e99c8fd8f", "data": "42b1e385022bef0795e3820c21412239"},
    "1.9": {"state": "01ae0d5676f4996104a6fb6e99c8fd8f", "data": "42b1e385022bef0795e3820c21412239"},
    "1.10": {"state": "01ae0d5676f4996104a6fb6e99c8fd8f", "data": "1c6a74f2c37faaf2e8df9baaf956a4db"},
    "1.11": {"state": "a25a1a83a9c451054d7d632f78dac417", "data": "22984f10e01a25cdd6a1de6aac39ba87"},
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
        assert run.features - {"motion", "flux"} == {"heat", "softening"}
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

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
    "1.0": {"state": "7d7babbfe379f548abda789721c49952", "data": "edac8b38b91aa33a74d2226f85520e07"},
    "1.1": {"state": "84bc88b17024bfa29f65390be5db9899", "data": "22174d328cee121c7a19c9f96aa97178"},
    "1.2": {"state": "84bc88b17024bfa29f65390be5db9899", "data": "f98f1cc1941b500ea54656dad149341d"},
    "1.3": {"state": "84bc88b17024bfa29f65390be5db9899", "data": "38d87f07cc92379b404d4665bc1bb564"},
    "1.4": {"state": "8c20765bc467f38faca2eab7d9b49b6a", "data": "6f5804c096e7551b40b81e3323891aa6"},
    "1.5": {"state": "6dd66945ca116257167354904b712b01", "data": "c9ead8d583aa5ee7ba9ebda517361de4"},
    "1.6": {"state": "16194fb296bfef25ba76fdd4ee76dd6d", "data": "596aa5a17aa33b30e4a64f5741b81232"},
    "1.7": {"state": "d120359ca1d5e3b7766a98a2a80d09cc", "data": "c3f52eb4e15b89f9569510371bf39859"},
    "1.8": {"state": "f64ae86577e60345e6e2101bd7a848b8", "data": "2c9c50e2bb3b305ccd74f38fe01b178a"},
    "1.9": {"state": "f64ae86577e60345e6e2101bd7a848b8", "data": "2c9c50e2bb3b305ccd74f38fe01b178a"},
    "1.10": {"state": "f64ae86577e60345e6e2101bd7a848b8", "data": "991cd025febe77f980bc1f06780a02c7"},
    "1.11": {"state": "af61ca6e6b8169fef709a70c8f5eedcf", "data": "073cf36b0661dffe345041aba311f3b3"},
    "1.12": {"state": "244bc0d383e812f2aec1abe14a5ce43b", "data": "176679df54f772f09055a88caf84cd82"},
    "1.13": {"state": "c1ddd707c3e1915451306d8d08429f19", "data": "ed8f6d69031eaa38bae237116c4ab2db"},
    "1.14": {"state": "c1ddd707c3e1915451306d8d08429f19", "data": "ed8f6d69031eaa38bae237116c4ab2db"},
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

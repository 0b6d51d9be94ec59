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
    "1.0": {"state": "083bebcc11c6865faa104e2497513834", "data": "557f2b3ce1f999e304c5ea75f56f2647"},
    "1.1": {"state": "41f797c31b288df1b49c8185ed234244", "data": "ed1bb5ecb40d4cdb6e072856773086b4"},
    "1.2": {"state": "41f797c31b288df1b49c8185ed234244", "data": "7d83a7194cf753be8bfd69ec049f6531"},
    "1.3": {"state": "41f797c31b288df1b49c8185ed234244", "data": "bf5487a7966976262b22da18c644e829"},
    "1.4": {"state": "e03604ecb9d42740f065c0c7c0351906", "data": "df97971a3e524176958da8b42f62b23d"},
    "1.5": {"state": "c22d36e995c419d98146cb6a0a5c6748", "data": "869c1e00228271ea695b28406ecb555a"},
    "1.6": {"state": "70972fcc2bd696c7a5b58368168d86e3", "data": "6b3522347c5eff56e7363f567cb523ba"},
    "1.7": {"state": "fb3ff2e99b29b041ce81cdf65b48867a", "data": "e4992d72164edbed5505caab216f92b7"},
    "1.8": {"state": "e61a98ef0b45772e0ed5c4afff524a4a", "data": "598eba2dbb3987b8842b88c30ff287fb"},
    "1.9": {"state": "e61a98ef0b45772e0ed5c4afff524a4a", "data": "598eba2dbb3987b8842b88c30ff287fb"},
    "1.10": {"state": "e61a98ef0b45772e0ed5c4afff524a4a", "data": "dd6dec9d0c789986bfd8e42020dfb604"},
    "1.11": {"state": "d5f45548d1a9135fcf7b1f3e769f0197", "data": "d26ce9bf565cc4e486cd2fdcc7ebaef8"},
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

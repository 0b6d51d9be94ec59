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
    "1.0": {"state": "282d3a6848d8d583f2cc988296889879", "data": "e5b0a7005539e5cd0967e08346bb7c92"},
    "1.1": {"state": "5728bd89b9837022dcc2174ce568355f", "data": "f379a5bf212a2db215ad9e4df6a980b5"},
    "1.2": {"state": "5728bd89b9837022dcc2174ce568355f", "data": "70e79a6e148cbc192e96d4d25c3983c4"},
    "1.3": {"state": "5728bd89b9837022dcc2174ce568355f", "data": "95c1188c19f4d50112df811bb5196e8c"},
    "1.4": {"state": "ce663697e6f7debcbd563f1282ecd05c", "data": "450801abfaaa195cb539e27ca3831d32"},
    "1.5": {"state": "db6b4f6050298c7323fc811019229044", "data": "20919bf06887f1a1cee3a42f2f38ae05"},
    "1.6": {"state": "e4f9a3583de96e8bed7cfbc17a214de5", "data": "637a7d6758232e4502ca47db8fd8c21a"},
    "1.7": {"state": "b9585687dcbb64b9ab3bd00e7be7d577", "data": "c95e0dd1ba65728df8722a96de2d252b"},
    "1.8": {"state": "c0f2caf2965f76d2bd02fdfc83299872", "data": "324f128e2559d534a27ea10c40978d15"},
    "1.9": {"state": "c0f2caf2965f76d2bd02fdfc83299872", "data": "324f128e2559d534a27ea10c40978d15"},
    "1.10": {"state": "c0f2caf2965f76d2bd02fdfc83299872", "data": "e415bd8db9fc774395cad18150549615"},
    "1.11": {"state": "5f7c0bebd3727dd18abdf87d2b676a6b", "data": "2601c9eab4f9821b6cd249b70f2351a9"},
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

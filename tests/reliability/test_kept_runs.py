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
    "1.0": {"state": "a1dbe394a4c05446ff8a5e1764ab507d", "data": "51ecd6c5d1787ea05310fc5f8cbc33af"},
    "1.1": {"state": "af9ed9ad475b94420a93a417409d360a", "data": "8f316a29a08a2951660632c8d1d2a4bc"},
    "1.2": {"state": "af9ed9ad475b94420a93a417409d360a", "data": "8954dfe1afe2d646d5ce518dd120b9f5"},
    "1.3": {"state": "af9ed9ad475b94420a93a417409d360a", "data": "fe1fc7084c7944fc1504dfa289022c8d"},
    "1.4": {"state": "39ead0a54bacdbd0164b8d8aeb1aac2a", "data": "a609526df69ad611d0994718c703c8cb"},
    "1.5": {"state": "d072d45eb9aca62f5377d0df9804df26", "data": "284e84f07135cf6a870550cb33305655"},
    "1.6": {"state": "fcd716aa5344a66b89837f4eaa27e6e4", "data": "941deb33d77e3f182623ef6e72473fe2"},
    "1.7": {"state": "02480295e081e6f31bd7f18394a0902f", "data": "09a72d67a6553bc2161f3259968120c9"},
    "1.8": {"state": "6758752b1202714b55a4bf25642b3a8a", "data": "b85d2f9905685467b70f0d5dd5bb8af5"},
    "1.9": {"state": "6758752b1202714b55a4bf25642b3a8a", "data": "b85d2f9905685467b70f0d5dd5bb8af5"},
    "1.10": {"state": "6758752b1202714b55a4bf25642b3a8a", "data": "dd68cb8e7fc749ae09b37950e0edad07"},
    "1.11": {"state": "f5df7e51a26d2f6ffc06fa7b96f008dc", "data": "39b3700e1ffc689f28b8f5b8ce0bbf97"},
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

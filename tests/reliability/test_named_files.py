"""Whatever lies under a name that is given is read, or refused by one message; nothing is waited
for or fills the memory."""

import os
import shutil
import socket
import subprocess
from pathlib import Path

import pytest
from command_line import call
from scenes import SMALL, WARM, changed
from trials import thinned

pytestmark = pytest.mark.timeout(60, func_only=True)  # a fixture may compile

GRAINS = """sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 60
region = { min = [0.0, 0.001], max = [0.02, 0.009] }
packing = { kind = "random" }"""
PLANES = changed(
    SMALL,
    ('{ kind = "rough", from = [0.0, 0.0], to = [0.02, 0.0], side = "left" }',
        '{ kind = "plane", point = [0, 0], normal = [0, 1] }'),
    ('{ kind = "rough", from = [0.0, 0.01], to = [0.02, 0.01], side = "right" }',
        '{ kind = "plane", point = [0, 0.01], normal = [0, -1] }\nmass = 1.0'),
)  # fmt: skip
START = SMALL[SMALL.index("[[particles]]") : SMALL.index("[[walls]]")]
STUDY = '[study]\nname = "s"\nscenario = "small.toml"\n[vary]\nfile = "cases.csv"\n'

PACKED = (PLANES, GRAINS, 'packing = { kind = "file", path = "NAME" }')
KEYS = {
    "particles.0.packing.path": ("grains.csv", *PACKED),
    "particles.0.packing.path ": ("grains.h5", *PACKED),
    "particles.0.packing.path  ": ("a-run", PLANES, GRAINS, 'packing = { kind = "run", path = "NAME" }'),
    "particles.0.sizes": ("sizes.csv", SMALL, GRAINS.split("\n")[0], 'sizes = { kind = "table", file = "NAME" }'),
    "loading.1.drives.top.x.velocity": ("drive.csv", SMALL, "{ ramp = [0.0, 0.1], duration = 0.03 }", '{ file = "NAME" }'),
    "particles.0.temperature": ("heat.txt", WARM, "{ value = 300.0, gradient = [0.0, 2000.0] }", '{ file = "NAME" }'),
    "start.run": ("a-run", SMALL, START, '[start]\nrun = "NAME"\n'),
}  # fmt: skip
"""Keys of a scenario that name a file or a directory: a name, and the scenario with it."""


def write_naming(path, key, name=""):
    """Write a scenario whose key names a file; its name."""
    usual, text, old, new = KEYS[key]
    path.write_text(changed(text, (old, new.replace("NAME", name or usual))))
    return name or usual


def make_sparse(path):
    with path.open("wb") as file:
        file.truncate(1 << 36)


def make_socket(path):
    with socket.socket(socket.AF_UNIX) as place:
        place.bind(str(path))


def link(target):
    return lambda path: path.symlink_to(target)


def make_link_to_pipe(path):
    os.mkfifo(path.with_name("the-pipe"))
    path.symlink_to("the-pipe")


BAD = {
    "pipe": os.mkfifo,
    "link to a pipe": make_link_to_pipe,
    "endless device": link("/dev/zero"),
    "socket": make_socket,
    "directory": Path.mkdir,
    "link to itself": lambda path: path.symlink_to(path.name),
    "link to nothing": link("nowhere"),
    "file of 64 GiB": make_sparse,
    "file that says it has no bytes": link("/proc/self/pagemap"),
    "nothing": lambda path: None,
    "bytes": lambda path: path.write_bytes(bytes(range(256)) * 50),
}
"""What may lie under a name, and is neither a table nor a run."""


@pytest.mark.parametrize("what", thinned(BAD, 1))
@pytest.mark.parametrize("key", KEYS)
def test_keys_that_name_files(tmp_path, key, what):
    name = write_naming(tmp_path / "bad.toml", key)
    what(tmp_path / name)
    done = call("validate", "bad.toml", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert key.strip() in done.stderr
    assert name in done.stderr
    assert done.stderr.count("\n") == 3  # the message, the line of the file, the caret


ARGUMENTS = {
    "validate X.toml": {3}, "run X.toml": {3}, "study validate X.toml": {3},
    "study run X.toml": {3}, "bench bed --compare X.json": {2, 5}, "info X.h5": {5, 6, 7},
    "verify X.h5": {5, 6, 7}, "post series X.h5": {5, 6, 7}, "post compare X.h5 X.h5": {5, 6, 7},
    "export csv X.h5 -o out": {5, 6, 7}, "report X.h5 -o a.html": {5, 6, 7},
}  # fmt: skip
"""Commands that take a file, and exit codes that refuse it."""


@pytest.mark.parametrize("what", thinned(BAD, 3))
@pytest.mark.parametrize("words", ARGUMENTS)
def test_arguments_that_name_files(tmp_path, words, what):
    name = next(word for word in words.split() if word.startswith("X"))
    what(tmp_path / name)
    done = call(*words.split(), cwd=tmp_path)
    assert done.returncode in ARGUMENTS[words], done.stderr
    assert "internal error" not in done.stderr
    assert name in done.stderr + done.stdout


@pytest.mark.parametrize("what", thinned(BAD, 3))
def test_files_of_a_study(tmp_path, what):
    (tmp_path / "small.toml").write_text(SMALL)
    (tmp_path / "s.toml").write_text(STUDY)
    what(tmp_path / "cases.csv")
    done = call("study", "validate", "s.toml", cwd=tmp_path)
    assert done.returncode == 3
    assert "vary.file: " in done.stderr
    assert "cases.csv" in done.stderr


INSIDE = (
    "scenario.resolved.toml", "scenario.toml", "results.h5", "run.json", "lock", "progress.json",
    "checkpoints", "segments", "checkpoints/*.json", "checkpoints/*.h5",
)  # fmt: skip
"""Files of a run that something else may lie in place of."""

READERS = (
    "info run", "verify run", "post series run", "post map run --of velocity",
    "export csv run -o out --overwrite", "validate on.toml", "run same.toml -o run -q",
)  # fmt: skip

ANSWERS = {0, 2, 3, 5, 6, 7}


@pytest.mark.parametrize("what", ["pipe", "endless device", "file of 64 GiB", "directory"])
@pytest.mark.parametrize("inside", INSIDE)
def test_runs_whose_files_are_something_else(tmp_path, finished, inside, what):
    shutil.copytree(finished, tmp_path / "run", symlinks=True)
    write_naming(tmp_path / "on.toml", "start.run", "run")
    (tmp_path / "same.toml").write_text(SMALL)
    for file in sorted((tmp_path / "run").glob(inside)):
        shutil.rmtree(file) if file.is_dir() else file.unlink()
        BAD[what](file)
    for words in READERS:
        done = call(*words.split(), cwd=tmp_path)
        assert done.returncode in ANSWERS, (words, done.stderr)
        assert "internal error" not in done.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
@pytest.mark.parametrize("key", KEYS)
def test_files_that_may_not_be_read(tmp_path, key):
    name = write_naming(tmp_path / "bad.toml", key)
    (tmp_path / name).mkdir() if "." not in name else (tmp_path / name).write_text("x\n")
    (tmp_path / name).chmod(0)
    for folder in (tmp_path, *tmp_path.parents[:-2]):
        folder.chmod(folder.stat().st_mode | 0o055)
    pid = os.fork()
    if not pid:
        os.setgid(65534)
        os.setuid(65534)
        done = call("validate", "bad.toml", cwd=tmp_path)
        os._exit(done.returncode != 3 or key.strip() not in done.stderr or name not in done.stderr)
    assert os.waitpid(pid, 0)[1] == 0


ECHOES = (
    "NAME", "--NAME", "info NAME", "verify NAME", "post NAME", "post series NAME",
    "post series RUN --of NAME", "post map RUN --of NAME", "run same.toml -o NAME", "run NAME",
    "run same.toml --set NAME", "run same.toml --set a=NAME",
    "run same.toml --set scenario.name=NAME", "run same.toml --set loading.0.name=NAME", "new NAME",
    "new a --template NAME", "export csv RUN -o NAME", "report RUN -o NAME.html", "study run NAME",
    "bench NAME", "post map RUN --of speed --plot NAME.png",
)  # fmt: skip
"""Commands that say what they were given."""


@pytest.mark.parametrize("letter", thinned(["a", "a ", "\x1b[31m", "\n", "é"], 2))
@pytest.mark.parametrize("words", ECHOES)
def test_long_names_are_not_echoed_whole(tmp_path, finished, words, letter):
    (tmp_path / "same.toml").write_text(SMALL)
    name = (letter * 100_000)[:100_000]
    line = (word.replace("NAME", name).replace("RUN", str(finished)) for word in words.split())
    done = call(*line, cwd=tmp_path)
    assert done.returncode in ANSWERS - {0}, done.stderr[:500]
    assert "internal error" not in done.stderr
    assert len(done.stderr) < 8_000
    assert "\x1b" not in done.stderr


PLACES = {
    "many levels": "d/" * 2_000, "long path": "/".join(["d" * 200] * 30), "long name": "n" * 256,
    "link to itself": "loop", "below a link to itself": "loop/x",
    "below a link to nothing": "dangling/x", "below a file": "file/x", "below a pipe": "pipe/x",
    "below a device": "/dev/null/x", "processes": "/proc/x", "name that commands": "a\x1b[31m\nb",
}  # fmt: skip
"""Where nothing can be written, or hardly anything."""

WRITERS = {
    "run same.toml -q -o": "", "export csv RUN -o": "", "export gsd RUN -o": "",
    "report RUN -o": ".html", "post map RUN --of speed --plot": ".png",
}  # fmt: skip
"""Commands that write something of a name, and what it ends with."""


@pytest.mark.parametrize("name", thinned(PLACES, 2))
@pytest.mark.parametrize("words", WRITERS)
def test_places_where_nothing_can_be_written(tmp_path, finished, words, name, monkeypatch):
    # they take most of the time of a report
    monkeypatch.setattr("multicor_cli.report.make_figures", lambda run, books: [])
    (tmp_path / "same.toml").write_text(SMALL)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "dangling").symlink_to("nowhere/at/all")
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe")
    line = words.replace("RUN", str(finished)).split()
    done = call(*line, name.rstrip("/") + WRITERS[words], cwd=tmp_path)
    assert done.returncode in ANSWERS, done.stderr
    assert "internal error" not in done.stderr
    assert len(done.stderr) < 6_000
    # shutil.rmtree, which cleans up, calls itself at each level
    subprocess.run(["rm", "-rf", "d"], cwd=tmp_path, check=True)

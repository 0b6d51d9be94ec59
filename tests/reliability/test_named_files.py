"""Whatever lies under a name that is given is read, or refused by one message; nothing is waited
for or fills the memory.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from collections.abc import Callable
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
    (
        '{ kind = "rough", from = [0.0, 0.0], to = [0.02, 0.0], side = "left" }',
        '{ kind = "plane", point = [0, 0], normal = [0, 1] }',
    ),
    (
        '{ kind = "rough", from = [0.0, 0.01], to = [0.02, 0.01], side = "right" }',
        '{ kind = "plane", point = [0, 0.01], normal = [0, -1] }\nmass = 1.0',
    ),
)
RAMP = "{ ramp = [0.0, 0.1], duration = 0.03 }"
STUDY = '[study]\nname = "s"\nscenario = "{scenario}"\n[vary]\n{vary}\n'


def scenario_with(old: str, new: str, text: str = SMALL) -> Callable[[str], str]:
    return lambda name: changed(text, (old, new.replace("NAME", name)))


def on_start(name: str) -> str:
    begin, end = SMALL.index("[[particles]]"), SMALL.index("[[walls]]")
    return SMALL[:begin] + f'[start]\nrun = "{name}"\n' + SMALL[end:]


KEYS: dict[str, tuple[str, Callable[[str], str]]] = {
    "particles.0.packing.path": ("grains.csv", scenario_with(GRAINS, ('packing = { kind = "file", '
        'path = "NAME" }'), PLANES)),
    "particles.0.packing.path ": ("grains.h5", scenario_with(GRAINS, ('packing = { kind = "file", '
        'path = "NAME" }'), PLANES)),
    "particles.0.packing.path  ": ("a-run", scenario_with(GRAINS, ('packing = { kind = "run", '
        'path = "NAME" }'), PLANES)),
    "particles.0.sizes": ("sizes.csv", scenario_with(GRAINS.split("\n")[0], ('sizes = { kind = '
        '"table", file = "NAME" }'))),
    "loading.1.drives.top.x.velocity": ("drive.csv", scenario_with(RAMP, '{ file = "NAME" }')),
    "particles.0.temperature": (
        "heat.txt", scenario_with("{ value = 300.0, gradient = [0.0, 2000.0] }", ('{ file = '
            '"NAME" }'), WARM)
    ),
    "start.run": ("a-run", on_start),
}  # fmt: skip
"""Keys of a scenario that name a file or a directory: a name, and the scenario with it."""


def make_sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 36)


def make_socket(path: Path) -> None:
    place = socket.socket(socket.AF_UNIX)
    place.bind(str(path))
    place.close()


def link(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


def make_link_to_pipe(path: Path) -> None:
    os.mkfifo(path.with_name("the-pipe"))
    path.symlink_to("the-pipe")


BAD: dict[str, Callable[[Path], object]] = {
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
def test_keys_that_name_files(tmp_path: Path, key: str, what: Callable[[Path], object]) -> None:
    name, text = KEYS[key]
    what(tmp_path / name)
    (tmp_path / "bad.toml").write_text(text(name))
    done = call("validate", "bad.toml", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert key.strip() in done.stderr
    assert name in done.stderr
    assert done.stderr.count("\n") == 3  # the message, the line of the file, the caret


@pytest.mark.parametrize("what", thinned(BAD, 3))
@pytest.mark.parametrize(
    "words", ["validate X.toml", "run X.toml", "study validate X.toml", "study run X.toml",
              "bench bed --compare X.json",
              "info X.h5", "verify X.h5", "post series X.h5", "post compare X.h5 X.h5",
              "export csv X.h5 -o out", "report X.h5 -o a.html"]
)  # fmt: skip
def test_arguments_that_name_files(
    tmp_path: Path, words: str, what: Callable[[Path], object]
) -> None:
    name = next(word for word in words.split() if word.startswith("X"))
    what(tmp_path / name)
    done = call(*words.split(), cwd=tmp_path)
    assert done.returncode in (
        {2, 5} if "bench" in words else {3} if ".toml" in words else {5, 6, 7}
    ), done.stderr
    assert "internal error" not in done.stderr
    assert name in done.stderr + done.stdout


@pytest.mark.parametrize("what", thinned(BAD, 3))
def test_files_of_a_study(tmp_path: Path, what: Callable[[Path], object]) -> None:
    (tmp_path / "small.toml").write_text(SMALL)
    (tmp_path / "s.toml").write_text(STUDY.format(scenario="small.toml", vary='file = "cases.csv"'))
    what(tmp_path / "cases.csv")
    done = call("study", "validate", "s.toml", cwd=tmp_path)
    assert done.returncode == 3
    assert "vary.file: " in done.stderr
    assert "cases.csv" in done.stderr


INSIDE = ("scenario.resolved.toml", "scenario.toml", "results.h5", "run.json", "lock",
    "progress.json", "checkpoints", "segments",
          "checkpoints/*.json", "checkpoints/*.h5")  # fmt: skip
"""Files of a run that something else may lie in place of."""

WORST = ("pipe", "directory", "file of 64 GiB", "endless device")

ANSWERS = {0, 2, 3, 5, 6, 7}


@pytest.mark.parametrize(
    "what",
    thinned(
        {name: BAD[name] for name in ("pipe", "endless device", "file of 64 GiB", "directory")}, 1
    ),
)
@pytest.mark.parametrize("inside", INSIDE)
def test_runs_whose_files_are_something_else(
    tmp_path: Path, finished: Path, inside: str, what: Callable[[Path], object]
) -> None:
    shutil.copytree(finished, tmp_path / "run", symlinks=True)
    (tmp_path / "on.toml").write_text(on_start("run"))
    (tmp_path / "same.toml").write_text(SMALL)
    for file in sorted((tmp_path / "run").glob(inside)):
        shutil.rmtree(file) if file.is_dir() else file.unlink()
        what(file)
    for words in ("info run", "verify run", "post series run", "post map run --of velocity",
        "export csv run -o out --overwrite",
                  "validate on.toml", "run same.toml -o run -q"):  # fmt: skip
        done = call(*words.split(), cwd=tmp_path)
        assert done.returncode in ANSWERS, (words, done.stderr)
        assert "internal error" not in done.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
@pytest.mark.parametrize("key", KEYS)
def test_files_that_may_not_be_read(tmp_path: Path, key: str) -> None:
    name, text = KEYS[key]
    (tmp_path / name).mkdir() if "." not in name else (tmp_path / name).write_text("x\n")
    (tmp_path / name).chmod(0)
    (tmp_path / "bad.toml").write_text(text(name))
    for folder in (tmp_path, *tmp_path.parents[:-2]):
        folder.chmod(folder.stat().st_mode | 0o055)
    pid = os.fork()
    if not pid:
        os.setgid(65534)
        os.setuid(65534)
        done = call("validate", "bad.toml", cwd=tmp_path)
        os._exit(
            0 if done.returncode == 3 and key.strip() in done.stderr and name in done.stderr else 1
        )
    assert os.waitpid(pid, 0)[1] == 0


ECHOES = (
    "NAME", "--NAME", "info NAME", "verify NAME", "post NAME", "post series NAME",
    "post series RUN --of NAME",
    "post map RUN --of NAME", "run same.toml -o NAME", "run NAME", "run same.toml --set NAME",
    "run same.toml --set a=NAME",
    "run same.toml --set scenario.name=NAME", "run same.toml --set loading.0.name=NAME", "new NAME",
    "new a --template NAME",
    "export csv RUN -o NAME", "report RUN -o NAME.html", "study run NAME", "bench NAME",
    "post map RUN --of speed --plot NAME.png",
)  # fmt: skip
"""Commands that say what they were given."""


@pytest.mark.parametrize("letter", thinned(["a", "a ", "\x1b[31m", "\n", "é"], 2))
@pytest.mark.parametrize("words", ECHOES)
def test_long_names_are_not_echoed_whole(
    tmp_path: Path, finished: Path, words: str, letter: str
) -> None:
    (tmp_path / "same.toml").write_text(SMALL)
    name = (letter * 100_000)[:100_000]
    done = call(
        *(word.replace("NAME", name).replace("RUN", str(finished)) for word in words.split()),
        cwd=tmp_path,
    )
    assert done.returncode in ANSWERS - {0}, done.stderr[:500]
    assert "internal error" not in done.stderr
    assert len(done.stderr) < 8_000
    assert "\x1b" not in done.stderr


PLACES = {
    "many levels": "d/" * 2_000, "long path": "/".join(["d" * 200] * 30), "long name": "n" * 256,
    "link to itself": "loop",
    "below a link to itself": "loop/x", "below a link to nothing": "dangling/x",
    "below a file": "file/x", "below a pipe": "pipe/x",
    "below a device": "/dev/null/x", "processes": "/proc/x", "name that commands": "a\x1b[31m\nb",
}  # fmt: skip
"""Where nothing can be written, or hardly anything."""


@pytest.mark.parametrize("name", thinned(PLACES, 2))
@pytest.mark.parametrize(
    "words",
    [
        "run same.toml -q -o",
        "export csv RUN -o",
        "export gsd RUN -o",
        "report RUN -o",
        "post map RUN --of speed --plot",
    ],
)
def test_places_where_nothing_can_be_written(
    tmp_path: Path, finished: Path, words: str, name: str
) -> None:
    (tmp_path / "same.toml").write_text(SMALL)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "dangling").symlink_to("nowhere/at/all")
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe")
    ending = {"report": ".html", "post": ".png"}.get(words.split()[0], "")
    done = call(
        *words.replace("RUN", str(finished)).split(), name.rstrip("/") + ending, cwd=tmp_path
    )
    assert done.returncode in ANSWERS, done.stderr
    assert "internal error" not in done.stderr
    assert len(done.stderr) < 6_000
    # shutil.rmtree, which cleans up, calls itself at each level
    subprocess.run(["rm", "-rf", "d"], cwd=tmp_path, check=True)

"""Damages copies of runs and looks at them as users do; a process of its own, as it may crash.

Each line of stdin is a case: ``[kind of run, file, damage, seed]``. Each line of stdout says what
came of it.
"""

import hashlib
import json
import random
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from store_support import continue_run, ends_of, errors_of

from multicor_cli.running.outcome import exit_code_of
from multicor_cli.store import open_run, run_info

PAGE = 4096


def flip(data: bytes, choose: random.Random) -> bytes:
    damaged = bytearray(data)
    damaged[choose.randrange(len(data))] ^= 1 << choose.randrange(8)
    return bytes(damaged)


def cut(data: bytes, choose: random.Random) -> bytes:
    return data[: choose.randrange(len(data))]


def zero_page(data: bytes, choose: random.Random) -> bytes:
    start = choose.randrange(0, len(data), PAGE)
    return data[:start] + bytes(len(data[start : start + PAGE])) + data[start + PAGE :]


def shift(data: bytes, choose: random.Random) -> bytes:
    """A byte too many somewhere."""
    at = choose.randrange(len(data))
    return data[:at] + bytes([choose.randrange(256)]) + data[at:]


BYTES: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "flip": flip, "cut": cut, "zero": zero_page, "shift": shift,
}  # fmt: skip


def damage(file: Path, how: str, seed: int, other: Path) -> bool:
    """Damage a file; False if that changes nothing."""
    before = file.read_bytes()
    file.chmod(0o644)
    if how in BYTES:
        file.write_bytes(BYTES[how](before, random.Random(seed)))
    elif how == "empty":
        file.write_bytes(b"")
    elif how == "gone":
        file.unlink()
    elif how == "foreign":
        file.unlink()
        with h5py.File(file, "w") as foreign:
            foreign["x"] = np.arange(10.0)
    elif how == "another run's":
        file.write_bytes(other.read_bytes())
    elif how == "sibling's":
        siblings = sorted(
            path for path in file.parent.glob(f"*{file.suffix}") if path != file and path.is_file()
        )
        if siblings:
            file.write_bytes(siblings[0].read_bytes())
    else:
        raise ValueError(how)
    return not file.exists() or file.read_bytes() != before


def read_all(path: Path) -> str:
    """Digest of all that a user can read."""
    total = hashlib.blake2b(digest_size=16)
    with open_run(path) as run:
        for frame in run.frames:
            for name in ("step", "time", "position", "angle", "velocity", "spin"):
                total.update(np.ascontiguousarray(getattr(frame, name)).tobytes())
            for name in ("i", "j", "normal", "gap", "impulse", "slip", "sliding"):
                total.update(np.ascontiguousarray(getattr(frame.contacts, name)).tobytes())
        for name in run.series:
            total.update(np.ascontiguousarray(run.series[name]).tobytes())
        total.update(run.model.grains.radius.tobytes())
        total.update((run.scenario_source + run.scenario_resolved).encode())
        if path.is_file():  # a directory has more than one file that tells
            total.update(json.dumps(run.info, sort_keys=True).encode())
    return total.hexdigest()


def read_state(path: Path) -> str:
    """Digest of the state from which the run goes on."""
    with open_run(path) as run:
        state = run.state()
        return state.digest() if state else "none"


def opened(run: Path) -> Path:
    """What a user opens: the directory of a run, or the only file in it."""
    return run if (run / "run.json").exists() else run / "results.h5"


def contents_of(path: Path, scratch: Path) -> set[str]:
    """Digests of what may be read of the run: all, or nothing after its newest checkpoint."""
    found = {read_all(opened(path))}
    manifest = scratch / "segments" / "MANIFEST.jsonl"
    shutil.copytree(path, scratch, symlinks=True)
    if manifest.exists():
        newest = max((scratch / "checkpoints").glob("*.json"))
        count = len(json.loads(newest.read_text())["segments"])
        manifest.write_bytes(b"".join(manifest.read_bytes().splitlines(keepends=True)[:count]))
        found.add(read_all(scratch))
    shutil.rmtree(scratch)
    return found


def states_of(path: Path, scratch: Path) -> set[str]:
    """Digests of all states that the run has saved."""
    if opened(path) != path:
        return {"none"}
    shutil.copytree(path, scratch, symlinks=True)
    found = set()
    for sidecar in sorted((scratch / "checkpoints").glob("*.json"), reverse=True):
        found.add(read_state(scratch))
        sidecar.unlink()
    found.add(read_state(scratch))
    shutil.rmtree(scratch)
    return found


def attempt(action: Callable[[Path], Any], path: Path) -> tuple[int, Any]:
    """Exit code that the command line would give, and the result or the message."""
    try:
        return 0, action(path)
    except Exception as error:
        return int(exit_code_of(error)), f"{type(error).__name__}: {error}"


def continued(path: Path) -> tuple[str, str]:
    """Digests of the end; a file alone is at its end."""
    if path.is_dir():
        continue_run(path)
    return ends_of(path)


def main(runs: Path, others: Path, scratch: Path) -> None:
    whole = {kind.name: contents_of(kind, scratch) for kind in sorted(runs.iterdir())}
    states = {kind: states_of(runs / kind, scratch) for kind in whole}
    ends = {}
    for kind in whole:
        shutil.copytree(runs / kind, scratch, symlinks=True)
        ends[kind] = attempt(continued, opened(scratch))[1]
        shutil.rmtree(scratch)
    for line in sys.stdin:
        kind, name, how, seed = json.loads(line)
        shutil.copytree(runs / kind, scratch, symlinks=True)
        path = opened(scratch)
        is_changed = damage(scratch / name, how, seed, others / kind / name)
        findings = attempt(errors_of, path)
        reading, value = attempt(read_all, path)
        state, digest = attempt(read_state, path)
        info, _ = attempt(run_info, path)
        going_on, end = attempt(continued, path)
        result = {
            "changed": is_changed,
            "noticed": findings[0] != 0 or bool(findings[1]),
            "codes": [findings[0], reading, state, info, going_on],
            "same": (reading != 0 or value in whole[kind])
            and (state != 0 or digest in states[kind]),
            "same_end": going_on != 0 or end == ends[kind],
            "message": [findings[1], value, digest, end],
        }
        print(json.dumps(result, default=str), flush=True)
        shutil.rmtree(scratch)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))

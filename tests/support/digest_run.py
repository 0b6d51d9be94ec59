"""Runs the cases of `digest_cases`, and sets their digests beside the frozen ones."""

import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import tomli_w
from digest_cases import CASES, Case
from places import DATA

import multicor_cli as multicor
from multicor_cli.store import run_info

FROZEN = DATA / "digests.toml"

_HEAD = """\
# What the short runs of tests/support/digest_cases.py end with, on every machine. `python
# tests/digests` compares this machine with them, `python tests/digests --write` freezes them again:
# a change of results, which belongs into CHANGELOG.md.

"""

Digests = dict[str, dict[str, str]]


def run_cases(
    names: Iterable[str], folder: Path, threads: int, say: Callable[[str], None] = lambda _: None
) -> Digests:
    """Run cases (and those they start from) into directories of their names; digests by name."""
    found: Digests = {}
    for name in names:
        for each in (CASES[name].after, name):
            if each and each not in found:
                found[each] = run_case(each, CASES[each], folder, threads)
                say(f"{each}: {found[each]['state']}")
    return found


def run_case(name: str, case: Case, folder: Path, threads: int) -> dict[str, str]:
    """Run one case into ``folder/name``; its digests."""
    if isinstance(case.source, Path):
        path = case.source
    else:
        path = folder / f"{name}.toml"
        path.write_text(case.source, encoding="utf-8")
    multicor.run(path, folder / name, overrides=case.overrides, threads=threads)
    return digests_of(folder / name)


def digests_of(directory: Path) -> dict[str, str]:
    """``state_digest`` and ``data_digest`` of a finished run."""
    info = run_info(directory)
    if info["status"] != "finished":
        message = f"{directory} is {info['status']}"
        raise ValueError(message)
    return {"state": info["state_digest"], "data": info["data_digest"]}


def frozen() -> Digests:
    return tomllib.loads(FROZEN.read_text(encoding="utf-8"))


def freeze(found: Digests) -> None:
    """Write digests in the order of the cases; those of cases that are not in ``found`` stay."""
    known = {**(frozen() if FROZEN.exists() else {}), **found}
    FROZEN.write_text(
        _HEAD + tomli_w.dumps({name: known[name] for name in CASES if name in known}),
        encoding="utf-8",
    )


def differences(found: Digests) -> list[str]:
    """What is not as frozen, one line a case."""
    known = frozen() if FROZEN.exists() else {}
    lines = []
    for name, digests in found.items():
        before = known.get(name)
        if before is None:
            lines.append(f"{name}: new")
        elif before != digests:
            what = [key for key in ("state", "data") if before[key] != digests[key]]
            lines.append(
                f"{name}: {' and '.join(what)} changed from {before[what[0]]} to {digests[what[0]]}"
            )
    return lines

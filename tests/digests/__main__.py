"""Compares what short runs give on this machine with their frozen digests, or freezes them anew.

python tests/digests [--threads N] [--json FILE] [CASE ...]   compare; exit code 1 if any differs
python tests/digests --write                                  freeze, and say what has changed
"""

import argparse
import functools
import json
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from digest_cases import CASES  # noqa: E402
from digest_run import FROZEN, differences, freeze, run_cases  # noqa: E402

WHY = """\
Results of the program have changed. If that was not meant, find out why before anything else. If
it was: digests are what users compare runs with, and what says that two machines agree, so
CHANGELOG.md gets an entry under "Results change" that says what changed, in which scenarios, by how
much, and why."""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python tests/digests", description=__doc__.splitlines()[0]
    )
    some = f"cases to run; all if none is named: {', '.join(CASES)}"
    parser.add_argument("cases", nargs="*", metavar="CASE", help=some)
    parser.add_argument("--threads", type=int, default=1, help="threads of each run (default 1)")
    parser.add_argument("--write", action="store_true", help="freeze what comes out")
    into = "write what comes out into FILE too"
    parser.add_argument("--json", type=Path, metavar="FILE", help=into)
    options = parser.parse_args(arguments)
    unknown = sorted(set(options.cases) - set(CASES))
    if unknown:
        parser.error(f"no such case: {', '.join(unknown)}")
    with tempfile.TemporaryDirectory() as folder:
        names, say = options.cases or list(CASES), functools.partial(print, flush=True)
        found = run_cases(names, Path(folder), options.threads, say)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    changed = differences(found)
    for line in changed:
        print(f"differs: {line}")
    print(f"{len(found) - len(changed)} of {len(found)} cases as frozen")
    if changed:
        print(WHY)
    if options.write:
        freeze(found)
        print(f"wrote {FROZEN}")
        return 0
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())

"""Are the reliability tests worth something? Take away each safeguard in turn, and see a test fail.

    python tests/reliability/mutations.py            # all
    python tests/reliability/mutations.py fsync lock # those whose names contain one of the words

Each mutant of ``mutants.toml`` is a copy of the repository with one change; the tests named beside it must fail there. Exit code
1 if one survives. Fields of a state are taken away by `test_saved_states.py` itself.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Mutant:
    """One safeguard less.

    Attributes:
        name: What is taken away.
        file: Where.
        before: Text of the program, which must occur once.
        after: What stands there instead.
        tests: Test files, in ``tests``, one of which must fail.
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]


def read_mutants() -> list[Mutant]:
    with (Path(__file__).parent / "mutants.toml").open("rb") as file:
        return [Mutant(**entry) for entry in tomllib.load(file)["mutants"]]


def main(words: list[str]) -> int:
    chosen = [mutant for mutant in read_mutants() if not words or any(word in mutant.name for word in words)]
    survivors = 0
    for mutant in chosen:
        killer = first_failure(mutant)
        survivors += killer is None
        print(f"| {mutant.name} | {killer or 'SURVIVES |'} |", flush=True)
    print(f"{len(chosen)} mutants, {survivors} survive")
    return 1 if survivors else 0


def first_failure(mutant: Mutant) -> str | None:
    """The test that fails first, of the short forms or else of the long ones, and why."""
    with tempfile.TemporaryDirectory() as directory:
        copy = Path(directory) / "repository"
        skipped = shutil.ignore_patterns("__pycache__", ".*", "runs", "docs", "benchmarks")
        shutil.copytree(ROOT, copy, ignore=skipped)
        file = copy / mutant.file
        file.write_text(file.read_text().replace(mutant.before, mutant.after))
        for form in ("not reliability", "reliability"):
            arguments = [
                *(f"tests/{test}" for test in mutant.tests),
                "-x",
                "-m",
                form,
                "-p",
                "no:cacheprovider",
                "--basetemp",
                f"{directory}/tmp",
            ]
            done = subprocess.run(
                [sys.executable, "-m", "pytest", *arguments],
                cwd=copy,
                env={**os.environ, "PYTHONPATH": str(copy)},
                capture_output=True,
                text=True,
                check=False,
            )
            failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
            if failed:
                reasons = [line.split(maxsplit=1)[1] for line in done.stdout.splitlines() if line.startswith("E  ")]
                return f"{failed[0].split()[1].rpartition('/')[2]} | {reasons[0][:100] if reasons else ''}"
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

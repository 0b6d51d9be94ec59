"""Are the reliability tests worth something? Take away each safeguard in turn, and see a test fail.

    python tests/reliability/mutations.py            # all
    python tests/reliability/mutations.py fsync lock # those whose names contain one of the words

Each mutant of ``mutants.toml`` is a copy of the repository with one change; the tests named beside
it must fail there, and pass without the change. Exit code 1 if one survives, 2 if a test fails
without any change.

Fields of a state are taken away by `test_saved_states.py` itself.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FORMS = ("not reliability", "reliability")
"""Markers of the short forms of the tests, and of the long ones."""


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
        files = tomllib.load(file)
    return [
        Mutant(name, path, before, after, tuple(tests))
        for path, entries in files.items()
        for name, (before, after, *tests) in entries.items()
    ]


def main(words: list[str]) -> int:
    mutants = read_mutants()
    chosen = [m for m in mutants if not words or any(word in m.name for word in words)]
    survivors = 0
    with tempfile.TemporaryDirectory() as directory:
        # Always the same, so that Numba finds the kernels that it has compiled
        copy = Path(directory) / "repository"
        for tests in dict.fromkeys(mutant.tests for mutant in chosen):
            make_copy(copy)
            failure = first_failure(copy, tests, FORMS[:1])
            if failure is not None:
                print(f"fails without any mutant: {failure}")
                return 2
        for mutant in chosen:
            make_copy(copy)
            file = copy / mutant.file
            file.write_text(file.read_text().replace(mutant.before, mutant.after))
            killer = first_failure(copy, mutant.tests, FORMS)
            survivors += killer is None
            print(f"| {mutant.name} | {killer or 'SURVIVES |'} |", flush=True)
    print(f"{len(chosen)} mutants, {survivors} survive")
    return 1 if survivors else 0


def make_copy(copy: Path) -> None:
    """The repository as it is, anew."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(
        ROOT, copy, ignore=shutil.ignore_patterns("__pycache__", ".*", "runs", "benchmarks")
    )


def first_failure(copy: Path, tests: tuple[str, ...], forms: tuple[str, ...]) -> str | None:
    """The test that fails first, of the short forms or else of the long ones, and why."""
    for form in forms:
        files = (f"tests/{test}" for test in tests)
        options = ["-x", "-p", "no:cacheprovider", "--basetemp", str(copy.parent / "tmp")]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *files, *options, "-m", form],
            cwd=copy, env={**os.environ, "PYTHONPATH": str(copy)},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        lines = done.stdout.splitlines()
        failed = [line.split()[1] for line in lines if line.startswith(("FAILED", "ERROR"))]
        if failed:
            reasons = [line.removeprefix("E").strip() for line in lines if line.startswith("E  ")]
            return f"{failed[0].rpartition('/')[2]} | {next(filter(None, reasons), '')[:100]}"
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Frozen digests on as many machines as this one can pretend to be: a table of what holds.

    python tests/digests/machines.py [--oldest] [--aarch64 FOLDER] [--only TEXT]

``--oldest`` makes an environment with the oldest dependencies that pyproject.toml admits;
``--aarch64`` takes a root directory that `tests/digests/aarch64.sh` has made; ``--only`` leaves out
machines whose names do not contain a text.
"""

import argparse
import functools
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]

# Names of one feature differ between versions of the C library: those it does not know it passes
# over.
GLIBC = (
    "glibc.cpu.hwcaps=-AVX512F,-AVX512DQ,-AVX512BW,-AVX512VL,-AVX2,-FMA,-FMA4,-AVX2_Usable,"
    "-FMA_Usable"
)
# Kernels of OpenBLAS
BLAS = ("Prescott", "Haswell") if platform.machine() == "x86_64" else ("ARMV8", "NEOVERSEN1")


def optional_features() -> str:
    """What NumPy may use beyond its baseline."""
    from numpy._core import _multiarray_umath

    return " ".join(_multiarray_umath.__cpu_dispatch__)


def another_machine() -> dict[str, str]:
    """An environment without any optional instruction."""
    return {
        "NPY_DISABLE_CPU_FEATURES": optional_features(),
        "GLIBC_TUNABLES": GLIBC,
        "OPENBLAS_CORETYPE": BLAS[0],
        "NUMBA_CPU_NAME": "generic",
    }


def machines() -> dict[str, tuple[dict[str, str], int]]:
    """Name, environment and number of threads of each."""
    every = another_machine()
    return {
        **{f"{count} thread{'s' if count > 1 else ''}": ({}, count) for count in (1, 2, 4)},
        **{
            f"{name}={value}": ({name: value}, 2)
            for name, value in every.items()
            if name != "OPENBLAS_CORETYPE"
        },
        **{f"OPENBLAS_CORETYPE={kernel}": ({"OPENBLAS_CORETYPE": kernel}, 2) for kernel in BLAS},
        "all of these": (every, 2),
    }


def oldest(folder: Path) -> str:
    """Interpreter of a new environment with the oldest dependencies."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        wanted = tomllib.load(file)["project"]["dependencies"]
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    pip = [str(folder / "bin" / "python"), "-m", "pip", "install", "-q"]
    subprocess.run([*pip, *(item.replace(">=", "==") + ".*" for item in wanted)], check=True)
    return str(folder / "bin" / "python")


def check(python: list[str], environment: dict[str, str], threads: int) -> str:
    """Last words of a comparison: how many digests are as frozen; what differs otherwise."""
    return last_words([*python, str(HERE), "--threads", str(threads)], environment)


def last_words(command: list[str], environment: dict[str, str]) -> str:
    done = subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    lines = [
        line
        for line in done.stdout.splitlines()
        if line.startswith("differs: ") or line.endswith("as frozen")
    ]
    return "; ".join(lines) if lines else f"failed: {done.stderr.strip()[-300:]}"


def emulated(root: Path) -> str:
    """The same in a root directory of another architecture; the package and the tests are copied
    there first."""
    target = root / "opt" / "multicor"
    shutil.rmtree(target, ignore_errors=True)
    # With the times of the files: kernels of unchanged ones stay compiled
    for name in ("multicor_cli", "tests", "configs"):
        shutil.copytree(ROOT / name, target / name, ignore=shutil.ignore_patterns("__pycache__"))
    clean = ["env", "-i", "HOME=/root", "PATH=/usr/bin:/bin", "PYTHONPATH=/opt/site"]
    program = ["python3", "/opt/multicor/tests/digests"]
    return last_words(["chroot", str(root), *clean, *program], {})


def _results(options: argparse.Namespace, folder: Path) -> Iterator[tuple[str, Callable[[], str]]]:
    """Names of machines, and how each is asked."""
    for name, (environment, threads) in machines().items():
        yield name, functools.partial(check, [sys.executable], environment, threads)
    if options.oldest:
        cache = {"NUMBA_CACHE_DIR": str(folder / "cache")}
        yield "oldest dependencies", lambda: check([oldest(folder / "venv")], cache, 2)
    if options.aarch64:
        yield "AArch64 (QEMU)", lambda: emulated(options.aarch64)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python tests/digests/machines.py", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--oldest", action="store_true", help="the oldest dependencies too")
    root = "a root directory of AArch64 too (tests/digests/aarch64.sh)"
    parser.add_argument("--aarch64", type=Path, metavar="FOLDER", help=root)
    some = "only machines whose names contain it"
    parser.add_argument("--only", default="", metavar="TEXT", help=some)
    options = parser.parse_args(arguments)
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "numba", "h5py"))
    print(f"{platform.machine()}, Python {platform.python_version()}, {versions}\n")
    print("| machine | digests |\n|---|---|", flush=True)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name, result in _results(options, Path(folder)):
            if options.only in name:
                found.append(result())
                print(f"| {name} | {found[-1]} |", flush=True)
    return 0 if all(result.split()[0] == result.split()[2] for result in found) else 1


if __name__ == "__main__":
    sys.exit(main())

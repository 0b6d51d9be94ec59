"""What `multicor validate` predicts for the shipped scenarios, and what they took:
``python benchmarks/estimates [NAME…]``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
LEFT_OUT = {"million"}
COLUMNS = (
    "scenario",
    "steps at most",
    "done",
    "said [s]",
    "took [s]",
    "said/took",
    "frames",
    "said [MB]",
    "took [MB]",
    "a frame",
)


def main() -> None:
    """Run the scenarios and print a table."""
    known = sorted(
        path.stem for path in (ROOT / "configs").glob("*.toml") if path.stem not in LEFT_OUT
    )
    parser = argparse.ArgumentParser(prog="python benchmarks/estimates", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenarios [all but the million]")
    names = parser.parse_args().names or known
    if unknown := set(names) - set(known):
        parser.error(f"no scenario {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    print(" | ".join(COLUMNS), flush=True)
    with tempfile.TemporaryDirectory(prefix="estimates-") as folder:
        for name in names:
            print(" | ".join(_row(name, Path(folder))), flush=True)


def _row(name: str, folder: Path) -> list[str]:
    scenario, run = str(ROOT / "configs" / f"{name}.toml"), folder / name
    _multicor("run", scenario, "--dry-run", "--quiet")  # compiles, which no estimate includes
    _multicor("run", scenario, "-o", str(run), "--quiet")
    said: dict[str, Any] = json.loads(_multicor("validate", scenario, "--json"))["estimate"]
    found: dict[str, Any] = json.loads(_multicor("info", str(run), "--json"))
    took, size = found["timings"]["wall"], (run / "results.h5").stat().st_size
    seconds, megabytes = said["wall_seconds"], 1e-6 * said["disk_bytes"]
    per_frame = (said["disk_bytes"] / said["frames"]) / (size / found["frame_count"])
    return [
        name, str(said["steps"]), str(found["step"]), f"{seconds:.1f}", f"{took:.1f}",
        f"{seconds / took:.2f}",
        str(found["frame_count"]), f"{megabytes:.1f}", f"{1e-6 * size:.1f}", f"{per_frame:.2f}",
    ]  # fmt: skip


def _multicor(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "multicor_cli", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        sys.exit(f"multicor {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


if __name__ == "__main__":
    main()

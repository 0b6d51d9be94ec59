"""What studies cost beside the runs themselves.

    python benchmarks/studies short [CASES]   # short runs on two workers, and one by one
    python benchmarks/studies idle [CASES …]  # cases that do nothing: what the rest costs
"""  # fmt: skip

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PER_ROUND = 10

STUDY = """\
[study]
name = "s"
scenario = "{scenario}"
{seeds}

[set]
"solver.dt" = 2e-4
"loading.0.until.strain.value" = {strain}

[vary]
"contacts.0.friction" = {{ from = 0.2, to = 0.8, count = {count} }}

[[observe]]
name = "mu"
series = "kinetic"

[compute]
workers = 2
"""


def main() -> None:
    """Run one of the measurements."""
    parser = argparse.ArgumentParser(
        prog="python benchmarks/studies",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    commands = parser.add_subparsers(required=True)
    short = commands.add_parser("short", help="short runs on two workers")
    short.add_argument("cases", nargs="?", type=int, default=200)
    short.set_defaults(act=lambda asked: measure_short(asked.cases))
    idle = commands.add_parser("idle", help="cases that do nothing")
    idle.add_argument("cases", nargs="*", type=int, default=[1000, 3000, 10_000])
    idle.set_defaults(act=lambda asked: measure_idle(asked.cases))
    asked = parser.parse_args()
    asked.act(asked)


def measure_short(cases: int) -> None:
    """Wall time of a study over half the time of its runs alone, and over that of the same runs two
    at a time by hand.
    """
    with tempfile.TemporaryDirectory(prefix="studies-") as folder:
        base = Path(folder)
        text = STUDY.format(
            scenario=ROOT / "configs" / "shear-gravity-free.toml", seeds="", strain=0.3, count=cases
        )
        (base / "s.toml").write_text(text)
        values = [
            case["values"]
            for case in _multicor(base, "study", "status", "s.toml", "--json")["cases"]
        ]
        _alone(base, values[0], "warm")  # compiles
        before = [_alone(base, row, f"before-{k}") for k, row in enumerate(_some(values))]
        both_before = _two_by_two(base, values, "pairs-before")
        started = time.monotonic()
        _multicor(base, "study", "run", "s.toml", "--quiet", "--json")
        took = time.monotonic() - started
        after = [_alone(base, row, f"after-{k}") for k, row in enumerate(_some(values))]
        both_after = _two_by_two(base, values, "pairs-after")
        alone, pairs = statistics.mean(before + after), statistics.mean([both_before, both_after])
    print(f"cases                                     {cases}")
    print(f"a run alone, mean of {len(before + after)} [s]               {alone:.2f}")
    print(
        f"a run of two at a time by hand [s]        {pairs:.2f} of both cores: "
        f"{2.0 * pairs / alone:.2f} of a run alone each"
    )
    print(f"the study [s]                             {took:.1f}")
    print(f"over half the runs alone                  {took / (0.5 * cases * alone):.3f}")
    print(f"over the runs two at a time by hand       {took / (cases * pairs):.3f}")


def _some(values: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return values[:: max(1, len(values) // PER_ROUND)][:PER_ROUND]


def _alone(base: Path, values: dict[str, Any], name: str) -> float:
    """Seconds of a run by ``multicor run`` on one thread."""
    changes = {"solver.dt": 2e-4, "loading.0.until.strain.value": 0.3, **values}
    words = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    started = time.monotonic()
    scenario = str(ROOT / "configs" / "shear-gravity-free.toml")
    _multicor(base, "run", scenario, "-o", name, "--threads", "1", "--quiet", *words, is_json=False)
    return time.monotonic() - started


def _two_by_two(base: Path, values: list[dict[str, Any]], name: str) -> float:
    """Seconds of a run, two at a time on two cores: what a perfect study would take for each."""
    chosen = _some(values)
    started = time.monotonic()
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda pair: _alone(base, pair[1], f"{name}-{pair[0]}"), enumerate(chosen)))
    return (time.monotonic() - started) / len(chosen)


def measure_idle(counts: list[int]) -> None:
    """Time and memory of everything but the runs, each number of cases in a process of its own."""
    print(
        (
            "cases | check [s] | first pass [s] | a case [ms] | nothing left [s] | status [s] | "
            "table [s] | client [MB]"
        ),
        flush=True,
    )
    for count in counts:
        done = subprocess.run(
            [sys.executable, __file__, "idle-one", str(count)],
            env=_environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        print(done.stdout.strip() or done.stderr, flush=True)


def idle_one(count: int) -> None:
    """One line of the table."""
    sys.path.insert(0, str(ROOT))
    from multicor_cli.studies import computing
    from multicor_cli.studies.session import StudySession

    computing.run_case = do_nothing  # everything else is as it is
    with tempfile.TemporaryDirectory(prefix="studies-") as folder:
        (Path(folder) / "s.toml").write_text(
            STUDY.format(
                scenario=ROOT / "configs" / "shear-gravity-free.toml",
                seeds="",
                strain=0.3,
                count=count,
            )
        )
        os.chdir(folder)
        session = StudySession.open("s.toml")
        check = _timed(session.check)
        predicted = check[1]
        first = _timed(lambda: session.compute(predicted=predicted))
        assert first[1].finished == count, first[1]
        again = _timed(session.compute)
        status = _timed(session.states)
        table = _timed(lambda: session.table().csv())
        assert table[1].count("finished") == count
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(
        f"{count} | {check[0]:.1f} | {first[0]:.1f} | {1e3 * first[0] / count:.1f} | "
        f"{again[0]:.1f} | {status[0]:.2f} | {table[0]:.2f} | {memory:.0f}"
    )


def _timed(act: Any) -> tuple[float, Any]:
    started = time.monotonic()
    found = act()
    return time.monotonic() - started, found


def do_nothing(task: dict[str, Any]) -> dict[str, Any]:
    """Stands for a run: leaves what a finished one leaves for the study to read."""
    from multicor_cli.studies.observing import _digest
    from multicor_cli.studies.study_file import Observable

    path = Path(task["directory"])
    path.mkdir()
    (path / "run.json").write_text(json.dumps({"status": "finished", "summary": {"step": 1}}))
    numbers = {_digest(Observable.model_validate(row)): [0.5, 0.1] for row in task["observe"]}
    kept = {"numbers": numbers, "verdict": "ok", "digest": "0", "hours": 0.0}
    (path.parent.parent / "observed" / f"{path.name}.json").write_text(json.dumps(kept))
    return {"status": "finished", "reason": "finished", "exit_code": 0, "step": 1}


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def _multicor(base: Path, *arguments: str, is_json: bool = True) -> Any:
    words = [sys.executable, "-m", "multicor_cli", *arguments]
    done = subprocess.run(
        words, cwd=base, env=_environment(), capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        sys.exit(f"multicor {' '.join(arguments)}: {done.stderr.strip()}")
    return json.loads(done.stdout) if is_json else None


if __name__ == "__main__":
    if sys.argv[1:2] == ["idle-one"]:
        idle_one(int(sys.argv[2]))
    else:
        main()

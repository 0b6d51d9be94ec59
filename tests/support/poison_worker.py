"""Runs a scenario with a spoiled state; a process of its own, as nonsense may crash the code.

Each line of stdin is a case: ``[field, entry, value, step]``. Each line of stdout is its outcome:
exit code, message, step of the last checkpoint, row of the entry, and whether frames and checkpoint
are sound.
"""

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli import run as run_scenario
from multicor_cli.running import session as session_module
from multicor_cli.running.outcome import exit_code_of
from multicor_cli.store import open_run, verify

OVERRIDES = "output.checkpoint_interval=0.01", "materials.steel.expansion=1e-6"


def main(scenario: Path, directory: Path) -> None:
    original = session_module.Engine.step
    case: list[Any] = []
    row = [0]

    def step(self: Any, *arguments: Any, **options: Any) -> Any:
        field, entry, value, at = case
        if self.state.step == at:
            values = getattr(self.state, field)
            if field in ("contact_impulse", "mean_force"):
                values[:] = value  # single ones may be those of contacts that open
            elif isinstance(values, np.ndarray):
                values.reshape(-1)[entry % values.size] = value
                row[0] = entry % values.size // max(1, values.size // len(values))
            else:
                setattr(self.state, field, value)
        return original(self, *arguments, **options)

    session_module.Engine.step = step  # type: ignore[method-assign]
    for line in sys.stdin:
        case[:] = json.loads(line)
        case[2] = float(case[2])
        print(json.dumps({**outcome(scenario, directory), "row": row[0]}), flush=True)
        shutil.rmtree(directory)


def outcome(scenario: Path, directory: Path) -> dict[str, Any]:
    code, message = 0, ""
    try:
        run_scenario(scenario, directory, overrides=OVERRIDES)
    except Exception as error:
        code, message = int(exit_code_of(error)), f"{type(error).__name__}: {error}"
    with open_run(directory) as run:
        state = run.state()
        assert state is not None
        return {
            "code": code,
            "message": message,
            "checkpoint": state.step,
            "last_frame": int(run.frames.step[-1]),
            "findings": [f"{finding.file}: {finding.message}" for finding in verify(directory)],
        }


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

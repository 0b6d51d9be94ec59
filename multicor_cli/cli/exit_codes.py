"""Exit codes of the command line, and which error gives which.

| code | meaning |
|---|---|
| 0 | done, or already finished |
| 1 | internal error: a bug of ours; the traceback is in ``crash.txt`` |
| 2 | the command line is wrong |
| 3 | the scenario is invalid, or not the one that the run began with |
| 4 | physics: non-finite state, no admissible positions, solver failed by request |
| 5 | environment: disk full, no permission, out of memory, missing library, environment variable with a wrong value |
| 6 | the output exists, or another live run holds it |
| 7 | data damaged, or made by an incompatible version |
| 75 | stopped at the time limit, resumable |
| 129, 130, 143 | stopped by SIGHUP, Ctrl-C, SIGTERM after a checkpoint |
"""

from __future__ import annotations

import sys

from multicor_cli.running.outcome import ExitCode as ExitCode

_BY_CLASS = {
    ("multicor_cli.scenario.problems", "ScenarioError"): ExitCode.SCENARIO,
    ("multicor_cli.engine.contact.report", "PhysicsError"): ExitCode.PHYSICS,
    ("multicor_cli.post.source", "PostError"): ExitCode.USAGE,
    ("multicor_cli.plots.style", "PlotError"): ExitCode.ENVIRONMENT,
    ("multicor_cli.engine.jit.layer", "NoThreadingLayer"): ExitCode.ENVIRONMENT,
    ("multicor_cli.model.nudge", "NudgeError"): ExitCode.ENVIRONMENT,
    ("multicor_cli.bench.recorded", "RecordError"): ExitCode.USAGE,
}


def exit_code_of(error: BaseException) -> ExitCode:
    """Exit code for an error that a command raised; modules that have not been imported cannot have raised it."""
    for (module, name), code in _BY_CLASS.items():
        if module in sys.modules and isinstance(error, getattr(sys.modules[module], name)):
            return code
    store = sys.modules.get("multicor_cli.store.errors")
    if store is not None and isinstance(error, store.StoreError):
        return ExitCode(error.exit_code)
    if isinstance(error, KeyboardInterrupt):
        return ExitCode.INTERRUPTED
    return ExitCode.ENVIRONMENT if isinstance(error, OSError | MemoryError) else ExitCode.BUG

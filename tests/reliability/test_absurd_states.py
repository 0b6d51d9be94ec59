"""Values that are not finite, or absurd, stop the run where they are; what is on disk stays
right."""

import json
import re
from dataclasses import fields

import numpy as np
from command_line import python
from places import SUPPORT
from scenes import WARM
from trials import trials

from multicor_cli.model import State

VALUES = ("nan", "inf", "-inf", "1e308", "-1e308")
EMPTY = (
    "stage_notes", "wall_origin", "wall_surface", "heat_before", "wall_ahead", "released",
    "outlet_flow", "exchange", "adhesion_books", "nonaffine", "gradient_books",
)  # fmt: skip
"""The conditions of these stages have nothing to note, no wall has to know where it was, no surface
runs, the run does not go on from another, no wall has a heat capacity, no grain comes or goes, nothing adheres, and there is no cell."""

FLOATS = tuple(
    f.name
    for f in fields(State)
    if "Ints" not in str(f.type) and "int" not in str(f.type) and f.name not in EMPTY
)
"""Fields of a state that hold numbers with a fraction."""

REPLACED = {
    "time": "follows from the start of the stage",
    "stage_peak": "a maximum, which -inf and -1e308 never are",
    "tallies": "some are maxima too",
    "contact_impulse": "the solver goes on with its own; every step writes them anew",
    "last_dt": "scales the first guess of the next solve and nothing else; every step sets it anew",
    "wall_velocity": "of a wall that moves as it is told: a step takes over what it is told",
    "wall_temperature": "taken anew from the conditions of the walls in every step with heat",
    "heat_dt": "a first guess, which the length of the step bounds",
    "heat_books": "two of its entries are those of the last step",
}
"""Fields that a step may make right by itself, and why."""

OF_GRAINS = {name: name for name in ("position", "velocity", "heat", "wear", "radius")} | {
    "generated": "heat generated"
}
"""Fields with a row per grain, and what messages call them."""

ROWS = {"books": 12}
"""Entries that are kept from step to step; those after them follow from the others."""


def spoil(tmp_path, cases):
    """What became of the runs in which ``(field, row, value, step)`` was changed."""
    (tmp_path / "warm.toml").write_text(WARM)
    given = "".join(f"{json.dumps(case)}\n" for case in cases)
    done = python(SUPPORT / "poison_worker.py", "warm.toml", "run", cwd=tmp_path, given=given)
    outcomes = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"{cases[len(outcomes)]}: {done.returncode}\n{done.stderr}"
    return outcomes


def test_fields_are_all_that_have_a_fraction():
    assert len(FLOATS) == 29
    assert set(REPLACED) < set(FLOATS)


@trials(short=1, long=5)
def test_spoiled_states_stop_the_run(tmp_path, count):
    """Every field of the state (in CI every other one), spoiled in a moving step, in a frozen one,
    and after it."""
    rng = np.random.default_rng(9)
    steps = (7, 13, 19, 23, 27)
    cases = [
        (name, int(rng.integers(0, 450)) % ROWS.get(name, 450), value, steps[(k + index) % 5])
        for k in range(count)
        for index, name in enumerate(FLOATS)
        if count > 1 or index % 2 == 0
        for value in (VALUES if count > 1 else VALUES[index % 2 : index % 2 + 1])
    ]
    wrong = []
    for case, found in zip(cases, spoil(tmp_path, cases), strict=True):
        name, _row, _value, step = case
        named = re.search(r"PhysicsError: step (\d+): .* is (not finite|absurd)", found["message"])
        is_stopped = (
            found["code"] == 4
            and named is not None
            and step <= int(named[1]) <= step + 2  # rows of series are 2 steps apart
            and (
                name not in OF_GRAINS
                or f"{OF_GRAINS[name]} of grain {found['row']} is" in found["message"]
            )
        )
        is_right = is_stopped or (found["code"] == 0 and name in REPLACED)
        is_late = is_stopped and max(found["checkpoint"], found["last_frame"]) > step
        if not is_right or found["findings"] or is_late:
            wrong.append((case, found))
    assert not wrong, "\n".join(map(str, wrong))

"""A scenario that has been loaded and found right, with all that other packages ask about it."""

from __future__ import annotations

import secrets
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ConfigDict, Field

from multicor_cli.model.cell import CELL
from multicor_cli.scenario.documents import to_document, to_override
from multicor_cli.scenario.drives import WallCondition
from multicor_cli.scenario.load import apply_overrides, read_tables, read_text
from multicor_cli.scenario.materials import ContactPair
from multicor_cli.scenario.particles import MOTION
from multicor_cli.scenario.problems import Refused, ScenarioError, Sources
from multicor_cli.scenario.settings import Solver
from multicor_cli.scenario.sizes import Sizes
from multicor_cli.scenario.stage_drives import (
    KeptCondition,
    StageDrives,
    cell_drives,
    resolve_conditions,
    stage_drives,
)
from multicor_cli.scenario.stages import frozen_dt
from multicor_cli.scenario.tables import ScenarioModel
from multicor_cli.scenario.walls import Wall
from multicor_cli.text import count_noun

SEED_BITS = 53
NO_FILE = "scenario.toml"
"""Name of the file of a scenario that comes from none."""


class Scenario(ScenarioModel):
    """A valid scenario.

    The tables are attributes, named as in the file: ``scenario.domain.size``,
    ``scenario.particles[0].packing.kind``; all defaults are filled in. Two scenarios are equal if
    their tables are, wherever they come from.

    Attributes:
        path: The file it comes from; without one the name that it would have.
        sources: Its text and what has changed it; gives problems found later their positions.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    path: Path = Field(exclude=True)
    sources: Sources = Field(exclude=True)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], directory: str | Path = ".") -> Scenario:
        """A scenario from Python values: tables as dicts, arrays as lists, tuples or of NumPy.

        It is checked as a file is, and messages name the keys. ``"= 2 * d"`` is an expression.

        Args:
            data: The tables, as ``{"scenario": {"name": "bed", "seed": 1}, "domain": {…}, …}``;
                SI units.
            directory: To which paths in it are relative.

        Raises:
            ScenarioError: Its ``problems`` say all that is wrong, or has no value in TOML.
        """
        return parse_scenario(to_document(data), Path(directory) / NO_FILE, file="")

    def with_(self, changes: Mapping[str, Any]) -> Scenario:
        """A changed copy, checked again: to the bit what ``--set`` makes of the file.

        Expressions are evaluated again, with variables as changed. A seed that was drawn stays.

        Args:
            changes: Values by dotted keys with 0-based indices, as
                ``{"loading.1.duration": 2.0, "variables.angle": 26}``; applied in this order, after
                what the scenario has been changed by before.

        Raises:
            ScenarioError: There is no such key, or the changed scenario is wrong.
        """
        changed = self.with_overrides([to_override(key, value) for key, value in changes.items()])
        return changed.with_drawn(self.seed)

    def with_drawn(self, seed: int) -> Scenario:
        """The same, with this ``seed`` where one is to be drawn."""
        if self.given["scenario"]["seed"] != "random":
            return self
        header = self.scenario.model_copy(update={"seed": seed})
        return self.model_copy(update={"scenario": header})

    def with_overrides(self, overrides: Sequence[str]) -> Scenario:
        """As `with_`; the changes as ``--set`` takes them, each ``key=value``."""
        text, every = self.sources.text, [*self.sources.overrides, *overrides]
        return parse_scenario(text, self.path, every, file=self.sources.file)

    @property
    def name(self) -> str:
        """Name of the scenario and of its run directory."""
        return self.scenario.name

    @property
    def description(self) -> str:
        """What the scenario is about."""
        return self.scenario.description

    @property
    def seed(self) -> int:
        """Seed of all random numbers; where the file says ``"random"``, the one that was drawn."""
        return int(self.scenario.seed)

    @property
    def given(self) -> dict[str, Any]:
        """The tables as the file says them, with changes, but neither defaults nor evaluated."""
        tables = tomllib.loads(self.sources.text)
        apply_overrides(tables, self.sources.overrides)
        return tables

    @property
    def variables(self) -> dict[str, float]:
        """``[variables]``: the values that expressions have used."""
        return self.given_variables or {}

    @property
    def is_open(self) -> bool:
        """Whether grains may come or go, or end the run by getting lost."""
        releases = [group for group in self.particles if group.release]
        return bool(self.outlets or releases) or self.domain.lost != "ignore"

    def law(self, a: str, b: str, stage: int | None = None) -> ContactPair:
        """The contact law of materials ``a`` and ``b``: the most specific entry that covers them.

        With the index of a ``stage`` its friction is what the last stage up to this one says that
        covers the pair.

        Raises:
            KeyError: No entry covers the pair (only pairs that can touch need one).
        """
        covering = [entry for entry in self.contacts if entry.covers(a, b)]
        if not covering:
            raise KeyError(f"no contact law for '{a}' and '{b}'")
        law = max(covering, key=lambda entry: entry.specificity)
        for earlier in self.loading[: 0 if stage is None else stage + 1]:
            changes = [entry for entry in earlier.contacts if entry.covers(a, b)]
            if changes:
                law = law.model_copy(
                    update={"friction": max(changes, key=lambda entry: entry.specificity).friction}
                )
        return law

    def glued_sizes(self, wall: Wall) -> Sizes | None:
        """Sizes of the glued grains of a wall; ``None`` if it has no glued grains."""
        glued = wall.geometry.glued()
        if glued is None:
            return None
        if glued.sizes is None:
            return self.particles[0].sizes
        if isinstance(glued.sizes, str):
            return next(group.sizes for group in self.particles if group.name == glued.sizes)
        return glued.sizes

    def stage_solver(self, stage: int) -> Solver:
        """``[solver]`` with what the stage of this index overrides, its time step included.

        Of a frozen stage that is the interval at which temperatures are evaluated.
        """
        table = self.loading[stage]
        changes = table.solver.model_dump(exclude_none=True) if table.solver else {}
        if table.frozen:
            changes["dt"] = frozen_dt(table, self.output)
        elif table.dt is not None:
            changes["dt"] = table.dt
        return self.solver.model_copy(update=changes)

    def drives(self, wall_names: tuple[str, ...] | None = None) -> list[StageDrives]:
        """The drives of all stages; walls in the order of the file, or of ``wall_names``.

        Of a cell, which is the one wall of its run, they are those of its components.
        """
        if self.domain.is_cell:
            return cell_drives(self.loading)
        names = wall_names if wall_names is not None else tuple(wall.name for wall in self.walls)
        return stage_drives(self.loading, names)

    def wall_conditions(
        self, wall_names: tuple[str, ...] | None = None
    ) -> list[list[KeptCondition]]:
        """The thermal condition of each wall in each stage; walls as in the file, or as named.

        A cell exchanges no heat with its grains.
        """
        first: dict[str, WallCondition | None] = {wall.name: wall.thermal for wall in self.walls}
        if self.domain.is_cell:
            first = {CELL: None}
        names = wall_names if wall_names is not None else tuple(first)
        return resolve_conditions(self.loading, first, names)

    def resolve_path(self, path: str) -> Path:
        """A path of the scenario, which is relative to the directory of its file."""
        return self.path.parent / path

    def refuse(self, *refused: Refused) -> ScenarioError:
        """The error about what is found wrong later, at keys as ``("walls", 1, "geometry")``."""
        return ScenarioError([self.sources.problem(each) for each in refused])

    def as_dict(self) -> dict[str, Any]:
        """All tables, with defaults and changes, evaluated; `from_dict` makes an equal scenario."""
        tables = self.model_dump(by_alias=True, exclude_none=True)
        if self.domain.cell_rates is not None:  # else grains would not move with the mean flow
            for table, group in zip(tables["particles"], self.particles, strict=True):
                for key in {*MOTION} - group.model_fields_set:
                    del table[key]
        return tables

    def resolved_toml(self) -> str:
        """What `as_dict` holds, as TOML; loads back to an equal scenario."""
        return tomli_w.dumps(self.as_dict())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self.as_dict() == other.as_dict()

    __hash__ = None  # type: ignore[assignment]  # tables hold dictionaries

    def __repr__(self) -> str:
        counts = ((self.particles, "group"), (self.walls, "wall"), (self.loading, "stage"))
        parts = [count_noun(len(tables), noun) for tables, noun in counts]
        return f"<Scenario {self.name}: {', '.join(parts)}, seed {self.seed}>"

    __str__ = __repr__


def load_scenario(path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Load and check a scenario file.

    Args:
        path: The TOML file.
        overrides: Values set on the command line, as ``loading.1.duration=2.0``.

    Raises:
        ScenarioError: The file is unreadable or wrong; its ``problems`` say all that is wrong.
    """
    path = Path(path)
    return parse_scenario(read_text(path), path, overrides)


def parse_scenario(
    text: str, path: str | Path, overrides: Sequence[str] = (), *, file: str | None = None
) -> Scenario:
    """As `load_scenario` with the text given: ``path`` is for messages and relative paths only.

    Messages call it ``file`` if that is given; empty: they name keys only.

    Raises:
        ScenarioError: The scenario is wrong.
    """
    model, sources = read_tables(text, Path(path), overrides, str(path) if file is None else file)
    tables = dict(model)
    if model.scenario.seed == "random":
        tables["scenario"] = model.scenario.model_copy(update={"seed": secrets.randbits(SEED_BITS)})
    return Scenario.model_construct(**tables, path=Path(path), sources=sources)

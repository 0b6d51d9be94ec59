"""A scenario that has been loaded and found right, with everything that other packages ask about it."""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from multicor_cli.scenario.checks.grains import region_of
from multicor_cli.scenario.drives import StageDrives, stage_drives
from multicor_cli.scenario.loading import KeptCondition, Stage, frozen_dt, resolve_conditions
from multicor_cli.scenario.materials import ContactPair, Heat, Material
from multicor_cli.scenario.models import ScenarioModel
from multicor_cli.scenario.particles import Outlet, ParticleGroup, Start
from multicor_cli.scenario.problems import Refused, ScenarioError
from multicor_cli.scenario.region import Region
from multicor_cli.scenario.settings import Domain, Output, Solver
from multicor_cli.scenario.sizes import AnySizes
from multicor_cli.scenario.sources import Sources
from multicor_cli.scenario.walls import Wall
from multicor_cli.text import count_noun

SEED_BITS = 53
NO_FILE = "scenario.toml"
"""Name of the file of a scenario that comes from none."""


@dataclass(frozen=True, repr=False)
class Scenario:
    """A valid scenario.

    The tables are attributes, named as in the file: ``scenario.domain.size``, ``scenario.particles[0].packing.kind``.
    Two scenarios are equal if their tables are, wherever they come from.

    Attributes:
        model: All tables, defaults filled in. A seed ``"random"`` has been replaced by the number drawn.
        path: The file it comes from; of a scenario that comes from none the name that one would have.
        sources: Gives problems found later their positions.
    """

    model: ScenarioModel
    path: Path = field(compare=False)
    sources: Sources = field(compare=False, repr=False)

    def __post_init__(self) -> None:
        """Draw the seed once if it is ``"random"``."""
        if self.model.scenario.seed == "random":
            header = self.model.scenario.model_copy(update={"seed": secrets.randbits(SEED_BITS)})
            object.__setattr__(self, "model", self.model.model_copy(update={"scenario": header}))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], directory: str | Path = ".") -> Scenario:
        """A scenario from Python values: the tables of a file as dicts, its arrays as lists, tuples or arrays of NumPy.

        It is checked as a file is, and messages name the keys. ``"= 2 * d"`` is an expression here too.

        Args:
            data: The tables, as ``{"scenario": {"name": "bed", "seed": 1}, "domain": {…}, …}``. SI units.
            directory: To which paths in it are relative.

        Raises:
            ScenarioError: The scenario is wrong, or holds what TOML has no value for; its ``problems`` say all that is wrong.
        """
        from multicor_cli.scenario.load import parse_scenario
        from multicor_cli.scenario.values import to_document

        return parse_scenario(to_document(data), Path(directory) / NO_FILE, file="")

    def with_(self, changes: Mapping[str, Any]) -> Scenario:
        """A changed copy, checked anew: to the bit what ``--set`` makes of the file.

        Expressions are evaluated again, with changed variables where these change. A seed that was drawn stays.

        Args:
            changes: Values by dotted keys with 0-based indices, as ``{"loading.1.duration": 2.0, "variables.angle": 26}``; applied
                in this order, after what the scenario has been changed by before.

        Raises:
            ScenarioError: There is no such key, or the changed scenario is wrong.
        """
        from multicor_cli.scenario.values import to_override

        drawn = to_override("scenario.seed", self.seed)  # it may be "random" in the file
        return self.with_overrides([drawn, *(to_override(key, value) for key, value in changes.items())])

    def with_overrides(self, overrides: Sequence[str]) -> Scenario:
        """As `with_`; the changes as ``--set`` takes them, each ``key=value``."""
        from multicor_cli.scenario.load import parse_scenario

        return parse_scenario(self.source, self.path, [*self.sources.overrides, *overrides], file=self.sources.file)

    @property
    def source(self) -> str:
        """Text of the file, as it was read (line ends as in Unix, no byte order mark)."""
        return self.sources.text

    @property
    def name(self) -> str:
        """Name of the scenario and of its run directory."""
        return self.model.scenario.name

    @property
    def description(self) -> str:
        """What the scenario is about."""
        return self.model.scenario.description

    @property
    def seed(self) -> int:
        """Seed of all random numbers."""
        return int(self.model.scenario.seed)

    @property
    def variables(self) -> dict[str, float]:
        """``[variables]``: the values that expressions have used."""
        return self.model.variables or {}

    @property
    def domain(self) -> Domain:
        """``[domain]``."""
        return self.model.domain

    @property
    def materials(self) -> dict[str, Material]:
        """``[materials.NAME]`` by name, in the order of the file."""
        return self.model.materials

    @property
    def contacts(self) -> tuple[ContactPair, ...]:
        """``[[contacts]]``."""
        return self.model.contacts

    @property
    def start(self) -> Start | None:
        """``[start]``; None if the run does not go on from another."""
        return self.model.start

    @property
    def particles(self) -> tuple[ParticleGroup, ...]:
        """``[[particles]]``."""
        return self.model.particles

    @property
    def walls(self) -> tuple[Wall, ...]:
        """``[[walls]]``."""
        return self.model.walls

    @property
    def outlets(self) -> tuple[Outlet, ...]:
        """``[[outlets]]``."""
        return self.model.outlets

    @property
    def is_open(self) -> bool:
        """Whether grains may come or go, or end the run by getting lost."""
        return bool(self.outlets) or self.domain.lost != "ignore" or any(group.release for group in self.particles)

    @property
    def loading(self) -> tuple[Stage, ...]:
        """``[[loading]]``."""
        return self.model.loading

    @property
    def heat(self) -> Heat | None:
        """``[heat]``; None if there is no heat."""
        return self.model.heat

    @property
    def solver(self) -> Solver:
        """``[solver]``; see `stage_solver` for what holds in a stage."""
        return self.model.solver

    @property
    def output(self) -> Output:
        """``[output]``."""
        return self.model.output

    def law(self, a: str, b: str, stage: int | None = None) -> ContactPair:
        """The contact law of the materials ``a`` and ``b``: of the entries that cover the pair the most specific.

        With the index of a ``stage`` its friction is what the last stage up to this one says that covers the pair.

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
                law = law.model_copy(update={"friction": max(changes, key=lambda entry: entry.specificity).friction})
        return law

    def region(self, group: ParticleGroup) -> Region:
        """Where a group is placed: its region, or the whole domain."""
        return region_of(group, self.domain)

    def glued_sizes(self, wall: Wall) -> AnySizes | None:
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

        The time step of a frozen stage is the interval at which temperatures are evaluated.
        """
        table = self.loading[stage]
        changes = table.solver.model_dump(exclude_none=True) if table.solver else {}
        if table.frozen:
            changes["dt"] = frozen_dt(table, self.output)
        elif table.dt is not None:
            changes["dt"] = table.dt
        return self.solver.model_copy(update=changes)

    def drives(self, wall_names: tuple[str, ...] | None = None) -> list[StageDrives]:
        """The drives of all stages; walls in the order of the file, or of ``wall_names``."""
        names = wall_names if wall_names is not None else tuple(wall.name for wall in self.walls)
        return stage_drives(self.loading, names)

    def wall_conditions(self, wall_names: tuple[str, ...] | None = None) -> list[list[KeptCondition]]:
        """The thermal condition of each wall in each stage; walls in the order of the file, or of ``wall_names``."""
        first = {wall.name: wall.thermal for wall in self.walls}
        return resolve_conditions(self.loading, first, wall_names if wall_names is not None else tuple(first))

    def resolve_path(self, path: str) -> Path:
        """A path of the scenario, which is relative to the directory of its file."""
        return self.path.parent / path

    def refuse(self, *refused: Refused) -> ScenarioError:
        """The error that tells what has been found wrong later, with the positions of the keys, as ``("walls", 1, "geometry")``."""
        return ScenarioError([self.sources.problem(each) for each in refused])

    def as_dict(self) -> dict[str, Any]:
        """All tables with defaults and changes filled in and expressions evaluated; `from_dict` makes an equal scenario of them."""
        return self.model.model_dump(by_alias=True, exclude_none=True)

    def resolved_toml(self) -> str:
        """What `as_dict` holds, as TOML; loads back to an equal scenario."""
        import tomli_w

        return tomli_w.dumps(self.as_dict())

    def __repr__(self) -> str:
        counts = ((self.particles, "group"), (self.walls, "wall"), (self.loading, "stage"))
        return f"<Scenario {self.name}: {', '.join(count_noun(len(tables), noun) for tables, noun in counts)}, seed {self.seed}>"

"""What the user said: models of the TOML file, loading, positions of problems."""

from multicor_cli.scenario.drives import StageDrives, stage_drives
from multicor_cli.scenario.load import load_scenario, parse_scenario
from multicor_cli.scenario.problems import Problem, ScenarioError
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.schema import scenario_schema, schema_text
from multicor_cli.scenario.templates import TEMPLATES, new_scenario

__all__ = [
    "TEMPLATES",
    "Problem",
    "Scenario",
    "ScenarioError",
    "StageDrives",
    "load_scenario",
    "new_scenario",
    "parse_scenario",
    "scenario_schema",
    "schema_text",
    "stage_drives",
]

from .problems import Refused as Refused
from .problems import ScenarioError as ScenarioError
from .scenario import Scenario as Scenario
from .scenario import load_scenario as load_scenario
from .scenario import parse_scenario as parse_scenario

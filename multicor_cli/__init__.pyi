from .checks import check_run as check_run
from .checks import check_scenario as check_scenario
from .engine.orders import PhysicsError as PhysicsError
from .plots.grain_map import picture as picture
from .running import run as run
from .running.outcome import Observer as Observer
from .running.outcome import RunOutcome as RunOutcome
from .running.outcome import StageTimeout as StageTimeout
from .running.outcome import Status as Status
from .running.steering import LiveRun as LiveRun
from .scenario.problems import ScenarioError as ScenarioError
from .scenario.scenario import Scenario as Scenario
from .scenario.scenario import load_scenario as load_scenario
from .store.errors import StoreError as StoreError
from .store.frames import Contacts as Contacts
from .store.frames import Frame as Frame
from .store.reader import Run as Run
from .store.reader import open_run as open_run
from .studies import study as study

__version__: str

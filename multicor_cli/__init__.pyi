from .checks import check_run as check_run
from .checks import check_scenario as check_scenario
from .plots.notebook import picture as picture
from .running import run as run
from .scenario.load import load_scenario as load_scenario
from .scenario.scenario import Scenario as Scenario
from .store.reader import open_run as open_run
from .studies import study as study

__version__: str

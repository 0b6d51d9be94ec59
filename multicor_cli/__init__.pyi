from .running import run as run
from .scenario.load import load_scenario as load_scenario
from .store.reader import open_run as open_run

__version__: str

"""From a scenario to the initial `Model` and `State`.

Names are loaded when they are first used: a plan needs the contact laws alone, and no grain.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

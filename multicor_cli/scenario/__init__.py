"""What the user said: models of the TOML file, loading, positions of problems.

Names are loaded when they are first used: whoever only reads runs needs none of the models.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""One time step of rigid grains with friction and heat, and the contact solver on its own.

Names are loaded when they are first used: importing this package does not load Numba.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

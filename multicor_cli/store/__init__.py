"""Files of a run: segments, checkpoints, results, reading and verifying them.

Names are loaded when they are first used: importing this package loads neither numpy nor h5py.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Frames of a run in the formats of other programs.

Names are loaded when first used: importing this package loads none of the libraries it needs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

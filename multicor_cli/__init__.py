"""multicor: thermomechanics of two-dimensional granular flows. Importing this package loads nothing heavy."""

__version__ = "0.1.0"

"""How kernels are compiled and kept: decorators, cache, threading layer, elementary functions."""

"""How kernels are compiled and kept: decorators, the cache, the threading layer, elementary
functions of arrays.
"""

"""Formulas of heat: one module per mechanism, each with its source and a statement of validity.

Plain scalar functions of floats in SI units and kelvin, like everything in `multicor_cli.physics`. Those that kernels compile
call no other function of ours, so that each can be compiled by itself; where this repeats an expression, a test holds the two
equal. Nothing is checked here: what makes sense is decided where a scenario is read.
"""

"""The contact problem of a step: its contacts, its law, its sweeps, and the errors of its
solution.
"""

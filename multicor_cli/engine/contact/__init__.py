"""The contact problem of a step: its contacts, law and sweeps, and the errors of its solution."""

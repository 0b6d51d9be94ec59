"""Figures of the tables that `post` makes."""

"""Scalar formulas, undecorated, so that they can be tested without compilation."""

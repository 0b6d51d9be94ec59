"""Grains that come and go between two steps: releases, outlets, the edge of the domain, and what
that does to the books.
"""

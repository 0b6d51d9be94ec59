"""Grains that come and go between two steps: releases, outlets, the edge of the domain, books."""

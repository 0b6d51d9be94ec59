"""How bodies move: predicted and final positions, drives of walls, and the correction of
overlaps.
"""

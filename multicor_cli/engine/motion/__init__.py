"""How bodies move: predicted and final positions, drives of walls, correction of overlaps."""

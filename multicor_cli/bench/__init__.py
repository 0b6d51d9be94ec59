"""Benchmarks: named scenes, what a step of them costs stage by stage, and calibrations that turn seconds into ratios."""

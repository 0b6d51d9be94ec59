"""Benchmarks: named scenes, what a step of them costs phase by phase, and calibrations that turn
seconds into ratios.
"""

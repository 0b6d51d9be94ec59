"""Benchmarks: named scenes, what a step of them costs by phase, and yardsticks for ratios."""

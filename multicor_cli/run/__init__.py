"""Running a scenario: loading stages, cadences, checkpoints, signals."""

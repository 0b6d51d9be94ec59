"""From a scenario to the initial `Model` and `State`."""

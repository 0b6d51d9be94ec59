"""What is wrong with a scenario, and where."""

from multicor_cli.scenario import ScenarioError, parse_scenario


def problems_of(text, overrides=()):
    """The problems of a scenario, none if it is right."""
    try:
        parse_scenario(text, "shear.toml", overrides)
    except ScenarioError as error:
        return error.problems
    return []


def place_of(text, word):
    """Line and column of a word in a text, both from 1."""
    before = text[: text.index(word)]
    return before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1

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


def check_one(text, key, place, *words):
    """A scenario has one problem: at a key, where the text ``place`` is, with words in it."""
    (problem,) = problems_of(text)
    assert (problem.key, problem.file) == (key, "shear.toml")
    if place is not None:
        assert (problem.line, problem.column) == place_of(text, place)
    assert [word for word in words if word not in str(problem)] == []
    assert problem.remedy
    assert "\n" not in str(problem)


def places(node, path=()):
    """Paths of all keys and elements of a document."""
    inside = (
        node.items()
        if isinstance(node, dict)
        else enumerate(node)
        if isinstance(node, list)
        else ()
    )
    for key, value in inside:
        yield (*path, key)
        yield from places(value, (*path, key))

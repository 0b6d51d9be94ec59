"""Judging numbers by their limits, and the page that lists all rules."""

import math

import pytest
from page_tables import CHECKS, with_tables

from multicor_cli.checks import BEFORE_RUN, OF_RUN, Rule, Verdict, worst_verdict
from multicor_cli.checks.check import Measured, judge_all


def rule(**limits):
    return Rule(
        "size",
        lambda values: [Measured(value, f"number {k}") for k, value in enumerate(values)],
        "means",
        "do",
        "m",
        **limits,
    )


@pytest.mark.parametrize(("limits", "values", "verdict", "text"), [
    ({"warning": 1.0, "bad": 2.0}, [0.5, 1.0], Verdict.OK, "1 m (number 1)"),
    ({"warning": 1.0, "bad": 2.0}, [0.5, 1.5], Verdict.WARNING, "1.5 m (number 1)"),
    ({"warning": 1.0, "bad": 2.0}, [3.0, 1.5], Verdict.BAD, "3 m (number 0)"),
    ({"warning": 1.0, "bad": 2.0}, [math.nan], Verdict.BAD, "nan m (number 0)"),
    ({"warning": 1.0}, [math.inf], Verdict.WARNING, "inf m (number 0)"),
    ({"least": 1.0, "warning": 10.0}, [2.0, 5.0], Verdict.OK, "2 m (number 0)"),
    ({"least": 1.0, "warning": 10.0}, [5.0, 0.5, 0.1], Verdict.WARNING, "0.1 m (number 2)"),
    ({"least": 1.0}, [1e9, 0.0], Verdict.WARNING, "0 m (number 1)"),
])  # fmt: skip
def test_the_worst_number_counts(limits, values, verdict, text):
    check = rule(**limits).judge(values)
    assert (check.verdict, check.text) == (verdict, text)
    assert check.as_dict()["verdict"] == verdict.value


def test_limits_in_words_and_what_does_not_apply():
    assert judge_all([rule(warning=1.0)], []) == []
    assert worst_verdict([]) is Verdict.OK
    assert rule(warning=1.0).limit == "at most 1"
    assert rule(warning=1.0, bad=2.0).limit == "at most 1, bad above 2"
    assert rule(warning=1.0, bad=1.0).limit == "bad above 1"
    assert rule(warning=0.0).limit == "none"
    assert rule(least=1.0).limit == "at least 1"
    assert rule(least=1.0, warning=2.0).limit == "1 to 2"


@pytest.mark.parametrize("rules", [BEFORE_RUN, OF_RUN])
def test_every_rule_has_its_own_name_and_says_everything(rules):
    assert len({entry.name for entry in rules}) == len(rules)
    for entry in rules:
        assert entry.meaning.endswith(".")
        assert entry.remedy.endswith(".")
        assert entry.warning < math.inf or entry.least is not None


def test_the_page_lists_the_rules():
    text = CHECKS.read_text(encoding="utf-8")
    assert with_tables(text) == text, "run python tests/support/page_tables.py"
    assert all(f"| {entry.name} |" in text for entry in (*BEFORE_RUN, *OF_RUN))

"""Checks on the terminal and in JSON, and what ``--strict`` makes of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import typer

from multicor_cli.text import count_noun

if TYPE_CHECKING:
    from multicor_cli.checks import Check

Strict = Annotated[bool, typer.Option("--strict", help="Exit with code 4 if a check is bad.")]


_WIDTH = 120
_INDENT = " " * 11


def show_all(checks: Sequence[Check], write: Callable[[str], None]) -> None:
    """Every check in a line; what those that are not ok mean, and what to do, below theirs."""
    width = max((len(check.name) for check in checks), default=0)
    for check in checks:
        write(f"{check.verdict.value:<7}  {check.name:<{width}}  {check.text} [{check.limit}]")
        if check.verdict.value != "ok":
            for text, start in ((check.meaning, _INDENT), (check.remedy, _INDENT[:-2] + "→ ")):
                write(fill(text, _WIDTH, initial_indent=start, subsequent_indent=_INDENT))


def show_doubtful(checks: Sequence[Check], say: Callable[[str], None]) -> None:
    """The checks that are not ok, each in a line."""
    for check in checks:
        if check.verdict.value != "ok":
            say(f"{check.verdict.value}: {check.name}: {check.text} [{check.limit}]. {check.remedy}")


def count_verdicts(checks: Sequence[Check]) -> str:
    """How many checks came out how, in words."""
    count = {verdict: sum(check.verdict.value == verdict for check in checks) for verdict in ("ok", "warning", "bad")}
    return f"{count_noun(len(checks), 'check')}: {count['ok']} ok, {count_noun(count['warning'], 'warning')}, {count['bad']} bad"


def checks_as_json(checks: Sequence[Check]) -> dict[str, Any]:
    """The worst verdict, and all checks."""
    from multicor_cli.checks import worst_verdict

    return {"verdict": worst_verdict(checks).value, "checks": [check.as_dict() for check in checks]}


def refuse_bad(checks: Sequence[Check], *, is_strict: bool) -> None:
    """Leave the command with code 4 if a check is bad and the user asked for that; raises `ChecksFailed`."""
    from multicor_cli.checks import ChecksFailed, Verdict

    if is_strict and any(check.verdict is Verdict.BAD for check in checks):
        raise ChecksFailed(list(checks))

"""What the shell offers for the value of an option: ``multicor --install-completion`` turns it on."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable

import typer

from multicor_cli.cli.listing import names_in


def listed(*keys: str) -> Callable[[str], list[str]]:
    """Names of the lists that help texts show under these keys."""

    def offer(incomplete: str) -> list[str]:
        return _beginning(incomplete, (name for key in keys for name in names_in(key)))

    return offer


def fields(ctx: typer.Context, incomplete: str) -> list[str]:
    """Coarse-grained fields, with components along the axes that the line asks for."""
    from multicor_cli.post.field_sums import field_list

    known = field_list("rt" if ctx.params.get("center") else "xy", has_heat=True, has_stress=True)
    return _beginning(incomplete, (field.name for field in known))


def columns(ctx: typer.Context, incomplete: str) -> list[str]:
    """Columns of the time series of the run that the line names; of walls and outlets what stands behind the colon."""
    from multicor_cli.store import open_run

    with contextlib.suppress(Exception), open_run(_place(ctx, "directory")) as run:  # a shell has no place for messages
        return _beginning(incomplete, (column.name.rpartition(": ")[2] for column in run.series_columns))
    return []


def observables(ctx: typer.Context, incomplete: str) -> list[str]:
    """Observables of the study that the line names."""
    from multicor_cli.studies.load import load_study

    with contextlib.suppress(Exception):
        return _beginning(incomplete, (observable.name for observable in load_study(_place(ctx, "file")).model.observe))
    return []


def _place(ctx: typer.Context, name: str) -> str:
    """The first argument: the parser leaves it where it was when an option behind it has no value yet."""
    return str(ctx.params.get(name) or ctx.args[0])


def _beginning(incomplete: str, names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(name for name in names if name.startswith(incomplete)))

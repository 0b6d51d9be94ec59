"""The few numbers about a state that ``run.json``, checkpoints and ``results.h5`` carry, and that `run_info` reports."""

from __future__ import annotations

from typing import Any

from multicor_cli.model import BOOK_NAMES, EXCHANGE_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES, Model, State
from multicor_cli.model.books import EXCHANGE_BOOKS, TALLIES, Version, entry_counts, measures_first
from multicor_cli.model.model import Thermal
from multicor_cli.store.snapshot import temperatures_of

Summary = dict[str, Any]

_SUMMARIZED = {entry.summary: entry for entry in measures_first(TALLIES) if entry.summary is not None}
"""Counters that have a key of their own, by this key."""


def summarize(state: State, model: Model) -> Summary:
    """Counters, books and digest of a state of a model.

    Returns:
        ``step, time, stage, grain_count, state_digest, energy_closure, heat_closure`` (null: no heat),
        ``max_overlap`` (over the smaller radius), ``max_contact_force`` [N], ``corrected_steps``,
        ``negative_loss_share``, ``solver``, ``books`` [J], and ``heat`` (null: no heat) with ``books`` [J], ``sub_steps``,
        ``max_biot``, ``integration_error``, ``solid_gas_min``, ``solid_gas_max`` (null: no gas) and
        ``temperature.{mean, min, max}`` [K]; and ``exchange`` (null: no grain comes or goes) with its books and
        ``outlets.NAME.{grains, mass}``.
    """
    tallies = dict(zip(TALLY_NAMES, state.tallies.tolist(), strict=True))
    books = dict(zip(BOOK_NAMES, state.books.tolist(), strict=True))
    heat = None if model.thermal is None else _summarize_heat(state, model.thermal)
    return {
        "step": state.step,
        "time": state.time,
        "stage": state.stage,
        "grain_count": len(state.position),
        "state_digest": state.digest(),
        "energy_closure": books["closure"],
        "heat_closure": None if heat is None else heat["books"]["closure"],
        **{key: round(tallies[e.name]) if e.dtype == "i8" else tallies[e.name] for key, e in _SUMMARIZED.items()},
        "negative_loss_share": _negative_share(books),
        "solver": {
            "sweeps_mean": tallies["sweeps"] / max(1, state.step - state.frozen_steps),
            "residual_rms_max": tallies["residual_rms_max"],
            "residual_max_max": tallies["residual_max_max"],
            "unconverged_steps": round(tallies["unconverged_steps"]),
        },
        "books": books,
        "heat": heat,
        "exchange": None if model.outlets is None else _summarize_exchange(state, model.outlets),
    }


def _summarize_exchange(state: State, outlets: tuple[str, ...]) -> Summary:
    counts = {entry.name for entry in EXCHANGE_BOOKS if entry.dtype == "i8"}
    books = dict(zip(EXCHANGE_NAMES, state.exchange.tolist(), strict=True))
    flows = {
        name: {"grains": round(grains), "mass": mass}
        for name, (grains, mass) in zip(outlets, state.outlet_flow.tolist(), strict=True)
    }
    return {name: round(value) if name in counts else value for name, value in books.items()} | {"outlets": flows}


def _summarize_heat(state: State, thermal: Thermal) -> Summary:
    books = dict(zip(HEAT_BOOK_NAMES, state.heat_books.tolist(), strict=True))
    counters = {name: books.pop(name) for name in ("sub_steps", "max_biot", "solid_gas_min", "solid_gas_max", "integration_error")}
    mean, lowest, highest = temperatures_of(state, thermal)
    return {
        "books": books,
        "sub_steps": round(counters["sub_steps"]),
        "max_biot": counters["max_biot"],
        "integration_error": counters["integration_error"],
        "solid_gas_min": counters["solid_gas_min"] or None,
        "solid_gas_max": counters["solid_gas_max"] or None,
        "temperature": {
            "mean": mean,
            "min": lowest,
            "max": highest,
        },
    }


def empty_summary(version: Version | None = None) -> Summary:
    """The summary of a run of which no state has been stored: the same keys, or those of an older version, without values."""
    counters = (key for key, entry in _SUMMARIZED.items() if version is None or entry.since <= version)
    names = ("step", "time", "stage", "grain_count", "state_digest", "energy_closure", "heat_closure")
    later = ("exchange",) if version is None or version >= (1, 2) else ()
    solver = ("sweeps_mean", "residual_rms_max", "residual_max_max", "unconverged_steps")
    books = BOOK_NAMES[: entry_counts(version)["book"]]
    return {
        **dict.fromkeys((*names, *counters, "negative_loss_share", "heat", *later)),
        "solver": dict.fromkeys(solver),
        "books": dict.fromkeys(books),
    }


def _negative_share(books: dict[str, float]) -> float:
    """Energy gained at contacts over energy lost there; ``negative_loss`` is their signed sum's negative part."""
    negative = abs(books["negative_loss"])
    positive = books["friction_loss"] + books["impact_loss"] + negative
    return negative / positive if positive > 0.0 else 0.0

"""Commands that look at a run or at the installation: ``info``, ``verify``, ``doctor``."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from multicor_cli.cli.console import emit, emit_json, emit_pairs, format_seconds, say
from multicor_cli.cli.options import RunPath, count_noun
from multicor_cli.running.outcome import ExitCode

_HEAT_LABELS = {
    "friction": "  of friction",
    "impact": "  of impacts",
    "to_walls": "  of these to walls",
    "from_walls": "  from walls",
    "from_ambient": "  from the fluid",
    "from_surroundings": "  from surroundings",
    "undelivered": "  not delivered",
}
"""Heat books for people, by name; those that are zero are not shown."""

_OF_REFERENCE = " of the reference velocity (rms of a step)"

AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


def info(directory: RunPath, is_json: AsJson = False) -> None:
    """Show what a run contains, how far it has got, and how accurate it is."""
    from multicor_cli.engine.exchange.watch import stray_warnings
    from multicor_cli.engine.heat.watch import biot_warning, undelivered_warning
    from multicor_cli.store import run_info

    found = run_info(directory)
    if is_json:
        emit_json(found)
        return
    emit_pairs(_describe(found))
    exchange = found["exchange"] or {}
    for stray in stray_warnings(found["fallen"] or 0, exchange.get("lost", 0), exchange.get("behind", 0)):
        say(f"warning: {stray}")
    if found["heat"] is not None:
        emit("")
        emit_pairs(_describe_heat(found["heat"]))
        for warning in (biot_warning(found["heat"]["max_biot"]), undelivered_warning(found["heat"]["books"]["undelivered"])):
            if warning is not None:
                say(f"warning: {warning}")


def verify(directory: RunPath, is_json: AsJson = False) -> None:
    """Read everything that a run has stored and compare it with its checksums; exit code 7 if something is damaged."""
    from multicor_cli.store import verify as verify_run

    findings = verify_run(directory)
    damaged = [finding for finding in findings if finding.severity == "error"]
    if is_json:
        rows = [{"severity": f.severity, "file": f.file, "message": f.message} for f in findings]
        emit_json({"path": str(directory), "whole": not damaged, "findings": rows})
    else:
        for finding in findings:
            emit(f"{finding.severity}: {_with_file(finding.file, finding.message)}")
        say(f"{directory}: {count_noun(len(damaged), 'file')} damaged" if damaged else f"{directory}: no damage found")
    if damaged:
        raise typer.Exit(ExitCode.DAMAGED)


def doctor(is_json: AsJson = False) -> None:
    """Describe this installation, for a bug report."""
    from multicor_cli.cli.diagnosis import diagnose

    found = diagnose()
    if is_json:
        emit_json(found)
    else:
        emit_pairs([(name, str(value)) for name, value in found.items()])


def _with_file(file: str, message: str) -> str:
    return message if message.startswith(file) else f"{file}: {message}"


def _describe(found: dict[str, Any]) -> list[tuple[str, str]]:
    solver = found["solver"]
    reason = found["stop_reason"]
    lines = [
        ("run", found["path"]),
        ("status", f"{found['status']} ({reason})" if reason and reason != found["status"] else found["status"]),
        ("grains", _text(found["grain_count"])),
        *_describe_exchange(found["exchange"]),
        ("walls", ", ".join(found["walls"]) or "none"),
        ("frames", f"{found['frame_count']} (and {found['series_count']} rows of the time series)"),
        ("step", _text(found["step"])),
        ("time", _text(found["time"], " s")),
        ("stages", ", ".join(found["stages"])),
        *_describe_ends(found["stage_ends"]),
        ("wall time", "–" if found["duration"] is None else format_seconds(found["duration"])),
        ("state digest", _text(found["state_digest"])),
        ("energy closure", _text(found["energy_closure"])),
        *_describe_tallies(found),
        ("sweeps", _text(solver["sweeps_mean"], " per step")),
        ("largest residual", _text(solver["residual_rms_max"], _OF_REFERENCE) + _where(found["worst_step"])),
        ("not converged", _text(solver["unconverged_steps"], " steps")),
        ("negative losses", _text(found["negative_loss_share"], " of the losses at contacts")),
    ]
    if found["hertz_deflection"] is not None:
        lines.append(("Hertz deflection", _text(found["hertz_deflection"], " of a diameter under the largest contact force")))
    version = found["provenance"].get("multicor_version", "")
    return [*lines, ("made by", f"multicor {version}, seed {found['provenance'].get('seed')}")]


def _describe_exchange(exchange: dict[str, Any] | None) -> list[tuple[str, str]]:
    if exchange is None:
        return []
    counts = ", ".join(f"{exchange[name]} {name}" for name in ("present", "waiting", "released", "left", "returned", "lost"))
    flows = [(f"  {name}", f"{flow['grains']} grains, {flow['mass']:.4g} kg left") for name, flow in exchange["outlets"].items()]
    return [("  of these", counts), *flows]


def _describe_ends(ends: list[dict[str, Any]]) -> list[tuple[str, str]]:
    from multicor_cli.store.stage_ends import StageEnd

    return [(f"  {end.name}", end.text) for end in map(StageEnd.of_document, ends)]


def _describe_tallies(found: dict[str, Any]) -> list[tuple[str, str]]:
    from multicor_cli.model.books import TALLIES

    return [(entry.label[0], _text(found[str(entry.summary)], entry.label[1])) for entry in TALLIES if entry.label is not None]


def _where(worst: dict[str, Any] | None) -> str:
    return "" if worst is None else f", by step {worst['step']} (t = {worst['time']:.4g} s)"


def _describe_heat(heat: dict[str, Any]) -> list[tuple[str, str]]:
    books, temperature = heat["books"], heat["temperature"]
    lines = [
        ("heat closure", _text(books["closure"])),
        ("temperature", f"{temperature['mean']:.6g} K on average, {temperature['min']:.6g} to {temperature['max']:.6g} K"),
        ("largest Biot number", _text(heat["max_biot"])),
        ("heat stored", _text(books["stored"], " J")),
    ]
    lines += [(label, _text(books[name], " J")) for name, label in _HEAT_LABELS.items() if books[name]]
    if heat["solid_gas_max"] is not None:
        lines.append(("solid to gas", f"λ_s s/(λ_f a) from {_text(heat['solid_gas_min'])} to {_text(heat['solid_gas_max'])}"))
    return [*lines, ("heat sub-steps", _text(heat["sub_steps"]))]


def _text(value: Any, unit: str = "") -> str:
    if value is None:
        return "–"
    return (f"{value:.4g}" if isinstance(value, float) else str(value)) + unit


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    app.command("info")(wrap(info))
    app.command("verify")(wrap(verify))
    app.command("doctor")(wrap(doctor))

"""Commands that read a run or the installation: info, verify, doctor, report, export."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from multicor_cli import __version__
from multicor_cli.cli import console
from multicor_cli.cli.options import AsJson, RunPath, option, output_option
from multicor_cli.cli.post_output import Frames, OneFrame, parse_frames
from multicor_cli.optional import LIBRARIES
from multicor_cli.running.outcome import ExitCode
from multicor_cli.text import count_noun, format_bytes

# ---- Commands `info`, `verify`, `doctor`

_LIBRARIES = ("numpy", "numba", "llvmlite", "h5py", "pydantic", "typer", "rich")

_HEAT_LABELS = {
    "friction": "  of friction",
    "impact": "  of impacts",
    "to_walls": "  of these to walls",
    "ahead": "  ahead of losses",
    "from_walls": "  from walls",
    "from_ambient": "  from the fluid",
    "from_surroundings": "  from surroundings",
    "undelivered": "  not delivered",
}
"""Heat books for people, by name; those that are zero are not shown."""


def info(directory: RunPath, is_strict: console.Strict = False, is_json: AsJson = False) -> None:
    """Show what a run contains, how far it has got, and how accurate it is; also while it goes
    on.
    """
    from multicor_cli.checks import check_run
    from multicor_cli.store import run_info

    found = run_info(directory)
    checks = check_run(directory, found)
    if is_json:
        console.emit_json({**found, **console.checks_as_json(checks)})
    else:
        console.emit_pairs(_describe(found))
        if found["heat"] is not None:
            console.emit("")
            console.emit_pairs(_describe_heat(found["heat"]))
        if checks:
            console.emit("")
            console.show_all(checks, console.emit)
    console.refuse_bad(checks, is_strict=is_strict)


def verify(directory: RunPath, is_json: AsJson = False) -> None:
    """Read everything that a run has stored and compare it with its checksums; exit code 7 if
    something is damaged.
    """
    from multicor_cli.store import verify as verify_run

    findings = verify_run(directory)
    damaged = [finding for finding in findings if finding.severity == "error"]
    if is_json:
        rows = [asdict(finding) for finding in findings]
        console.emit_json({"path": str(directory), "whole": not damaged, "findings": rows})
    else:
        for finding in findings:
            is_named = finding.message.startswith(finding.file)
            where = "" if is_named else f"{finding.file}: "
            console.emit(f"{finding.severity}: {where}{finding.message}")
        damage = f"{count_noun(len(damaged), 'file')} damaged" if damaged else "no damage found"
        console.say(f"{directory}: {damage}")
    if damaged:
        raise typer.Exit(ExitCode.DAMAGED)


def doctor(is_json: AsJson = False) -> None:
    """Describe this installation, for a bug report."""
    found = diagnose()
    if is_json:
        console.emit_json(found)
    else:
        console.emit_pairs([(name, str(value)) for name, value in found.items()])


def _describe(found: dict[str, Any]) -> Iterator[tuple[str, str]]:
    from multicor_cli.model.books import TALLIES
    from multicor_cli.store.documents import Origin, StageEnd, record_of

    status, reason, solver = found["status"], found["stop_reason"], found["solver"]
    yield "run", found["path"]
    yield "status", f"{status} ({reason})" if reason and reason != status else status
    yield "grains", _text(found["grain_count"])
    if (exchange := found["exchange"]) is not None:
        counts = ("present", "waiting", "released", "left", "returned", "lost")
        yield "  of these", ", ".join(f"{exchange[name]} {name}" for name in counts)
        for name, flow in exchange["outlets"].items():
            yield f"  {name}", f"{flow['grains']} grains, {flow['mass']:.4g} kg left"
    # That of a cell is none; its module would load NumPy for its name
    yield "walls", ", ".join(name for name in found["walls"] if name != "cell") or "none"
    if found["origin"] is not None:
        yield "goes on from", record_of(Origin, found["origin"]).text
    yield "frames", f"{found['frame_count']} (and {found['series_count']} rows of the time series)"
    yield "step", _text(found["step"])
    yield "time", _text(found["time"], " s")
    yield "stages", ", ".join(found["stages"])
    for each in found["extensions"]:
        added = f"from {each['stages_before']} to {each['stages']} stages at {each['started']}"
        yield "  extended", f"{added}, at step {_text(each['step'])}"
    if (steering := found["steering"]) is not None:
        every = count_noun(steering["every"], "step")
        decisions = count_noun(len(steering["decisions"]), "decision")
        program = f"by the Python program {steering['by']}"
        yield "  steered", f"{program}, asked every {every}: {decisions}"
    for end in (record_of(StageEnd, document) for document in found["stage_ends"]):
        yield f"  {end.name}", end.text
    seconds = found["duration"]  # pauses of a run that was continued or extended included
    length = "–" if seconds is None else f"{console.format_seconds(seconds)} from start to end"
    yield "wall time", length
    yield "state digest", _text(found["state_digest"])
    for entry in TALLIES:
        if entry.label is not None:
            yield entry.label[0], _text(found[str(entry.summary)], entry.label[1])
    yield "sweeps", _text(solver["sweeps_mean"], " per step")
    residual = _text(solver["residual_rms_max"], " of the reference velocity (rms of a step)")
    if (worst := found["worst_step"]) is not None:
        residual += f", by step {worst['step']} (t = {worst['time']:.4g} s)"
    yield "largest residual", residual
    provenance = found["provenance"]
    version = f"multicor {provenance.get('multicor_version', '')}"
    yield "made by", f"{version}, seed {provenance.get('seed')}"
    # what the heartbeat of a run that goes on tells, and how to talk to it
    if (beat := found["progress"]) is not None:
        where = (
            f"step {beat['step']}, t = {beat['time']:.4g} s, stage {beat.get('stage', '–')}, "
            f"{100.0 * beat['progress']:.1f} %"
        )
        speed, left = beat.get("steps_per_second"), beat.get("remaining_seconds")
        where += f", {speed:.3g} steps/s" if speed is not None else ""
        where += f", {console.format_seconds(left)} left" if left is not None else ""
        yield "now", f"{where} ({beat.get('updated', 'time not known')})"
    if (pid := found["pid"]) is not None:
        usage = f"kill -USR1 {pid} writes one; kill -TERM {pid} writes one and stops"
        yield "checkpoint", f"{usage}, and the same command continues"


def _describe_heat(heat: dict[str, Any]) -> Iterator[tuple[str, str]]:
    books, temperature = heat["books"], heat["temperature"]
    low, high = temperature["min"], temperature["max"]
    if high > 0.0:  # else no grain is there
        mean = f"{temperature['mean']:.6g} K on average"
        yield "temperature", f"{mean}, {low:.6g} to {high:.6g} K"
    yield "heat stored", _text(books["stored"], " J")
    for name, label in _HEAT_LABELS.items():
        if books[name]:
            yield label, _text(books[name], " J")
    if heat["solid_gas_max"] is not None:
        low, high = _text(heat["solid_gas_min"]), _text(heat["solid_gas_max"])
        yield "solid to gas", f"λ_s s/(λ_f a) from {low} to {high}"
    yield "heat sub-steps", _text(heat["sub_steps"])


def _text(value: Any, unit: str = "") -> str:
    if value is None:
        return "–"
    return (f"{value:.4g}" if isinstance(value, float) else str(value)) + unit


def diagnose() -> dict[str, Any]:
    """Versions, processor, memory, threads, kernel cache and free disk."""
    import platform
    import shutil

    import h5py

    from multicor_cli.engine.jit.cache import configure_cache, is_compiled
    from multicor_cli.running.machine import available_cores

    threading, cache = _threading_layer(), configure_cache()
    kept = f"{cache} ({'compiled' if is_compiled() else 'empty'})"
    try:
        memory = format_bytes(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (ValueError, OSError):
        memory = "unknown"
    return {
        "multicor": __version__,
        "python": f"{platform.python_version()} ({sys.executable})",
        **{name: _version(name) for name in _LIBRARIES},
        "hdf5": str(h5py.version.hdf5_version),
        **{
            each.name: _version(each.name, f"not installed ({each.use} need it: {each.remedy})")
            for each in LIBRARIES.values()
        },
        "ffmpeg": shutil.which("ffmpeg") or "not installed (films become GIF)",
        "platform": platform.platform(),
        "cores": f"{available_cores()} of {os.cpu_count()}",
        "threading layer": threading,
        "memory": memory,
        "kernel cache": "none that outlives a process" if cache is None else kept,
        "free disk": format_bytes(shutil.disk_usage(Path.cwd()).free),
    }


def _version(name: str, missing: str = "not installed") -> str:
    from importlib import metadata

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return missing


def _threading_layer() -> str:
    """The threading layer of kernels, asked for in another process: a failure stays there."""
    import subprocess

    from multicor_cli.running.machine import python_child, reserve_threads

    reserve_threads()  # as a run does
    command, environment = python_child(
        "-c", "from multicor_cli.engine.jit.cache import describe_layer; print(describe_layer())"
    )
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=False
        )
    except (OSError, subprocess.SubprocessError) as error:
        return f"not known: {type(error).__name__}"
    said = (done.stderr if done.returncode else done.stdout).strip().splitlines()
    if done.returncode:
        return f"none: {said[-1] if said else 'Numba cannot be started'}"
    return said[-1]


# ---- Command `report`: one HTML page about a run

PageFile = Annotated[
    Path | None,
    output_option(
        metavar="FILE.html", help="File to write.", show_default="DIR-report.html beside DIR"
    ),
]
FrameLimit = Annotated[
    int | None,
    option("--frames N", "Largest number of frames in it.", "as many as fit in 30 MB", min=1),
]
OverwritePage = Annotated[bool, option("--overwrite", "Replace the file if it is a report.")]


def report(
    directory: RunPath,
    output: PageFile = None,
    frames: FrameLimit = None,
    is_overwriting: OverwritePage = False,
) -> None:
    """Write one HTML page about a run, to mail or to keep: how it went, figures, and an interactive
    view of the grains.

    The page needs no network and opens in any current browser. It works on a run that is still
    going on. Frames are left out, evenly, if the page would become larger than 30 MB, and it says
    so.
    """
    if output is not None and output.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"'{output}' does not end in .html", param_hint="-o")
    from multicor_cli.report import write_report

    with console.show_progress("frame") as progress:
        done = write_report(
            directory, output, frames=frames, is_overwriting=is_overwriting, progress=progress
        )
    if not done.has_figures:
        console.say(f"without figures: they need matplotlib: {LIBRARIES['matplotlib'].remedy}")
    shown = f"{done.frames} of {done.frame_count} frames"
    if done.contact_limit is not None:
        shown += f", with the {done.contact_limit} strongest contacts of each"
    console.say(f"wrote {done.path}: {format_bytes(done.size)}, {shown}")


# ---- Commands `export …`: frames of a run in the formats of other programs

export = typer.Typer(
    no_args_is_help=True,
    help=(
        "A run in the formats of other programs. ParaView opens results.vtkhdf in the run "
        "directory as it is; grains that are no discs are points there, and polygons in what "
        "'export vtkhdf' writes."
    ),
)

GsdFile = Annotated[Path, output_option(metavar="FILE.gsd", help="File to write.")]
CsvDirectory = Annotated[Path, output_option(metavar="DIR", help="Directory to write.")]
VtkhdfFile = Annotated[Path, output_option(metavar="FILE.vtkhdf", help="File to write.")]
FclibFile = Annotated[Path, output_option(metavar="FILE.hdf5", help="File to write.")]
OverwriteExport = Annotated[
    bool, option("--overwrite", "Replace what an export has written there before.")
]


def _export(
    write: Callable[..., int], directory: Path, output: Path, frames: str | None,
    is_overwriting: bool,
) -> None:  # fmt: skip
    """Write frames of a run to a file or directory, and say so."""
    chosen = parse_frames(frames)
    from multicor_cli.store import open_run

    with open_run(directory) as run, console.show_progress("frame") as progress:
        count = write(run, output, chosen, is_overwriting=is_overwriting, progress=progress)
    files = output.iterdir() if output.is_dir() else [output]
    size = sum(file.stat().st_size for file in files)
    console.say(f"wrote {output}: {count_noun(count, 'frame')}, {format_bytes(size)}")


def to_gsd(
    directory: RunPath,
    output: GsdFile,
    frames: Frames = None,
    is_overwriting: OverwriteExport = False,
) -> None:
    """Write a GSD file for OVITO: grains as particles, contacts that carry a force as bonds.

    Temperatures, angular velocities and forces are logged quantities, which OVITO shows as
    properties. Where not all grains are discs, there is a particle type for each outline. Needs the
    library gsd.
    """
    from multicor_cli.export import export_gsd

    _export(export_gsd, directory, output, frames, is_overwriting)


def to_vtkhdf(
    directory: RunPath,
    output: VtkhdfFile,
    frames: Frames = None,
    is_overwriting: OverwriteExport = False,
) -> None:
    """Write a VTKHDF file for ParaView: grains that are no discs as polygons, in all frames.

    Contacts are in results.vtkhdf of the run directory, which ParaView opens beside it.
    """
    if output.suffix.lower() != ".vtkhdf":
        raise typer.BadParameter(f"'{output}' does not end in .vtkhdf", param_hint="-o")
    from multicor_cli.export import export_vtkhdf

    _export(export_vtkhdf, directory, output, frames, is_overwriting)


def to_csv(
    directory: RunPath,
    output: CsvDirectory,
    frames: Frames = None,
    is_overwriting: OverwriteExport = False,
) -> None:
    """Write CSV files into a directory: grains, contacts and walls of every frame, the list of
    frames, and the time series.

    Headings carry the units; numbers are written so that reading them gives the same bits.
    """
    from multicor_cli.export import export_csv

    _export(export_csv, directory, output, frames, is_overwriting)


def to_fclib(
    directory: RunPath,
    output: FclibFile,
    frame: OneFrame = -1,
    is_overwriting: OverwriteExport = False,
) -> None:
    """Write the contact problem of the step after a frame in the HDF5 format of FCLib, for other
    solvers.

    After the last frame of a finished run, the step is the one that its last stage would take next.
    """
    from multicor_cli.export import export_fclib
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        found = export_fclib(
            run, output, frame, is_overwriting=is_overwriting, computing=_may_be_left()
        )
    contacts = count_noun(len(found.problem.pair), "contact")
    where = "beyond the end of the run" if found.is_beyond else f"in stage '{found.stage}'"
    after = f"the step after frame {found.frame} (t = {found.time:g} s)"
    console.say(f"wrote {output}: {contacts} of {after}, {where}")


@contextlib.contextmanager
def _may_be_left() -> Iterator[None]:
    """Leave at once on a signal: an exception would have to pass a compiler's machine code."""
    from multicor_cli.running.signals import StopSignals

    stop_signals = StopSignals(may_exit=True)
    stop_signals.on_exit = lambda number: console.complain("interrupted")
    with stop_signals.installed(), stop_signals.exit_at_once():
        yield


COMMANDS = {"info": info, "verify": verify, "doctor": doctor, "report": report}
EXPORTS = {"gsd": to_gsd, "vtkhdf": to_vtkhdf, "csv": to_csv, "fclib": to_fclib}

"""The HTML of the page. Whatever comes from the run is escaped; nothing is loaded from anywhere."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from html import escape
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli import __version__
from multicor_cli.checks import Check, Verdict
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import outlines
from multicor_cli.plots.grain_map import solid_polygons
from multicor_cli.plots.style import rise_reference
from multicor_cli.post import PostError, force_network, rheology
from multicor_cli.post.energy import HEAT, MECHANICAL, BookLine, EnergyTable
from multicor_cli.post.lattice import gradient_of
from multicor_cli.report.figures import Figure
from multicor_cli.report.pack import Packed
from multicor_cli.store import Run
from multicor_cli.store.documents import StageEnd, record_of
from multicor_cli.text import json_value, unit_sign

MARK = '<meta name="generator" content="multicor report">'
"""What tells a page of ours from other files; it stands within the first 400 bytes."""

_POLICY = (
    "default-src 'none'; script-src 'sha256-{}'; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
_OF_FIELDS = ("name", "label", "unit", "colors", "scale")
_SCRIPTS = ("data.js", "scale.js", "picture.js", "viewer.js")
_LONGEST = 200  # letters of a name; longer ones stand whole in the scenario at the end of the page


def make_page(
    run: Run,
    info: dict[str, Any],
    checks: Sequence[Check],
    books: EnergyTable | None,
    packing: Packed,
    figures: list[Figure] | None,
) -> bytes:
    """The page as UTF-8; ``books`` is None without a series, ``figures`` without matplotlib.

    Raises:
        StoreError: If the scenario cannot be read.
    """
    source, resolved = run.scenario_source, run.scenario_resolved
    scenario = None
    with contextlib.suppress(tomllib.TOMLDecodeError):
        scenario = tomllib.loads(resolved).get("scenario")
    scenario = scenario if isinstance(scenario, dict) else {}
    name = _shorten(str(scenario.get("name") or run.path.resolve().name))
    program = "\n" + "\n".join(_file(script) for script in _SCRIPTS)
    looks = packing.looks
    made = f"Made by multicor {escape(__version__)} from {escape(run.path.resolve().name)}."
    body = [
        header(
            name, _shorten(str(scenario.get("description") or "")), str(info["status"]),
            str(info["stop_reason"] or ""),
            ' <button id="theme" type="button" aria-label="Light or dark">◐</button>',
        ),
        _checks(checks),
        _file("view.html").replace("NOTE_ON_FRAMES", escape(_note(packing))),
        _tables(run, info, books),
        figure_cards(figures),
        *(
            details(title, f'<pre tabindex="0">{escape(text)}</pre>')
            for title, text in (
                ("Scenario as given", source), ("Scenario with all defaults", resolved),
            )
            if text.strip()
        ),
        f"<footer><p>{made}</p></footer>",
        _data("meta", "application/json", _json(_meta(run, packing))),
        _data("radii", "text/plain", _base64(packing.radii)),
        *(() if looks is None else (_data("looks", "text/plain", _base64(looks.data)),)),
        *(
            _data(f"frame-{k}", "text/plain", _base64(chunk.data))
            for k, chunk in enumerate(packing.chunks)
        ),
        f"<script>{program}</script>",
    ]  # fmt: skip
    return html_of(name, body, program)


def _shorten(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def html_of(name: str, body: Sequence[str], program: str = "") -> bytes:
    """A whole page; browsers run only its one program, known by digest, and load nothing."""
    policy = _POLICY.format(_base64(hashlib.sha256(program.encode()).digest()))
    head = (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n{MARK}\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(name)} – multicor</title>\n<style>\n{_file('viewer.css')}</style>\n"
        "</head>"
    )
    page = "\n".join([head, "<body>", *body, "</body>", "</html>", ""])
    return page.encode(errors="backslashreplace")


def header(name: str, description: str, status: str, reason: str = "", corner: str = "") -> str:
    """What stands above all: name, description, status and the reason for it; HTML in a corner."""
    about = f'<p dir="auto">{escape(description)}</p>' if description else ""
    if reason not in ("", status):
        about += f'<p data-status="{escape(status)}" dir="auto">{escape(_shorten(reason))}</p>'
    return (
        f'<header><div><h1 dir="auto">{escape(name)}</h1>{about}</div><div class="corner">'
        f'<span class="badge" data-status="{escape(status)}">{escape(status)}</span>{corner}'
        "</div></header>"
    )


def details(summary: str, body: str, *, is_open: bool = False) -> str:
    """A card that can be closed; both are HTML."""
    opened = " open" if is_open else ""
    return f'<details class="card"{opened}><summary>{summary}</summary>{body}</details>'


def _note(packing: Packed) -> str:
    shown, count = len(packing.chunks), packing.frame_count
    frames = f"{shown:,} of {count:,} frames of the run"
    if shown == count:
        frames = "The only frame of the run" if count == 1 else f"All {count:,} frames of the run"
    if packing.contact_limit is not None and any(
        (c.contact_count or 0) > packing.contact_limit for c in packing.chunks
    ):
        frames += f", with the {packing.contact_limit:,} strongest contacts of each"
    if "look" in packing.codes and packing.looks is None:
        frames += ". Grains are circles here: their outlines would not leave room for the frames"
    step = max(
        (code.high - code.low) * code.resolution
        for code in (packing.codes["x"], packing.codes["y"])
    )
    share = 100.0 * packing.codes["speed"].resolution
    return (
        f"{frames}. Positions are stored in steps of {_up(step)} m, values in steps of "
        f"{_up(share)} % of their range over these frames or finer; the values shown are given to "
        "that precision. The files of the run hold them exactly."
    )


def _up(value: float) -> str:
    """A number rounded up to one digit: what is true of the number is true of it."""
    if value <= 0.0:
        return "0"
    power = 10.0 ** math.floor(math.log10(value))
    return pretty(math.ceil(value / power - 1e-9) * power, 1)


def _checks(checks: Sequence[Check]) -> str:
    """What was checked, above all else: a line if everything is ok, else the whole table."""
    rows = describe_checks(checks)
    if not rows:
        return ""
    counts = {kind: sum(row.verdict == kind for row in rows) for kind in ("bad", "warning", "ok")}
    marks = ", ".join(
        f'<span class="{kind}">{count} {kind}{"s" * (kind == "warning" and count > 1)}</span>'
        for kind, count in counts.items()
        if count
    )
    table = f"<table>{''.join(map(_row, rows))}</table>"
    return details(f"Checks: {marks}", table, is_open=counts["ok"] < len(rows))


def _tables(run: Run, info: dict[str, Any], books: EnergyTable | None) -> str:
    tables = {
        "What was run": describe_run(info),
        "Rheology, means of the later half": describe_rheology(run),
        "Contact forces": describe_forces(run),
        "Ends of the stages": describe_stages(info),
        "Contact solver": describe_solver(info),
    }
    if books is not None:
        tables["Energy books"] = describe_books(books, MECHANICAL)
        tables["Books of heat"] = describe_books(books, HEAT)
    return table_cards(tables)


def table_cards(tables: Mapping[str, Sequence[ReportRow]]) -> str:
    """Names and values, each table under its title; those without rows are left out."""
    cards = "".join(
        f'<div class="card"><h2>{escape(title)}</h2><table>{"".join(map(_row, rows))}</table></div>'
        for title, rows in tables.items()
        if rows
    )
    return f'<section class="cards">{cards}</section>'


def _row(row: ReportRow) -> str:
    verdict = f' <span class="{row.verdict}">{row.verdict} [{escape(row.limit)}]</span>'
    note = f'<tr><td colspan="2" class="note">{escape(row.note)}</td></tr>' if row.note else ""
    value = escape(_shorten(row.value)) + (verdict if row.limit else "")
    return f'<tr><th scope="row">{escape(row.name)}</th><td dir="auto">{value}</td></tr>{note}'


def figure_cards(figures: Sequence[Figure] | None) -> str:
    """Figures side by side; None: there is no matplotlib."""
    text = "".join(
        f'<figure class="card"><figcaption>{escape(figure.title)}</figcaption>'
        + figure.svg.replace("<svg", f'<svg role="img" aria-label="{escape(figure.title)}"', 1)
        + "</figure>"
        for figure in figures or ()
    )
    if figures is None:
        text = (
            "<p>There are no figures here: the installation that made this page has no "
            "matplotlib.</p>"
        )
    return f'<section class="figures">{text}</section>' if text else ""


def _meta(run: Run, packing: Packed) -> dict[str, Any]:
    """What the scripts need to know besides the packed numbers."""
    model, frames = run.model, run.frames
    times, steps, stages = map(np.asarray, (frames.time, frames.step, frames.stage))
    drawn = list(outlines(model.shapes.kind, model.shapes.geometry))
    stage_names = dict(enumerate(map(_shorten, run.stages)))  # a damaged file may tell of others
    return {
        "grains": model.grain_count,
        "groups": [_shorten(name) for name in model.groups],
        "group": model.grains.group.tolist() if len(model.groups) > 1 else [],
        "period": model.period,
        "isCell": model.is_cell,
        "meanForce": packing.mean_force,
        "box": packing.box.tolist(),
        "frameCount": packing.frame_count,
        "looks": None if packing.looks is None else packing.looks.arrays,
        "codes": {
            name: {n: getattr(code, n) for n in ("low", "high", "largest", "spacing")}
            for name, code in packing.codes.items()
        },
        "fields": [
            {
                **{name: getattr(each, name) for name in _OF_FIELDS},
                "range": packing.colors[each.name],
                # A round temperature where temperatures hardly differ
                "reference": rise_reference(each.unit, *packing.colors[each.name]),
            }
            for each in packing.fields
        ],
        "shapes": [
            {
                "wall": model.shapes.wall[which].tolist(),
                "points": _short(outline.points),
                "radius": None if outline.radius is None else _short(outline.radius),
                "normal": None if outline.normal is None else _short(outline.normal),
                "isGrain": outline.is_grain,
            }
            for which, outline in drawn
        ],
        "solids": [
            {"wall": wall, "corners": _short(corners)}
            for which, outline in drawn
            if outline.is_solid
            for wall, corners in _solids(model.shapes.wall[which], outline.points)
        ],
        "frames": [
            {
                "index": chunk.index,
                "time": float(times[chunk.index]),
                "step": int(steps[chunk.index]),
                "stage": stage_names.get(int(stages[chunk.index]), ""),
                "arrays": chunk.arrays,
                "contactCount": chunk.contact_count,
                "box": chunk.box.tolist(),
                "walls": walls.tolist(),
                "gradient": gradient_of(frames[chunk.index]).tolist() if model.is_cell else None,
            }
            for chunk, walls in zip(packing.chunks, packing.walls, strict=True)
        ],
    }


def _solids(wall: NDArray[Any], sides: Floats) -> Iterator[tuple[int, Floats]]:
    for number in np.unique(wall).tolist():
        for corners in solid_polygons(sides[wall == number]):
            yield number, corners


def _short(values: Floats) -> Any:
    """Numbers of an array as lists, with as many digits as a picture needs."""
    short = np.array([float(f"{value:.7g}") for value in values.ravel().tolist()])
    return short.reshape(values.shape).tolist()


def _json(data: Any) -> str:
    """JSON that may stand in an HTML page, whatever strings are in it."""
    text = json.dumps(json_value(data), ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _data(name: str, kind: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">{text}</script>'


def _file(name: str) -> str:
    return resources.files("multicor_cli.report").joinpath(name).read_text(encoding="utf-8")


# ---- What was run, how it ended, and how good it is, as rows of names and values

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class ReportRow:
    """A row of a table; of a value with a limit, the verdict, and what to do if it is not ok."""

    name: str
    value: str
    limit: str = ""
    verdict: str = "ok"
    note: str = ""


def describe_run(info: dict[str, Any]) -> list[ReportRow]:
    """What was run and how it ended, from `multicor_cli.store.run_info`."""
    made, status, reason = info["provenance"], info["status"], info["stop_reason"]
    seconds = info["duration"]
    rows = {
        "status": status if not reason or reason == status else f"{status} ({reason})",
        "time": _number(info["time"], "s"),
        "steps": _number(info["step"]),
        "stages": ", ".join(info["stages"]),
        "grains": _number(info["grain_count"]),
        "walls": ", ".join(info["walls"]) or "none",
        "frames": f"{info['frame_count']:,}, and {info['series_count']:,} rows of the time series",
        "seed": made.get("seed", "–"),
        "started": _moment(info["started"]),
        "finished": _moment(info["finished"]),
        "wall time": (
            "–" if seconds is None else f"{timedelta(seconds=round(seconds))} from start to end"
        ),
        "version": f"multicor {made['multicor_version']}" if "multicor_version" in made else "–",
        "command": made.get("command", "–"),
        "processor": made.get("cpu") or "–",
        "threads allowed": made.get("threads") or "–",
        "state digest": info["state_digest"] or "–",
    }
    return [ReportRow(name, str(value)) for name, value in rows.items() if value != "–"]


def describe_stages(info: dict[str, Any]) -> list[ReportRow]:
    """Why and when each stage ended that is over, as far as the run has kept it."""
    ends = (record_of(StageEnd, end) for end in info["stage_ends"])
    return [ReportRow(end.name, end.text) for end in ends]


def describe_checks(checks: Sequence[Check]) -> list[ReportRow]:
    """What was checked of the run."""

    def note(check: Check) -> str:
        return "" if check.verdict is Verdict.OK else f"{check.meaning} {check.remedy}"

    return [ReportRow(c.name, c.text, c.limit, c.verdict.value, note(c)) for c in checks]


def describe_solver(info: dict[str, Any]) -> list[ReportRow]:
    """Residuals and counters of the solver, and the largest force."""
    solver, force = info["solver"], _number(info["max_contact_force"], "N")
    residual = _number(solver["residual_rms_max"])
    rows = [
        ReportRow("largest residual over the reference velocity (rms of a step)", residual),
        ReportRow("sweeps per step", _number(solver["sweeps_mean"])),
        ReportRow("largest contact force (mean of a step)", force),
    ]
    return [row for row in rows if row.value != "–"]


def describe_rheology(run: Run) -> list[ReportRow]:
    """Rheology of a layer that two walls shear or of a cell, with errors; nothing of other runs."""
    try:
        found = rheology(run)
    except PostError:
        return []
    rows = []
    for q in found.quantities:
        mean, error, note = found.mean[q.name], found.error[q.name], found.spread[q.name].note()
        if math.isfinite(mean):
            within = f" ± {pretty(error, 2)}" if math.isfinite(error) else ""
            unit = "" if q.unit == "1" else f" {unit_sign(q.unit)}"
            value = f"{pretty(mean)}{within}{unit}" + (f" ({note})" if note else "")
            rows.append(ReportRow(q.label.strip(), value))
    return rows


def describe_forces(run: Run) -> list[ReportRow]:
    """The contacts of the last frame with forces; nothing where there are none."""
    try:
        network = force_network(run)
    except PostError:
        return []
    if not network.i.size:
        return []
    return [
        ReportRow("at", f"t = {network.time:.6g} s"),
        *(ReportRow(name.strip(), pretty(value)) for name, value in network.rows),
    ]


def describe_books(table: EnergyTable, entries: Sequence[BookLine]) -> list[ReportRow]:
    """Some lines of the energy books at the end [J]; what never happened is left out."""
    return [
        ReportRow(entry.label, _number(float(table.books[entry.name][-1]), "J"))
        for entry in entries
        if entry.name in table.books
        and (np.any(table.books[entry.name]) or "imbalance" in entry.label)
    ]


def _number(value: Any, unit: str = "") -> str:
    return "–" if value is None else f"{pretty(value)} {unit}".strip()


def pretty(value: float, digits: int = 4) -> str:
    """A number with a real minus sign, and powers of ten as the scripts of the page write them."""
    if isinstance(value, int):
        return f"{value:,}".replace("-", "−")
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    power = f"·10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if exponent else ""
    return mantissa.replace("-", "−") + power


def _moment(text: str | None) -> str:
    return "–" if not text else text.replace("T", " ").replace("+00:00", " UTC")

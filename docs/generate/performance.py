"""Table and figure of the page about performance, from the recorded tables of ``benchmarks``.

The site takes the table at every build; ``python docs/generate/performance.py`` draws the figure,
which a test compares with the tables by the digest of their numbers that it carries.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multicor_cli.plots.style import COLORS, PAGE, house_style

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
FIGURE = BENCHMARKS.parent / "docs" / "pictures" / "performance.svg"
MARK = "<!-- budgets -->"
"""Where the page has the table of the budgets."""

_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")
_METHODS = "program", "gs", "sor-1.5", "apgd", "newton", "cpg"


def budgets() -> str:
    """The table of the budgets, with the paragraph that says when and where it was measured."""
    text = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
    found = re.search(r"^Two virtual cores.*?(?=\n\nLMGC90)", text, re.MULTILINE | re.DOTALL)
    assert found is not None, "benchmarks/README.md: the table of the budgets is not where it was"
    return found[0]


def figure() -> str:
    """What recorded benchmarks found, as SVG."""
    with house_style():
        drawing = Figure(figsize=(PAGE, 2.7), layout="constrained")
        FigureCanvasAgg(drawing)
        scaling, peers, methods = drawing.subplots(1, 3)
        _draw_scaling(scaling)
        _draw_peers(peers)
        _draw_methods(methods)
        written = io.StringIO()
        drawing.savefig(written, format="svg", metadata={"Date": None, "Description": digest()})
    return written.getvalue()


def digest() -> str:
    """Digest of the numbers that the figure shows."""
    shown = (
        _table("scaling", "scene"),
        _table("peers", "code"),
        _table("solvers", "method", "shear"),
    )
    return hashlib.blake2b(json.dumps(shown).encode(), digest_size=16).hexdigest()


def _draw_scaling(axes: Any) -> None:
    found: dict[tuple[str, str], dict[float, float]] = {}
    for row in _table("scaling", "scene"):
        sizes = found.setdefault((row["scene"], row["threads"]), {})
        sizes.setdefault(_number(row["grains"]), _number(row["ns/contact/sweep"]))
    for (scene, threads), sizes in found.items():
        color, line = COLORS[0 if scene == "bed" else 1], "-" if threads == "1" else "--"
        label = f"{scene}, {threads} thread{'s' if threads != '1' else ''}"
        axes.semilogx(
            list(sizes),
            list(sizes.values()),
            line,
            marker="o",
            markersize=3.0,
            color=color,
            label=label,
        )
    axes.set_xlabel("grains")
    axes.set_ylabel("time per contact and sweep [ns]")
    axes.set_ylim(0.0, 14.0)
    axes.legend(loc="upper left")


def _draw_peers(axes: Any) -> None:
    for color, peer in zip(COLORS, ("LIGGGHTS", "LAMMPS"), strict=False):
        rows = [
            row
            for row in _table("peers", "code")
            if row["code"].startswith(peer) and "κ" in row["code"]
        ]
        stiffness = [
            10.0 ** int(re.findall(r"10([⁰¹²³⁴⁵⁶⁷⁸⁹]+)", row["code"])[0].translate(_RAISED))
            for row in rows
        ]
        axes.loglog(
            stiffness,
            [_number(row["ratio"]) for row in rows],
            "o-",
            color=color,
            markersize=3.0,
            label=peer,
        )
    axes.axhline(1.0, color="0.4", linewidth=0.7)
    axes.text(1.2e4, 1.1, "multicor, rigid", fontsize=7.0, color="0.3")
    axes.set_xlabel(r"stiffness of the soft grains $\kappa = k_n/P$ [–]")
    axes.set_ylabel("time per strain over ours [–]")
    axes.set_ylim(0.6, 200.0)
    axes.legend(loc="upper left")


def _draw_methods(axes: Any) -> None:
    rows = {row["method"]: row for row in _table("solvers", "method", "shear")}
    times = [_number(rows[name]["shear"]) for name in _METHODS]
    places = range(len(_METHODS))
    axes.hlines(places, 1.0, times, color="0.8", linewidth=0.7)
    axes.plot(times[1:], places[1:], "o", color="0.4", markersize=4.0)
    axes.plot(times[:1], places[:1], "o", color=COLORS[0], markersize=5.0)
    axes.set_yticks(places, ["this program", *_METHODS[1:]])
    axes.tick_params(axis="y", which="both", length=0.0)
    axes.minorticks_off()
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlim(1.0, 1.5 * max(times))
    axes.set_xlabel("solve of a step, shear [ms]")


def _table(folder: str, *headings: str) -> list[dict[str, str]]:
    """The rows of the first table of a README that has these columns, the first of them first."""
    lines = (BENCHMARKS / folder / "README.md").read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines):
        names = _cells(line)
        if names[:1] == [headings[0]] and set(headings) <= set(names):
            rows = []
            for row in lines[number + 2 :]:
                if not row.startswith("|"):
                    return rows
                rows.append(dict(zip(names, _cells(row), strict=True)))
    message = f"benchmarks/{folder}/README.md has no table with the columns {', '.join(headings)}"
    raise ValueError(message)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []


def _number(cell: str) -> float:
    """The first number of a cell."""
    found = re.search(
        r"[\d.]+(e[+-]?\d+)?",
        cell.replace(",", "") if re.match(r"[\d,]+$", cell) else cell.replace("*", ""),
    )
    assert found is not None, cell
    return float(found[0])


if __name__ == "__main__":
    FIGURE.write_text(figure(), encoding="utf-8")

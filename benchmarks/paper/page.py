"""The page: every figure beside what the paper states about it."""

from __future__ import annotations

from html import escape
from pathlib import Path

from entry import Entry, Panel
from runs import Study

from multicor_cli import __version__

_CITATION = (
    "Nguyen, Fortin, Guessasma, Bellenger &amp; Cogné, <cite>J. Mech. Mater. Struct.</cite> 4(2), "
    "2009, 413–426"
)

_STYLE = """
:root { color-scheme: light dark; --line: #8884; --paper: #0072b2; --ours: #009e73;
  --differ: #d55e00; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 78rem; margin: 0 auto; padding: 1rem; }
nav a { display: inline-block; margin-right: .8rem; }
section { border-top: 1px solid var(--line); padding: 1rem 0 2rem; }
.sides { display: grid; grid-template-columns: minmax(17rem, 1fr) 2fr; gap: 2rem; }
.sides > * { min-width: 0; }
h3 { margin: 0 0 .3rem; font-size: 1rem; }
.paper { border-left: 4px solid var(--paper); padding-left: 1rem; align-self: start; }
.differ { border-left: 4px solid var(--differ); padding-left: 1rem; margin-top: 1rem; }
.ours { border-left: 4px solid var(--ours); padding-left: 1rem; }
ul, ol { margin: .2rem 0 .8rem; padding-left: 1.2rem; }
.panels { display: grid; gap: 1rem;
  grid-template-columns: repeat(auto-fit, minmax(min(20rem, 100%), 1fr)); }
figure { margin: 0; }
img { width: 100%; height: auto; background: white; border: 1px solid var(--line);
  border-radius: 4px; }
.single { grid-template-columns: minmax(0, 30rem); }
figcaption { font-size: .85rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; margin-top: 1rem; }
th, td { border-bottom: 1px solid var(--line); padding: .25rem .8rem .25rem 0; text-align: left;
  vertical-align: top; }
td { white-space: nowrap; }
.note { border: 1px solid var(--differ); border-radius: 4px; padding: .5rem 1rem; }
@media (max-width: 55rem) { .sides { grid-template-columns: minmax(0, 1fr); } }
"""


def write_page(folder: Path, entries: list[Entry], studies: list[Study]) -> Path:
    """Write ``index.html``, which shows the figures of the folder by relative links; returns its
    path.
    """
    links = "".join(
        f'<a href="#figure-{entry.number}">Figure {entry.number}</a>' for entry in entries
    )
    text = (
        "<!doctype html>\n"
        '<html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        'content="width=device-width, initial-scale=1">'
        f"<title>The figures of the paper with our data</title><style>{_STYLE}</style></head>\n"
        "<body><h1>The figures of the paper with our data</h1>\n"
        f"<p>The paper: {_CITATION}. Each figure is set beside what the paper states about it, in "
        "our words. Our numbers were computed from the runs when the page was made, by multicor "
        f"{escape(__version__)}.</p>\n{_runs(studies)}<nav>{links}</nav>\n"
        f"{''.join(_section(entry) for entry in entries)}</body></html>\n"
    )
    path = folder / "index.html"
    path.write_text(text, encoding="utf-8")
    return path


def _runs(studies: list[Study]) -> str:
    changed = [study.name for study in studies if not study.is_shipped]
    if not changed:
        return "<p>The runs are those of the shipped scenarios.</p>\n"
    return (
        f'<p class="note">The scenario of {escape(", ".join(changed))} is not the one shipped now '
        "(another version, or values set by hand): numbers may differ from the documentation.</p>\n"
    )


def _section(entry: Entry) -> str:
    single = " single" if len(entry.panels) == 1 else ""
    return (
        f'<section id="figure-{entry.number}"><h2>Figure {entry.number}. '
        f"{escape(entry.title)}</h2>\n"
        '<div class="sides"><div><div class="paper"><h3>The paper '
        f"states</h3>{_list(entry.states)}<h3>It leaves open</h3>{_list(entry.open)}</div>\n"
        '<div class="differ"><h3>Where we differ, and '
        f"why</h3>{_list(entry.differs)}</div></div>\n"
        f'<div class="ours"><h3>Ours</h3><div class="panels{single}">'
        f"{''.join(_panel(panel, entry) for panel in entry.panels)}</div>"
        f"{_table(entry)}</div></div></section>\n"
    )


def _list(items: list[str]) -> str:
    return f"<ul>{''.join(f'<li>{item}</li>' for item in items)}</ul>"


def _panel(panel: Panel, entry: Entry) -> str:
    alt = escape(f"Figure {entry.number}: {panel.caption}", quote=True)
    return (
        f'<figure><a href="{panel.name}.png"><img src="{panel.name}.png" alt="{alt}"></a>'
        f"<figcaption>{escape(panel.caption)} <a "
        f'href="{panel.name}.pdf">PDF</a></figcaption></figure>\n'
    )


def _table(entry: Entry) -> str:
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in entry.head)
    rows = "".join(
        f'<tr><th scope="row">{escape(row[0])}</th>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in entry.rows
    )
    return (
        "<div "
        f'class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )

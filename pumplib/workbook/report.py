"""Thesis, all chapters: the report as static HTML that needs no network.

The executed notebooks are exported with nbconvert's `basic` template, because its other templates
load MathJax and require.js from elsewhere. Formulas in the exports therefore stay LaTeX source;
JupyterLab shows them typeset.
"""

import html
import shutil
from pathlib import Path

from pumplib.errors import DataError
from pumplib.workbook import thesis_map
from pumplib.workbook.collect import Row
from pumplib.workbook.figures import FigureEntry, load_index
from pumplib.workbook.layout import Layout, write_text
from pumplib.workbook.state import State
from pumplib.workbook.table import count_text, format_bound, format_value

_CSS = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --paper: #fff; --line: #d0d7de;
  --panel: #f6f8fa; --link: #0550ae; --holds: #116329; --fails: #b3151f; --idle: #57606a; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --soft: #9aa4af; --paper: #0d1117;
  --line: #30363d; --panel: #161b22; --link: #79b8ff; --holds: #56d364; --fails: #ff7b72; --idle: #9aa4af; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 90rem; font: 16px/1.5 system-ui, sans-serif;
  color: var(--ink); background: var(--paper); overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; }
a { color: var(--link); }
nav a { margin-right: 1rem; white-space: nowrap; }
input { font: inherit; width: 100%; max-width: 30rem; padding: .4rem .6rem; color: inherit;
  background: var(--panel); border: 1px solid var(--line); border-radius: 4px; }
table { border-collapse: collapse; width: 100%; margin: .8rem 0; font-size: .9rem; }
th, td { text-align: left; vertical-align: top; padding: .4rem .6rem; border-bottom: 1px solid var(--line); }
thead th { position: sticky; top: 0; background: var(--paper); }
.holds { color: var(--holds); font-weight: 600; } .fails { color: var(--fails); font-weight: 700; }
.idle { color: var(--idle); }
tr.failing td { background: color-mix(in srgb, var(--fails) 12%, transparent); }
small { color: var(--soft); display: block; }
code, pre { font: .85em/1.45 ui-monospace, monospace; }
pre { background: var(--panel); padding: .6rem; overflow-x: auto; border-radius: 4px; white-space: pre; }
.gallery { display: grid; gap: 1rem;
  grid-template-columns: repeat(auto-fill, minmax(min(20rem, 100%), 1fr)); }
figure { margin: 0; border: 1px solid var(--line); border-radius: 4px; padding: .5rem; }
figure img { width: 100%; height: auto; background: #fff; }
.notebook { max-width: 60rem; margin: 0 auto; }
.notebook img { max-width: 100%; height: auto; background: #fff; }
.notebook .prompt { color: var(--soft); font-size: .75rem; }
.notebook table { display: block; overflow-x: auto; }
@media (min-width: 48rem) {
  table.cards th, table.cards td { overflow-wrap: break-word; }
  table.cards td:first-child, table.cards td[data-name="Time"], table.cards td[data-name="Status"],
  table.cards td[data-name="Value"] { white-space: nowrap; }
  table.cards td[data-name="Statement"], table.cards td[data-name="Note"] { min-width: 16rem; }
}
@media (max-width: 48rem) {
  table.cards thead { display: none; }
  table.cards tr { display: block; border: 1px solid var(--line); border-radius: 4px; margin-bottom: .6rem; }
  table.cards td { display: block; border: 0; padding: .2rem .6rem; }
  table.cards td:empty { display: none; }
  table.cards td::before { content: attr(data-name); color: var(--soft); font-size: .75rem; display: block; }
}
"""

_SEARCH = """
const box = document.getElementById("search");
const rows = [...document.querySelectorAll("#claims-table tbody tr")];
const count = document.getElementById("shown");
function filter() {
  const words = box.value.toLowerCase().split(/\\s+/).filter(Boolean);
  let shown = 0;
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    row.hidden = !words.every(word => text.includes(word));
    shown += row.hidden ? 0 : 1;
  }
  count.textContent = shown + " of " + rows.length + " claims";
}
box.addEventListener("input", filter);
filter();
"""


def _page(title: str, body: str, script: str = "") -> str:
    code = f"<script>{script}</script>" if script else ""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_CSS}</style>\n</head>\n"
        f"<body>\n{body}\n{code}</body>\n</html>\n"
    )


def _table(head: list[str], rows: list[tuple[str, list[str]]], name: str = "") -> str:
    """Build a table from cells that are HTML already; on a narrow screen each row becomes a card."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    lines = []
    for style, cells in rows:
        body = "".join(f'<td data-name="{h}">{c}</td>' for h, c in zip(head, cells, strict=True))
        lines.append(f'<tr class="{style}">{body}</tr>')
    tag = f' id="{name}"' if name else ""
    return (
        f'<table class="cards"{tag}><thead><tr>{top}</tr></thead>\n<tbody>\n' + "\n".join(lines) + "\n</tbody></table>"
    )


def _verdict(word: str) -> str:
    return f'<span class="{word if word in ("holds", "fails") else "idle"}">{word}</span>'


def _claims(rows: list[Row]) -> str:
    lines = []
    for row in rows:
        text = {key: html.escape(str(row[key])) for key in ("id", "statement", "metric", "thesis", "why", "note")}
        details = [f"thesis {row['section']}: {text['thesis']}", f"bound: {text['why']}"]
        if row["profile"]:
            details.append(f"bench profile {html.escape(row['profile'])}")
        origin = html.escape(row["origin"])
        runs = f"n = {row['n']}" if row["n"] else ""
        notes = [part for part in (runs, text["note"], origin) if part]
        cells = [
            _verdict(row["verdict"]),
            f"<code>{text['id']}</code>",
            f"{text['statement']}<small>{text['metric']}</small><small>{'; '.join(details)}</small>",
            html.escape(format_value(row)),
            html.escape(format_bound(row)),
            f"{row['class']}, {row['level']}",
            f"<small>{'; '.join(notes)}</small>" if notes else "",
        ]
        lines.append(("failing" if row["verdict"] == "fails" else "", cells))
    head = ["Verdict", "Claim", "Statement", "Value", "Bound", "Class", "Note"]
    return _table(head, lines, "claims-table")


def _notebooks(layout: Layout, states: dict[str, State], current: set[str]) -> str:
    lines = []
    for name, state in states.items():
        link = f'<a href="notebooks/{name}.html">{name}</a>'
        if not (layout.report / "notebooks" / f"{name}.html").exists():
            link = name
        status = state.status if name in current else f"{state.status}, inputs changed since"
        style = "holds" if status == "completed" else "fails" if state.status == "error" else "idle"
        message = f"<pre>{html.escape(state.message)}</pre>" if state.message else ""
        cells = [link, f'<span class="{style}">{status}</span>{message}', f"{state.seconds:.1f} s"]
        lines.append(("", [*cells, ", ".join(f"<code>{c.id}</code>" for c in state.claims)]))
    return _table(["Notebook", "Status", "Time", "Claims recorded"], lines)


def _gallery(layout: Layout, index: dict[str, FigureEntry]) -> str:
    folder = layout.report / "figures"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    items = []
    for entry in index.values():
        svg, png = (layout.figures / name for name in entry.files)
        if not (svg.exists() and png.exists()):
            continue
        shutil.copy(svg, folder)
        shutil.copy(png, folder)
        number = f"thesis figure {entry.thesis}, " if entry.thesis else ""
        title = html.escape(entry.title)
        links = f'<a href="figures/{svg.name}">SVG</a> <a href="figures/{png.name}">PNG</a>'
        picture = f'<img src="figures/{png.name}" alt="{title}" loading="lazy">'
        origin = f"{number}{entry.kind}, {entry.notebook}: <code>{entry.id}</code> {links}"
        items.append(
            f'<figure><a href="figures/{svg.name}">{picture}</a>'
            f"<figcaption>{title}<small>{origin}</small></figcaption></figure>"
        )
    return f'<div class="gallery">{"".join(items)}</div>' if items else "<p>No figures yet.</p>"


def _map(layout: Layout) -> str:
    try:
        entries = thesis_map.build(layout)
    except (DataError, OSError) as error:
        return f"<p>{html.escape(str(error))}</p>"
    lines = [
        (
            "",
            [
                html.escape(f"{e.section} {e.title}" if e.section != "summary" else e.title),
                ", ".join(f"<code>{name}</code>" for name in e.modules),
                ", ".join(e.notebooks),
                ", ".join(f"<code>{name}</code>" for name in e.claims),
            ],
        )
        for e in entries
    ]
    return _table(["Thesis", "Modules", "Notebooks", "Claims"], lines)


def export_notebook(source: Path, target: Path) -> None:
    """Write an executed notebook as one HTML page that loads nothing from elsewhere.

    Parameters
    ----------
    source : Path
        Executed notebook.
    target : Path
        HTML file.
    """
    from nbconvert import HTMLExporter

    exporter = HTMLExporter(template_name="basic", embed_images=True)
    body, _ = exporter.from_filename(str(source))
    top = f'<nav><a href="../index.html">Report</a></nav>\n<main class="notebook">\n{body}\n</main>'
    write_text(target, _page(source.stem, top))


def write_report(layout: Layout, states: dict[str, State], current: set[str], rows: list[Row]) -> Path:
    """Write the report.

    Parameters
    ----------
    layout : Layout
        Folders.
    states : dict of str to State
        Last run of each notebook.
    current : set of str
        Notebooks whose inputs have not changed since.
    rows : list of dict
        Judged claims.

    Returns
    -------
    Path
        `build/report/index.html`.
    """
    exports = layout.report / "notebooks"
    for name in states:
        source, target = layout.executed / f"{name}.ipynb", exports / f"{name}.html"
        if not source.exists():
            continue
        if not target.exists() or target.stat().st_mtime < source.stat().st_mtime:
            export_notebook(source, target)
    links = ("notebooks", "claims", "figures", "map")
    parts = [
        "<h1>Fault Detection and Isolation in Centrifugal Pumps: replication workbook</h1>",
        f"<p>{html.escape(count_text(rows))}</p>",
        "<nav>" + "".join(f'<a href="#{name}">{name.capitalize()}</a>' for name in links) + "</nav>",
        f'<h2 id="notebooks">Notebooks</h2>{_notebooks(layout, states, current)}',
        '<h2 id="claims">Claims</h2><p><label>Search claims, such as <code>fails</code> or <code>ch3</code>: '
        '<input id="search" type="search" autocomplete="off"></label> <span id="shown"></span></p>',
        _claims(rows),
        f'<h2 id="figures">Figures</h2>{_gallery(layout, load_index(layout.index))}',
        f'<h2 id="map">Thesis map</h2>{_map(layout)}',
    ]
    path = layout.report / "index.html"
    write_text(path, _page("Replication workbook", "\n".join(parts), _SEARCH))
    return path

"""One self-contained HTML page of a sweep: figures, table, comparisons, command, versions and seed."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2rem }
figure { margin: 1rem 0 } figure svg { max-width: 100%; height: auto }
figcaption { color: #444; font-size: .9rem }
pre { background: #f3f3f3; padding: .7rem; overflow-x: auto; white-space: pre-wrap }
.wide { overflow-x: auto }
table { border-collapse: collapse; font-size: .82rem; font-variant-numeric: tabular-nums }
th, td { padding: .15rem .55rem; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap }
th { border-bottom: 2px solid #888; position: sticky; top: 0; background: #fff }
td.text, th.text { text-align: left }
@media print { body { max-width: none } }
"""


def page(
    title: str,
    manifest: Mapping[str, Any],
    figures: Sequence[tuple[Path, str]],
    tables: Sequence[tuple[str, pd.DataFrame]],
    intro: str = "",
) -> str:
    """The page; `figures` are SVG files with their captions, which go into it."""
    parts = [
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>",
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{html.escape(intro)}</p>" if intro else "",
        "<h2>How it was made</h2>",
        f"<pre>{html.escape(str(manifest.get('command', '')))}</pre>",
        _settings(manifest),
    ]
    for number, (path, caption) in enumerate(figures, 1):
        parts.append(_figure(path, f"Figure {number}. {caption}", prefix=f"f{number}-"))
    for heading, table in tables:
        parts.append(f'<h2>{html.escape(heading)}</h2><div class="wide">{_table(table)}</div>')
    return "\n".join([*filter(None, parts), "</body></html>\n"])


def _settings(manifest: Mapping[str, Any]) -> str:
    config, versions = manifest["config"], manifest["versions"]
    seed = [("seed", config["seed"])]
    lines = [*seed, *((k, v) for k, v in config.items() if k != "seed"), *versions.items()]
    rows = "".join(
        "".join(f'<td class="text">{html.escape(_plain(text))}</td>' for text in line).join(("<tr>", "</tr>"))
        for line in lines
    )
    return f"<table>{rows}</table>"


def _plain(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _figure(path: Path, caption: str, prefix: str) -> str:
    """The drawing inline; its ids get a prefix, for two drawings in one page may have the same."""
    svg = path.read_text(encoding="utf-8")
    svg = svg[svg.index("<svg") :]
    for before in ('id="', 'href="#', "url(#"):
        svg = svg.replace(before, before + prefix)
    return f"<figure>{svg}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _table(table: pd.DataFrame) -> str:
    texts = {name for name in table.columns if not pd.api.types.is_numeric_dtype(table[name])}

    def cell(tag: str, name: str, text: str) -> str:
        mark = ' class="text"' if name in texts else ""
        return f"<{tag}{mark}>{html.escape(text)}</{tag}>"

    head = "".join(cell("th", name, name.replace("_", " ")) for name in table.columns)
    body = "".join(
        "<tr>" + "".join(cell("td", n, _number(v)) for n, v in zip(table.columns, row, strict=True)) + "</tr>"
        for row in table.itertuples(index=False)
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _number(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)

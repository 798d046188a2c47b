"""Self-contained HTML pages: their style, policy and tables."""

from __future__ import annotations

import html
from collections.abc import Sequence

STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
figure { margin: 0; } figcaption { font-size: .85rem; opacity: .8; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(26rem, 100%), 1fr)); gap: 1.5rem; }
figure svg { width: 100%; height: auto; background: #fff; border-radius: 4px; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .2rem .8rem .2rem 0; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 1px solid; }
pre { overflow-x: auto; padding: .8rem; border: 1px solid #8884; border-radius: 4px; font-size: .85rem; }
"""
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def page(title: str, body: str) -> str:
    """Return a page with a heading; `body` is HTML."""
    title = html.escape(title)
    head = (
        f'<meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"><style>{STYLE}</style>'
    )
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body><h1>{title}</h1>\n{body}\n</body></html>\n'


def table(heads: Sequence[str], lines: Sequence[Sequence[str]], links: Sequence[str] = ()) -> str:
    """Return a table of texts.

    Args:
        heads: The headings.
        lines: The cells of each line.
        links: The address for the first cell of each line. Empty: the table has no links.
    """
    head = "".join(f"<th>{html.escape(one)}</th>" for one in heads)
    rows = "".join(f"<tr>{_cells(line, links[place] if links else '')}</tr>" for place, line in enumerate(lines))
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'


def _cells(line: Sequence[str], link: str) -> str:
    first, *rest = map(html.escape, line)
    linked = f'<a href="{html.escape(link)}">{first}</a>' if link else first
    return "".join(f"<td>{cell}</td>" for cell in (linked, *rest))

"""The sniffer's page: one document with its style and scripts (`assets/`), and Meshcat's viewer.

A served page requests its data from its server. An embedded page contains all data, so it can be opened as a file. The
scripts are classic scripts that extend one object `Sniffer`: `model.js` creates it and is first, `main.js` starts the
page and is last, and the others are in alphabetical order, since they use each other only in later calls.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from typing import Literal

from robochoc.system.plain_text import printable
from robochoc.view.page_scripts import content_security_policy, labels_script, viewer_script

Mode = Literal["served", "embedded"]

_FIRST, _LAST = "model.js", "main.js"
_TITLE = "<title>Sniffer</title>"
"""The title in `index.html`, which is replaced."""


def sniffer_page(mode: Mode, embedded: Mapping[str, bytes] | None = None, title: str = "Sniffer") -> bytes:
    """Return the page, in UTF-8. Equal arguments give equal pages.

    Args:
        mode: Served by a server, or embedded: one file with all data.
        embedded: The page's data by name (`columns`, `details:0`), zlib-compressed. The names are trusted, the data is
            not.
        title: The title, as untrusted plain text.

    An embedded page without a `scene` leaves out Meshcat's viewer, a megabyte.
    """
    answers = embedded or {}
    connections = "'self'" if mode == "served" else "'none'"
    scripts = [_asset(name) for name in _scripts()]
    if mode == "served" or "scene" in answers:
        scripts += [labels_script(), viewer_script()]  # last, so that the page does not wait for them
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{content_security_policy(scripts, connections)}">\n'
        f'<link rel="icon" href="data:,">\n<style>\n{_asset("style.css")}</style>\n'
    )
    body = [_block(name, content) for name, content in answers.items()] + [_script(script) for script in scripts]
    before, _, after = _asset("index.html").partition(_TITLE)
    top, _, middle = after.partition("</head>")
    document = [before, f"<title>{escape(printable(title))}</title>", top, head, "</head>"]
    return "".join([*document, middle.replace("</body>", "\n".join([*body, "</body>"]))]).encode()


def _script(script: str) -> str:
    return f"<script>{script}</script>"


def _block(name: str, content: bytes) -> str:
    """Return an answer of `PageData` as a script element with a type that browsers do not execute."""
    text = base64.b64encode(content).decode()
    return f'<script id="feed:{escape(name)}" type="application/octet-stream">{text}</script>'


def _scripts() -> list[str]:
    names = sorted(entry.name for entry in (files(__package__) / "assets").iterdir() if entry.name.endswith(".js"))
    return [_FIRST, *(name for name in names if name not in {_FIRST, _LAST}), _LAST]


def _asset(name: str) -> str:
    return (files(__package__) / "assets" / name).read_text(encoding="utf-8")

"""The sniffer's page: one document with its style, scripts (`assets/`), and Meshcat's viewer.

A served page requests its data from the server. An embedded page contains all data and can be opened as a file. The
scripts are classic scripts that extend one object `Sniffer`. `model.js`, which creates the object, comes first, and
`main.js`, which starts the page, last. The other scripts are in alphabetical order, since they use each other only
later.
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
"""The title in `index.html`, which is replaced by the actual title."""


def sniffer_page(mode: Mode, embedded: Mapping[str, bytes] | None = None, title: str = "Sniffer") -> bytes:
    """Return the page in UTF-8. Equal arguments give equal pages.

    Args:
        mode: The source of the data: a server, or the page itself (embedded: one file with all data).
        embedded: The page's data by name (`columns`, `details:0`), zlib-compressed. The names are trusted, but not the
            data.
        title: The title as untrusted plain text.

    If there is no `scene`, an embedded page does not include Meshcat's viewer (1 MB).
    """
    answers = embedded or {}
    connections = "'self'" if mode == "served" else "'none'"
    scripts = [_asset(name) for name in _scripts()]
    if mode == "served" or "scene" in answers:
        scripts += [labels_script(), viewer_script()]  # at the end, so that the page does not wait for them
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{content_security_policy(scripts, connections)}">\n'
        f'<link rel="icon" href="data:,">\n<style>\n{base_style()}{_asset("style.css")}</style>\n'
    )
    body = [_block(name, content) for name, content in answers.items()] + [_script(script) for script in scripts]
    before, _, after = _asset("index.html").partition(_TITLE)
    top, _, middle = after.partition("</head>")
    document = [before, f"<title>{escape(printable(title))}</title>", top, head, "</head>"]
    return "".join([*document, middle.replace("</body>", "\n".join([*body, "</body>"]))]).encode()


def base_style() -> str:
    """Return the style that the pages of this package share: colours, text, buttons."""
    return _asset("base.css")


def _script(script: str) -> str:
    return f"<script>{script}</script>"


def _block(name: str, content: bytes) -> str:
    """Return an answer of `PageData` as a script element of a type that browsers do not execute."""
    text = base64.b64encode(content).decode()
    return f'<script id="feed:{escape(name)}" type="application/octet-stream">{text}</script>'


def _scripts() -> list[str]:
    names = sorted(entry.name for entry in (files(__package__) / "assets").iterdir() if entry.name.endswith(".js"))
    return [_FIRST, *(name for name in names if name not in {_FIRST, _LAST}), _LAST]


def _asset(name: str) -> str:
    return (files(__package__) / "assets" / name).read_text(encoding="utf-8")

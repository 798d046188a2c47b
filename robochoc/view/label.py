"""Labels of the scene as SVG pictures. The browser draws them in its own fonts, in any script."""

from __future__ import annotations

import unicodedata
from html import escape
from typing import NamedTuple

from robochoc.system.plain_text import printable

_EM = 44
"""Font size in pixels: sharp from close by, and still small in memory."""
_HEIGHT = 64
_LONGEST = 24


class Label(NamedTuple):
    """A picture, and its width divided by its height."""

    svg: str
    aspect: float


def label(text: str) -> Label:
    """Return `text` in white with a dark rim, readable on any background; cut where it is too long."""
    shown = printable(text)
    if len(shown) > _LONGEST:
        shown = shown[: _LONGEST - 1] + "…"
    ems = sum(1.1 if unicodedata.east_asian_width(sign) in "WF" else 0.62 for sign in shown)
    width = round(ems * _EM) + 24
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{_HEIGHT}">'
        f'<text x="50%" y="46" text-anchor="middle" font-family="system-ui,sans-serif" font-size="{_EM}"'
        ' font-weight="600" fill="#fff" stroke="#1d2733" stroke-width="9" stroke-linejoin="round"'
        f' paint-order="stroke">{escape(shown)}</text></svg>'
    )
    return Label(svg, width / _HEIGHT)

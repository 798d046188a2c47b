"""The button for light or dark. What is chosen is kept in the browser, so that it holds for all pages."""

from __future__ import annotations

from nicegui.element import Element

from robochoc.app.texts import say


class ThemeButton(Element, component="theme.js"):
    """Turns light into dark, and dark into light. The server is not asked, and not told."""

    def __init__(self) -> None:
        super().__init__()
        self._props["says"] = say("app.dark")

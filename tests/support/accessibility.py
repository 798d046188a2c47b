"""Accessibility faults of a page in a browser, found by axe-core."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.browser_pages import Page

_FOUND = """
async () => (await axe.run(document, {resultTypes: ["violations"]})).violations.flatMap(
  ({id, impact, nodes}) => nodes.map((node) => [impact, `${id}: ${node.target} ${node.failureSummary}`]))
"""


@cache
def _axe_core() -> str:
    spec = find_spec("axe_playwright_python")
    if spec is None or spec.origin is None:
        pytest.skip("axe-playwright-python is not installed")
    return Path(spec.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def axe_findings(page: Page) -> list[tuple[str, str]]:
    """Return the impact and the description of each violation that axe-core finds."""
    page.evaluate(_axe_core())
    return [(impact, text) for impact, text in page.evaluate(_FOUND)]

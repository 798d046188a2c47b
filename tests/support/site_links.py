"""The links within a folder of HTML pages, without a network."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

NAMES = ("href", "src", "poster", "data")


class _Page(HTMLParser):
    """The anchors and the links of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: Counter[str] = Counter()
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        del tag
        self.anchors.update(value for name, value in attrs if name == "id" and value)
        self.links += [value for name, value in attrs if name in NAMES and value is not None]


def broken_links(site: Path) -> Iterator[str]:
    """Yield a sentence for each broken link and for each anchor that a page has twice.

    Links to folders count as broken: a browser that reads files lists the folder. 404.html, which servers show at any
    address, has absolute links.
    """
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in sorted(site.resolve().rglob("*.html"))}
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        yield from (f"{name}: #{anchor} twice" for anchor, count in page.anchors.items() if count > 1)
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            place = unquote(parts.path)
            if place.startswith("/") and name.name == "404.html":
                there = site.resolve() / place.lstrip("/")
            else:
                there = (path.parent / place).resolve() if place else path
            if not there.is_relative_to(site.resolve()) or not there.is_file():
                yield f"{name}: {link}: no such file"
            elif parts.fragment and there in pages and unquote(parts.fragment) not in pages[there].anchors:
                yield f"{name}: {link}: no such anchor"


def external_hosts(site: Path) -> set[str]:
    """Return the hosts to which the pages have links."""
    pages = (_Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html"))
    return {host for page in pages for link in page.links if (host := urlsplit(link).netloc)}

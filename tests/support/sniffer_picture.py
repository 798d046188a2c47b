"""The picture of the sniffer in the README: a nogood of the first tutorial's team, explained.

`python -m tests.support.sniffer_picture` writes it, with Chromium.
"""

from __future__ import annotations

import argparse
import io
import tempfile
from pathlib import Path

from PIL import Image

from robochoc.cli.group import cli
from tests.support.browser_pages import chromium
from tests.support.program import ROOT
from tests.support.sniffer_pages import choose, drawn, shown
from tests.support.snippets import blocks_of

PICTURE = ROOT / "docs" / "images" / "nogood.png"
NOGOOD = 2
"""The number of the nogood among the six messages."""
SIZE = {"width": 1000, "height": 640}
SHOWN = {"width": 1000, "height": 548}
"""The part above the counters and the clock."""


def write_team(folder: Path) -> None:
    """Write the corrected files of docs/tutorials/first-team.md."""
    folder.mkdir(parents=True)
    for block in blocks_of((ROOT / "docs" / "tutorials" / "first-team.md").read_text()):
        if block.title:
            (folder / Path(block.title).name).write_text(block.text.replace("relay bases", "relay base"))


def page(folder: Path) -> Path:
    """Run ABT on the team, and return the sniffer's page of its journal."""
    write_team(folder / "first")
    journal, html = folder / "first.journal", folder / "first.html"
    run = ["solve", str(folder / "first"), "--protocol", "abt", "--runtime", "simulator", "--journal", str(journal)]
    cli(run, standalone_mode=False)
    cli(["journal", "export", str(journal), "--format", "html", "-o", str(html)], standalone_mode=False)
    return html


def main() -> None:
    """Write the picture."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    with tempfile.TemporaryDirectory() as place, chromium() as browser:
        url = page(Path(place)).as_uri()
        with shown(browser, url, "6 messages", viewport=SIZE) as shown_page:
            for panel in ("#show-left", "#fold"):
                shown_page.click(panel)
            choose(shown_page, NOGOOD)
            shown_page.wait_for_selector("#message .why")
            shown_page.evaluate("Sniffer.page.view.set({ rowHeight: 36, top: 0 })")
            drawn(shown_page)
            shown_page.mouse.move(0, 0)
            picture = shown_page.screenshot(clip={"x": 0, "y": 0, **SHOWN})
    small = Image.open(io.BytesIO(picture)).convert("P", palette=Image.Palette.ADAPTIVE, colors=160)
    small.save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()

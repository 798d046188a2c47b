"""The benchmarks that are studies: `robochoc experiment` carries them out, and writes their pages."""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path

from measure import ROBOCHOC, ROOT, say

STUDIES = Path(__file__).with_name("studies")
PAGES = Path(__file__).with_name("results")
HEADING = "## Studies"
NAMES = (
    "sweep-sparse", "sweep-dense", "variants", "awc-and-orders", "dynamic", "optimum", "colouring-cycles", "channels",
    "channels-costs",
)  # fmt: skip
"""Our own studies. Others in the folder repeat what papers claim: docs/explanation/replications.md."""


def page_of(name: str) -> str:
    """Carry out a study, as far as its runs are not there yet, and write its page; return what is on it."""
    say(name)
    results = ROOT / "out" / "bench" / f"{name}.sqlite"
    results.parent.mkdir(parents=True, exist_ok=True)
    PAGES.mkdir(exist_ok=True)
    page = PAGES / f"{name}.md"
    study = STUDIES / f"{name}.toml"
    for words in (["run", str(study), "-o", str(results)], ["report", str(results), "-o", str(page)]):
        subprocess.run([ROBOCHOC, "experiment", *words], check=True)
    return page.read_text()


def listed() -> str:
    """The section of RESULTS.md that leads to the pages."""
    lines = [
        HEADING,
        "",
        (
            "Questions that a [study](../docs/guides/experiments.md) answers, each in under four minutes of one core. "
            "`python benchmarks/run.py NAME` carries one out and writes its page; a test holds each page against it. "
            "[Replications](../docs/explanation/replications.md) has those that papers have answered before."
        ),
        "",
    ]
    for name in NAMES:
        title = tomllib.loads((STUDIES / f"{name}.toml").read_text())["title"]
        lines.append(f"- [{title}](results/{name}.md): `{name}`")
    return "\n".join(lines)

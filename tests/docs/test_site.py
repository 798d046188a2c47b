"""The site as `make docs` builds it: strictly, and readable without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from robochoc.run.registry import installed_protocols
from tests.support.program import ROOT

pytest.importorskip("material", reason="the extra docs is not installed: make docs")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    # Not --quiet: warnings that are not shown are not counted by --strict.
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    pages = [*site.rglob("*.html")]
    assert len(pages) > 50
    for page in pages:
        loaded = re.findall(r"<(?:script|link|img|iframe)\b[^>]*?(?:src|href)=\"?(https?:[^\"\s>]+)", page.read_text())
        assert not [address for address in loaded if "canonical" not in address], page.name


def test_there_is_a_page_for_each_protocol_and_for_each_command(site: Path) -> None:
    for offer in installed_protocols():
        page = (site / "reference" / "protocols" / f"{offer.name}.html").read_text()
        assert f"--protocol {offer.name}" in page
    commands = (site / "reference" / "cli.html").read_text()
    assert all(f"robochoc {name}" in commands for name in ("solve", "master", "journal export", "generate queens3d"))

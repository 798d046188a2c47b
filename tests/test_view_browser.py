"""A browser plays the page: it draws the drones, moves them, and meets no error."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from robochoc.outcome import Outcome, Verdict
from robochoc.view.page import page
from robochoc.view.scene import scene_of

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--window-size=800,600",
    "--enable-logging=stderr",
]
HOSTILE = "</script><img src=x onerror=document.title='broken'>"

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path")


@pytest.fixture
def html(tmp_path: Path) -> Path:
    assignment = {"V1.1": 2, "V1.2": 4, "V2.1": 3, "constructor": 1, HOSTILE: 2}
    outcome = Outcome(HOSTILE, "abt", "processes", 0, Verdict.SOLUTION, assignment, withdrawn=("Robot2.2", "__proto__"))
    file = tmp_path / "page.html"
    file.write_bytes(page(scene_of(outcome)))
    return file


def chromium(html: Path, after_ms: int, *flags: str) -> str:
    """Show the page for so long (of the browser's own time); returns standard output. No script may complain."""
    profile = html.parent / f"profile-{after_ms}"
    run = subprocess.run(
        [
            str(CHROMIUM),
            *FLAGS,
            f"--user-data-dir={profile}",
            f"--virtual-time-budget={after_ms}",
            *flags,
            html.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=100,
        check=True,
    )
    assert not re.findall(r"CONSOLE.*", run.stderr)
    return run.stdout


def screenshot(html: Path, after_ms: int) -> npt.NDArray[np.int16]:
    png = html.parent / f"{after_ms}.png"
    chromium(html, after_ms, f"--screenshot={png}")
    return np.asarray(Image.open(io.BytesIO(png.read_bytes())).convert("RGB"), dtype=np.int16)


def test_the_drones_move(html: Path) -> None:
    early, late = screenshot(html, 100), screenshot(html, 15_000)
    for picture in (early, late):
        scene = picture[150:, 300:]
        assert len(np.unique(scene.reshape(-1, 3), axis=0)) > 500
    changed = np.abs(early - late).max(axis=2) > 40
    assert changed.mean() > 0.005


def test_nothing_goes_wrong(html: Path) -> None:
    dom = chromium(html, 15_000, "--dump-dom")
    assert re.search(r'<p id="trouble" role="alert" hidden="">', dom)
    assert "<canvas" in dom
    assert "<img" not in dom
    assert "<title>broken" not in dom

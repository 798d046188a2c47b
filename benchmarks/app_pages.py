"""Part `app`: how long `robochoc app` takes to its first picture, and how 121 robots are modelled, decide and fly.

It needs the extra `app`, Playwright, and Chromium on the path.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from measure import ROBOCHOC, say, spread
from report import Row, Section

RUNS = 7
SIDE = 11
PATIENCE_S = 600
DECIDE = ".go button"
FLIGHT = "document.querySelector('.stage-views iframe').contentWindow.Playback.player"
FRAMES = """
() => new Promise((done) => {
  const times = [];
  const step = (now) => { times.push(now); times.length > 60 ? done(times) : requestAnimationFrame(step); };
  requestAnimationFrame(step);
})
"""


def measured() -> Section:
    """Start it several times, and look at its pages in one browser."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - an extra

    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    rows: list[Row] = [("what", "seconds, or frames a second")]
    with sync_playwright() as play, tempfile.TemporaryDirectory() as place:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        team = _team(Path(place))
        say(f"the application is started {RUNS} times")
        starts = [_start(browser, Path(place)) for _ in range(RUNS)]
        rows.append(("from the command to its address", spread(one for one, _ in starts)))
        rows.append(("from the command to the first picture", spread(two for _, two in starts)))
        with _app(Path(place)) as url:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            began = time.perf_counter()
            page.goto(f"{url}team/{team}/model")
            page.wait_for_selector("svg [data-robot], svg .robot")
            rows.append((f"page of a team of {SIDE * SIDE} robots", f"{time.perf_counter() - began:.2f}"))
            rows.append(("frames a second while a robot is dragged", f"{_dragging(page):.0f}"))
            rows += _deciding_and_flying(page, f"{url}team/{team}")
        browser.close()
    notes = (
        "Chromium without a window, its pages drawn by the processor. The picture is there when the gallery's cards "
        "are. Median (min..max). A flight has begun when its scene, which is simulated first, can be played."
    )
    return Section("app", "The application", notes, (rows,))


def _team(folder: Path) -> str:
    """Keep a team of 121 robots in a square, no two neighbours at the same level; return its id."""
    cells = [{"x": x, "y": y} for y in range(SIDE) for x in range(SIDE)]
    sketch = {
        "name": "square",
        "area": {"columns": SIDE, "rows": SIDE, "blocked": []},
        "robots": [{"name": f"R{number}", "at": cell} for number, cell in enumerate(cells)],
        "decisions": [{"name": "level", "kind": "level", "values": [*range(1, 6)]}],
        "rules": [{"id": "R1", "kind": "neighbours-different", "decision": "level", "settings": {"radius": 1}}],
    }
    name = "0123456789ab"
    (folder / name).mkdir()
    (folder / name / "history.json").write_text(json.dumps({"now": sketch}))
    return name


def _start(browser: Any, folder: Path) -> tuple[float, float]:  # noqa: ANN401 - Playwright's
    page = browser.new_page()
    began = time.perf_counter()
    with _app(folder) as url:
        answered = time.perf_counter() - began
        page.goto(url)
        page.wait_for_selector(".cards .drawn svg")
        shown = time.perf_counter() - began
        page.close()
    return answered, shown


@contextmanager
def _app(folder: Path) -> Iterator[str]:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [ROBOCHOC, "app", "--no-open", "--folder", str(folder)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None  # noqa: S101 - it is a pipe
        try:
            yield process.stderr.readline().split()[0]
        finally:
            process.send_signal(signal.SIGINT)


def _dragging(page: Any) -> float:  # noqa: ANN401 - Playwright's
    """Return how many frames a second are drawn while the first robot is dragged over the map."""
    box = page.locator("svg [data-robot], svg .robot").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    frames = page.evaluate_handle(f"window.frames_ = ({FRAMES})()")
    for step in range(60):
        page.mouse.move(box["x"] + 5 * step, box["y"] + 3 * step)
    times: list[float] = page.evaluate("window.frames_")
    frames.dispose()
    page.mouse.up()
    return 1000 / statistics.median(later - one for one, later in itertools.pairwise(times))


def _deciding_and_flying(page: Any, team: str) -> list[Row]:  # noqa: ANN401 - Playwright's
    """Let the team decide by a click, and see it fly: how long each takes, and frames a second of the flight."""
    page.set_default_timeout(PATIENCE_S * 1000)
    page.goto(f"{team}/decide")
    page.wait_for_function("window.did_handshake")
    began = time.perf_counter()
    page.click(DECIDE)
    page.wait_for_selector(f".headline:has-text('All {SIDE * SIDE} decide')")
    rows: list[Row] = [(f"from the click to the answer of {SIDE * SIDE} robots", f"{time.perf_counter() - began:.2f}")]
    began = time.perf_counter()
    page.goto(f"{team}/fly")
    page.wait_for_selector(".stage[data-ready=true]")
    rows.append(("from there to their flight", f"{time.perf_counter() - began:.2f}"))
    page.focus(".stage-line input")
    page.click(".stage-play")
    page.wait_for_function(f"{FLIGHT}.time > 0")
    times: list[float] = page.evaluate(f"({FRAMES})()")
    median = statistics.median(later - one for one, later in itertools.pairwise(times))
    rows.append(("frames a second of their flight, beside the conversation", f"{1000 / median:.0f}"))
    return rows

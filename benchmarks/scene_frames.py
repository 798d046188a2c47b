"""Measure how fast a browser without a graphics card draws the scene of a page.

    robochoc solve TEAM --html page.html
    python benchmarks/scene_frames.py page.html ...

For each page: the CPU time of all processes of the browser for each frame, frames and draw calls. The flight is played
slowly, so that each frame differs from the previous one. It needs Playwright, and Chromium on the path.
"""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path

SECONDS = 5
COUNT = f"""new Promise((done) => {{
  const {{ info }} = Playback.viewer.renderer;
  const [first, begun] = [info.render.frame, performance.now()];
  const step = () => {{
    if (performance.now() - begun < {1000 * SECONDS}) requestAnimationFrame(step);
    else done([info.render.frame - first, (performance.now() - begun) / 1000, info.render.calls]);
  }};
  step();
}})"""


def cpu_s() -> float:
    """Return the CPU time of the descendants of this process."""
    times, children = {}, dict[int, list[int]]()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        number = int(stat.parent.name)
        times[number] = int(fields[11]) + int(fields[12])
        children.setdefault(int(fields[1]), []).append(number)
    found, waiting = 0, [*children.get(os.getpid(), [])]
    while waiting:
        number = waiting.pop()
        found += times[number]
        waiting += children.get(number, [])
    return found / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print a line for each page."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("pages", nargs="+", type=Path, metavar="PAGE")
    pages: list[Path] = arguments.parse_args().pages
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - an extra

    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for file in pages:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.set_default_timeout(600_000)
            page.goto(file.resolve().as_uri())
            page.evaluate("Playback.player.speed = 0.25, Playback.player.seek(0), Playback.player.play()")
            page.wait_for_timeout(2_000)
            before = cpu_s()
            frames, wall_s, calls = page.evaluate(COUNT)
            used_ms = 1000 * (cpu_s() - before) / max(frames, 1)
            print(f"{file}: {used_ms:.0f} ms of CPU a frame, {frames / wall_s:.1f} frames a second, {calls} draw calls")
            page.close()
        browser.close()


if __name__ == "__main__":
    main()

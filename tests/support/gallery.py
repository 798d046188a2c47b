"""The pictures of docs/gallery.md.

`python -m tests.support.gallery` runs the page's commands, and draws the pictures from their results.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import robochoc
from tests.support.program import ROOT
from tests.support.snippets import steps_of

PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "images" / "gallery"
COLOURS = ("#1f66c1", "#d9822b", "#2b8a57", "#a63d8f", "#7a6a00")
"""Distinct colours, on white."""
PALE, GREY, RED, INK = "#e8edf4", "#9aa3ad", "#c0392b", "#1d2733"
FREE, DARK = 250, 100
"""Grey values of the map: free from here on, a wall below."""
Result = dict[str, Any]


class Drawing:
    """An SVG picture of small size, on white, so that it can be read in both modes of the site."""

    def __init__(self, width: int, height: int) -> None:
        self._size = width, height
        self._parts = [f'<rect width="{width}" height="{height}" rx="6" fill="#fff"/>']

    def rect(self, x: float, y: float, width: float, height: float, fill: str) -> None:
        """Draw a filled rectangle."""
        self._parts.append(f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" fill="{fill}"/>')

    def circle(self, x: float, y: float, radius: float, fill: str) -> None:
        """Draw a filled circle."""
        self._parts.append(f'<circle cx="{x:.0f}" cy="{y:.0f}" r="{radius:g}" fill="{fill}"/>')

    def line(self, points: Sequence[tuple[float, float]], colour: str, width: float = 1) -> None:
        """Draw a line through the points."""
        through = " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
        self._parts.append(f'<polyline points="{through}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>')

    def text(self, x: float, y: float, words: object, anchor: str = "middle", colour: str = INK) -> None:
        """Write words; `y` is their base line. Dark words have a white border, for lines below them."""
        border = "" if colour == "#fff" else ' stroke="#fff" stroke-width="4" paint-order="stroke"'
        place = f'x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" fill="{colour}"'
        self._parts.append(f"<text {place}{border}>{escape(str(words))}</text>")

    def svg(self) -> str:
        """Return the picture's file."""
        width, height = self._size
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
        )
        return "\n".join([f'{head} font-family="sans-serif" font-size="13">', *self._parts, "</svg>\n"])


def bars(rows: Sequence[tuple[str, float]], unit: str) -> Drawing:
    """Return horizontal bars with their names and values."""
    picture = Drawing(420, 34 * len(rows) + 20)
    most = max(value for _, value in rows)
    for place, (name, value) in enumerate(rows):
        y = 12 + 34 * place
        picture.text(92, y + 18, name, "end")
        picture.rect(100, y, 200 * value / most, 26, COLOURS[0])
        picture.text(106 + 200 * value / most, y + 18, f"{value:,g}{unit}", "start")
    return picture


def grid(
    rows: Sequence[str], columns: Sequence[object], cells: Mapping[tuple[int, int], tuple[object, str]]
) -> Drawing:
    """Return a table whose cells have a text and a colour, by row and column."""
    width, height, left, top = 62, 30, 84, 28
    picture = Drawing(left + width * len(columns) + 10, top + height * len(rows) + 10)
    for column, name in enumerate(columns):
        picture.text(left + width * (column + 0.5), 19, name)
    for row, name in enumerate(rows):
        picture.text(left - 8, top + height * row + 20, name, "end")
        for column in range(len(columns)):
            words, colour = cells.get((row, column), ("", PALE))
            picture.rect(left + width * column + 1, top + height * row + 1, width - 2, height - 2, colour)
            picture.text(left + width * (column + 0.5), top + height * row + 20, words, colour="#fff")
    return picture


def curves(named: Sequence[tuple[str, Sequence[float]]], across: str, up: str) -> Drawing:
    """Return a chart of series over 0, 1, ..."""
    width, height, left, top = 420, 220, 60, 34
    picture = Drawing(width, height)
    most = max(max(values) for _, values in named)
    last = max(len(values) for _, values in named) - 1

    def x(number: int) -> float:
        return left + (width - left - 20) * number / last

    def y(value: float) -> float:
        return height - 36 - (height - top - 46) * value / most

    picture.line([(left, top), (left, height - 36), (width - 16, height - 36)], GREY)
    picture.text(left - 6, y(most) + 5, f"{most:,.0f}", "end")
    picture.text(left - 6, y(0), "0", "end")
    picture.text(left, 18, up, "start")
    picture.text(width - 20, height - 10, f"{across} {last}", "end")
    for (name, values), colour in zip(named, COLOURS, strict=False):
        picture.line([(x(n), y(value)) for n, value in enumerate(values)], colour, 2)
        picture.text(width - 24, y(values[-1]) - 6, name, "end", colour)
    return picture


def queens(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the levels on the board."""
    levels = {re.sub("[A-Z]+", "", name): value for name, value in results[0]["assignment"].items()}
    away = {name.removeprefix("Robot") for name in results[0]["withdrawn"]}
    cells = {
        (int(name[0]) - 1, int(name[2]) - 1): (level, COLOURS[level - 1])
        for name, level in levels.items()
        if name not in away
    }
    return grid([f"row {n}" for n in range(1, 5)], [f"col {n}" for n in range(1, 5)], cells)


def meetings(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the timetable."""
    cells = {}
    for name, hour in results[0]["assignment"].items():
        person, meeting = (int(part) for part in name.removeprefix("V").split("."))
        cells[person - 1, hour - 1] = f"M{meeting}", COLOURS[meeting - 1]
    return grid([f"person {n}" for n in range(1, 6)], [f"hour {n}" for n in range(1, 6)], cells)


def tasks(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the map with the ways of each robot."""
    places = {name: (int(x), int(y)) for name, x, y in re.findall(r"  (\w+): {at: \[(\d+), (\d+)\]", PAGE.read_text())}
    at = {name: (50 + 40 * x, 260 - 36 * y) for name, (x, y) in places.items()}
    picture = Drawing(420, 290)
    robots = list(dict.fromkeys(name.partition(".")[0] for name in results[0]["assignment"]))
    for name, does in results[0]["assignment"].items():
        robot, _dot, task = name.partition(".")
        if does:
            picture.line([at[robot], at[task]], COLOURS[robots.index(robot)], 3)
    for name, (x, y) in at.items():
        if name in robots:
            picture.circle(x, y, 9, COLOURS[robots.index(name)])
        else:
            picture.rect(x - 7, y - 7, 14, 14, INK)
        picture.text(x, y + 24, name)
    return picture


def colouring(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the small world on a circle."""
    values = results[0]["assignment"]
    team = robochoc.load("out/ring").team
    number = {name: place for place, name in enumerate(values)}
    angle = 2 * math.pi / len(values)
    at = [(160 + 130 * math.sin(angle * n), 160 - 130 * math.cos(angle * n)) for n in range(len(values))]
    picture = Drawing(320, 320)
    for edge in sorted({tuple(sorted(each.variables, key=number.__getitem__)) for each in team.constraints()}):
        clash = len({values[name] for name in edge}) == 1
        picture.line([at[number[name]] for name in edge], RED if clash else GREY, 3 if clash else 1)
    for (x, y), value in zip(at, values.values(), strict=True):
        picture.circle(x, y, 9, COLOURS[value - 1])
    return picture


def rescue(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the levels in each epoch."""
    epochs = results[0]["epochs"]
    robots = list(dict.fromkeys(name for epoch in epochs for name in epoch["robots"]))
    cells = {}
    for column, epoch in enumerate(epochs):
        for row, robot in enumerate(robots):
            level = (epoch["assignment"] or {}).get(robot.lower())
            if level is not None:
                cells[row, column] = level, COLOURS[level - 1]
            elif robot in epoch["robots"]:
                cells[row, column] = "?", GREY
    return grid(robots, [f"epoch {n}" for n in range(len(epochs))], cells)


def asymmetric(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the costs of four protocols."""
    return bars([(result["protocol"], result["cost"]) for result in results], "")


def privacy(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the losses of three protocols."""
    measured = [result for result in results if "system" in result]
    return bars([(one["protocol"], round(100 * one["system"]["domain"]["entropy"], 1)) for one in measured], " %")


def coverage(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the plan, and the ways from start to place."""
    words = (ROOT / "docs/examples/building/building.pgm").read_text().splitlines()
    numbers = [int(word) for line in words[1:] if not line.startswith("#") for word in line.split()]
    columns, rows, _most, *pixels = numbers
    side = 10
    picture = Drawing(columns * side, rows * side)
    place = 0
    for grey, run in groupby(range(len(pixels)), lambda place: (place // columns, pixels[place])):
        length = len(list(run))
        if grey[1] < FREE:
            fill = INK if grey[1] < DARK else PALE
            picture.rect(place % columns * side, place // columns * side, length * side, side, fill)
        place += length

    def at(place: Sequence[float]) -> tuple[float, float]:
        return (place[0] + 0.25) * 4 * side, (rows - (place[1] + 0.25) * 4) * side

    starts = json.loads(Path("out/coverage/map.json").read_text())["places"]
    for (name, start), end, colour in zip(starts.items(), results[0]["places"].values(), COLOURS, strict=False):
        picture.line([at(start), at(end)], colour, 2)
        picture.circle(*at(start), 4, colour)
        picture.circle(*at(end), 10, colour)
        picture.text(at(end)[0], at(end)[1] + 5, name.removeprefix("Robot"), colour="#fff")
    return picture


def arrays(_: Sequence[Result], names: Mapping[str, Any]) -> Drawing:
    """Draw the conflicts over cycles."""
    return curves([("DSA", [float(cost) for cost in names["found"].costs])], "cycle", "conflicts")


def change(results: Sequence[Result], _: Mapping[str, Any]) -> Drawing:
    """Draw the messages in each epoch."""
    series = [(result["protocol"], [epoch["messages"] for epoch in result["epochs"]]) for result in results]
    return curves(series, "epoch", "messages")


SECTIONS: dict[str, Callable[[Sequence[Result], Mapping[str, Any]], Drawing]] = {
    each.__name__: each
    for each in (queens, meetings, tasks, colouring, rescue, asymmetric, privacy, coverage, arrays, change)
}
"""The pictures, in the order of the page's sections."""


def results_of(section: str) -> tuple[list[Result], dict[str, Any]]:
    """Run a section's steps; return the JSON results of `solve` and `privacy`, and the names of its Python."""
    results, names = [], {"__name__": "__main__"}
    for step in steps_of(section):
        if step.kind == "file":
            Path(step.words).write_text(step.code)
        elif step.kind == "python":
            exec(compile(step.code, "<page>", "exec"), names)  # noqa: S102 - our own page
        else:
            wants = re.match(r"robochoc (solve|privacy) ", step.code)
            program = [sys.executable, "-m", "robochoc", *step.code.split()[1:], *(["--json"] if wants else [])]
            done = subprocess.run(program, capture_output=True, text=True, check=True)
            results += [json.loads(done.stdout)] if wants else []
    return results, names


def drawn(name: str) -> str:
    """Return a picture's file, drawn from the results of its section, which is run in the current folder."""
    Path("out").mkdir(exist_ok=True)
    for part in ("instances", "docs"):
        if not Path(part).exists():
            Path(part).symlink_to(ROOT / part)
    sections = dict(zip(SECTIONS, PAGE.read_text().split("\n## ")[1:], strict=True))
    return SECTIONS[name](*results_of(sections[name])).svg()


def main() -> None:
    """Write all pictures."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        for name in SECTIONS:
            (PICTURES / f"{name}.svg").write_text(drawn(name))


if __name__ == "__main__":
    main()

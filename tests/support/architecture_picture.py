"""The picture of docs/explanation/architecture.md, drawn from import-linter's layers in pyproject.toml.

`python -m tests.support.architecture_picture` writes it.
"""

from __future__ import annotations

import argparse
import tomllib

from tests.support.program import ROOT

PICTURE = ROOT / "docs" / "images" / "architecture.svg"
_SUBJECTS = {
    "people": (
        "#dbe9fb",
        ("cli", "app", "leaderboard", "experiments", "api", "testing", "environments", "seats", "modelling"),
    ),
    "around a run": (
        "#e3f3e1",
        ("privacy", "sniffer", "exploration", "view", "replay", "ros", "vehicles", "robots", "rounds", "generators"),
    ),
    "a run": ("#fdeccb", ("run", "flight", "communication", "authority", "services", "journal")),
    "data": ("#efe5f7", ("formats", "maps", "tasks", "verification", "model", "system")),
    "reasoning": ("#fbdcd9", ("protocols", "solver")),
}
_FILL = {package: fill for fill, packages in _SUBJECTS.values() for package in packages}
_WIDTH, _HEIGHT, _GAP, _TEXT = 640, 30, 8, 15


def layers() -> list[list[str]]:
    """Return the layers of the package, the highest first, each with its packages."""
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]
    return [layer.split(" | ") for layer in contract["layers"] if layer != "__main__"]


def picture() -> str:
    """Return the picture as SVG: a row for each layer, coloured by subject, and a legend."""
    rows = layers()
    lines = [
        _box(place * (width + _GAP) + _GAP, row * (_HEIGHT + _GAP) + _GAP, width, _FILL[package], package)
        for row, packages in enumerate(rows)
        for width in [(_WIDTH - _GAP * (len(packages) + 1)) / len(packages)]
        for place, package in enumerate(packages)
    ]
    top = (len(rows) + 0.4) * (_HEIGHT + _GAP) + _GAP
    width = (_WIDTH - _GAP * (len(_SUBJECTS) + 1)) / len(_SUBJECTS)
    lines += [
        _box(place * (width + _GAP) + _GAP, top, width, fill, subject)
        for place, (subject, (fill, _)) in enumerate(_SUBJECTS.items())
    ]
    height = top + _HEIGHT + _GAP
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height:.0f}" role="img" '
        f'font-family="sans-serif" font-size="{_TEXT}">\n'
        "<title>The layers of robochoc: a package imports only those below it</title>\n"
        f'<rect width="{_WIDTH}" height="{height:.0f}" fill="#fff"/>'
    )
    return "\n".join([head, *lines, "</svg>\n"])


def _box(x: float, y: float, width: float, fill: str, text: str) -> str:
    return (
        f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{_HEIGHT}" rx="5" fill="{fill}" stroke="#555"/>'
        f'<text x="{x + width / 2:.0f}" y="{y + _HEIGHT / 2 + 5:.0f}" text-anchor="middle" fill="#111">{text}</text>'
    )


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    PICTURE.write_text(picture(), encoding="utf-8")

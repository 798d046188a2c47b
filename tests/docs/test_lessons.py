"""The lessons in the documentation are those of the application: pages, styles, and the recorded runs.

`python -m tests.docs.test_lessons` writes all of them again, after a lesson, a picture or a protocol has changed.
"""

from __future__ import annotations

import argparse
import re
from importlib.resources import files
from pathlib import Path

import msgspec

import robochoc.app.lessons
from robochoc.app.lessons.docs_page import lesson_page, list_page, page_name
from robochoc.app.lessons.lesson import COUNT, lesson
from robochoc.app.lessons.record import recorded
from robochoc.app.lessons.recording import recordings

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "lessons"
STYLE = ROOT / "docs" / "stylesheets" / "lessons.css"
NUMBERS = range(1, COUNT + 1)
_RUNS = Path(robochoc.app.lessons.__file__).parent / "runs"
_COLOURS = """/* Made from robochoc/app/lessons/picture.css by tests/docs/test_lessons.py. */
.lesson-picture { --paper: var(--md-default-bg-color); --ink: var(--md-default-fg-color);
  --soft: var(--md-default-fg-color--light); --raised: var(--md-code-bg-color); --accent: var(--md-typeset-a-color);
  margin: 1.2em 0; padding: .6em; border: 1px solid var(--md-default-fg-color--lightest); border-radius: .6em; }
"""


def _style() -> str:
    return _COLOURS + (files("robochoc.app.lessons") / "picture.css").read_text(encoding="utf-8")


def test_a_lesson_in_the_documentation_is_the_one_of_the_application() -> None:
    for number in NUMBERS:
        assert (PAGES / page_name(number)).read_text(encoding="utf-8") == lesson_page(number)


def test_the_list_and_the_style_are_those_of_the_application() -> None:
    assert (PAGES / "index.md").read_text(encoding="utf-8") == list_page()
    assert STYLE.read_text(encoding="utf-8") == _style()


def test_all_lessons_are_in_the_navigation_in_their_order() -> None:
    found = re.findall(r"lessons/([a-z0-9]+\.md)", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert found == ["index.md", *map(page_name, NUMBERS)]
    assert sorted(found) == sorted(page.name for page in PAGES.iterdir())


if __name__ == "__main__":
    argparse.ArgumentParser(description="Write the lessons and their recorded runs anew.").parse_args()
    PAGES.mkdir(exist_ok=True)
    for number in NUMBERS:
        runs = msgspec.json.encode(recorded(lesson(number)))
        (_RUNS / f"{number:02}.json").write_bytes(msgspec.json.format(runs, indent=1) + b"\n")
    recordings.cache_clear()
    for number in NUMBERS:
        (PAGES / page_name(number)).write_text(lesson_page(number), encoding="utf-8")
    (PAGES / "index.md").write_text(list_page(), encoding="utf-8")
    STYLE.write_text(_style(), encoding="utf-8")

"""The catalogue of texts: every text that is asked for is there, and none is there that nobody asks for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import robochoc.app
from robochoc.app.texts import catalogue, say

APP = Path(robochoc.app.__file__).parent
_KEY = re.compile(r"""["']([a-z]+(?:[.-][a-z0-9-]+)+)["']""")
_BUILT = re.compile(r"""f["']([a-z-]+\.(?:[a-z-]+\.)*)\{""")


def _asked() -> tuple[set[str], set[str]]:
    """All that looks like a key in the code, and the beginnings of those that are put together."""
    code = "\n".join(file.read_text(encoding="utf-8") for file in APP.rglob("*.py"))
    return set(_KEY.findall(code)), set(_BUILT.findall(code))


def test_every_text_that_is_asked_for_is_there() -> None:
    code = "\n".join(file.read_text(encoding="utf-8") for file in APP.rglob("*.py"))
    said = set(re.findall(r"""say\(\s*["']([^"'{]+)["']""", code)) | set(re.findall(r"""EditError\("([^"]+)\"""", code))
    assert said - set(catalogue()) == set()


def test_no_text_is_there_for_nobody() -> None:
    asked, built = _asked()
    assert {key for key in catalogue() if key not in asked and not key.startswith(tuple(built) or "-")} == set()


def test_what_a_text_names_is_filled_in() -> None:
    assert say("gallery.robots", count=3) == "3 robots"
    with pytest.raises(KeyError):
        say("no.such.text")

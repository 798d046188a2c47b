"""The pictures of docs/gallery.md are those of the results that its commands give today."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.gallery import PICTURES, SECTIONS, drawn


@pytest.mark.more
@pytest.mark.parametrize("name", [name for name in SECTIONS if name not in {"arrays", "privacy"}])
def test_a_picture_shows_the_results_of_the_commands(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`arrays` takes half a minute, and `privacy` needs the team of another section."""
    monkeypatch.chdir(tmp_path)
    assert drawn(name) == (PICTURES / f"{name}.svg").read_text()

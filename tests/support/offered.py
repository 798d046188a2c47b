"""As if packages had been installed that offer something."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest


def offered(monkeypatch: pytest.MonkeyPatch, group: str, **places: str | list[str]) -> None:
    """As if packages offered these under `group`, and nothing else was installed; several places: several packages."""
    found = [
        EntryPoint(name, place, group)
        for name, some in places.items()
        for place in ([some] if isinstance(some, str) else some)
    ]
    monkeypatch.setattr(
        "robochoc.system.installed.entries", lambda asked: [entry for entry in found if entry.group == asked]
    )

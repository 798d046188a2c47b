"""Entry points that no installed package has."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest


def install_entry_points(monkeypatch: pytest.MonkeyPatch, group: str, **places: str | list[str]) -> None:
    """Make `places` the entry points of `group`, the only ones. Several places of a name: as of several packages."""
    found = [
        EntryPoint(name, place, group)
        for name, some in places.items()
        for place in ([some] if isinstance(some, str) else some)
    ]
    monkeypatch.setattr(
        "robochoc.system.installed.installed_entry_points",
        lambda asked: [entry for entry in found if entry.group == asked],
    )

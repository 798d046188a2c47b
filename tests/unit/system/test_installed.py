"""A signal that meets the import of a package ends the program: it is no fault of the package."""

from __future__ import annotations

import signal
from importlib.metadata import EntryPoint

import pytest

from robochoc.robots import connections
from robochoc.system.installed import load_entry_point
from robochoc.system.termination import Terminated


class Struck:
    """An entry point during whose import SIGTERM arrives."""

    name, value, dist = "own", "own:Own", None

    def load(self) -> object:
        raise Terminated(128 + signal.SIGTERM)


class Leaving(Struck):
    def load(self) -> object:
        raise SystemExit(3)


def test_sigterm_ends_the_program_while_a_protocol_is_imported() -> None:
    with pytest.raises(Terminated, match="143"):
        load_entry_point(Struck(), [], lambda _: "")
    assert load_entry_point(Leaving(), [], lambda _: "").broken == "cannot be imported: SystemExit: 3"


def test_who_has_updated_an_editable_install_is_told_to_install_again() -> None:
    moved = EntryPoint("abt", "robochoc.protocols.moved_since:ABT", "robochoc.protocols")
    said = load_entry_point(moved, [], lambda _: "").broken
    assert said.startswith("cannot be imported: ModuleNotFoundError")
    assert said.endswith("; robochoc has changed since it was installed: run make demo, or pip install -e . again")
    other = EntryPoint("own", "no_such_module:Own", "robochoc.protocols")
    assert "changed since" not in load_entry_point(other, [], lambda _: "").broken


def test_sigterm_ends_the_program_while_a_sink_is_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "entry_points_named", lambda *_: [Struck()])
    with pytest.raises(Terminated):
        connections.open_sink("own:")
    monkeypatch.setattr(connections, "entry_points_named", lambda *_: [Leaving()])
    with pytest.raises(connections.UnknownSinkError, match="cannot be imported: SystemExit: 3"):
        connections.open_sink("own:")

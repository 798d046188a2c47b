"""What `robochoc master` prints of its events."""

from __future__ import annotations

import pytest

from robochoc.cli.commands.master import _Teller
from robochoc.journal.events import DroppedOut, Registered
from robochoc.run.networked.address import Address


def test_that_robots_can_come_is_said_before_who_has_come(capfd: pytest.CaptureFixture[str]) -> None:
    teller = _Teller(Address("127.0.0.1", 7447))
    teller.tell(Registered(t=0.0, robot="Scout"))
    assert capfd.readouterr() == ("", "")
    teller.listening()
    teller.tell(Registered(t=0.0, robot="Base"))
    assert capfd.readouterr().err.splitlines() == [
        "listening at 127.0.0.1:7447; start robots with --master 127.0.0.1:7447",
        "Scout is there",
        "Base is there",
    ]


def test_that_a_robot_has_dropped_out_is_said_in_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    teller = _Teller(Address("127.0.0.1", 7447))
    teller.listening()
    teller.tell(DroppedOut(t=0.0, robot="Scout", why="it has not been there for 10 s"))
    line = "Scout has dropped out: it has not been there for 10 s; waiting for it again"
    assert capfd.readouterr().err.splitlines()[1:] == [line]

"""What the master says at the end reaches all, also who was away for a moment, or has only just come."""

from __future__ import annotations

import time
from pathlib import Path

from robochoc.communication.network.control_messages import Bye, Joined, Leave, Register, Welcome
from robochoc.communication.network.framing import MASTER, Framing, Opened
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.transport import Transport
from tests.support.limits import HANG_S
from tests.support.network_runs import SLICE_S, NetworkRun
from tests.support.paused_abt import CHAIN
from tests.support.relays import Relay


def test_robots_that_are_away_for_a_moment_hear_the_masters_farewell(tmp_path: Path) -> None:
    """Behind a router that has been opened anew, everybody is."""
    with NetworkRun(tmp_path, absent=CHAIN.order) as run, Relay(run.endpoint) as relay:
        for name in CHAIN.order[:-1]:
            run.start(name, relay.endpoint)
        members = run.master.members.robots
        run.wait_until(lambda: len(members) == len(CHAIN.order) - 1, "robots do not register")
        relay.cut()
        run.wait_until(lambda: all(member.away_since for member in members.values()), "they do not go")
        run.give_up()
        time.sleep(2 * SLICE_S)
        relay.mend()
        run.wait_until(lambda: all(member.left for member in members.values()), "the master does not wait for them")
    assert [ending.why for ending in run.endings.values()] == ["the run is over"] * len(members)


def test_who_joins_while_the_master_says_farewell_hears_it(tmp_path: Path) -> None:
    """Not before: it may not have been welcomed yet, and would take it for another run's."""
    with NetworkRun(tmp_path, absent=CHAIN.order) as run, run.transport("RX0") as transport:
        framing = Framing("RX0")
        transport.send(MASTER, framing.write(MASTER, Register(profile_of(CHAIN["RX0"]), "a life")))
        run.give_up()
        welcomes = [heard(transport, framing) for _ in range(2)]  # until it answers
        assert {type(opened.message) for opened in welcomes} == {Welcome}
        framing.start_run(run.master.run)
        transport.send(MASTER, framing.write(MASTER, Joined("a life", b"")))
        while isinstance((opened := heard(transport, framing)).message, Welcome):
            pass
        assert opened == Opened(1, Leave("the run is over", failed=False))
        transport.send(MASTER, framing.write(MASTER, Bye()))


def heard(transport: Transport, framing: Framing) -> Opened:
    item = transport.inbox.get(timeout=HANG_S)
    assert isinstance(item, FrameArrived)
    return framing.read(MASTER, item.content)

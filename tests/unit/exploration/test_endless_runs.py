"""Faults "the robots may continue forever": the path, the cycle, the report, the page and the journal."""

from __future__ import annotations

import itertools
import json
from collections import defaultdict
from pathlib import Path
from random import Random

import pytest

from robochoc.exploration.changes import FaultPlan
from robochoc.exploration.check import CheckedTeam, CheckOptions, checked, graph_of
from robochoc.exploration.counterexample import write_counterexample
from robochoc.exploration.endless_runs import Edge, endless_run
from robochoc.exploration.problems import small_teams
from robochoc.exploration.team_state import Channel, Delivery, TeamState
from robochoc.journal.events import Received
from robochoc.journal.journal import read_journal
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.run import Options, Runtime
from robochoc.sniffer.orders_page import orders_page
from tests.support.compiled import plain_python_only

pytestmark = plain_python_only

OPTIONS = Options(protocol="abt", runtime=Runtime.SIMULATOR)


class AsksAgain(ABT):
    """Asks for each value again as soon as it has received it."""

    def receive(self, sender: str, message: Message) -> None:
        super().receive(sender, message)
        if isinstance(message, Ok):
            self.send(sender, AddLink())


class AsksAfterChange(DynABT):
    """Asks for each value again after a change of the problem."""

    asks = False

    def resume(self, *, lossless: bool) -> None:
        self.asks = True
        super().resume(lossless=lossless)

    def receive(self, sender: str, message: Message) -> None:
        super().receive(sender, message)
        if self.asks and isinstance(message, Ok):
            self.send(sender, AddLink())


def endless(protocol: type[Protocol], number: int, plan: FaultPlan) -> tuple[CheckedTeam, CheckOptions]:
    """Return a team whose robots may continue forever, and the options of its check."""
    team = next(itertools.islice(small_teams(protocol.traits, 3, 2, 0), number, None))
    options = CheckOptions(protocol, OPTIONS, plan=plan)
    (faulty,) = checked([team], options)
    assert faulty.exploration.fault.startswith("the robots may continue forever")
    return faulty, options


def channels_of(state: TeamState) -> set[Channel]:
    """Return the channels that are not empty."""
    return {channel for channel, _ in state.queues}


@pytest.mark.parametrize(
    ("protocol", "number", "plan"),
    [
        *((AsksAgain, number, FaultPlan()) for number in (0, 1, 3, 6)),
        *((AsksAfterChange, number, FaultPlan(events=1)) for number in (1, 4)),
    ],
)
def test_the_cycle_leads_back_and_is_fair(
    protocol: type[Protocol], number: int, plan: FaultPlan, tmp_path: Path
) -> None:
    faulty, options = endless(protocol, number, plan)
    found = faulty.exploration
    graph = graph_of(faulty.case, options)
    states = graph.along(found.run)
    assert states[len(found.path)] == states[-1]
    places = graph.stage_of(states[-1]).places
    delivered = {(places[step.receiver], places[sender]) for step in found.cycle for sender in step.senders}
    assert set.intersection(*map(channels_of, states[len(found.path) :])) <= delivered
    assert any(step.change for step in found.path) == any(plan)
    assert f"lead back to the state after step {len(found.path)}." in faulty.report.replace("\n", " ")
    page = orders_page(faulty, options, 100).decode()
    shown = json.loads(page.partition('type="application/json">')[2].partition("</script>")[0])
    assert len(shown["path"]) == len(found.run)
    write_counterexample(tmp_path / "run.jsonl", faulty.case, found.run, OPTIONS)
    journal = read_journal((tmp_path / "run.jsonl").read_bytes())
    received = [(one.receiver, one.sender) for one in journal.events if isinstance(one, Received)]
    assert received == [(step.receiver, sender) for step in found.run for sender in step.senders]


@pytest.mark.parametrize("seed", range(60))
def test_runs_are_endless_by_definition(seed: int) -> None:
    chance = Random(seed)
    size, channels = chance.randint(1, 6), [(0, 1), (1, 0)]
    waiting = [{one for one in channels if chance.random() < 0.7} for _ in range(size)]
    edges = defaultdict[int, list[Edge]](list)
    for one, other in itertools.product(range(size), repeat=2):
        if chance.random() < 0.3:
            served = frozenset(channel for channel in waiting[one] if chance.random() < 0.4)
            edges[one].append(Edge(other, Delivery(str(other)), served))

    def reached(start: int, within: set[int]) -> set[int]:
        """Return the states that can be reached from `start` by at least one step, among `within`."""
        seen, left = set[int](), [start]
        while left:
            new = {edge.after for edge in edges[left.pop()]} & within - seen
            seen |= new
            left += new
        return seen

    def is_fair(inside: set[int]) -> bool:
        served = {channel for one in inside for edge in edges[one] if edge.after in inside for channel in edge.channels}
        return set.intersection(*(waiting[one] for one in inside)) <= served

    near = {0} | reached(0, {*range(size)})
    subsets = ({*some} for count in range(1, size + 1) for some in itertools.combinations(near, count))
    expected = any(is_fair(some) and all(reached(one, some) == some for one in some) for some in subsets)
    run = endless_run(lambda number: [edge.after for edge in edges[number]], edges.__getitem__, waiting.__getitem__)
    assert (run is not None) == expected
    if run is not None:
        states = [0, *(int(step.receiver) for step in (*run.path, *run.cycle))]
        assert states[len(run.path)] == states[-1]
        assert run.cycle

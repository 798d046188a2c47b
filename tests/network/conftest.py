"""What several test files of the network begin with."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from tests.support import traitors
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.one_traitor import CHAIN
from tests.support.traitors import Lie


@pytest.fixture(autouse=True)
def measured_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots in this process do not measure its memory: the system takes long to add up that of many tests."""
    monkeypatch.setattr("robochoc.communication.network.searcher.own_memory", lambda: 1_000_000)


@pytest.fixture
def lied() -> Iterator[Callable[..., InMemoryNetwork]]:
    """A team in which RB lies, after a search. Each call ends the lie of the call before."""
    with ExitStack() as patches:

        def searched(lie: Lie, protocol: type[Protocol] = ABT, team: Team = CHAIN) -> InMemoryNetwork:
            patches.close()
            traitors.install(lie, "RB", patches.enter_context(pytest.MonkeyPatch.context()).setattr)
            office = InMemoryNetwork(team, protocol, traitor="RB")
            office.search()
            return office

        yield searched

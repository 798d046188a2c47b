"""What several test files of the network begin with."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from tests.support import traitors
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.one_traitor import CHAIN
from tests.support.traitors import Lie


@pytest.fixture
def lied(monkeypatch: pytest.MonkeyPatch) -> Callable[..., InMemoryNetwork]:
    """A team in which RB lies, after a search."""

    def searched(lie: Lie, protocol: type[Protocol] = ABT, team: Team = CHAIN) -> InMemoryNetwork:
        traitors.install(lie, "RB", monkeypatch.setattr)
        office = InMemoryNetwork(team, protocol, traitor="RB")
        office.search()
        return office

    return searched

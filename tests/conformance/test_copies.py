"""A copy of a host behaves as the original, for every protocol."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from functools import partial
from random import Random

import pytest

from robochoc.communication.host import Host
from robochoc.protocols.message import Envelope
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import agent_problems
from tests.support.allocation_problems import simple_allocation_team
from tests.support.compiled import plain_python_only
from tests.support.cost_problems import random_cost_team
from tests.support.encrypted_problems import affordable
from tests.support.examples import count
from tests.support.problems import random_team

pytestmark = pytest.mark.usefixtures("quick_encryption")
STEPS = 60
"""The number of messages that are delivered after the copy."""


def hosts_of(protocol: str, chance: Random) -> dict[str, Host]:
    """Return the hosts of a random team that the protocol accepts."""
    kind = protocol_named(protocol)
    traits = kind.traits
    draw = partial(random_cost_team if traits.costs else random_team, chance, n_ary=traits.n_ary)
    team = simple_allocation_team(chance) if traits.allocates else affordable(protocol, draw)
    parts = agent_problems(team, shared_scopes=traits.shared_scopes, tree=traits.tree)
    return {name: Host.create(kind, part) for name, part in parts.items()}


def delivered(hosts: Mapping[str, Host], transit: list[Envelope], chance: Random, steps: int) -> list[object]:
    """Deliver up to `steps` messages in a random order, first in, first out on each channel; return what is seen."""
    seen: list[object] = []
    while transit and len(seen) < steps and all(host.protocol.verdict is None for host in hosts.values()):
        envelope = chance.choice(transit)
        first = next(one for one in transit if (one.sender, one.receiver) == (envelope.sender, envelope.receiver))
        transit.remove(first)
        host = hosts[first.receiver]
        sent = host.handle([first])
        transit += sent
        seen.append((host.name, sent, host.protocol.assignment, host.protocol.findings, host.metrics()))
    return seen


@plain_python_only
@pytest.mark.parametrize("protocol", protocol_names())
@count("number", fast=3, slow=300)
def test_a_copy_behaves_as_the_original(protocol: str, number: int) -> None:
    for seed in range(number):
        chance = Random(f"{protocol} {seed}")
        hosts = hosts_of(protocol, chance)
        transit = [envelope for host in hosts.values() for envelope in host.start()]
        delivered(hosts, transit, chance, chance.randint(0, 25))
        twins, copied, schedule = deepcopy(hosts), [*transit], chance.getrandbits(32)
        first = delivered(twins, copied, Random(schedule), STEPS)
        assert delivered(hosts, transit, Random(schedule), STEPS) == first, f"seed {seed}"

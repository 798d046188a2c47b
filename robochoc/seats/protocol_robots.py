"""Protocols as players: local search in which every robot sends its value in each cycle.

A round is a cycle. The values that other players announce count as values in the protocol's messages. Protocols with
one phase (DSA and its variants, regret matching) need nothing else. In MGM, robots also exchange gains within the
round: a robot that MGM does not play has the gain 0, so it never prevents a move, and the cost may rise.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from robochoc.communication.host import Host
from robochoc.protocols.local_search.dsa import OnePhase
from robochoc.protocols.local_search.mgm import MGM, Gain
from robochoc.protocols.message import Envelope, Message, encode
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import NO_GAIN, Value
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.run.registry import protocol_named
from robochoc.seats.moves import Move, Players, Seen
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.errors import UnsupportedError


class ProtocolRobots(Players):
    """Robots that one protocol plays.

    Args:
        rounds: The team.
        protocol: The name of the protocol.
        robots: The robots.
        seed: The seed of the protocol.
        number: The number of rounds.

    Raises:
        UnknownProtocolError: if the protocol is not installed.
        UnsupportedError: if the protocol cannot play in rounds, or does not accept the team.
    """

    def __init__(self, rounds: TeamRounds, protocol: str, robots: Iterable[str], seed: int, number: int) -> None:
        kind = protocol_named(protocol)
        if not (issubclass(kind, OnePhase) or kind is MGM):
            raise UnsupportedError(
                f"{protocol} cannot play in rounds: its robots must choose values in cycles, as in dsa, dsa-sdp,"
                " mixed-dsa, regret-matching and mgm"
            )
        self.kind = protocol
        self._has_gains = kind is MGM
        self.robots = tuple(robots)
        self._rounds = rounds
        parameters = RunParameters(seed, {"cycles": str(number + 2)})
        parts = agent_problems(rounds.compiled, parameters, shared_scopes=True)
        order = PriorityOrder(rounds.team.order)
        self._hosts = {name: Host.create(kind, parts[name], order) for name in self.robots}

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Run one cycle of the protocol, and return the robots' values."""
        gains: list[Envelope] = []
        for name, host in self._hosts.items():
            one = seen[name]
            if one.round == 1:
                host.start()
            else:
                values = one.announced.items()
                gains += host.handle([_envelope(other, name, Value(value)) for other, value in values])
        if self._has_gains and gains:
            self._exchange_gains(gains)
        return {name: Move(host.protocol.value) for name, host in self._hosts.items()}

    def _exchange_gains(self, sent: Iterable[Envelope]) -> None:
        """Deliver the gains of these robots, and the gain 0 of all other neighbours."""
        gains: dict[str, list[Envelope]] = {name: [] for name in self._hosts}
        for envelope in sent:
            if envelope.receiver in gains:
                gains[envelope.receiver].append(envelope)
        for name, host in self._hosts.items():
            others = [other for other in self._rounds.problems[name].neighbours if other not in self._hosts]
            host.handle([*gains[name], *(_envelope(other, name, Gain(*NO_GAIN)) for other in others)])


def _envelope(sender: str, receiver: str, message: Message) -> Envelope:
    return Envelope(sender, receiver, encode(message), 0)

"""ABT and a simulator, written anew from the papers: what the counts of robochoc's `abt` are held against.

No code is shared with robochoc, and none of its words. Agents are numbers, 0 the highest; each has one variable with
the values 0, 1, ... The agent is that of Yokoo, Durfee, Ishida, Kuwabara (IEEE TKDE 10(5), 1998) in the form of
Bessiere, Maestre, Brito, Meseguer (AIJ 161, 2005), which adds links; one nogood is kept for each value, that with the
highest lowest variable; all messages that are there are read before the view is checked. Checks and clocks are those
of Meisels, Kaplansky, Razgon, Zivan (2002): looking at one constraint for one value is a check, which moves the
agent's clock by one; a message carries the clock as it is when it is sent; who reads it takes the larger clock. An
agent that computes reads what comes meanwhile when it is done (Zivan and Meisels 2006, without delays).
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import NamedTuple

Conflicts = Mapping[tuple[int, int], frozenset[tuple[int, int]]]
"""For each constraint, by its agents, the higher first: the pairs of values that it forbids."""


class Counts(NamedTuple):
    """What a run needed, and whether there is a solution."""

    solvable: bool
    messages: int
    ncccs: int


class Nogood(NamedTuple):
    """While `given` stands the receiver must not take `value`."""

    given: dict[int, int]
    value: int


class Network:
    """Who is told what, and when; and the agents' clocks."""

    def __init__(self, size: int, seed: int) -> None:
        self.clocks = [0] * size
        self.messages = 0
        self._lots = random.Random(seed)
        self._letters: list[list[tuple[int, int, int | Nogood | None]]] = [[] for _ in range(size)]

    def send(self, sender: int, receiver: int, content: int | Nogood | None) -> None:
        """A value, a nogood, or (None) the wish to be told values; stamped with the sender's clock."""
        self.messages += 1
        self._letters[receiver].append((self.clocks[sender], sender, content))

    def read(self) -> tuple[int, list[tuple[int, int | Nogood | None]]] | None:
        """The agent that is the first to get to its letters, and those; it takes up their clocks."""
        ready = [
            (max(self.clocks[agent], min(stamp for stamp, _, _ in letters)), self._lots.random(), agent)
            for agent, letters in enumerate(self._letters)
            if letters
        ]
        if not ready:
            return None
        now, _, agent = min(ready)
        letters = sorted((letter for letter in self._letters[agent] if letter[0] <= now), key=lambda one: one[0])
        self._letters[agent] = [letter for letter in self._letters[agent] if letter[0] > now]
        self.clocks[agent] = now
        return agent, [(sender, content) for _, sender, content in letters]


class Agent:
    """One agent. `above` holds what it checks, by the higher agent; `told` those who hear its value."""

    def __init__(self, number: int, values: int, conflicts: Conflicts, network: Network) -> None:
        self.number = number
        self.value: int | None = None
        self.hopeless = False
        self._network = network
        self._values = range(values)
        self._above = {pair[0]: conflicts[pair] for pair in sorted(conflicts) if pair[1] == number}
        self._told = [lower for higher, lower in sorted(conflicts) if higher == number]
        self._known = set(self._above)
        self._view: dict[int, int] = {}
        self._reasons: dict[int, dict[int, int]] = {}

    def hear(self, sender: int, content: int | Nogood | None) -> None:
        """Read one letter."""
        if content is None:
            if sender not in self._told:
                self._told.append(sender)
            if self.value is not None:
                self._network.send(self.number, sender, self.value)
        elif isinstance(content, Nogood):
            self._object(sender, content)
        else:
            self._see(sender, content)

    def decide(self) -> None:
        """Keep the value, or take the first that stands, or go back until there is one."""
        while not self.hopeless:
            if self.value is not None and self._stands(self.value):
                return
            self.value = next((value for value in self._values if self._stands(value)), None)
            if self.value is not None:
                for lower in self._told:
                    self._network.send(self.number, lower, self.value)
                return
            self._go_back()

    def _object(self, sender: int, nogood: Nogood) -> None:
        if nogood.value != self.value:
            return
        if any(self._view.get(agent) != value for agent, value in nogood.given.items() if agent in self._known):
            self._network.send(self.number, sender, self.value)  # the sender has forgotten it
            return
        for agent, value in nogood.given.items():
            if agent not in self._known:
                self._known.add(agent)
                self._network.send(self.number, agent, None)
                self._see(agent, value)
        self._keep(nogood.value, nogood.given)
        self.value = None

    def _see(self, agent: int, value: int | None) -> None:
        """`agent` has this value now; reasons that say otherwise go."""
        if value is None:
            self._view.pop(agent, None)
        else:
            self._view[agent] = value
        self._reasons = {own: why for own, why in self._reasons.items() if why.get(agent, value) == value}

    def _stands(self, value: int) -> bool:
        """Whether nothing that is known is against `value`; checks constraints, the highest first."""
        if value in self._reasons:
            return False
        for higher, forbidden in self._above.items():
            if higher in self._view:
                self._network.clocks[self.number] += 1
                if (self._view[higher], value) in forbidden:
                    self._keep(value, {higher: self._view[higher]})
                    return False
        return True

    def _keep(self, value: int, why: dict[int, int]) -> None:
        """Of two reasons the one whose lowest agent is higher, then the shorter."""
        before = self._reasons.get(value)
        if before is None or (max(why, default=-1), len(why)) < (max(before, default=-1), len(before)):
            self._reasons[value] = why

    def _go_back(self) -> None:
        given: dict[int, int] = {}
        for why in self._reasons.values():
            given |= why
        if not given:
            self.hopeless = True
            return
        lowest = max(given)
        value = given.pop(lowest)
        self._network.send(self.number, lowest, Nogood(given, value))
        self._see(lowest, None)


def search(size: int, values: int, conflicts: Conflicts, seed: int) -> Counts:
    """Solve the problem of `size` agents with `values` values each; `seed` breaks ties."""
    network = Network(size, seed)
    agents = [Agent(number, values, conflicts, network) for number in range(size)]
    for agent in agents:
        agent.decide()
    while letters := network.read():
        agent = agents[letters[0]]
        for sender, content in letters[1]:
            agent.hear(sender, content)
        agent.decide()
        if agent.hopeless:
            return Counts(solvable=False, messages=network.messages, ncccs=max(network.clocks))
    return Counts(solvable=True, messages=network.messages, ncccs=max(network.clocks))

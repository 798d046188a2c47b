"""Who has registered with the master: profiles, lives, and what of them is common knowledge. Pure."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from robochoc.communication.network.access import ALL
from robochoc.communication.network.profile import (
    BadProfile,
    Profile,
    Ranges,
    acquaintances,
    contradictions,
    in_priority_order,
    missing,
    ranges_of,
    silhouette,
)
from robochoc.communication.network.words import Task
from robochoc.problem import Robot
from robochoc.protocols.traits import Traits
from robochoc.solver.part import Brief


def reach(profiles: Mapping[str, Profile], *, beyond: bool) -> dict[str, tuple[str, ...]]:
    """To whom each of a team may write besides the master. See `Members.reach`."""
    if beyond:
        return dict.fromkeys(profiles, (ALL,))
    met = acquaintances(profiles)
    return {name: tuple(sorted(profiles.keys() & others)) for name, others in met.items()}


class NotTaken(ValueError):  # noqa: N818 - named for the answer
    """A robot cannot be registered; the message says why."""


@dataclass
class Member:
    """A registered robot in its life `visit`; `gone` since when it is away (None: it is there)."""

    profile: Profile
    visit: str
    also: dict[str, Ranges] = field(default_factory=dict)
    card: bytes = b""
    joined: bool = False
    gone: float | None = None
    left: bool = False

    @property
    def robot(self) -> Robot:
        """Its silhouette."""
        return silhouette(self.profile, self.also)


class Members:
    """All registered robots, by name.

    `expected` names who alone may come (None: whoever the Authority lets in), `number` says how many do. Without either
    the team is complete when every neighbour that a robot names is there. `order` is the priority order, where it is
    known before; parents come before their children in it. `ways` are those that it will have (`reach`), likewise.
    """

    def __init__(
        self,
        expected: Collection[str] | None = None,
        number: int | None = None,
        order: Sequence[str] | None = None,
        ways: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
    ) -> None:
        self.expected = expected
        self.ways = ways
        self._order = order
        self.number = number
        self.robots: dict[str, Member] = {}
        self.closed = False
        self._known: frozenset[tuple[str, str]] = frozenset()
        self._acquainted: dict[str, tuple[str, ...]] = {}
        self._over: set[str] = set()
        """Lives that have ended. In one that goes on after all, letters are numbered as nobody expects."""

    @property
    def profiles(self) -> dict[str, Profile]:
        """What all have told of themselves."""
        return {name: member.profile for name, member in self.robots.items()}

    def register(self, sender: str, profile: Profile, visit: str) -> Member:
        """Take `sender` in, or find it there already in the same life. Raises `NotTaken`."""
        known = self.robots.get(sender)
        if known and known.visit == visit:
            return known
        if profile.name != sender:
            raise NotTaken(f"its file is {profile.name[:80]!r}'s, and its certificate {sender}'s")
        if visit in self._over:
            raise NotTaken("it was away for too long; start it anew")
        if known and (self.closed or known.gone is None):
            raise NotTaken(f"a robot called {sender} is registered already")
        if self.closed or (self.expected is not None and sender not in self.expected):
            raise NotTaken("the team is complete without it" if self.closed else "it is not one of the team")
        try:
            silhouette(profile, {})
        except BadProfile as bad:
            raise NotTaken(str(bad)) from None
        others = {name: other for name, other in self.profiles.items() if name != sender}
        wrong = next(contradictions({**others, sender: profile}), None)
        if wrong:
            raise NotTaken(wrong)
        if known:
            self._over.add(known.visit)
        self.robots[sender] = Member(profile, visit)
        return self.robots[sender]

    @property
    def awaited(self) -> set[str]:
        """Who has to come yet, as far as that is known by name."""
        return (set(self.expected or ()) | missing(self.profiles)) - self.robots.keys()

    @property
    def complete(self) -> bool:
        """Whether all are there: as many as were asked for, or all that somebody names."""
        enough = self.number is None or len(self.robots) >= self.number
        return bool(self.robots) and enough and not self.awaited and all(m.joined for m in self.robots.values())

    def unseen(self) -> dict[str, tuple[str, ...]]:
        """Variables that parts of partially known constraints look at, and whose owners have not shown them."""
        wanted: dict[str, dict[str, None]] = {}
        for member in self.robots.values():
            for child, names in member.profile.looks_at.items():
                other = self.robots.get(child)
                if other:
                    unseen = [name for name in names if name not in other.profile.variables and name not in other.also]
                    wanted.setdefault(child, {}).update(dict.fromkeys(unseen))
        return {child: tuple(names) for child, names in wanted.items() if names}

    def remove(self, names: Collection[str]) -> None:
        """Robots are out for good: whoever named them as neighbours does so no more."""
        for name in names:
            member = self.robots.pop(name, None)
            if member:
                self._over.add(member.visit)

    @property
    def order(self) -> tuple[str, ...]:
        """The total priority order of those that are there."""
        if self._order is not None:
            return tuple(name for name in self._order if name in self.robots)
        return tuple(in_priority_order(self.profiles))

    def reach(self, *, beyond: bool) -> dict[str, tuple[str, ...]]:
        """To whom each may write: everybody, if the protocol goes beyond those it may share constraints with."""
        return reach(self.profiles, beyond=beyond)

    def tasks(self, epoch: int, protocol: str, traits: Traits, brief: Brief) -> dict[str, Task]:
        """What each robot is told for a search, in priority order."""
        order = self.order
        shown = {name: self.robots[name].robot for name in order}
        domains = {
            variable.name: ranges_of(variable.domain) for robot in shown.values() for variable in robot.variables
        }
        links = {name: self._links(name) for name in order} if traits.tree else None
        cards = tuple(member.card for member in self.robots.values() if member.card)
        return {
            name: Task(
                epoch,
                protocol,
                order,
                {other: robot.interface for other, robot in shown.items()},
                domains,
                links,
                tuple(parent for parent in self._links(name) if name in self.robots[parent].profile.looks_at),
                brief.seed,
                dict(brief.settings),
                brief.aside,
                cards,
            )
            for name in order
        }

    def neighbourhood(self, name: str, values: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
        """Of the decided `values`, by robot, those that all whom `name` may share a constraint with show."""
        found: dict[str, int] = {}
        for other in self._met()[name]:
            if other in self.robots:
                interface = self.robots[other].robot.interface
                found.update({v: value for v, value in values.get(other, {}).items() if v in interface})
        return found

    def _met(self) -> dict[str, tuple[str, ...]]:
        """See `acquaintances`; worked out once for all who are there."""
        there = frozenset((name, member.visit) for name, member in self.robots.items())
        if self._known != there:
            self._known, self._acquainted = there, acquaintances(self.profiles)
        return self._acquainted

    def _links(self, name: str) -> tuple[str, ...]:
        return tuple(parent for parent in self.robots[name].profile.parents if parent in self.robots)

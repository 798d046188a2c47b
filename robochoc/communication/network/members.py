"""The robots that have registered with the master: profiles, incarnations, and what all robots know of them. Pure."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from robochoc.communication.network.access import ALL
from robochoc.communication.network.control_messages import Task
from robochoc.communication.network.plausibility import Declarations
from robochoc.communication.network.profile import (
    Profile,
    ProfileError,
    Ranges,
    in_priority_order,
    missing,
    possible_neighbours,
    profile_contradictions,
    ranges_of,
    visible_robot,
)
from robochoc.model.problem import Robot
from robochoc.protocols.traits import Traits
from robochoc.solver.agent_problem import RunParameters


def reach(profiles: Mapping[str, Profile], *, writes_to_non_neighbours: bool) -> dict[str, tuple[str, ...]]:
    """Return the receivers of each robot of a team besides the master. See `Members.reach`."""
    if writes_to_non_neighbours:
        return dict.fromkeys(profiles, (ALL,))
    met = possible_neighbours(profiles)
    return {name: tuple(sorted(profiles.keys() & others)) for name, others in met.items()}


class RegistrationRefusedError(ValueError):
    """A robot cannot be registered; the message says why."""


@dataclass
class Member:
    """A registered robot.

    Attributes:
        profile: What it has declared of its file.
        incarnation: The process of it that is registered.
        shown_later: Variables that it has shown since, as it was asked for them.
        card: Its key card of this run.
        joined: It has confirmed the welcome.
        away_since: Since when it is away, on the monotonic clock; None while it is there.
        unconfirmed: It was away since its last message, and may have been started again since.
        asked: Variables that it was asked for.
        left: It has confirmed that the run is over.
    """

    profile: Profile
    incarnation: str
    shown_later: dict[str, Ranges] = field(default_factory=dict)
    card: bytes = b""
    joined: bool = False
    away_since: float | None = None
    unconfirmed: bool = False
    asked: set[str] = field(default_factory=set)
    left: bool = False

    @property
    def robot(self) -> Robot:
        """The robot as others see it."""
        return visible_robot(self.profile, self.shown_later)

    def join(self, incarnation: str, card: bytes) -> None:
        """Note that it has read the welcome. Messages of another incarnation change nothing."""
        if incarnation == self.incarnation:
            self.card, self.joined, self.unconfirmed = card, True, False

    def note_presence(self, *, there: bool) -> None:
        """Note whether it is there, as far as the router knows."""
        self.away_since = None if there else self.away_since or time.monotonic()
        self.unconfirmed = self.unconfirmed or not there

    def is_away(self, for_s: float) -> bool:
        """Return whether it has been away for longer than that.

        For a moment all are, behind a router that is opened anew.
        """
        return self.away_since is not None and time.monotonic() - self.away_since > for_s


class Members:
    """All registered robots, by name.

    `expected` names the only robots that may come (None: all that the Authority admits), `number` says how many do.
    Without either the team is complete when every neighbour that a robot names is there. `order` is the priority order,
    where it is known before; parents come before their children in it. `ways` are those that it will have (`reach`),
    likewise.
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
        self._dropped: set[str] = set()
        """Robots that were registered, are gone, and have not come back."""
        self._over: set[str] = set()
        """Incarnations that have ended. If one goes on after all, its frames have unexpected numbers."""

    @property
    def profiles(self) -> dict[str, Profile]:
        """The profiles of all registered robots, by name."""
        return {name: member.profile for name, member in self.robots.items()}

    def register(self, sender: str, profile: Profile, incarnation: str, *, admitted: bool = True) -> Member:
        """Register `sender`, or return its registration if it is there in the same incarnation.

        Raises:
            RegistrationRefusedError: when it is not `admitted`, or its profile does not fit.
        """
        known = self.robots.get(sender)
        if known and known.incarnation == incarnation:
            known.away_since, known.unconfirmed = None, False
            return known
        if not admitted:
            raise RegistrationRefusedError(
                "it is enrolled to observe, not to take part; say: robochoc authority enrol NAME"
            )
        if fault := self._fault_of_incarnation(sender, incarnation) or self._fault_of_profile(sender, profile):
            raise RegistrationRefusedError(fault)
        if known:
            self._over.add(known.incarnation)
        self._dropped.discard(sender)
        self.robots[sender] = Member(profile, incarnation)
        return self.robots[sender]

    def _fault_of_incarnation(self, sender: str, incarnation: str) -> str:
        """Return why this incarnation of `sender` cannot be registered now; empty if it can."""
        known = self.robots.get(sender)
        if incarnation in self._over:
            return "it was away for too long; start it anew"
        if known and (self.closed or not (known.unconfirmed or known.away_since)):
            return f"a robot called {sender} is registered already"
        if self.closed:
            return "the team is complete without it"
        return "" if self.expected is None or sender in self.expected else "it is not one of the team"

    def _fault_of_profile(self, sender: str, profile: Profile) -> str:
        """Return why `profile` is none of `sender`, or contradicts those of others; empty if it fits."""
        if profile.name != sender:
            return f"its file is {profile.name[:80]!r}'s, and its certificate {sender}'s"
        try:
            visible_robot(profile, {})
        except ProfileError as bad:
            return str(bad)
        others = {name: other for name, other in self.profiles.items() if name != sender}
        return next(profile_contradictions({**others, sender: profile}), "")

    @property
    def awaited(self) -> set[str]:
        """The robots that have to register yet, as far as they are known by name."""
        return (set(self.expected or ()) | missing(self.profiles)) - self.robots.keys()

    @property
    def waited_for(self) -> list[str]:
        """The robots without which the team is not complete, in words: those that are not there, or not for certain."""
        absent = sorted((self.awaited | self._dropped) - self.robots.keys())
        unsure = sorted(name for name, m in self.robots.items() if not m.joined or m.unconfirmed)
        more = 0 if self.number is None else self.number - len(self.robots) - len(absent)
        return [
            *(f"{name} (it was there, and has dropped out)" if name in self._dropped else name for name in absent),
            *(f"{name} (it has registered, and does not answer)" for name in unsure),
            *[f"{more} more robot{'s' * (more > 1)}"] * (more > 0),
        ]

    @property
    def complete(self) -> bool:
        """Return whether the team is complete: all requested robots and all named neighbours are present."""
        enough = bool(self.robots) and (self.number is None or len(self.robots) >= self.number)
        return enough and not self.awaited and all(m.joined and not m.unconfirmed for m in self.robots.values())

    def unseen(self) -> dict[str, tuple[str, ...]]:
        """Variables that neighbours' constraints look at, by those who have not shown them and may own them.

        A parent need not say which of its variables a child has to know: the child's constraints do.
        """
        owners = self._owners()
        wanted: dict[str, dict[str, None]] = {}
        for member in self.robots.values():
            for child, names in member.profile.looks_at.items():
                wanted.setdefault(child, {}).update(dict.fromkeys(names))
            for name in member.profile.wants:
                if name not in owners:
                    for parent in member.profile.parents:
                        wanted.setdefault(parent, {})[name] = None
        unseen = {}
        for name, variables in wanted.items():
            member_asked = self.robots.get(name)
            if member_asked:
                known = {*member_asked.profile.variables, *member_asked.shown_later, *member_asked.asked}
                unseen[name] = tuple(variable for variable in variables if variable not in known)
        return {name: variables for name, variables in unseen.items() if variables}

    def show(self, name: str, variables: Mapping[str, Ranges]) -> str:
        """Take in the answer of the robot `name` on the `unseen` variables. Return what is wrong with it."""
        member = self.robots[name]
        wanted = self.unseen().get(name, ())
        owners = self._owners()
        for variable in variables:
            if owners.get(variable, name) != name:
                return f"the variable {variable} is {owners[variable]}'s, and {name}'s too"
        if not variables.keys() <= {*wanted, *member.asked}:
            return "it has shown variables that it was not asked for"
        shown = {variable: variables[variable] for variable in wanted if variable in variables}
        try:
            visible_robot(member.profile, {**member.shown_later, **shown})
        except ProfileError as bad:
            return str(bad)
        member.asked.update(wanted)
        member.shown_later.update(shown)
        return ""

    def strangers(self) -> Iterator[str]:
        """Yield constraints over variables that no neighbour has, in words; once nothing is `unseen` any more."""
        owners = self._owners()
        for name, member in self.robots.items():
            looked_at = [one for names in member.profile.looks_at.values() for one in names]
            for variable in (*member.profile.wants, *looked_at):
                if owners.get(variable) not in {name, *member.profile.neighbours}:
                    yield f"{name} holds a constraint over {variable}, which is a variable of none of its neighbours"

    def _owners(self) -> dict[str, str]:
        """Return the owners of the variables that are shown."""
        return {
            variable: name
            for name, member in self.robots.items()
            for variable in (*member.profile.variables, *member.shown_later)
        }

    def remove(self, names: Collection[str]) -> None:
        """Remove robots for good, also as neighbours of others.

        Once the team is complete, those who are left keep their places in the order, as they do in every runtime.
        """
        if self.closed:
            self._order = self.order
        for name in names:
            member = self.robots.pop(name, None)
            if member:
                self._over.add(member.incarnation)

    def drop_out(self, name: str) -> None:
        """Remove a robot while the team is open; it may register again."""
        self.remove([name])
        self._dropped.add(name)

    def to_welcome(self) -> dict[str, str]:
        """Return the incarnations of robots that are there and have not answered a welcome, while the team is open.

        Their answer may have been lost; and of two incarnations only the one that is still there answers.
        """
        waiting = {
            name: m.incarnation
            for name, m in self.robots.items()
            if m.away_since is None and (m.unconfirmed or not m.joined)
        }
        return {} if self.closed else waiting

    @property
    def listening(self) -> list[str]:
        """The robots that have joined, and not left. Others do not know this run yet."""
        return [name for name, member in self.robots.items() if member.joined and not member.left]

    def staying(self, away_s: float, besides: Collection[str]) -> list[str]:
        """Return the robots, `besides` those, that have neither left nor been away for longer than `away_s` seconds."""
        stay = (name for name, member in self.robots.items() if not (member.left or member.is_away(away_s)))
        return [name for name in stay if name not in besides]

    @property
    def order(self) -> tuple[str, ...]:
        """The total priority order of those that are there."""
        if self._order is not None:
            return tuple(name for name in self._order if name in self.robots)
        return tuple(in_priority_order(self.profiles))

    def reach(self, *, writes_to_non_neighbours: bool) -> dict[str, tuple[str, ...]]:
        """Return the receivers of each robot: all others, if the protocol writes to non-neighbours."""
        return reach(self.profiles, writes_to_non_neighbours=writes_to_non_neighbours)

    def tasks(self, epoch: int, protocol: str, traits: Traits, parameters: RunParameters) -> dict[str, Task]:
        """Return the task of each robot for a search, in priority order."""
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
                parameters.seed,
                dict(parameters.settings),
                parameters.withdrawal_cost,
                cards,
                parameters.message_loss,
            )
            for name in order
        }

    def declared(self, traits: Traits) -> Declarations:
        """Return the declarations that robots' reports in a search are checked against."""
        shown = {
            name: {variable.name: variable.domain for variable in member.robot.variables}
            for name, member in self.robots.items()
        }
        dearest = {name: member.profile.max_cost for name, member in self.robots.items()}
        return Declarations(traits, shown, dearest)

    def neighbourhood(self, name: str, values: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
        """Return those of the decided `values` that robots show which `name` may share a constraint with."""
        found: dict[str, int] = {}
        for other in self._met()[name]:
            if other in self.robots:
                interface = self.robots[other].robot.interface
                found.update({v: value for v, value in values.get(other, {}).items() if v in interface})
        return found

    def _met(self) -> dict[str, tuple[str, ...]]:
        """See `possible_neighbours`; worked out once for all who are there."""
        there = frozenset((name, member.incarnation) for name, member in self.robots.items())
        if self._known != there:
            self._known, self._acquainted = there, possible_neighbours(self.profiles)
        return self._acquainted

    def _links(self, name: str) -> tuple[str, ...]:
        return tuple(parent for parent in self.robots[name].profile.parents if parent in self.robots)

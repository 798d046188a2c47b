"""The robots that have registered with the master: profiles, incarnations, and common knowledge about them. Pure."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field
from types import MappingProxyType

import msgspec

from robochoc.communication.network.access import ALL
from robochoc.communication.network.control_messages import SearchTask
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
from robochoc.solver.agent_problem import RunParameters, only_values_of
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass


def reach(profiles: Mapping[str, Profile], *, writes_to_non_neighbours: bool) -> dict[str, tuple[str, ...]]:
    """Return each robot's receivers, besides the master. See `NetworkMembers.reach`."""
    if writes_to_non_neighbours:
        return dict.fromkeys(profiles, (ALL,))
    met = possible_neighbours(profiles)
    return {name: tuple(sorted(profiles.keys() & others)) for name, others in met.items()}


class RegistrationRefusedError(RobochocError, ValueError):
    """Raised if a robot cannot be registered. The text is the reason."""


@dataclass
class Member:
    """A registered robot.

    Attributes:
        profile: The robot's declarations about its file.
        incarnation: The name of the registered process of the robot.
        shown_later: Variables that the robot has disclosed later, on request.
        card: The robot's key card in this run.
        joined: True if the robot has confirmed the welcome.
        away_since: The start of its absence, on the monotonic clock; None while it is present.
        unconfirmed: True if the robot was absent since its last message, and may have been restarted.
        asked: Variables that were requested from the robot.
        left: True if the robot has confirmed that the run is over.
        since: The time of the registration, on the monotonic clock.
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
    since: float = field(default_factory=time.monotonic)

    @property
    def robot(self) -> Robot:
        """The robot, limited to what others see."""
        return visible_robot(self.profile, self.shown_later)

    def join(self, incarnation: str, card: bytes) -> None:
        """Record that the robot has received the welcome. Messages from another incarnation are ignored."""
        if incarnation == self.incarnation:
            self.card, self.joined, self.unconfirmed = card, True, False

    def note_presence(self, *, there: bool) -> None:
        """Record whether the router reports the robot as present."""
        self.away_since = None if there else self.away_since or time.monotonic()
        self.unconfirmed = self.unconfirmed or not there

    def is_away(self, for_s: float) -> bool:
        """Return whether the robot has been absent for longer than `for_s`. A router restart is a short absence."""
        return self.away_since is not None and time.monotonic() - self.away_since > for_s


class NetworkMembers:
    """All registered robots, by name.

    Only the robots in `expected` are allowed (None: all robots that the Authority admits); `number` is the size of the
    team. Without either, the team is complete when all neighbours named by robots are present. `order` is the priority
    order, and `ways` are the robots' receivers (`reach`), if known in advance; in `order` parents precede their
    children.
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
        """Robots that were registered, have dropped out, and have not returned."""
        self._given_up: set[str] = set()
        """Robots that the team does not wait for."""
        self._over: set[str] = set()
        """Incarnations that have ended. If one of them continues nevertheless, its frames have unexpected numbers."""

    @property
    def profiles(self) -> dict[str, Profile]:
        """The profiles of all registered robots, by name."""
        return {name: member.profile for name, member in self.robots.items()}

    def register(self, sender: str, profile: Profile, incarnation: str, *, admitted: bool = True) -> Member:
        """Register `sender`, or return its registration if the same incarnation is already registered.

        Raises:
            RegistrationRefusedError: if the robot is not `admitted`, or its profile is invalid.
        """
        known = self.robots.get(sender)
        if known and known.incarnation == incarnation:
            known.away_since, known.unconfirmed = None, False
            return known
        if not admitted:
            raise RegistrationRefusedError(
                "it is enrolled as an observer, not as a robot: enrol it by robochoc authority enrol NAME"
            )
        if fault := self._fault_of_incarnation(sender, incarnation) or self._fault_of_profile(sender, profile):
            raise RegistrationRefusedError(fault)
        if known:
            self._over.add(known.incarnation)
        self._dropped.discard(sender)
        self.robots[sender] = Member(profile, incarnation)
        return self.robots[sender]

    def _fault_of_incarnation(self, sender: str, incarnation: str) -> str:
        """Return the reason why this incarnation of `sender` cannot be registered now; empty if it can."""
        known = self.robots.get(sender)
        if incarnation in self._over:
            return "it was absent for too long: restart it"
        if known and (self.closed or not (known.unconfirmed or known.away_since)):
            return f"a robot called {sender} is registered already"
        if self.closed:
            return "the team is complete without it"
        return "" if self.expected is None or sender in self.expected else "it is not a member of the team"

    def _fault_of_profile(self, sender: str, profile: Profile) -> str:
        """Return why `profile` is invalid for `sender`, or contradicts other profiles; empty if it is valid."""
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
        """The names of known robots that have not yet registered."""
        return (set(self.expected or ()) | missing(self.profiles)) - self.robots.keys() - self._given_up

    def expect(self, team: Collection[str]) -> dict[str, str]:
        """Allow only the robots in `team`. Remove all others, and return their incarnations."""
        self.expected, self.number = frozenset(team), None
        others = {name: member.incarnation for name, member in self.robots.items() if name not in team}
        self.remove(others)
        return others

    def give_up(self, names: Collection[str]) -> None:
        """Do not wait for robots that do not come."""
        self._given_up.update(names)

    @property
    def waited_for(self) -> list[str]:
        """Descriptions of the absent or unconfirmed robots that the team is waiting for."""
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
        """True if the team is complete: all requested robots and all named neighbours are present."""
        enough = bool(self.robots) and (self.number is None or len(self.robots) >= self.number)
        return enough and not self.awaited and all(m.joined and not m.unconfirmed for m in self.robots.values())

    def unseen(self) -> dict[str, tuple[str, ...]]:
        """Return the undisclosed variables in neighbours' constraints, by the robots that may own these variables.

        A parent's file need not list the variables that a child must know: the child's constraints name them.
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

    def show(
        self,
        name: str,
        variables: Mapping[str, Ranges],
        symbolic: Sequence[str] = (),
        real_places: Mapping[str, int] = MappingProxyType({}),
    ) -> str:
        """Record a robot's answer about its `unseen` variables. Return why the answer is invalid, or an empty text.

        For `symbolic` and `real_places` see `Profile`.
        """
        member = self.robots[name]
        wanted = self.unseen().get(name, ())
        owners = self._owners()
        for variable in variables:
            if owners.get(variable, name) != name:
                return f"the variable {variable} is {owners[variable]}'s, and {name}'s too"
        if not {*variables, *symbolic, *real_places} <= {*wanted, *member.asked}:
            return "it has disclosed variables that were not requested"
        shown = {variable: variables[variable] for variable in wanted if variable in variables}
        before = member.profile
        profile = msgspec.structs.replace(
            before,
            symbolic=tuple(dict.fromkeys([*before.symbolic, *symbolic])),
            real_places={**before.real_places, **real_places},
        )
        try:
            visible_robot(profile, {**member.shown_later, **shown})
        except ProfileError as bad:
            return str(bad)
        member.profile = profile
        member.asked.update(wanted)
        member.shown_later.update(shown)
        return ""

    def invalid_scopes(self) -> Iterator[str]:
        """Yield descriptions of constraints over variables that no neighbour has, once no variable is `unseen`."""
        owners = self._owners()
        for name, member in self.robots.items():
            looked_at = [one for names in member.profile.looks_at.values() for one in names]
            for variable in (*member.profile.wants, *looked_at):
                owner = owners.get(variable)
                is_absent = owner is None and self._given_up
                if owner not in {name, *member.profile.neighbours} and not is_absent:
                    yield f"{name} has a constraint over {variable}, which is not a variable of a neighbour"

    def _owners(self) -> dict[str, str]:
        """Return the owners of the disclosed variables."""
        return {
            variable: name
            for name, member in self.robots.items()
            for variable in (*member.profile.variables, *member.shown_later)
        }

    def remove(self, names: Collection[str]) -> None:
        """Remove robots permanently, including as neighbours of other robots.

        After the team is complete, the remaining robots keep their relative order, like in every runtime.
        """
        if self.closed:
            self._order = self.order
        for name in names:
            member = self.robots.pop(name, None)
            if member:
                self._over.add(member.incarnation)

    def drop_out(self, name: str) -> None:
        """Remove a robot while the team is open. The robot may register again."""
        self.remove([name])
        self._dropped.add(name)

    def to_welcome(self) -> dict[str, str]:
        """Return the incarnations of present robots that have not answered a welcome, while the team is open.

        Their answer may have been lost. If a robot has two incarnations, only the running one answers.
        """
        waiting = {
            name: m.incarnation
            for name, m in self.robots.items()
            if m.away_since is None and (m.unconfirmed or not m.joined)
        }
        return {} if self.closed else waiting

    @property
    def listening(self) -> list[str]:
        """The robots that have joined and not left. Other robots do not know this run yet."""
        return [name for name, member in self.robots.items() if member.joined and not member.left]

    def staying(self, away_s: float, besides: Collection[str]) -> list[str]:
        """Return the robots, except `besides`, that have not left or been absent for more than `away_s` seconds."""
        stay = (name for name, member in self.robots.items() if not (member.left or member.is_away(away_s)))
        return [name for name in stay if name not in besides]

    @property
    def order(self) -> tuple[str, ...]:
        """The total priority order of the registered robots."""
        if self._order is not None:
            return tuple(name for name in self._order if name in self.robots)
        return tuple(in_priority_order(self.profiles))

    def reach(self, *, writes_to_non_neighbours: bool) -> dict[str, tuple[str, ...]]:
        """Return each robot's receivers: all others if the protocol writes to non-neighbours, else its neighbours."""
        return reach(self.profiles, writes_to_non_neighbours=writes_to_non_neighbours)

    def tasks(self, epoch: int, protocol: str, traits: Traits, parameters: RunParameters) -> dict[str, SearchTask]:
        """Return each robot's task in a search, in priority order."""
        order = self.order
        shown = {name: self.robots[name].robot for name in order}
        domains = {
            variable.name: ranges_of(variable.domain) for robot in shown.values() for variable in robot.variables
        }
        links = {name: self._links(name) for name in order} if traits.tree else None
        cards = tuple(member.card for member in self.robots.values() if member.card)
        return {
            name: SearchTask(
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
                only_values_of(shown[name], parameters.start),
                parameters.upper_bound,
            )
            for name in order
        }

    def declared(self, traits: Traits) -> Declarations:
        """Return the declarations used to check the robots' reports."""
        shown = {
            name: {variable.name: variable.domain for variable in member.robot.variables}
            for name, member in self.robots.items()
        }
        dearest = {name: member.profile.max_cost for name, member in self.robots.items()}
        return Declarations(traits, shown, dearest)

    def neighbourhood(self, name: str, values: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
        """Return those `values` that were disclosed by robots with which `name` may share a constraint."""
        found: dict[str, int] = {}
        for other in self._met()[name]:
            if other in self.robots:
                interface = self.robots[other].robot.interface
                found.update({v: value for v, value in values.get(other, {}).items() if v in interface})
        return found

    def _met(self) -> dict[str, tuple[str, ...]]:
        """Return `possible_neighbours`, cached for the present robots."""
        there = frozenset((name, member.incarnation) for name, member in self.robots.items())
        if self._known != there:
            self._known, self._acquainted = there, possible_neighbours(self.profiles)
        return self._acquainted

    def _links(self, name: str) -> tuple[str, ...]:
        return tuple(parent for parent in self.robots[name].profile.parents if parent in self.robots)

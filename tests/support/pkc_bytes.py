"""Every byte that robots say, and what may be changed in their files without changing one of them."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from random import Random
from types import MappingProxyType

import msgspec
import pytest

from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Decided
from robochoc.model.problem import Constraint, ConstraintModel, Domain, Relation, Robot, Semantics, Team
from robochoc.protocols.message import Envelope, encode
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.shared_constraint import OtherValues, SharedConstraint
from tests.support.pkc_problems import allowed, as_predicate, as_table, pkc_parts, rows, with_constraints

Asked = Mapping[tuple[str, str], set[frozenset[tuple[str, int | None]]]]
"""Of each holder's constraint, by name, the pairs that were looked up: values by variable."""

Free = Callable[[Mapping[str, int]], bool]
"""Which pairs of values, by variable, may be drawn anew."""


@dataclass(frozen=True)
class Run:
    """Return the outcome, every envelope in the order of sending, and the values that each variable took."""

    result: SearchResult
    envelopes: tuple[Envelope, ...]
    taken: Mapping[str, set[int]]


class _Tapped(RandomChannels):
    """Keeps a copy of all that is sent: sender, receiver, content, and the clock that goes with it."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.envelopes: list[Envelope] = []

    def put(self, envelope: Envelope, checks: int = 0) -> None:
        self.envelopes.append(envelope)
        super().put(envelope, checks)


def run(
    team: Team | CompiledTeam,
    protocol: type[Protocol],
    seed: int,
    settings: Mapping[str, str] = MappingProxyType({}),
) -> Run:
    """One run in the simulator; the same seed draws the same channels as long as the same is said."""
    tapped = _Tapped(seed)
    taken = defaultdict[str, set[int]](set)

    def note(event: AnyEvent) -> None:
        if isinstance(event, Decided):
            for name, value in event.assignment.items():
                taken[name].add(value)

    parameters = RunParameters(settings=dict(settings))
    result = Simulation(team, protocol, tapped, observer=note, parameters=parameters).run(60)
    return Run(result, tuple(tapped.envelopes), taken)


def nothing_hidden(protocol: type[Protocol], envelopes: Iterable[Envelope]) -> None:
    """Every content is a declared message, and the message is all that is in it."""
    decoder = msgspec.msgpack.Decoder(protocol.messages)
    for envelope in envelopes:
        assert encode(decoder.decode(envelope.content)) == envelope.content


def watched(team: Team, monkeypatch: pytest.MonkeyPatch) -> Asked:
    """From now on every look at a part of a PKC is noted. For robots of one variable."""
    asked = defaultdict[tuple[str, str], set[frozenset[tuple[str, int | None]]]](set)
    below = {f"{holder}<{other}:{name}": (holder, other, name) for holder, other, name in pkc_parts(team)}
    above = {f"{holder}>{other}:{name}": (holder, other, name) for holder, other, name in pkc_parts(team)}
    parts = {**below, **above}
    plain = SharedConstraint.mask

    class Mask(int):
        """A mask that notes which of its bits are looked at."""

        constraint: SharedConstraint
        others: OtherValues

        def __rshift__(self, index: int, /) -> int:
            if self.constraint.key in parts:
                holder, other, name = parts[self.constraint.key]
                (own,), (seen,) = self.constraint.own_part(index), self.others
                assert own is not None
                pair = ((team[holder].variables[0].name, own), (team[other].variables[0].name, seen))
                asked[holder, name].add(frozenset(pair))
            return int(self) >> index

    def mask(constraint: SharedConstraint, others: OtherValues) -> int:
        found = Mask(plain(constraint, others))
        found.constraint, found.others = constraint, others
        return found

    monkeypatch.setattr(SharedConstraint, "mask", mask)
    return asked


def changed_elsewhere(team: Team, asked: Asked, chance: Random, *, there: bool = False) -> Team:
    """Parts of PKCs say by chance anything about pairs that were not asked about (`there`: about those that were)."""

    def change(robot: Robot, constraint: Constraint) -> Constraint:
        if constraint.model is not ConstraintModel.PKC:
            return constraint
        known = asked.get((robot.name, constraint.name), set())
        return _redrawn(team, constraint, chance, lambda pair: (frozenset(pair.items()) in known) is there)

    return with_constraints(team, change)


def changed_where_nobody_was(team: Team, taken: Mapping[str, set[int]], chance: Random) -> Team:
    """Rows of values that their robot never took say anything: its part's, or of a TKC the higher robot's."""
    rank = {name: place for place, name in enumerate(team.order)}

    def change(robot: Robot, constraint: Constraint) -> Constraint:
        owners = {team.owner[name] for name in constraint.variables}
        looks = robot.name if constraint.model is ConstraintModel.PKC else min(owners, key=rank.__getitem__)
        own = [name for name in constraint.variables if team.owner[name] == looks]
        return _redrawn(
            team, constraint, chance, lambda pair: any(pair[name] not in taken.get(name, set()) for name in own)
        )

    return with_constraints(team, change)


def restated(team: Team, chance: Random) -> Team:
    """Every part of a PKC says the same in other words: another name, the other semantics, a predicate, an order."""
    numbers = itertools.count()

    def change(_: Robot, constraint: Constraint) -> Constraint:
        if constraint.model is not ConstraintModel.PKC:
            return constraint
        every = rows(team, constraint)
        allowing = [row for row in every if allowed(constraint, row)]
        name = f"other{next(numbers)}"
        match chance.randrange(3):
            case 0:
                return as_predicate(constraint, allowing, name)
            case 1:
                return as_table(constraint, chance.sample(allowing, len(allowing)), Semantics.SUPPORTS, name)
            case _:
                rest = [row for row in every if row not in allowing]
                return _turned(as_table(constraint, rest, Semantics.CONFLICTS, name))

    return with_constraints(team, change)


def renamed(team: Team, chance: Random) -> tuple[Team, dict[str, dict[int, int]]]:
    """Each variable's values renamed by a strictly increasing map of its own, with all constraints; and the maps."""
    maps = {}
    for name, variable in team.variables.items():
        values = sorted(variable.domain)
        maps[name] = dict(zip(values, sorted(chance.sample(range(-900, 900), len(values))), strict=True))

    def change(_: Robot, constraint: Constraint) -> Constraint:
        listed = [row for row in rows(team, constraint) if allowed(constraint, row)]
        names = constraint.variables
        moved = [tuple(maps[name][value] for name, value in zip(names, row, strict=True)) for row in listed]
        return as_table(constraint, moved, Semantics.SUPPORTS, "renamed")

    changed = with_constraints(team, change)
    robots = []
    for robot in changed.robots:
        variables = tuple(replace(v, domain=_domain(maps[v.name].values())) for v in robot.variables)
        private = tuple(change(robot, constraint) for constraint in robot.private)
        robots.append(replace(robot, variables=variables, private=private))
    return replace(changed, robots=tuple(robots)), maps


def _redrawn(team: Team, constraint: Constraint, chance: Random, free: Free) -> Constraint:
    """`constraint` with a new draw for the rows that are `free`."""
    listed = []
    for row in rows(team, constraint):
        if free(dict(zip(constraint.variables, row, strict=True))):
            if chance.random() < 0.5:
                listed.append(row)
        elif allowed(constraint, row):
            listed.append(row)
    return as_table(constraint, listed, Semantics.SUPPORTS, "redrawn")


def _turned(constraint: Constraint) -> Constraint:
    """The same table, its columns in the opposite order."""
    table = constraint.definition
    assert isinstance(table, Relation)
    scope = constraint.variables[::-1]
    relation = replace(table, tuples=tuple(row[::-1] for row in table.tuples))
    return replace(constraint, definition=relation, scope=scope, parameters=scope)


def _domain(values: Iterable[int]) -> Domain:
    return Domain("D", tuple(range(value, value + 1) for value in sorted(values)))

"""A robot as an observer of other robots: draws conclusions from the messages that it receives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple, assert_never

from robochoc.model.problem import INFINITE
from robochoc.privacy.possible import AtLeast, AtMost, CostCase, Knowledge, OneAtMost, OneCase, Terms
from robochoc.privacy.secrets import TeamSecrets
from robochoc.protocols.acts import Performative
from robochoc.protocols.disclosure import (
    AT_THE_END,
    FINITE,
    Clash,
    EveryValuePays,
    HasCompatibleValue,
    HasOnly,
    HasValue,
    M,
    PartPays,
    Pays,
    Proof,
    Reception,
    SomeValuePays,
    Total,
    View,
)
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import is_withdrawn

Channel = tuple[type, str, str]
_DECIDING = (Performative.CANCEL, Performative.REQUEST)
"""The acts by which a robot may set values of other robots: permanently, or temporarily in case of the receiver."""


class RunFacts(NamedTuple):
    """The facts about a run that all its observers know.

    Attributes:
        secrets: The secrets of the team.
        order: All robots, the highest priority first.
        branches: For each robot, the robots whose values are in its partial assignments.
        fixed_holders: As in `Reception`.
        minimises: As in `Reception`.
        one_sided: Costs in messages may be the costs of one robot's part of a partially known constraint. Then only
            proofs about single robots count, because own costs and totals include both sides
            (`protocols/disclosure.py`).
    """

    secrets: TeamSecrets
    order: Sequence[str]
    branches: Mapping[str, Sequence[str]]
    fixed_holders: bool
    minimises: bool
    one_sided: bool


class _LastValue(NamedTuple):
    """An observer's latest information about a robot's value: one of `values`, restricted by the statement `cases`."""

    stamp: tuple[int, ...]
    values: tuple[Value, ...]
    cases: OneCase | None = None


class Observer:
    """The observer `name`, with its possible `values`. `without_rule` has the received message types without a rule."""

    def __init__(self, facts: RunFacts, name: str, values: Sequence[Value]) -> None:
        self.name = name
        self.knowledge = Knowledge(facts.secrets.most, facts.secrets.withdrawing)
        self.knowledge.known.update(facts.secrets.known_from_the_start(name))
        self.without_rule: set[str] = set()
        self._facts = facts
        self._values: dict[str, Sequence[Value]] = {name: values}
        self._last: dict[Channel, Message] = {}
        self._last_values: dict[str, _LastValue] = {}

    def sends(self, receiver: str, message: Message) -> None:
        """Process a message that the observer sends. It knows the values that the message sets in others."""
        self._store(message, self.name, receiver)
        if message.act.performative not in _DECIDING:
            return
        for proof in self._proofs(message, self.name, receiver) or ():
            if isinstance(proof, HasValue) and (proof.stamp == AT_THE_END or proof.robot == receiver):
                self._learn(proof)

    def receives(self, sender: str, message: Message) -> None:
        """Process a received message and its proofs."""
        proofs = self._proofs(message, sender, self.name)
        self._store(message, sender, self.name)
        if proofs is None:
            self.without_rule.add(type(message).__name__)
            return
        for proof in proofs:
            self._learn(proof)

    def loses(self, sender: str, message: Message) -> None:
        """Forget the value of a robot if a lost message contains a newer one."""
        for proof in self._proofs(message, sender, self.name) or ():
            if isinstance(proof, HasValue | HasCompatibleValue):
                self._last_values.pop(proof.robot, None)

    def _store(self, message: Message, sender: str, receiver: str) -> None:
        """Store the last message on a channel, by the message's type and the base classes of this type."""
        for kind in type(message).__mro__:
            if issubclass(kind, Message):
                self._last[kind, sender, receiver] = message

    def possible_values(self, robot: str) -> list[Value]:
        """Return the possible current values of `robot` after its messages. Requires `knowledge.settle()`."""
        known_value = self._last_values.get(robot)
        if known_value is None:
            return list(self._facts.secrets.declared[robot])
        if known_value.cases is None:
            return list(known_value.values)
        return [known_value.values[place] for place in self.knowledge.open_cases(known_value.cases)]

    def _proofs(self, message: Message, sender: str, receiver: str) -> Sequence[Proof] | None:
        """Return the statements that a message proves; None if it has no rule."""
        proofs = message.proves(_ObservedMessage(self._facts, sender, receiver, self._values, self._last))
        if proofs is None or not self._facts.one_sided:
            return proofs
        return [proof for proof in proofs if _is_of_one_robot(proof)]

    def _learn(self, proof: Proof) -> None:
        """Translate a proof into statements about secrets."""
        match proof:
            case HasValue(robot, value, stamp):
                if None not in value or is_withdrawn(value):
                    self._bound(self._facts.secrets.own_cost(robot, value, {}), 0, FINITE)
                    self._set_last_value(robot, _LastValue(stamp, (value,)))
            case HasCompatibleValue():
                self._restrict_value(proof)
            case HasOnly(robot, values):
                self._values[robot] = values
                for value in self._facts.secrets.declared[robot]:
                    least, most = (0, FINITE) if value in values else (INFINITE, INFINITE)
                    self._bound(self._facts.secrets.own_cost(robot, value, {}), least, most)
            case _:
                self._learn_cost(proof)

    def _learn_cost(self, proof: Pays | PartPays | EveryValuePays | SomeValuePays | Total | Clash) -> None:
        """Translate a proof about costs into statements about secrets."""
        secrets = self._facts.secrets
        match proof:
            case Pays(robot, value, view, least, most):
                for complete in secrets.completions(view):
                    self._bound(secrets.own_cost(robot, value, complete), least, most)
            case PartPays(robot, value, other, theirs, cost):
                self._bound(secrets.filtered(robot, value, other, theirs, parts_only=True), cost, cost)
            case EveryValuePays(robot, view, least):
                self._every_value(robot, view, least)
            case SomeValuePays(robot, view, most):
                sums = tuple(secrets.own_cost(robot, value, view) for value in secrets.declared[robot])
                if most < INFINITE:
                    self.knowledge.add_statement(OneAtMost(sums, most))
            case Total(view, cost):
                self._bound(secrets.total(view), cost, cost)
            case Clash(view):
                for complete in secrets.completions(view):
                    self._bound(secrets.among(complete), INFINITE, INFINITE)
            case never:
                assert_never(never)

    def _every_value(self, robot: str, view: View, least: float) -> None:
        secrets = self._facts.secrets
        for complete in secrets.completions(view):
            for value in secrets.declared[robot]:
                if not is_withdrawn(value):
                    self._bound(secrets.own_cost(robot, value, complete), least, INFINITE)

    def _restrict_value(self, proof: HasCompatibleValue) -> None:
        """Keep the values of a robot that are compatible with exactly the values in its message."""
        secrets = self._facts.secrets
        others = [value for value in secrets.declared[proof.other] if not is_withdrawn(value)]
        values = secrets.declared[proof.robot]
        cases = OneCase(tuple(self._case(proof, value, others) for value in values))
        self.knowledge.add_statement(cases)
        self._set_last_value(proof.robot, _LastValue((), values, cases))

    def _case(self, proof: HasCompatibleValue, value: Value, others: Sequence[Value]) -> CostCase:
        secrets = self._facts.secrets
        finite: list[int] = list(secrets.own_cost(proof.robot, value, {}))
        broken: list[Terms] = []
        for place, theirs in enumerate(others):
            terms = secrets.filtered(proof.robot, value, proof.other, theirs, parts_only=proof.parts_only)
            if proof.allowed[place >> 3] >> (place & 7) & 1:
                finite += terms
            else:
                broken.append(terms)
        return CostCase(tuple(dict.fromkeys(finite)), tuple(broken))

    def _set_last_value(self, robot: str, known_value: _LastValue) -> None:
        known = self._last_values.get(robot)
        if known is None or known_value.stamp >= known.stamp:
            self._last_values[robot] = known_value

    def _bound(self, terms: Terms, least: float, most: float) -> None:
        if least > 0:
            self.knowledge.add_statement(AtLeast(terms, least))
        if most < INFINITE:
            self.knowledge.add_statement(AtMost(terms, most))


def _is_of_one_robot(proof: Proof) -> bool:
    """Return whether a proof is about one robot's values, private costs or parts, and not about sums of two sides."""
    return isinstance(proof, HasValue | HasCompatibleValue | HasOnly | PartPays) or (
        isinstance(proof, Pays) and not proof.view
    )


class _ObservedMessage(Reception):
    """A message as an observer receives it."""

    def __init__(
        self,
        facts: RunFacts,
        sender: str,
        receiver: str,
        values: Mapping[str, Sequence[Value]],
        last: Mapping[Channel, Message],
    ) -> None:
        self.sender, self.receiver = sender, receiver
        self.order = facts.order
        self.branch = facts.branches[sender]
        self.fixed_holders = facts.fixed_holders
        self.minimises = facts.minimises
        self.max_cost = facts.secrets.most
        self._declared = facts.secrets.declared
        self._neighbours = facts.secrets.neighbours
        self._values, self._last = values, last

    def neighbours(self, robot: str) -> Collection[str]:
        return self._neighbours[robot]

    def values(self, robot: str) -> Sequence[Value] | None:
        return self._values.get(robot)

    def width(self, robot: str) -> int:
        return len(self._declared[robot][0])

    def last(self, kind: type[M], sender: str, receiver: str) -> M | None:
        found = self._last.get((kind, sender, receiver))
        return found if isinstance(found, kind) else None

"""A robot as an observer of the others: what it hears in a run, and what follows from it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple, assert_never

from robochoc.model.problem import INFINITE
from robochoc.privacy.possible import AtLeast, AtMost, Case, Knowledge, OneAtMost, OneCase, Terms
from robochoc.privacy.secrets import TeamSecrets
from robochoc.protocols.acts import Performative
from robochoc.protocols.disclosure import (
    AT_THE_END,
    FINITE,
    Clash,
    EveryValuePays,
    HasOnly,
    Hearing,
    M,
    PartPays,
    Pays,
    Proof,
    SomeValuePays,
    StandsAt,
    StandsWhere,
    Total,
    View,
)
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import is_withdrawn

Channel = tuple[type, str, str]
_DECIDING = (Performative.CANCEL, Performative.REQUEST)
"""By these acts a robot may decide on others' values: for good, or (to a receiver) for now."""


class Scene(NamedTuple):
    """The facts of a run that all its observers share.

    Attributes:
        secrets: The secrets of the team.
        order: All robots, the highest priority first.
        branches: By robot, the robots whose values its partial assignments hold.
        fixed_holders: As in `Hearing`.
        minimises: As in `Hearing`.
        one_sided: Costs in messages may be those of one robot's part of a partially known constraint. Then only what is
            proved of single robots counts: own costs and totals are those of both sides (`protocols/disclosure.py`).
    """

    secrets: TeamSecrets
    order: Sequence[str]
    branches: Mapping[str, Sequence[str]]
    fixed_holders: bool
    minimises: bool
    one_sided: bool


class _Stand(NamedTuple):
    """The last that an observer has heard of a robot's value: the values, and the statement that leaves some of them.

    Without a statement it is one of `values`.
    """

    stamp: tuple[int, ...]
    values: tuple[Value, ...]
    cases: OneCase | None = None


class Observer:
    """One robot, `name`, which can take `values`; `without_rule` are the types of messages that have no rule."""

    def __init__(self, scene: Scene, name: str, values: Sequence[Value]) -> None:
        self.name = name
        self.knowledge = Knowledge(scene.secrets.most, scene.secrets.withdrawing)
        self.knowledge.known.update(scene.secrets.known_from_the_start(name))
        self.without_rule: set[str] = set()
        self._scene = scene
        self._values: dict[str, Sequence[Value]] = {name: values}
        self._last: dict[Channel, Message] = {}
        self._stands: dict[str, _Stand] = {}

    def says(self, receiver: str, message: Message) -> None:
        """Note a message that the observer sends; the values of others that it decides on it knows itself."""
        self._note(message, self.name, receiver)
        if message.act.performative not in _DECIDING:
            return
        for proof in self._proofs(message, self.name, receiver) or ():
            if isinstance(proof, StandsAt) and (proof.stamp == AT_THE_END or proof.robot == receiver):
                self._learn(proof)

    def hears(self, sender: str, message: Message) -> None:
        """Take in a message, and all that it proves."""
        proofs = self._proofs(message, sender, self.name)
        self._note(message, sender, self.name)
        if proofs is None:
            self.without_rule.add(type(message).__name__)
            return
        for proof in proofs:
            self._learn(proof)

    def misses(self, sender: str, message: Message) -> None:
        """Forget where a robot stands if a message that does not arrive any more says otherwise."""
        for proof in self._proofs(message, sender, self.name) or ():
            if isinstance(proof, StandsAt | StandsWhere):
                self._stands.pop(proof.robot, None)

    def _note(self, message: Message, sender: str, receiver: str) -> None:
        """Note the last message on a channel, of its type and of those that this extends."""
        for kind in type(message).__mro__:
            if issubclass(kind, Message):
                self._last[kind, sender, receiver] = message

    def possible_values(self, robot: str) -> list[Value]:
        """Return the possible current values of `robot`, by its messages, after `knowledge.settle()`."""
        stand = self._stands.get(robot)
        if stand is None:
            return list(self._scene.secrets.declared[robot])
        if stand.cases is None:
            return list(stand.values)
        return [stand.values[place] for place in self.knowledge.open_cases(stand.cases)]

    def _proofs(self, message: Message, sender: str, receiver: str) -> Sequence[Proof] | None:
        """Return the statements that a message proves. None: there is no rule."""
        proofs = message.proves(_Heard(self._scene, sender, receiver, self._values, self._last))
        if proofs is None or not self._scene.one_sided:
            return proofs
        return [proof for proof in proofs if _is_of_one_robot(proof)]

    def _learn(self, proof: Proof) -> None:
        """Put what a message proves in terms of secrets."""
        match proof:
            case StandsAt(robot, value, stamp):
                if None not in value or is_withdrawn(value):
                    self._bound(self._scene.secrets.own_cost(robot, value, {}), 0, FINITE)
                    self._stand(robot, _Stand(stamp, (value,)))
            case StandsWhere():
                self._stands_where(proof)
            case HasOnly(robot, values):
                self._values[robot] = values
                for value in self._scene.secrets.declared[robot]:
                    least, most = (0, FINITE) if value in values else (INFINITE, INFINITE)
                    self._bound(self._scene.secrets.own_cost(robot, value, {}), least, most)
            case _:
                self._learn_cost(proof)

    def _learn_cost(self, proof: Pays | PartPays | EveryValuePays | SomeValuePays | Total | Clash) -> None:
        """Put what a message proves of costs in terms of secrets."""
        secrets = self._scene.secrets
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
                    self.knowledge.tell(OneAtMost(sums, most))
            case Total(view, cost):
                self._bound(secrets.total(view), cost, cost)
            case Clash(view):
                for complete in secrets.completions(view):
                    self._bound(secrets.among(complete), INFINITE, INFINITE)
            case never:
                assert_never(never)

    def _every_value(self, robot: str, view: View, least: float) -> None:
        secrets = self._scene.secrets
        for complete in secrets.completions(view):
            for value in secrets.declared[robot]:
                if not is_withdrawn(value):
                    self._bound(secrets.own_cost(robot, value, complete), least, INFINITE)

    def _stands_where(self, proof: StandsWhere) -> None:
        """Leave those values of a robot that go with exactly the values that its message says."""
        secrets = self._scene.secrets
        others = [value for value in secrets.declared[proof.other] if not is_withdrawn(value)]
        values = secrets.declared[proof.robot]
        cases = OneCase(tuple(self._case(proof, value, others) for value in values))
        self.knowledge.tell(cases)
        self._stand(proof.robot, _Stand((), values, cases))

    def _case(self, proof: StandsWhere, value: Value, others: Sequence[Value]) -> Case:
        secrets = self._scene.secrets
        finite: list[int] = list(secrets.own_cost(proof.robot, value, {}))
        broken: list[Terms] = []
        for place, theirs in enumerate(others):
            terms = secrets.filtered(proof.robot, value, proof.other, theirs, parts_only=proof.parts_only)
            if proof.allowed[place >> 3] >> (place & 7) & 1:
                finite += terms
            else:
                broken.append(terms)
        return Case(tuple(dict.fromkeys(finite)), tuple(broken))

    def _stand(self, robot: str, stand: _Stand) -> None:
        known = self._stands.get(robot)
        if known is None or stand.stamp >= known.stamp:
            self._stands[robot] = stand

    def _bound(self, terms: Terms, least: float, most: float) -> None:
        if least > 0:
            self.knowledge.tell(AtLeast(terms, least))
        if most < INFINITE:
            self.knowledge.tell(AtMost(terms, most))


def _is_of_one_robot(proof: Proof) -> bool:
    """Return whether a proof is about one robot's values, private costs or parts, and not about sums of two sides."""
    return isinstance(proof, StandsAt | StandsWhere | HasOnly | PartPays) or (
        isinstance(proof, Pays) and not proof.view
    )


class _Heard(Hearing):
    """A message as an observer hears it."""

    def __init__(
        self,
        scene: Scene,
        sender: str,
        receiver: str,
        values: Mapping[str, Sequence[Value]],
        last: Mapping[Channel, Message],
    ) -> None:
        self.sender, self.receiver = sender, receiver
        self.order = scene.order
        self.branch = scene.branches[sender]
        self.fixed_holders = scene.fixed_holders
        self.minimises = scene.minimises
        self.max_cost = scene.secrets.most
        self._declared = scene.secrets.declared
        self._neighbours = scene.secrets.neighbours
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

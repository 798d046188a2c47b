"""Builds a changing problem from two sketches: a model of the first, with an event that converts it to the second.

An event can add and remove robots, values, and constraints between robots (docs/reference/format.md, "Changes over
time"). It cannot add or remove constraints of a single robot, so changes of these are expressed by removing or adding
values. Other differences cannot be expressed: `FromScratchError` contains the reason why the team must decide from
scratch.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import cast

import msgspec

from robochoc.app.sketch.building import add_constraint, add_topic, applied, term_of
from robochoc.app.sketch.palette import Applied, Links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Decision, DecisionKind, Sketch, SketchRule, Value
from robochoc.formats import InvalidInputError
from robochoc.modelling.errors import ModelError
from robochoc.modelling.events import ModelEvent
from robochoc.modelling.model import Model
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

Domains = dict[tuple[str, str], list[Value]]
"""The allowed values, by robot and decision."""


class FromScratchError(RobochocError, ValueError):
    """Events cannot express a difference, so the team must decide from scratch. `key`: the key of the error text."""

    def __init__(self, key: str, **named: object) -> None:
        super().__init__(key)
        self.key, self.named = key, named


@dataclass(frozen=True, eq=False)
class RuleLink:
    """The constraint of a rule for some robots. `name`: its name in the model."""

    sketch: Sketch
    rule: SketchRule
    robots: tuple[str, ...]
    name: str

    @cached_property
    def meaning(self) -> tuple[object, ...]:
        """The content of the constraint. Links with equal contents are the same constraint, even of several rules."""
        rule = self.rule
        settings = {name: value for name, value in rule.settings.items() if name != "radius"}
        encoded = msgspec.json.encode(settings, order="sorted")
        return rule.kind, rule.decision, self.robots, encoded, rule.cost, rule.private and len(self.robots) > 1

    @property
    def restricts_values(self) -> bool:
        """True if the constraint concerns a single robot, and can be expressed by removing values."""
        return len(self.robots) == 1 and self.rule.cost is None and not PALETTE[self.rule.kind].graded

    def allows(self, value: Value) -> bool:
        """Return whether the constraint allows this value of its only robot."""
        return PALETTE[self.rule.kind].holds(Applied(self.sketch, self.rule), (value,))


def changing_model(before: Sketch, after: Sketch) -> Model:
    """Return the model of `before`, with an event that converts it to `after` once it is solved.

    Raises:
        FromScratchError: if events cannot express the difference.
    """
    difference = _Difference(before, after)
    difference.check()
    try:
        model = difference.model()
        _ = model.team
    except (ModelError, InvalidInputError) as invalid:
        raise FromScratchError("whatif.anew-other") from invalid
    return model


class _Difference:
    """The differences between two sketches."""

    def __init__(self, before: Sketch, after: Sketch) -> None:
        self._before, self._after = before, after
        there, then = ({robot.name for robot in sketch.robots} for sketch in (before, after))
        self._stay = there & then
        self._leave = [robot.name for robot in before.robots if robot.name not in then]
        self._come = [robot for robot in after.robots if robot.name not in there]
        self._links = [*_with_names(links_of(before), set())]
        then_links = [*links_of(after)]
        remaining = [(link, left) for link in self._links if (left := self._remaining(link)) is not None]
        still = Counter(link.meaning for link in then_links)
        self._dropped: list[RuleLink] = []
        for link, left in remaining:
            if still[left.meaning]:
                still[left.meaning] -= 1
            else:
                self._dropped.append(link)
        taken = {link.name for link in self._links}
        self._added = [*_with_names(_beyond(then_links, [left for _, left in remaining]), taken)]

    def _remaining(self, link: RuleLink) -> RuleLink | None:
        """Return a link without the robots that have left: a count is restated; other links are dropped (None)."""
        if self._stay.issuperset(link.robots):
            return link
        rest = tuple(name for name in link.robots if name in self._stay)
        is_count = PALETTE[link.rule.kind].links == Links.GROUP and not link.rule.private
        return replace(link, robots=rest) if rest and is_count else None

    def check(self) -> None:
        """Raise `FromScratchError` if events cannot express the difference."""
        if not self._stay:
            raise FromScratchError("whatif.anew-nobody")
        if self._before.area.columns != self._after.area.columns:
            raise FromScratchError("whatif.anew-map")
        for name in sorted(self._stay):
            self._check_robot(name)
        for link in self._dropped:
            if self._stay.issuperset(link.robots):
                _check_link(link)
        for link in self._added:
            if self._stay.issuperset(link.robots) or (link.rule.private and len(link.robots) > 1):
                _check_link(link)

    def _check_robot(self, name: str) -> None:
        """Raise `FromScratchError` if a remaining robot has different decisions, or a different weight or rank."""
        was, now = self._before.robot(name), self._after.robot(name)
        decided, decides = (
            {one.name: one.kind for one in _decisions_of(sketch, name)} for sketch in (self._before, self._after)
        )
        if decided != decides:
            raise FromScratchError("whatif.anew-decision", robot=name)
        assert was is not None  # noqa: S101 - the robot is in both sketches
        assert now is not None  # noqa: S101 - the same
        if (was.weight, was.rank) != (now.weight, now.rank):
            raise FromScratchError("whatif.anew-importance", robot=name)
        if was.at != now.at and DecisionKind.LEVEL in decided.values() and DecisionKind.PLACE not in decided.values():
            raise FromScratchError("whatif.anew-moved", robot=name)  # the robot's waypoint depends on its position

    def model(self) -> Model:
        """Return the model of the first sketch with the event.

        Changed constraints of a single robot are expressed by values. Values are added to the event before constraints,
        constraints, since the value of a constraint must exist.
        """
        before, after = self._before, self._after
        was, now = self._domains(before, self._dropped), self._domains(after, self._added)
        model = self._robots(was)
        event = model.after_solution()
        self._add_value_changes(model, event, was, now)
        for link in self._links:
            if not (self._by_values(link) and link in self._dropped):
                add_constraint(model, link.rule, link.name, term_of(model, before, link.rule, link.robots), link.robots)
        self._add_other_changes(model, event)
        return model

    def _robots(self, domains: Domains) -> Model:
        """Return a model with the first sketch's robots and these values, without constraints."""
        before = self._before
        model = Model(before.name)
        for drawn in before.robots:
            model.robot(drawn.name, priority=drawn.rank, weight=drawn.weight)
        for decision in before.decisions:
            for name in before.deciders(decision):
                if not domains[name, decision.name]:
                    raise FromScratchError("whatif.anew-nothing", robot=name)
                model.robots[name].variable(decision.name, domains[name, decision.name])
        for robot in model.robots.values():
            add_topic(before, robot)
        return model

    def _add_value_changes(self, model: Model, event: ModelEvent, was: Domains, now: Domains) -> None:
        """Add to the event the changes in the values of remaining robots."""
        for (name, decision), values in now.items():
            if name in self._stay:
                old, variable = was[name, decision], model.robots[name][decision]
                for value in (value for value in values if value not in old):
                    event.add_value(variable, value)
                for value in (value for value in old if value not in values):
                    event.remove_value(variable, value)

    def _add_other_changes(self, model: Model, event: ModelEvent) -> None:
        """Add to the event the new and removed robots and constraints."""
        for link in self._dropped:
            if not self._stay.issuperset(link.robots):  # removed before it is restated for the remaining robots
                event.remove_constraint(link.name)
        for name in self._leave:
            event.remove_robot(name)
        for link in self._dropped:
            if self._stay.issuperset(link.robots) and not link.restricts_values:
                event.remove_constraint(link.name)
        for drawn in self._come:
            robot = event.robot(drawn.name, weight=drawn.weight)
            for decision in _decisions_of(self._after, drawn.name):
                robot.variable(decision.name, [*self._after.values(decision)])
            add_topic(self._after, robot)
        for link in self._added:
            if not self._by_values(link):
                _add(event, model, link)

    def _by_values(self, link: RuleLink) -> bool:
        return link.restricts_values and self._stay.issuperset(link.robots)

    def _domains(self, sketch: Sketch, links: Sequence[RuleLink]) -> Domains:
        """Return a sketch's values, without those that `links` forbid for remaining robots."""
        found: Domains = {
            (name, decision.name): [*sketch.values(decision)]
            for decision in sketch.decisions
            for name in sketch.deciders(decision)
        }
        for link in links:
            if self._by_values(link):
                place = link.robots[0], link.rule.decision
                found[place] = [value for value in found[place] if link.allows(value)]
        return found


def links_of(sketch: Sketch) -> Iterator[RuleLink]:
    """Yield the constraints of all active rules in a sketch."""
    for rule in sketch.rules:
        if rule.on:
            for name, robots in applied(sketch, rule):
                yield RuleLink(sketch, rule, robots, name)


def _beyond(links: Collection[RuleLink], others: Collection[RuleLink]) -> Iterator[RuleLink]:
    """Yield the links that are not in `others`. Repeated links are counted."""
    there = Counter(link.meaning for link in others)
    for link in links:
        if there[link.meaning]:
            there[link.meaning] -= 1
        else:
            yield link


def _with_names(links: Iterator[RuleLink], taken: set[str]) -> Iterator[RuleLink]:
    """Yield the links with unique names, since events remove constraints by name."""
    for link in links:
        name, number = link.name, 2
        while name in taken:
            name, number = f"{link.name}_{number}", number + 1
        taken.add(name)
        yield replace(link, name=name)


def _check_link(link: RuleLink) -> None:
    """Raise `FromScratchError` if events cannot add or remove the constraint of a link."""
    alone = len(link.robots) == 1
    if alone and not link.restricts_values:
        raise FromScratchError("whatif.anew-wish", robot=link.robots[0])
    if link.rule.private and not alone:
        raise FromScratchError("whatif.anew-private", rule=link.rule.id)


def _add(event: ModelEvent, model: Model, link: RuleLink) -> None:
    term = term_of(model, link.sketch, link.rule, link.robots)
    if not PALETTE[link.rule.kind].graded:
        event.add(term, cost=link.rule.cost, name=link.name)
        return
    (robot,) = link.robots  # an event cannot minimise a sum, so each value has a constraint with its cost
    variable, decision = model.robots[robot][link.rule.decision], link.sketch.decision(link.rule.decision)
    assert decision is not None  # noqa: S101 - an active rule has a decision
    for value in link.sketch.values(decision):
        price = cast("int", PALETTE[link.rule.kind].condition(Applied(link.sketch, link.rule), [value]))  # type: ignore[list-item] # a number counts as it does
        if price:
            event.add(variable != value, cost=price, name=f"{link.name}_{value}".replace("-", "m"))


def _decisions_of(sketch: Sketch, robot: str) -> Iterator[Decision]:
    """Yield the decisions of a robot."""
    for decision in sketch.decisions:
        if robot in sketch.deciders(decision):
            yield decision

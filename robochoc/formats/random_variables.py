"""Random variables in files and objects: their reader, their writer, and their rules (docs/reference/format.md)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from decimal import Decimal

from lxml import etree

from robochoc.formats.definition_reader import read_integer, read_range
from robochoc.formats.diagnostics import Diagnostic, DiagnosticCollector, MistakeError, shortened, suggestion
from robochoc.formats.names import check_integer, check_name, check_unique
from robochoc.formats.team_members import TeamMembers
from robochoc.formats.xml import attribute, line
from robochoc.model.cost_units import MAX_PLACES
from robochoc.model.problem import Constraint, ConstraintModel, RandomVariable, Robot
from robochoc.model.uncertainty import Outcomes, declared_robots

_PROBABILITY = re.compile(rf"(?:0|1|0?\.[0-9]{{1,{MAX_PLACES}}}|1\.0{{1,{MAX_PLACES}}})")
_MOST_OUTCOMES = 10_000
_FORM = "write probability:value, 0.3:1|0.7:2"
_EXACT = f"use decimals of at most {MAX_PLACES} places with the sum 1: 0.333:1|0.333:2|0.334:3"


def read_random(element: etree._Element) -> RandomVariable:
    """Return the random variable in an element such as `<random name="wind">0.3:1|0.07:2..11</random>`.

    A probability applies to each of the values up to the next probability. Raises `MistakeError`.
    """
    values: dict[int, Decimal] = {}
    current: Decimal | None = None
    for part in (element.text or "").split("|"):
        word, colon, value = part.rpartition(":")
        if colon:
            current = _probability(word.strip())
        if current is None:
            raise MistakeError(f"the outcome '{shortened(part.strip())}' has no probability", _FORM)
        outcomes = _outcomes(value.strip())
        if len(values) + len(outcomes) > _MOST_OUTCOMES:
            raise MistakeError(f"there are more than {_MOST_OUTCOMES:,} outcomes", "use fewer outcomes")
        for outcome in outcomes:
            if outcome in values:
                raise MistakeError(f"the outcome {outcome} occurs twice", "add up its probabilities")
            values[outcome] = current
    places = max((-int(one.normalize().as_tuple().exponent) for one in values.values()), default=0)
    weights = tuple(int(one.scaleb(max(places, 0))) for one in values.values())
    seen_by = tuple(attribute(element, "seen_by").split())
    return RandomVariable(attribute(element, "name"), tuple(values), weights, max(places, 0), seen_by, line(element))


def write_random(instance: etree._Element, robot: Robot) -> None:
    """Add the random variables of `robot` to its XML."""
    if not robot.random:
        return
    section = etree.SubElement(instance, "random_variables", nbRandom=str(len(robot.random)))
    for one in robot.random:
        element = etree.SubElement(section, "random", name=one.name)
        if one.seen_by:
            element.set("seen_by", " ".join(one.seen_by))
        weighted = zip(one.outcomes, one.weights, strict=True)
        element.text = "|".join(f"{Decimal(weight).scaleb(-one.places):f}:{value}" for value, weight in weighted)


def check_random(one: RandomVariable, own: Collection[str], earlier: Collection[str]) -> None:
    """Raise `MistakeError` unless a random variable is valid in a robot with the variables `own`.

    Args:
        one: The random variable.
        own: The names of the robot's decision variables.
        earlier: The names of the robot's random variables that precede it.
    """
    check_name(one.name)
    check_unique("random variable", one.name, earlier)
    if one.name in own:
        raise MistakeError(f"'{shortened(one.name)}' is a random variable and a variable", "rename one of them")
    for name in one.seen_by:
        check_name(name)
    if len(set(one.seen_by)) < len(one.seen_by):
        raise MistakeError("a variable occurs twice in seen_by", "list each variable once")
    if not one.outcomes or len(one.outcomes) != len(one.weights):
        message = f"{len(one.outcomes)} outcomes have {len(one.weights)} probabilities"
        raise MistakeError(message, "give each outcome one probability, and at least one outcome")
    for outcome in one.outcomes:
        check_integer(outcome)
    if len(set(one.outcomes)) < len(one.outcomes):
        raise MistakeError("an outcome occurs twice", "add up its probabilities")
    if not 0 <= one.places <= MAX_PLACES:
        raise MistakeError(f"the probabilities have {one.places} decimal places", _EXACT)
    if min(one.weights) <= 0:
        raise MistakeError("the probability of an outcome is not positive", "leave impossible outcomes out")
    if sum(one.weights) != 10**one.places:
        total = Decimal(sum(one.weights)).scaleb(-one.places)
        raise MistakeError(f"the probabilities of '{shortened(one.name)}' have the sum {total:f}", _EXACT)


def check_uncertain(constraint: Constraint, randoms: Iterable[RandomVariable]) -> None:
    """Raise `MistakeError` if a constraint cannot depend on `randoms`."""
    outcomes = Outcomes(randoms)
    found = outcomes.on_which(constraint.scope)
    if found and constraint.model == ConstraintModel.PKC:
        message = f"a partially known constraint (PKC) depends on the random variable '{shortened(found[0].name)}'"
        raise MistakeError(message, 'write model="TKC": only totally known constraints can be uncertain')
    if found and all(name in outcomes.by_name for name in constraint.variables):
        message = f"the scope '{shortened(' '.join(constraint.variables))}' has random variables only"
        raise MistakeError(message, "add a variable of a robot, or delete the constraint: it decides nothing")


def refuse_uncertain(names: Iterable[str], randoms: Iterable[RandomVariable]) -> None:
    """Raise `MistakeError` if a scenario changes what depends on `randoms`."""
    outcomes = Outcomes(randoms)
    for name in names:
        if found := outcomes.on_which([name]):
            what = (
                "is a random variable" if name in outcomes.by_name else f"is chosen after {found[0].name} was observed"
            )
            hint = "a scenario can change only variables and constraints that no random variable affects"
            raise MistakeError(f"'{shortened(name)}' {what}", hint)


def refuse_differing(robot: Robot, known: Iterable[RandomVariable]) -> None:
    """Raise `InvalidInputError` if an added robot declares random variables otherwise than the team, in `known`."""
    declared = {one.name: one for one in known}
    report = DiagnosticCollector(robot.file)
    for one in robot.random:
        with report.at(one.line):
            if declared.get(one.name, one) != one:
                message = f"the random variable '{shortened(one.name)}' differs from that of the team"
                raise MistakeError(message, "write the same outcomes, probabilities and seen_by in both")
    report.finish()


def differing_random_variables(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield random variables that differ between robots, or are missing where a constraint depends on them."""
    first: dict[str, tuple[RandomVariable, Robot]] = {}
    for robot in members.robots:
        for one in robot.random:
            known, other = first.setdefault(one.name, (one, robot))
            if known != one:
                message = f"the random variable '{shortened(one.name)}' differs from that of '{other.name}'"
                hint = f"write the same outcomes, probabilities and seen_by in both ({members.place(other.name)})"
                yield members.place(robot.name, one.name).mistake(message, hint)
    if first:
        yield from _undeclared(members, [one for one, _ in first.values()])


def _undeclared(members: TeamMembers, randoms: list[RandomVariable]) -> Iterator[Diagnostic]:
    outcomes = Outcomes(randoms)
    for name, robot in zip(members.files, declared_robots(members.robots), strict=True):
        place = members.files[name].places
        for variable in robot.variables:
            if variable.name in outcomes.by_name:
                message = f"'{shortened(variable.name)}' is a random variable of another robot"
                yield place.variable(variable.name).mistake(message, "rename one of them")
        declared = {one.name for one in robot.random}
        for constraint in robot.constraints():
            for one in outcomes.on_which(constraint.scope):
                if one.name not in declared:
                    message = f"the constraint depends on the random variable '{shortened(one.name)}'"
                    yield place.constraint(constraint).mistake(message, "declare it in this file as in the others")
                    break
    owned = {variable.name: None for robot in declared_robots(members.robots) for variable in robot.variables}
    for one in () if members.broken else randoms:
        for name in one.seen_by:
            if name not in owned:
                robot_name = next(robot.name for robot in members.robots if one in robot.random)
                message = f"seen_by of '{shortened(one.name)}' names '{shortened(name)}', which no robot has"
                yield members.place(robot_name, one.name).mistake(message, suggestion(name, owned, "variables"))


def _outcomes(word: str) -> range:
    if ".." in word:
        return read_range(word)
    value = read_integer(word)
    return range(value, value + 1)


def _probability(word: str) -> Decimal:
    if not _PROBABILITY.fullmatch(word):
        raise MistakeError(f"'{shortened(word)}' is not a probability", _EXACT)
    return Decimal(word)

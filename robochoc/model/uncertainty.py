"""The deterministic equivalent of a problem with random variables (docs/guides/uncertainty.md).

A decision variable whose value is chosen after an observation becomes one variable for each outcome of the observed
random variables: together they are the policy. The expectation of a sum is the sum of the expectations, so that each
constraint is replaced by itself in every outcome on which it depends, with its cost multiplied by the probability. If
there are too many outcomes, samples replace those that no decision variable of the constraint observes. Each robot does
this alone, from its own file. The result is an ordinary team, for all protocols.

Source: Leaute and Faltings, Distributed constraint optimization under stochastic uncertainty, AAAI 2011.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from robochoc.model.constraint import INFINITE, Constraint, Function, Predicate, Relation, Semantics, Term, Variable
from robochoc.model.cost_units import MAX_PLACES
from robochoc.model.expression import Apply, Constant, names
from robochoc.model.finer_units import robot_in_places, team_in_places
from robochoc.model.magnitudes import MAX_COST
from robochoc.model.problem import Robot, Team, Topic
from robochoc.model.random_variable import RandomVariable
from robochoc.model.sampling import MAX_OUTCOMES, Law, Samples, can_be_infinite, exact_law, joint_outcomes, sampled_law
from robochoc.system.errors import RobochocError
from robochoc.system.plain_text import counted

MAX_PARTS = 2_000_000
"""The maximum number of variables, constraints and costs in a robot's deterministic equivalent."""
AUTOMATIC = Samples()
"""The samples that are used where an expectation over all outcomes is too large."""
_MOST_NAMES = 10

Scenario = Mapping[str, int]
"""Outcomes of random variables, by name."""


class UncertaintyError(RobochocError, ValueError):
    """Raised if a problem with random variables has no deterministic equivalent.

    Attributes:
        message: The error.
        hint: A suggestion to the user.
        line: The line in a file with the constraint that causes the error; 0: unknown.
    """

    def __init__(self, message: str, hint: str, line: int = 0) -> None:
        super().__init__(f"{message}; {hint}")
        self.message = message
        self.hint = hint
        self.line = line


class Outcomes:
    """The random variables of a robot or a team, and the decision variables that depend on their outcomes."""

    def __init__(self, randoms: Iterable[RandomVariable]) -> None:
        self.by_name = {one.name: one for one in sorted(randoms, key=lambda one: one.name)}  # the same in every file
        self._seen: dict[str, list[RandomVariable]] = {}
        for one in self.by_name.values():
            for variable in one.seen_by:
                self._seen.setdefault(variable, []).append(one)

    def seen(self, variable: str) -> Sequence[RandomVariable]:
        """Return the random variables whose outcomes are known when the value of `variable` is chosen."""
        return self._seen.get(variable, ())

    def on_which(self, terms: Iterable[Term]) -> tuple[RandomVariable, ...]:
        """Return the random variables among `terms`, and those that decision variables among `terms` depend on."""
        found: dict[str, RandomVariable] = {}
        for term in terms:
            if isinstance(term, str):
                own = [self.by_name[term]] if term in self.by_name else self.seen(term)
                found |= {one.name: one for one in own}
        return tuple(found.values())

    def scenarios(self, randoms: Sequence[RandomVariable]) -> Iterator[tuple[int, Scenario]]:
        """Yield the joint outcomes of `randoms`, each with the product of the weights."""
        yield from joint_outcomes(randoms)

    def term(self, term: Term, scenario: Scenario) -> Term:
        """Return the value of a random variable, or the variable that decides for `scenario`."""
        if not isinstance(term, str):
            return term
        if term in self.by_name:
            return scenario[term]
        return "".join([term, *(f".{one.name}.{_word(scenario[one.name])}" for one in self.seen(term))])

    def decisions(self, variable: str) -> tuple[str, ...]:
        """Return the variables that make up the policy of `variable`, one for each outcome of what is observed."""
        return tuple(str(self.term(variable, scenario)) for _, scenario in self.scenarios(self.seen(variable)))

    def in_scenario(self, constraint: Constraint, scenario: Scenario) -> Constraint:
        """Return `constraint` as it is in `scenario`."""
        return replace(
            constraint,
            scope=tuple(self.term(term, scenario) for term in constraint.scope),
            parameters=tuple(self.term(term, scenario) for term in constraint.parameters),
        )


def law_of(constraint: Constraint, outcomes: Outcomes, samples: Samples, places: int) -> Law:
    """Return the joint outcomes over which the cost of a constraint is averaged.

    Args:
        constraint: The constraint.
        outcomes: The random variables of its robot.
        samples: The samples to use if there are too many joint outcomes for an exact expectation. Outcomes that
            variables of the constraint observe are not sampled, since a policy has a value for each of them.
        places: The decimal places of the unit of costs.
    """
    randoms = outcomes.on_which(constraint.scope)
    law = exact_law(randoms)
    if not constraint.has_costs:
        return law
    seen = {one.name for term in constraint.variables for one in outcomes.seen(term)}
    hidden = [one for one in randoms if one.name not in seen]
    number = math.prod(len(one.outcomes) for one in hidden)
    if number <= samples.exact and (number == 1 or _places_of(constraint, places, law) <= MAX_PLACES):
        return law
    return sampled_law([one for one in randoms if one.name in seen], hidden, samples)


def expected_robot(robot: Robot, samples: Samples = AUTOMATIC) -> Robot:
    """Return the deterministic equivalent of `robot`, whose costs are expected costs.

    The result has the original in `Robot.declared`. A robot without random variables is returned unchanged.

    Raises:
        UncertaintyError: if there are too many outcomes, or the expected costs have too many digits.
    """
    if not robot.random or robot.declared is not None:
        return robot
    return _Expectation(robot, samples).robot()


def sampled_team(team: Team, samples: Samples) -> Team:
    """Return the equivalent of a problem with random variables in which the averages of `samples` replace expectations.

    Args:
        team: Any equivalent of the problem.
        samples: The samples, for constraints that depend on too many joint outcomes.

    Raises:
        UncertaintyError: see `expected_robot`.
    """
    robots = [robot if robot.declared is None else expected_robot(robot.declared, samples) for robot in team.robots]
    places = max(robot.costs.places for robot in robots)
    return replace(team_in_places(team, places), robots=tuple(robot_in_places(robot, places) for robot in robots))


def is_uncertain(team: Team) -> bool:
    """Return whether `team` is the unchanged equivalent of a problem with random variables."""
    return any(robot.random for robot in team.robots) and all(
        not robot.random or as_declared(robot) is robot.declared for robot in team.robots
    )


def as_declared(robot: Robot) -> Robot:
    """Return the robot with random variables of which `robot` is the equivalent, or `robot` if it was changed since."""
    if robot.declared is not None and expected_robot(robot.declared) == robot:
        return robot.declared
    return replace(robot, random=(), declared=None) if robot.random else robot


def without_random(team: Team) -> Team:
    """Return `team` without the random variables from which it was derived."""
    if not any(robot.random for robot in team.robots):
        return team
    return replace(team, robots=tuple(replace(robot, random=(), declared=None) for robot in team.robots))


def declared_robots(robots: Iterable[Robot]) -> list[Robot]:
    """Return `robots` as they were declared, with random variables."""
    return [robot.declared or robot for robot in robots]


def random_variables(team: Team) -> tuple[RandomVariable, ...]:
    """Return the random variables of `team`, in the order of its robots."""
    return tuple({one.name: one for robot in team.robots for one in robot.random}.values())


class _Expectation:
    """Computes the deterministic equivalent of a robot, in the coarsest unit of costs that is exact."""

    def __init__(self, robot: Robot, samples: Samples = AUTOMATIC) -> None:
        self._outcomes = Outcomes(robot.random)
        self._samples = samples
        own = robot.costs.places
        copies = (copy for child in robot.children for copy in child.copies)
        laws = [(one, self._law(one, own)) for one in (*robot.constraints(), *copies)]
        self._is_sampled = any(law.drawn for _, law in laws)
        places = max([own, *(_places_of(one, own, law) for one, law in laws)])
        if places > MAX_PLACES:
            raise UncertaintyError(
                f"the expected costs have {places} decimal places",
                f"use probabilities and costs with fewer digits (at most {MAX_PLACES} places in all), or fewer samples",
            )
        self._declared = robot_in_places(robot, places)
        self._parts = 0
        self._scaled: dict[tuple[int, int, int], tuple[Relation | Function, Relation | Function]] = {}

    def robot(self) -> Robot:
        robot = self._declared
        return replace(
            robot,
            variables=tuple(copy for one in robot.variables for copy in self._variables(one)),
            private=self.constraints(robot.private),
            parents=tuple(replace(one, constraints=self.constraints(one.constraints)) for one in robot.parents),
            children=tuple(
                replace(
                    one,
                    variables=self._decisions(one.variables),
                    constraints=self.constraints(one.constraints),
                    copies=self.constraints(one.copies),
                )
                for one in robot.children
            ),
            topics=tuple(map(self._topic, robot.topics)),
            shown=self._decisions(robot.shown),
            declared=robot,
            sampled=self._is_sampled,
        )

    def constraints(self, constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(part for one in constraints for part in self._in_all_outcomes(one))

    def _law(self, constraint: Constraint, places: int) -> Law:
        law = law_of(constraint, self._outcomes, self._samples, places)
        if not constraint.has_costs or (law.drawn and can_be_infinite(constraint)):
            _check_number([*law.observed, *law.drawn], f"the constraint {constraint.name}", constraint.line)
        return law

    def _variables(self, variable: Variable) -> Iterator[Variable]:
        self._count(_check_number(self._outcomes.seen(variable.name), f"the variable {variable.name}"))
        return (replace(variable, name=name) for name in self._outcomes.decisions(variable.name))

    def _decisions(self, variables: Iterable[str]) -> tuple[str, ...]:
        return tuple(copy for one in variables for copy in self._outcomes.decisions(one))

    def _topic(self, topic: Topic) -> Topic:
        used = itertools.chain.from_iterable(names(one) for one in (topic.x, topic.y, topic.z) if one is not None)
        for name in used:
            if seen := self._outcomes.seen(name):
                raise UncertaintyError(
                    f"the topic {topic.name} publishes {name}, which is chosen after {seen[0].name} was observed",
                    "publish only variables that observe nothing",
                )
        return topic

    def _in_all_outcomes(self, constraint: Constraint) -> Iterator[Constraint]:
        law = self._law(constraint, self._declared.costs.places)
        self._count(law.number)
        undrawn = law.undrawn() if can_be_infinite(constraint) else ()
        for weight, scenario in itertools.chain(law.cases(), undrawn):
            yield self._weighted(self._outcomes.in_scenario(constraint, scenario), weight, law.places)

    def _weighted(self, constraint: Constraint, weight: int, places: int) -> Constraint:
        """Return `constraint` with its cost multiplied by a probability: `weight`, in units of 10^-`places`."""
        match constraint.definition:
            case Predicate():
                return replace(constraint, cost=_expected(constraint, constraint.cost, weight, places))
            case Relation(semantics=Semantics.SOFT) as relation:
                key = id(relation), weight, places
                if key not in self._scaled:
                    self._count(len(relation.costs))
                    costs = tuple(_expected(constraint, cost, weight, places) for cost in relation.costs)
                    default = _expected(constraint, relation.default_cost, weight, places)
                    self._scaled[key] = relation, replace(relation, costs=costs, default_cost=default)
                return replace(constraint, definition=self._scaled[key][1])
            case Function() as function if not weight:  # it must be defined, and costs nothing
                is_defined = Apply("eq", (function.body, function.body))
                rule = Predicate(function.name, function.parameters, is_defined, function.symbolic, function.real)
                return replace(constraint, definition=rule)
            case Function() as function:
                zeros = _final_zeros(weight, places)
                key = id(function), weight, places
                if key not in self._scaled:
                    factor, more = weight // 10**zeros, places - zeros
                    body = function.body if factor == 1 else Apply("mul", (Constant(factor), function.body))
                    self._scaled[key] = function, replace(function, body=body, places=function.places + more)
                return replace(constraint, definition=self._scaled[key][1])
            case _:
                return constraint

    def _count(self, parts: int) -> None:
        self._parts += parts
        if self._parts > MAX_PARTS:
            raise UncertaintyError(
                f"the variables, constraints and costs in all outcomes are more than {MAX_PARTS:,}",
                "use fewer outcomes or samples, smaller relations, or fewer variables in seen_by",
            )


def _places_of(constraint: Constraint, places: int, law: Law) -> int:
    """Return the decimal places of the average costs of a constraint whose costs have `places` decimal places."""
    match constraint.definition:
        case Predicate():
            amounts: Iterable[float] = (constraint.cost,)
        case Relation(costs=costs, default_cost=default):
            amounts = (*costs, default)
        case Function(places=own):
            places, amounts = own, (1,)
    amount = math.gcd(*(int(one) for one in amounts if one != INFINITE)) * law.factor
    places += law.places
    return places - _final_zeros(amount, places) if amount else 0


def _expected(constraint: Constraint, cost: float, weight: int, places: int) -> float:
    if cost == INFINITE:
        return cost
    if abs(int(cost)) * weight > MAX_COST * 10**places:
        raise UncertaintyError(
            f"the expected cost of {constraint.name} has more than 18 digits",
            "use smaller costs, or probabilities with fewer digits",
            constraint.line,
        )
    expected: int = int(cost) * weight // 10**places
    return expected


def _final_zeros(number: int, most: int) -> int:
    """Return the number of zeros at the end of `number`, at most `most`."""
    zeros = 0
    while zeros < most and number % 10 ** (zeros + 1) == 0:
        zeros += 1
    return zeros


def _check_number(randoms: Sequence[RandomVariable], what: str, line: int = 0) -> int:
    """Return the number of joint outcomes of `randoms`. Raises `UncertaintyError` if there are too many."""
    number = math.prod(len(one.outcomes) for one in randoms)
    if number > MAX_OUTCOMES:
        raise UncertaintyError(
            f"{what} depends on {counted(number, 'joint outcome')} of {named(randoms)}",
            f"use at most {MAX_OUTCOMES:,}: fewer outcomes, or fewer random variables;"
            " hard constraints, and quotients by variables, are not sampled",
            line,
        )
    return number


def named(randoms: Sequence[RandomVariable]) -> str:
    """Return the names of `randoms` for a message, at most ten of them."""
    names = " ".join(one.name for one in randoms[:_MOST_NAMES])
    return f"{names} and {len(randoms) - _MOST_NAMES:,} more" if len(randoms) > _MOST_NAMES else names


def _word(outcome: int) -> str:
    return f"m{-outcome}" if outcome < 0 else str(outcome)

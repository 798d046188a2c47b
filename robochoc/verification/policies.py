"""Check a policy in the scenarios of a problem with random variables, and compute its costs.

The costs follow from the constraints in the robots' files, outcome by outcome, and not from the equivalent problem that
the robots have solved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

from robochoc.model.cost_units import Cost, common_units, cost_shown
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.outcome import Outcome
from robochoc.model.policies import Choice, PolicyReport, Risk, SampledCost
from robochoc.model.problem import (
    INFINITE,
    Assignment,
    Constraint,
    Function,
    Predicate,
    RandomVariable,
    Relation,
    Team,
)
from robochoc.model.sampling import MAX_OUTCOMES, Samples
from robochoc.model.uncertainty import AUTOMATIC, Outcomes, Scenario, declared_robots, law_of, random_variables
from robochoc.model.worst_case import MAX_EVALUATIONS, connected
from robochoc.verification.checker import RefutedError

MOST_EXACT = 100_000
"""The maximum number of costs that are computed for the expected cost of a policy found with samples."""


def policy_report(team: Team, outcome: Outcome, risk: Risk, samples: Samples = AUTOMATIC) -> PolicyReport:
    """Return the policy in `outcome`, and its costs.

    Args:
        team: The equivalent of a problem with random variables, with expected costs.
        outcome: The outcome with an assignment. Its cost is checked.
        risk: The cost that was optimised.
        samples: The samples that replaced expectations over too many outcomes.

    Raises:
        RefutedError: if the policy violates a hard constraint in a scenario, or its cost is wrong.
    """
    randoms = random_variables(team)
    scenarios = math.prod(len(one.outcomes) for one in randoms)
    report = PolicyReport(risk, None, None, {}, scenarios, _policies(team, outcome))
    if outcome.withdrawn:
        return report
    costs = PolicyCosts(team, outcome.assignment, samples)
    expected = costs.expected()
    worst, worst_scenario = costs.worst() or (None, {})
    sampled = _sampled_cost(costs) if risk == Risk.EXPECTED and costs.drawn else None
    claimed = worst if risk == Risk.WORST else expected if sampled is None else sampled.cost
    if outcome.cost is not None and claimed is not None and Fraction(claimed) != Fraction(outcome.cost):
        raise RefutedError(
            f"the policy for {team.name} has the {risk} cost {cost_shown(claimed)}, but the protocol claims"
            f" {cost_shown(outcome.cost)}"
        )
    if outcome.cost is None:
        return report
    return replace(report, expected=expected, worst=worst, worst_scenario=worst_scenario, sampled=sampled)


def _sampled_cost(costs: PolicyCosts) -> SampledCost:
    found = SampledCost(costs.samples.number, costs.sampled())
    if not costs.large:
        return found
    from robochoc.verification.estimates import METHOD, estimate  # noqa: PLC0415 - start-up: rarely needed

    number, low, high = estimate(costs)
    return replace(found, fresh=number, low=low, high=high, method=METHOD if number else None)


def _policies(team: Team, outcome: Outcome) -> dict[str, tuple[Choice, ...]]:
    outcomes = Outcomes(random_variables(team))
    labelled = outcome.labelled(outcome.assignment)
    found: dict[str, tuple[Choice, ...]] = {}
    for variable in (one.name for robot in declared_robots(team.robots) for one in robot.variables):
        observed = outcomes.seen(variable)
        cases = [(dict(case), str(outcomes.term(variable, case))) for _, case in outcomes.scenarios(observed)]
        if observed and all(name in labelled for _, name in cases):
            found[variable] = tuple(Choice(case, labelled[name]) for case, name in cases)
    return found


class PolicyCosts:
    """The costs of a policy, from the declared constraints.

    Args:
        team: The equivalent of a problem with random variables.
        assignment: The policy, as values of the variables of `team`.
        samples: The samples that replaced expectations over too many outcomes.

    Attributes:
        outcomes: The random variables.
        drawn: The constraints whose expectations were replaced, each with the random variables that were sampled.
        large: Those of them that have too many outcomes for an exact expectation after the run.
    """

    def __init__(self, team: Team, assignment: Assignment, samples: Samples) -> None:
        self.samples = samples
        self._robots = declared_robots(team.robots)
        self.outcomes = Outcomes(random_variables(team))
        self._assignment = assignment
        self._units = common_units(robot.costs for robot in team.robots)
        self._on: list[tuple[Constraint, Sequence[RandomVariable]]] = [
            (one, self.outcomes.on_which(one.scope)) for robot in self._robots for one in robot.constraints()
        ]
        self._constant = sum(
            (Fraction(robot.costs.constant, 10**robot.costs.places) for robot in self._robots), Fraction(0)
        )
        self._unit = {id(one): self._unit_of(one) for one, _ in self._on}
        laws = ((one, law_of(one, self.outcomes, samples, self._units.places)) for one, _ in self._on)
        self.drawn = [(one, law.drawn) for one, law in laws if law.drawn]
        limit = max(MAX_OUTCOMES, MOST_EXACT // max(1, len(self.drawn)))
        self.large = [one for one, _ in self.drawn if _number(self.outcomes.on_which(one.scope)) > limit]

    def expected(self) -> Cost | None:
        """Return the expected cost; None if there are too many outcomes. Raises `RefutedError` for a violation."""
        total = self.expected_without(self.large)
        return None if self.large else self._shown(total)

    def expected_without(self, left_out: Iterable[Constraint]) -> Fraction:
        """Return the sum of the expected costs of all constraints except those that are `left_out`."""
        ignored = {id(one) for one in left_out}
        costs = (self._mean(one, randoms, {}) for one, randoms in self._on if id(one) not in ignored)
        return sum(costs, self._constant)

    def sampled(self) -> Cost:
        """Return the cost for the samples that replaced expectations."""
        total = self.expected_without([one for one, _ in self.drawn])
        for constraint, drawn in self.drawn:
            names = {one.name for one in drawn}
            observed = [one for one in self.outcomes.on_which(constraint.scope) if one.name not in names]
            for case in drawn_cases(drawn, self.samples):
                total += self._mean(constraint, observed, case) / self.samples.number
        return self._shown(total)

    def _mean(self, constraint: Constraint, randoms: Sequence[RandomVariable], known: Scenario) -> Fraction:
        """Return the expected cost of a constraint over all outcomes of `randoms`, where other outcomes are `known`."""
        weights = [(one.name, dict(zip(one.outcomes, one.weights, strict=True))) for one in randoms]
        total = 0
        for scenario in _joint(randoms):
            weight = math.prod(by_outcome[scenario[name]] for name, by_outcome in weights)
            total += weight * self._price(constraint, {**scenario, **known})
        return Fraction(total, 10 ** sum(one.places for one in randoms)) * self._unit[id(constraint)]

    def worst(self) -> tuple[Cost, dict[str, int]] | None:
        """Return the cost in a worst scenario, and the scenario; None if there are too many scenarios."""
        total = self._constant + sum(self.cost(one, {}) for one, randoms in self._on if not randoms)
        worst_scenario: dict[str, int] = {}
        for group, randoms in connected(self.outcomes, (one for one, some in self._on if some)):
            if _number(randoms) * len(group) > (MOST_EXACT if self.drawn else MAX_EVALUATIONS):
                return None
            costs = [(sum(self.cost(one, case) for one in group), case) for case in _joint(randoms)]
            cost, case = (min if self._units.maximize else max)(costs, key=lambda one: one[0])
            total += cost
            if any(other != cost for other, _ in costs):
                worst_scenario |= case
        return self._shown(Fraction(total)), worst_scenario

    def cost(self, constraint: Constraint, scenario: Scenario) -> Fraction:
        """Return the cost of a constraint in a scenario. Raises `RefutedError` if the constraint is violated."""
        return self._price(constraint, scenario) * self._unit[id(constraint)]

    def _price(self, constraint: Constraint, scenario: Scenario) -> int:
        values = {
            name: scenario[name] if name in scenario else self._assignment[str(self.outcomes.term(name, scenario))]
            for name in constraint.variables
        }
        cost = constraint.price(values)
        if cost == INFINITE:
            case = ", ".join(f"{name} = {value}" for name, value in scenario.items()) or "every scenario"
            raise RefutedError(f"constraint {constraint.name} is violated if {case}")
        return int(cost)

    def _unit_of(self, constraint: Constraint) -> Fraction:
        definition = constraint.definition
        return Fraction(1, 10 ** (definition.places if isinstance(definition, Function) else self._units.places))

    def spread(self, constraint: Constraint) -> float:
        """Return the difference between the largest and the smallest cost of a constraint in all scenarios."""
        match constraint.definition:
            case Predicate():
                low, high = 0.0, abs(constraint.cost)
            case Relation() as relation:
                low, high = relation.finite_costs
            case Function():
                limits = {name: self._extent(name) for name in constraint.variables}
                low, high = bounds(constraint.applied, limits)
        return high - low if math.inf in {-low, high} else float((int(high) - int(low)) * self._unit[id(constraint)])

    def _extent(self, name: str) -> Interval:
        random = self.outcomes.by_name.get(name)
        values = random.outcomes if random else [self._assignment[one] for one in self.outcomes.decisions(name)]
        return Interval(min(values), max(values))

    def _shown(self, total: Fraction) -> Cost:
        places = self._units.places
        while 10**places % total.denominator:
            places += 1
        return Decimal(int(total * 10**places)).scaleb(-places) if places else int(total)


def drawn_cases(randoms: Iterable[RandomVariable], samples: Samples, purpose: str = "") -> Iterator[dict[str, int]]:
    """Yield the joint outcome of `randoms` in each sample."""
    named = {one.name: samples.draws(one, purpose) for one in randoms}
    for values in zip(*named.values(), strict=True):
        yield dict(zip(named, values, strict=True))


def _number(randoms: Iterable[RandomVariable]) -> int:
    return math.prod(len(one.outcomes) for one in randoms)


def _joint(randoms: Sequence[RandomVariable]) -> Iterator[dict[str, int]]:
    for values in itertools.product(*(one.outcomes for one in randoms)):
        yield {one.name: value for one, value in zip(randoms, values, strict=True)}

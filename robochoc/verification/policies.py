"""Check a policy in the scenarios of a problem with random variables, and compute its costs.

The costs follow from the constraints in the robots' files, outcome by outcome, and not from the equivalent problem that
the robots have solved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from fractions import Fraction

from robochoc.model.cost_units import Cost, common_units, cost_shown
from robochoc.model.outcome import Outcome
from robochoc.model.policies import Choice, PolicyReport, Risk
from robochoc.model.problem import INFINITE, Assignment, Constraint, Function, RandomVariable, Team
from robochoc.model.uncertainty import Outcomes, Scenario, declared_robots, random_variables
from robochoc.model.worst_case import MAX_EVALUATIONS, connected
from robochoc.verification.checker import RefutedError


def policy_report(team: Team, outcome: Outcome, risk: Risk) -> PolicyReport:
    """Return the policy in `outcome`, and its costs.

    Args:
        team: The equivalent of a problem with random variables, with expected costs.
        outcome: The outcome with an assignment. Its cost is checked.
        risk: The cost that was optimised.

    Raises:
        RefutedError: if the policy violates a hard constraint in a scenario, or its cost is wrong.
    """
    randoms = random_variables(team)
    scenarios = math.prod(len(one.outcomes) for one in randoms)
    policies = _policies(team, outcome)
    if outcome.withdrawn:
        return PolicyReport(risk, None, None, {}, scenarios, policies)
    costs = _Costs(team, outcome.assignment)
    expected = costs.expected()
    worst, worst_scenario = costs.worst() or (None, {})
    claimed = expected if risk == Risk.EXPECTED else worst
    if outcome.cost is not None and claimed is not None and Fraction(claimed) != Fraction(outcome.cost):
        raise RefutedError(
            f"the policy for {team.name} has the {risk} cost {cost_shown(claimed)}, but the protocol claims"
            f" {cost_shown(outcome.cost)}"
        )
    has_costs = outcome.cost is not None
    return PolicyReport(
        risk, expected if has_costs else None, worst if has_costs else None,
        worst_scenario if has_costs else {}, scenarios, policies,
    )  # fmt: skip


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


class _Costs:
    def __init__(self, team: Team, assignment: Assignment) -> None:
        self._robots = declared_robots(team.robots)
        self._outcomes = Outcomes(random_variables(team))
        self._assignment = assignment
        self._units = common_units(robot.costs for robot in team.robots)
        self._on: list[tuple[Constraint, Sequence[RandomVariable]]] = [
            (one, self._outcomes.on_which(one.scope)) for robot in self._robots for one in robot.constraints()
        ]
        self._constant = sum(
            (Fraction(robot.costs.constant, 10**robot.costs.places) for robot in self._robots), Fraction(0)
        )
        self._unit = {id(one): self._unit_of(one) for one, _ in self._on}

    def expected(self) -> Cost:
        """Return the sum of the constraints' expected costs. Raises `RefutedError` if one is violated."""
        total = self._constant
        for constraint, randoms in self._on:
            for scenario in _joint(randoms):
                probability = math.prod(one.probabilities[scenario[one.name]] for one in randoms)
                total += probability * self._cost(constraint, scenario)
        return self._shown(total)

    def worst(self) -> tuple[Cost, dict[str, int]] | None:
        """Return the cost in a worst scenario, and the scenario; None if there are too many scenarios."""
        total = self._constant + sum(self._cost(one, {}) for one, randoms in self._on if not randoms)
        worst_scenario: dict[str, int] = {}
        for group, randoms in connected(self._outcomes, (one for one, some in self._on if some)):
            if math.prod(len(one.outcomes) for one in randoms) * len(group) > MAX_EVALUATIONS:
                return None
            costs = [(sum(self._cost(one, case) for one in group), case) for case in _joint(randoms)]
            cost, case = (min if self._units.maximize else max)(costs, key=lambda one: one[0])
            total += cost
            if any(other != cost for other, _ in costs):
                worst_scenario |= case
        return self._shown(Fraction(total)), worst_scenario

    def _cost(self, constraint: Constraint, scenario: Scenario) -> Fraction:
        values = {
            name: scenario[name] if name in scenario else self._assignment[str(self._outcomes.term(name, scenario))]
            for name in constraint.variables
        }
        cost = constraint.price(values)
        if cost == INFINITE:
            case = ", ".join(f"{name} = {value}" for name, value in scenario.items()) or "every scenario"
            raise RefutedError(f"constraint {constraint.name} is violated if {case}")
        return int(cost) * self._unit[id(constraint)]

    def _unit_of(self, constraint: Constraint) -> Fraction:
        definition = constraint.definition
        return Fraction(1, 10 ** (definition.places if isinstance(definition, Function) else self._units.places))

    def _shown(self, total: Fraction) -> Cost:
        places = self._units.places
        return Decimal(int(total * 10**places)).scaleb(-places) if places else int(total)


def _joint(randoms: Iterable[RandomVariable]) -> Iterator[dict[str, int]]:
    randoms = list(randoms)
    for values in itertools.product(*(one.outcomes for one in randoms)):
        yield {one.name: value for one, value in zip(randoms, values, strict=True)}

"""Small random problems with random variables, and their best costs by trying all policies in all scenarios.

Brute force uses the declared constraints only: it shares no code with `robochoc.model.uncertainty`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import prod
from random import Random

from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    Definition,
    Domain,
    Function,
    Predicate,
    Relation,
    Semantics,
    Variable,
)
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.random_variable import RandomVariable
from robochoc.model.sampling import Samples

Judged = tuple[Fraction | None, Fraction | None]
WEIGHTS: dict[int, list[tuple[int, ...]]] = {1: [(1,)], 2: [(5, 5), (3, 7), (9, 1)], 3: [(2, 3, 5), (1, 1, 8)]}


@dataclass
class UncertainProblem:
    """A problem as it is declared: its variables with domains, constraints and random variables."""

    domains: dict[str, Sequence[int]]
    constraints: list[Constraint]
    random: list[RandomVariable]
    units: CostUnits
    team: Team
    _prices: dict[tuple[int, ...], float] = field(default_factory=dict)

    def best(self) -> Judged:
        """Return the best expected cost and the best worst cost over all policies; None: there is no policy."""
        aim: Callable[..., Fraction] = max if self.units.maximize else min
        against: Callable[..., Fraction] = min if self.units.maximize else max
        found = []
        for policy in self._policies():
            costs = [(chance, self._cost(policy, case)) for chance, case in self._scenarios()]
            if all(cost is not None for _, cost in costs):
                known = [(chance, cost) for chance, cost in costs if cost is not None]
                found.append((sum(chance * cost for chance, cost in known), against(cost for _, cost in known)))
        if not found:
            return None, None
        return aim(one for one, _ in found), aim(one for _, one in found)

    def best_for(self, samples: Samples) -> Fraction | None:
        """Return the best cost for `samples` over all policies; None: there is no policy."""
        aim: Callable[..., Fraction] = max if self.units.maximize else min
        found = [self._average(policy, samples) for policy in self._policies()]
        return aim((one for one in found if one is not None), default=None)

    def _average(self, policy: Mapping[str, Mapping[tuple[int, ...], int]], samples: Samples) -> Fraction | None:
        unit = 10**self.units.places
        total = Fraction(self.units.constant, unit)
        if any(self._cost(policy, case) is None for _, case in self._scenarios()):
            return None
        for constraint in self.constraints:
            scope = set(constraint.variables)
            seen = {one.name for one in self.random if scope & {*one.seen_by}}
            hidden = [one for one in self.random if one.name in scope - seen]
            number = prod(len(one.outcomes) for one in hidden)
            if number <= samples.exact:
                cases = list(self._scenarios())
            else:
                draws = list(zip(*(samples.draws(one) for one in hidden), strict=True))
                names = [one.name for one in hidden]
                cases = [
                    (chance / probability(hidden, case) / len(draws), case | dict(zip(names, row, strict=True)))
                    for chance, case in self._scenarios()
                    if all(case[one.name] == one.outcomes[0] for one in hidden)
                    for row in draws
                ]
            factor = Fraction(1, 1 if isinstance(constraint.definition, Function) else unit)
            total += sum(chance * int(constraint.price(self._values(policy, case))) for chance, case in cases) * factor
        return total

    def _values(self, policy: Mapping[str, Mapping[tuple[int, ...], int]], case: Mapping[str, int]) -> dict[str, int]:
        seen = {name: tuple(case[one.name] for one in self.random if name in one.seen_by) for name in policy}
        return dict(case) | {name: rule[seen[name]] for name, rule in policy.items()}

    def _scenarios(self) -> Iterator[tuple[Fraction, dict[str, int]]]:
        for row in itertools.product(*(range(len(one.outcomes)) for one in self.random)):
            chance, case = Fraction(1), {}
            for one, number in zip(self.random, row, strict=True):
                chance *= Fraction(one.weights[number], 10**one.places)
                case[one.name] = one.outcomes[number]
            yield chance, case

    def _policies(self) -> Iterator[dict[str, dict[tuple[int, ...], int]]]:
        """Yield all policies: for each variable, the value for each tuple of observed outcomes."""
        rules = []
        for name, domain in self.domains.items():
            seen = [one.outcomes for one in self.random if name in one.seen_by]
            cases = list(itertools.product(*seen))
            rules.append([dict(zip(cases, row, strict=True)) for row in itertools.product(domain, repeat=len(cases))])
        for chosen in itertools.product(*rules):
            yield dict(zip(self.domains, chosen, strict=True))

    def _cost(self, policy: Mapping[str, Mapping[tuple[int, ...], int]], case: Mapping[str, int]) -> Fraction | None:
        values = self._values(policy, case)
        unit = 10**self.units.places
        total = self.units.constant
        for number, constraint in enumerate(self.constraints):
            key = number, *(values[name] for name in constraint.variables)
            if key not in self._prices:
                self._prices[key] = constraint.price(values)
            price = self._prices[key]
            if price == INFINITE:
                return None
            total += int(price) * (unit if isinstance(constraint.definition, Function) else 1)
        return Fraction(total, unit)


def probability(random: Sequence[RandomVariable], case: Mapping[str, int]) -> Fraction:
    """Return the probability of the outcomes of `random` in `case`."""
    return prod((one.probabilities[case[one.name]] for one in random), start=Fraction(1))


def uncertain_problem(chance: Random, *, hard: bool = True, observed: bool = True) -> UncertainProblem:
    """Return a random problem of two to four robots with one or two random variables."""
    number = chance.choice([2, 3, 3, 4])
    names = [f"V{robot}" for robot in range(1, number + 1)]
    domains: dict[str, Sequence[int]] = {name: range(chance.choice([2, 2, 3])) for name in names}
    units = CostUnits(chance.random() < 0.3, chance.choice([0, 0, 1]), chance.choice([0, 7, -3]))
    randoms = []
    budget = 1
    for place in range(chance.choice([1, 2, 2])):
        outcomes = tuple(sorted(chance.sample(range(-1, 4), chance.choice([2, 2, 3]))))
        seen = tuple(name for name in names if observed and chance.random() < 0.25 and budget * len(domains[name]) <= 8)
        for name in seen:
            budget *= len(domains[name]) ** (len(outcomes) - 1)
        weights = chance.choice(WEIGHTS[len(outcomes)])
        randoms.append(RandomVariable(f"r{place}", outcomes, weights, 1, seen))
    every = {**domains, **{one.name: one.outcomes for one in randoms}}
    constraints = []
    for place in range(number + 2):
        scope = chance.sample(names, chance.choice([1, 2, 2]))
        scope += [one.name for one in randoms if chance.random() < 0.5]
        chance.shuffle(scope)
        constraints.append(_constraint(chance, f"C{place}", scope, every, hard=hard, sign=-1 if units.maximize else 1))
    owned = {f"Robot{name[1:]}": [Variable(name, Domain("D" + name, (range(len(domains[name])),)))] for name in names}
    extras = Extras(random=randoms)
    team = assemble("uncertain", owned, constraints, kind=ProblemKind.DISWCSP, costs=units, extras=extras)
    return UncertainProblem(domains, constraints, randoms, units, team)


def frodo_xml(problem: UncertainProblem, digits: int) -> str:
    """Return a problem in FRODO's format, with probabilities as floating-point numbers of `digits` digits."""
    unit, infinity = 10**problem.units.places, "-infinity" if problem.units.maximize else "infinity"
    every = {**problem.domains, **{one.name: one.outcomes for one in problem.random}}
    domains = [f'<domain name="D{name}">{" ".join(map(str, values))}</domain>' for name, values in every.items()]
    variables = [f'<variable name="{name}" domain="D{name}" agent="a{name}"/>' for name in problem.domains]
    variables += [f'<variable name="{one.name}" domain="D{one.name}" type="random"/>' for one in problem.random]
    laws, relations, constraints = [], [], []
    for one in problem.random:
        chances = (f"{weight / 10**one.places:.{digits}f}" for weight in one.weights)
        text = " | ".join(f"{chance}: {value}" for chance, value in zip(chances, one.outcomes, strict=True))
        laws.append(f'<probability name="p{one.name}" semantics="soft" arity="1">{text}</probability>')
        constraints.append(f'<constraint name="c{one.name}" scope="{one.name}" reference="p{one.name}"/>')
    for constraint in problem.constraints:
        names, rows = constraint.variables, []
        one_unit = 1 if isinstance(constraint.definition, Function) else unit
        for row in itertools.product(*(every[name] for name in names)):
            price = constraint.price(dict(zip(names, row, strict=True)))
            cost = infinity if price == INFINITE else f"{price / one_unit:.1f}"
            rows.append(f"{cost}: {' '.join(map(str, row))}")
        name = constraint.name
        arity = f'arity="{len(names)}" semantics="soft"'
        relations.append(f'<relation name="r{name}" {arity}>{" | ".join(rows)}</relation>')
        constraints.append(f'<constraint name="{name}" scope="{" ".join(names)}" reference="r{name}"/>')
    parts = {"domains": domains, "variables": variables, "relations": relations}
    parts |= {"probabilities": laws, "constraints": constraints}
    body = "".join(f"<{tag}>{''.join(found)}</{tag}>" for tag, found in parts.items())
    agents = "".join(f'<agent name="a{name}"/>' for name in problem.domains)
    sense = str(problem.units.maximize).lower()
    head = f'<presentation maximize="{sense}" format="XCSP 2.1_FRODO"/><agents>{agents}</agents>'
    return f"<instance>{head}{body}</instance>"


def _constraint(
    chance: Random, name: str, scope: Sequence[str], domains: Mapping[str, Sequence[int]], *, hard: bool, sign: int
) -> Constraint:
    formals = tuple(f"X{place}" for place in range(len(scope)))
    total = Apply("add", tuple(map(Name, formals))) if len(formals) > 1 else Name(formals[0])
    definition: Definition
    cost: float = INFINITE
    kind = chance.choice(["soft", "soft", "function", "predicate", "hard"])
    if kind == "soft":
        rows = list(itertools.product(*(domains[one] for one in scope)))
        rows = chance.sample(rows, len(rows) * 2 // 3)
        costs = tuple(INFINITE if hard and chance.random() < 0.05 else chance.randint(-5, 9) for _ in rows)
        definition = Relation(f"R{name}", len(scope), Semantics.SOFT, tuple(rows), costs, chance.randint(0, 3))
    elif kind == "function":
        body = Apply("mod", (Apply("mul", (total, Constant(chance.randint(2, 5)))), Constant(chance.randint(2, 7))))
        definition = Function(f"F{name}", formals, body)
    else:
        body = Apply("ne", (Apply("mod", (total, Constant(3))), Constant(chance.randint(0, 2))))
        definition = Predicate(f"P{name}", formals, body)
        if kind == "predicate" or not hard or chance.random() < 0.5:
            cost = chance.randint(1, 9) * sign
    return Constraint(name, definition, tuple(scope), tuple(scope), cost=cost)

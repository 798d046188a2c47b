"""Wide predicates as small tables: they say the same, for both central solvers and for what is exported."""

from __future__ import annotations

import importlib.util
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from random import Random

import pytest

from robochoc.formats.dialects.xcsp3.writer import xcsp3
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Expression, Name, text
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Domain, Function, Predicate, ProblemKind, Team, Variable
from robochoc.run import Options, Runtime, solve
from robochoc.solver import splitting
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralSolver
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.external_programs import CP_SAT
from robochoc.solver.solver_choice import only
from robochoc.solver.splitting import Split, split
from tests.support.xcsp3_solvers import read_document

pytestmark = pytest.mark.usefixtures("shared_solvers")

needs_ortools = pytest.mark.skipif(importlib.util.find_spec("ortools") is None, reason="the extra ortools")
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 11))]
EACH = 150
COMPARISONS = ("eq", "ne", "lt", "le", "gt", "ge")
WIDE = 12
"""With 5 values for each of so many variables there are 244,140,625 combinations."""


# The same solutions


class AnyExpression:
    """Random expressions over the names X0, X1, ..."""

    def __init__(self, chance: Random, width: int) -> None:
        self.chance = chance
        self.width = width

    def integer(self, depth: int) -> Expression:
        chance = self.chance
        if depth <= 0 or chance.random() < 0.2:
            return (
                Name(f"X{chance.randrange(self.width)}") if chance.random() < 0.8 else Constant(chance.randint(-3, 3))
            )
        operator = chance.choice(("add", "add", "sub", "mul", "neg", "abs", "min", "max", "dist", "div", "mod", "if"))
        if operator == "if":
            return Apply("if", (self.truth(depth - 1), self.integer(depth - 1), self.integer(depth - 1)))
        most = {"add": 6, "min": 4, "max": 4, "mul": 3}.get(operator, 2)
        number = 1 if operator in {"neg", "abs"} else chance.randint(2, most)
        return Apply(operator, tuple(self.integer(depth - 1) for _ in range(number)))

    def truth(self, depth: int) -> Expression:
        chance = self.chance
        operator = chance.choice((*COMPARISONS, "le", "in", "not", "and", "or", "xor", "iff", "imp"))
        if depth <= 0 or operator in {*COMPARISONS, "in"}:
            operator = operator if operator in {*COMPARISONS, "in"} else "le"
            number = chance.randint(2, 4) if operator in {"eq", "in"} else 2
            return Apply(operator, tuple(self.integer(depth - 1) for _ in range(number)))
        number = {"not": 1, "imp": 2}.get(operator) or chance.randint(2, 4)
        return Apply(operator, tuple(self.truth(depth - 1) for _ in range(number)))


def extended(
    partial: list[dict[str, int]], tables: Iterable[tuple[Sequence[str], Iterable[tuple[int, ...]]]]
) -> list[dict[str, int]]:
    """Return all ways in which tables extend assignments."""
    for scope, rows in tables:
        parts = [dict(zip(scope, row, strict=True)) for row in rows]
        partial = [
            given | part
            for given in partial
            for part in parts
            if all(given.get(name, value) == value for name, value in part.items())
        ]
    return partial


def joined(found: Split, variables: Sequence[str], domains: Mapping[str, Sequence[int]]) -> Counter[tuple[int, ...]]:
    """Return how often each assignment of `variables` can be extended to the further variables of `found`."""
    every = [dict(zip(variables, row, strict=True)) for row in itertools.product(*(domains[v] for v in variables))]
    return Counter(tuple(given[name] for name in variables) for given in extended(every, found.tables))


@pytest.mark.parametrize("batch", BATCHES)
def test_tables_have_the_solutions_of_the_predicate_each_once(batch: int, monkeypatch: pytest.MonkeyPatch) -> None:
    done = 0
    for seed in range(EACH * batch, EACH * (batch + 1)):
        chance = Random(seed)
        monkeypatch.setattr(splitting, "SMALL", chance.choice((1, 3, 6, 20)))
        monkeypatch.setattr(splitting, "MAX_COMBINATIONS", chance.choice((12, 10**6, 10**6, 10**6)))
        width = chance.randint(2, 4)
        domains = {f"V{place}": sorted(chance.sample(range(-3, 5), chance.randint(1, 3))) for place in range(width)}
        formal = tuple(f"X{place}" for place in range(width))
        terms = ("V0", *(name if chance.random() < 0.9 else chance.randint(-2, 2) for name in list(domains)[1:]))
        body = AnyExpression(chance, width).truth(chance.randint(1, 3))
        scope = tuple(term for term in terms if isinstance(term, str))
        constraint = Constraint("c", Predicate("p", formal, body), scope, terms)
        found = split(constraint, domains, "#")
        if found is None:
            continue
        done += 1
        assert found.domains.keys() == {*scope, *(name for names, _ in found.tables for name in names)}
        rows = itertools.product(*(domains[name] for name in scope))
        expected = Counter(row for row in rows if constraint.allows(dict(zip(scope, row, strict=True))))
        assert joined(found, scope, domains) == expected, (seed, text(body))
    assert done > EACH / 2


# Whole teams


def wide_team(body: Expression, width: int = WIDE, values: int = 5, cost: Expression | None = None) -> Team:
    """Robots R0, R1, ... with a variable each, and one hard predicate over all of them."""
    domain = Domain("d", (range(values),))
    own = {f"R{place}": [Variable(f"V{place}", domain)] for place in range(width)}
    names = tuple(f"V{place}" for place in range(width))
    constraints = [Constraint("wide", Predicate("p", names, body), names, names)]
    if cost is not None:
        constraints += [Constraint("cost", Function("f", ("X",), cost), (name,), (name,)) for name in names]
    kind = ProblemKind.DISWCSP if cost is not None else ProblemKind.DISCSP
    return assemble("wide", own, constraints, kind=kind)


def members(width: int = WIDE) -> list[Expression]:
    return [Name(f"V{place}") for place in range(width)]


def weighted(factors: Sequence[int]) -> Expression:
    terms = zip(factors, members(len(factors)), strict=True)
    return Apply("add", tuple(Apply("mul", (Constant(factor), term)) for factor, term in terms))


def hits(value: int) -> Expression:
    found = [Apply("eq", (member, Constant(value))) for member in members()]
    return Apply("add", tuple(Apply("if", (hit, Constant(1), Constant(0))) for hit in found))


def ways(factors: Sequence[int], values: int = 5) -> Counter[int]:
    """How many assignments have each weighted sum."""
    found = Counter({0: 1})
    for factor in factors:
        longer: Counter[int] = Counter()
        for (total, number), value in itertools.product(found.items(), range(values)):
            longer[total + factor * value] += number
        found = longer
    return found


FACTORS = (3, -2, 7, 1, 1, -5, 2, 2, 4, -1, 3, 6)
MEANING: dict[str, Callable[[int, int], bool]] = {
    "le": lambda total, bound: total <= bound,
    "ge": lambda total, bound: total >= bound,
    "lt": lambda total, bound: total < bound,
    "eq": lambda total, bound: total == bound,
    "ne": lambda total, bound: total != bound,
}


@pytest.mark.parametrize(("operator", "bound"), [("le", -25), ("ge", 110), ("lt", -31), ("eq", 111), ("ne", 17)])
def test_a_wide_sum_has_its_solutions_and_no_others(operator: str, bound: int) -> None:
    team = wide_team(Apply(operator, (weighted(FACTORS), Constant(bound))))
    expected = sum(number for total, number in ways(FACTORS).items() if MEANING[operator](total, bound))
    found = CentralSolver().solve(team) if expected > 200_000 else CentralSolver().solve(team, count=True)
    assert found.verdict is Verdict.SOLUTION
    assert found.count in {expected, None}


@needs_ortools
@pytest.mark.parametrize("bound", [9, 200])
def test_both_central_solvers_find_the_least_cost_under_a_wide_sum(bound: int) -> None:
    """Each value costs its square: the optimum is told by adding up sums and costs."""
    factors = tuple(map(abs, FACTORS))
    team = wide_team(Apply("ge", (weighted(factors), Constant(bound))), cost=Apply("sqr", (Name("X"),)))
    least = {0: 0}
    for factor in factors:
        longer: dict[int, int] = {}
        for (total, cost), value in itertools.product(least.items(), range(5)):
            after = total + factor * value
            longer[after] = min(longer.get(after, cost + value * value), cost + value * value)
        least = longer
    expected = min((cost for total, cost in least.items() if total >= bound), default=None)
    with only(CP_SAT) as cp:
        answers = [CentralSolver().solve(team), cp.solve(team)]
    assert [answer.cost for answer in answers] == [expected, expected]
    assert {answer.verdict for answer in answers} == {Verdict.NO_SOLUTION if expected is None else Verdict.OPTIMAL}


def test_counts_and_numbers_of_different_values_are_split() -> None:
    different = [
        Apply(
            "if",
            (Apply("or", tuple(Apply("eq", (one, Constant(value))) for one in members())), Constant(1), Constant(0)),
        )
        for value in range(5)
    ]
    few = Apply("le", (Apply("add", tuple(different)), Constant(1)))
    assert CentralSolver().solve(wide_team(few), count=True).count == 5
    often = Apply("and", (Apply("eq", (hits(0), Constant(10))), Apply("eq", (hits(1), Constant(1)))))
    assert CentralSolver().solve(wide_team(often), count=True).count == 396  # 66 places for the zeros, then 2 * 3
    never = Apply("and", (Apply("ge", (hits(0), Constant(8))), Apply("ge", (hits(1), Constant(5)))))
    assert CentralSolver().solve(wide_team(never)).verdict is Verdict.NO_SOLUTION


def test_a_sum_of_powers_of_ten_is_added_up_from_the_largest_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(splitting, "MAX_COMBINATIONS", 20_000)  # in the written order there are too many partial sums
    team = wide_team(Apply("eq", (weighted([10**place for place in range(9)]), Constant(987654321))), 9, values=10)
    found = CentralSolver().solve(team, count=True)
    assert found.count == 1


def test_a_protocol_takes_the_predicate_as_it_is() -> None:
    team = wide_team(Apply("eq", (weighted(FACTORS), Constant(22))))
    assert solve(team, Options("afc-ng", runtime=Runtime.SIMULATOR, verify=True)).verdict is Verdict.SOLUTION


def test_what_cannot_be_split_is_refused_as_before() -> None:
    huge = Apply("eq", (Apply("mul", tuple(Apply("add", (one, Constant(2))) for one in members())), Constant(7)))
    with pytest.raises(UnsupportedError, match="combinations of values"):
        CentralSolver().solve(wide_team(huge, values=40))


def test_an_exported_document_has_the_parts_of_a_wide_predicate_behind_the_variables() -> None:
    team = wide_team(Apply("eq", (weighted(FACTORS), Constant(110))))
    with AceProcess(java=False) as writer:
        content = xcsp3(team, writer)
    noted = [b"note=" in line for line in content.splitlines() if b"<var " in line]
    assert noted[: WIDE + 1] == [True] * WIDE + [False]
    document = read_document(content)
    assert all(positive for _, _, positive in document.tables)
    found = extended([{}], [(scope, rows) for scope, rows, _ in document.tables])
    assert document.domains.keys() >= found[0].keys() >= {f"V{place}" for place in range(WIDE)}
    assert len(found) == ways(FACTORS)[110]

"""Predicates as comparisons of sums: translated rightly, and solved rightly by ACE and OR-Tools."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from random import Random

import pytest

from robochoc.model.expression import Type, evaluate, parse
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Predicate, Team
from robochoc.solver import encoding
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralAnswer, CentralSolver, TeamSolver
from robochoc.solver.encoding import components
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.external_programs import PROGRAMS
from robochoc.solver.linear import FALSE, TRUE, holds, linear
from robochoc.solver.solver_choice import only
from robochoc.verification.checker import assignment_cost, violations
from tests.support.brute_force import least_cost
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of

pytestmark = pytest.mark.usefixtures("shared_solvers")

NAMES = ("X", "Y", "Z")


def a_sum(chance: Random, depth: int = 0) -> str:
    kind = chance.choice(["name", "name", "constant", "add", "sub", "neg", "mul"]) if depth < 3 else "name"
    match kind:
        case "name":
            return chance.choice(NAMES)
        case "constant":
            return str(chance.randint(-5, 5))
        case "neg":
            return f"neg({a_sum(chance, depth + 1)})"
        case "mul":
            return f"mul({chance.randint(-3, 3)},{a_sum(chance, depth + 1)})"
        case _:
            return f"{kind}({a_sum(chance, depth + 1)},{a_sum(chance, depth + 1)})"


def a_side(chance: Random) -> str:
    match chance.choice(["sum", "sum", "sum", "abs", "dist", "min", "max"]):
        case "sum":
            return a_sum(chance)
        case "abs":
            return f"abs({a_sum(chance)})"
        case other:
            return f"{other}({a_side(chance) if other != 'dist' else a_sum(chance)},{a_sum(chance)})"


def a_truth(chance: Random, depth: int = 0) -> str:
    operators = ["and", "or", "imp", "iff", "xor", "not"]
    if depth > 2 or chance.random() < 0.5:
        return f"{chance.choice(['le', 'lt', 'ge', 'gt', 'eq', 'ne'])}({a_side(chance)},{a_side(chance)})"
    operator = chance.choice(operators)
    parts = [a_truth(chance, depth + 1) for _ in range(1 if operator == "not" else 2)]
    return f"{operator}({','.join(parts)})"


def predicate(name: str, text: str, scope: Sequence[str]) -> Constraint:
    scope = tuple(scope)
    return Constraint(name, Predicate(name, NAMES, parse(text, NAMES, Type.BOOLEAN)), scope, scope)


def some_domains(chance: Random) -> dict[str, tuple[int, ...]]:
    return {f"V{number}": tuple(sorted(chance.sample(range(-5, 7), chance.randint(1, 4)))) for number in range(4)}


def is_true(constraint: Constraint, values: Mapping[str, int]) -> bool:
    definition = constraint.definition
    assert isinstance(definition, Predicate)
    return bool(
        evaluate(
            definition.body, {formal: values[name] for formal, name in zip(NAMES, constraint.variables, strict=True)}
        )
    )


def test_a_formula_is_true_where_its_predicate_is() -> None:
    chance = Random("formulas")
    for number in range(250):
        domains = some_domains(chance)
        one = predicate(f"P{number}", a_truth(chance), chance.sample(sorted(domains), 3))
        formula = linear(one, domains)
        assert formula is not None
        for row in itertools.product(*(domains[name] for name in one.variables)):
            values = dict(zip(one.variables, row, strict=True))
            assert holds(formula, dict(values.items())) == is_true(one, values), (one, row)


@pytest.mark.parametrize(
    "text", ["eq(mul(X,Y),Z)", "le(div(X,2),Z)", "le(add(max(X,Y),1),Z)", "in(X,set(1,2))", "eq(X,Y,Z)"]
)
def test_other_predicates_stay_tables(text: str) -> None:
    assert linear(predicate("P", text, ("A", "B", "C")), dict.fromkeys("ABC", (1, 2, 3))) is None


def test_sums_that_do_not_fit_into_32_bits_stay_tables() -> None:
    domains = {"A": (0, 10**8), "B": (0, 1), "C": (-(10**8), 1)}
    assert linear(predicate("P", "le(add(X,Y),Z)", ("A", "B", "C")), domains) is not None
    assert linear(predicate("P", "le(mul(9,X),Z)", ("A", "B", "C")), domains) is None


def test_constant_formulas_have_no_comparisons() -> None:
    domains = dict.fromkeys("ABC", (1, 2))
    assert linear(predicate("P", "le(X,add(X,1))", ("A", "B", "C")), domains) == TRUE
    assert linear(predicate("P", "ne(sub(X,X),0)", ("A", "B", "C")), domains) == FALSE


def test_a_component_with_far_values_has_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Codes are as far apart as values, and sums of codes have to be small as well."""
    monkeypatch.setattr(encoding, "MAX_ALLOWED_ROWS", 2)
    rule = predicate("P", "le(add(X,Y),Z)", ("A", "B", "C"))
    near = team_of(dict.fromkeys("ABC", (1, 2, 3)), [rule])
    (part,) = components(near.variables.values(), near.constraints(), may_add=True)
    assert (len(part.network.formulas), part.values) == (1, range(1, 4))
    link = Constraint(
        "L", Predicate("L", ("X", "Y"), parse("ne(X,Y)", ("X", "Y"), Type.BOOLEAN)), ("C", "D"), ("C", "D")
    )
    far = team_of({**dict.fromkeys("ABC", (1, 2, 3)), "D": (-(2**40), 1)}, [rule, link])
    (part,) = components(far.variables.values(), far.constraints(), may_add=True)
    assert not part.network.formulas


@pytest.fixture(params=["ace", *PROGRAMS])
def solver(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[TeamSolver]:
    """Return a central solver that is given formulas also where tables are small."""
    monkeypatch.setattr(encoding, "MAX_ALLOWED_ROWS", 2)
    if request.param == "ace":
        request.getfixturevalue("warm_ace")
        with AceProcess(always=True) as ace:
            yield CentralSolver(solver=ace)
    elif not PROGRAMS[request.param].is_installed():
        pytest.skip(f"the extra {request.param} is not installed")
    else:
        with only(PROGRAMS[request.param]) as one:
            yield one


def solved(solver: TeamSolver, team: Team) -> CentralAnswer | None:
    """The answer of a solver. None: it is toulbar2, and there are disjunctions of sums."""
    try:
        return solver.solve(team)
    except UnsupportedError:
        assert solver.name == "toulbar2"
        return None


def random_team(chance: Random) -> Team:
    domains = some_domains(chance)
    rules = [
        predicate(f"P{n}", a_truth(chance), chance.sample(sorted(domains), 3)) for n in range(chance.randint(1, 3))
    ]
    return team_of(domains, rules)


@pytest.mark.parametrize("teams", [25, pytest.param(400, marks=pytest.mark.slow)])
def test_solvers_decide_formulas_as_brute_force_does(teams: int, solver: TeamSolver) -> None:
    chance = Random(f"decide {teams}")
    seen = {Verdict.SOLUTION: 0, Verdict.NO_SOLUTION: 0}
    for _ in range(teams):
        team = random_team(chance)
        if (found := solved(solver, team)) is None:
            continue
        rows = (
            dict(zip(team.variables, row, strict=True))
            for row in itertools.product(*(one.domain for one in team.variables.values()))
        )
        has_one = any(all(is_true(one, row) for one in team.constraints()) for row in rows)
        assert found.verdict is (Verdict.SOLUTION if has_one else Verdict.NO_SOLUTION), team
        assert not has_one or not list(violations(team, found.assignment)), team
        seen[found.verdict] += 1
    assert min(seen.values()) > 2


@pytest.mark.parametrize("teams", [10, pytest.param(200, marks=pytest.mark.slow)])
def test_solvers_find_the_least_cost_under_formulas(teams: int, solver: TeamSolver) -> None:
    chance = Random(f"costs {teams}")
    for _ in range(teams):
        hard = random_team(chance)
        domains = {name: tuple(variable.domain) for name, variable in hard.variables.items()}
        soft = [
            Constraint(
                f"S{n}",
                Predicate(f"S{n}", NAMES, parse(a_truth(chance), NAMES, Type.BOOLEAN)),
                scope,
                scope,
                cost=chance.randint(1, 9),
            )
            for n in range(2)
            for scope in [tuple(chance.sample(sorted(domains), 3))]
        ]
        team = with_costs(team_of(domains, [*hard.constraints(), *soft]))
        if (found := solved(solver, team)) is None:
            continue
        least = least_cost(team)
        assert found.verdict is (Verdict.NO_SOLUTION if least == INFINITE else Verdict.OPTIMAL), team
        assert least == INFINITE or found.cost == least == assignment_cost(team, found.assignment), team


def test_a_job_shop_with_a_long_horizon(warm_ace: None) -> None:
    """Its tables would have millions of rows."""
    del warm_ace
    horizon = tuple(range(2001))
    pair = ("X", "Y", "Z")
    tasks = {"A": 500, "B": 610, "C": 720}
    rules = []
    for one, other in itertools.combinations(tasks, 2):
        text = f"or(le(add(X,{tasks[one]}),Y),le(add(Y,{tasks[other]}),X))"
        rules.append(
            Constraint(
                one + other,
                Predicate(one + other, pair[:2], parse(text, pair[:2], Type.BOOLEAN)),
                (one, other),
                (one, other),
            )
        )
    late = Constraint("late", Predicate("late", ("X",), parse("ge(X,1200)", ("X",), Type.BOOLEAN)), ("C",), ("C",))
    last = Constraint("last", Predicate("last", ("X",), parse("le(X,1280)", ("X",), Type.BOOLEAN)), ("C",), ("C",))
    team = team_of(dict.fromkeys(tasks, horizon), [*rules, late, last])
    found = CentralSolver().solve(team)
    assert found.verdict is Verdict.SOLUTION
    assert not list(violations(team, found.assignment))

"""Random teams with all that people bring: symbols, decimals, utilities, functions, global constraints, parts.

What is written is read back, and each constraint costs then what it cost before, for every assignment.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import check_team, read_team, robot_in, robot_xml, write_team
from robochoc.formats.global_constraints import read_form
from robochoc.journal.team_events import TeamReader, TeamWriter
from robochoc.model.assembly import Extras, assemble
from robochoc.model.costs import normalized, user_cost
from robochoc.model.expression import SymbolNames, Type, parse
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    CostUnits,
    Definition,
    Domain,
    Function,
    Predicate,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)
from tests.support.examples import count

TABLE = ("red", "green", "dark-blue", "eq", "X0")
FORMS = (
    ("allDifferent", "[ X0 X1 X2 ]"),
    ("weightedSum", "[ {2 X0} {-1 X1} {1 X2} ] <ge/> 1"),
    ("element", "X0 [ X1 2 X2 ] 1"),
    ("cumulative", "[ {X0 2 1} {X1 1 1} {<nil/> 1 X2 1} ] <le/> 2"),
)
NUMBERS = ("imp(lt(X,Y),in(X,set(1,Y)))", "xor(eq(X,Y,1),iff(lt(X,1),gt(Y,0)),ne(X,0))", "le(sqr(sub(X,Y)),1)")
SYMBOLS = ("eq(X,Y)", "ne(X,'dark-blue')", "or(in(X,set(red,'eq')),eq(Y,X,green))")
COSTS = ("sub(sqr(X),mul(3,Y))", "if(eq(X,Y),-7,2)", "neg(dist(X,Y))")


def random_team(seed: int) -> Team:
    """Return a team of three robots, each with a number and a symbol."""
    chance = Random(seed)
    kind = chance.choice(list(ProblemKind))
    soft = kind is ProblemKind.DISWCSP
    own = {f"r{place}": [_number(chance, place), _symbol(chance, place)] for place in range(3)}
    constraints = [_constraint(chance, number, soft=soft) for number in range(chance.randint(1, 6))]
    parts = {f"r{place}": [_pair(chance, f"P{place}", ("n1", "n2"), soft=soft)] for place in (1, 2)}
    units = CostUnits(chance.random() < 0.5, chance.randint(0, 9), chance.randint(-99, 99)) if soft else CostUnits()
    extras = Extras(parts=parts) if chance.random() < 0.5 else Extras()
    return assemble(f"team-{seed}", own, constraints, kind=kind, costs=units, extras=extras)


def _number(chance: Random, place: int) -> Variable:
    return Variable(f"n{place}", Domain("N", (range(chance.randint(-1, 0), chance.randint(2, 3)),)))


def _symbol(chance: Random, place: int) -> Variable:
    codes = sorted(chance.sample(range(len(TABLE)), chance.randint(1, 3)))
    return Variable(f"s{place}", Domain(f"S{place}", tuple(range(code, code + 1) for code in codes), TABLE))


def _constraint(chance: Random, number: int, *, soft: bool) -> Constraint:
    name = f"C{number}"
    match chance.choice(["global", "numbers", "symbols", "both"]):
        case "global":
            scope: tuple[str, ...]
            kind, form = chance.choice(FORMS)
            scope = ("n0", "n1", "n2") if kind != "allDifferent" or chance.random() < 0.5 else ("s0", "s1", "s2")
            return _priced(chance, Constraint(name, read_form(f"global:{kind}", form), scope, scope), soft=soft)
        case "numbers":
            return _pair(chance, name, tuple(chance.sample(("n0", "n1", "n2"), 2)), soft=soft)
        case "symbols":
            scope = tuple(chance.sample(("s0", "s1", "s2"), 2))
            names = SymbolNames(("X", "Y"), TABLE.index)
            body = parse(chance.choice(SYMBOLS), ("X", "Y"), Type.BOOLEAN, names)
            return _priced(chance, Constraint(name, Predicate(f"p{number}", ("X", "Y"), body), scope, scope), soft=soft)
        case _:
            scope = (f"s{chance.randrange(3)}", f"n{chance.randrange(3)}")
            return Constraint(name, _table(chance, f"r{number}", len(TABLE), soft=soft), scope, scope)


def _pair(chance: Random, name: str, scope: tuple[str, ...], *, soft: bool) -> Constraint:
    definition: Definition
    if soft and chance.random() < 0.4:
        definition = Function(f"f{name}", ("X", "Y"), parse(chance.choice(COSTS), ("X", "Y"), Type.INTEGER))
        return Constraint(name, definition, scope, scope)
    if chance.random() < 0.5:
        return Constraint(name, _table(chance, f"t{name}", 3, soft=soft), scope, scope)
    definition = Predicate(f"p{name}", ("X", "Y"), parse(chance.choice(NUMBERS), ("X", "Y"), Type.BOOLEAN))
    return _priced(chance, Constraint(name, definition, scope, scope), soft=soft)


def _table(chance: Random, name: str, first: int, *, soft: bool) -> Relation:
    rows = tuple(row for row in itertools.product(range(first), range(-1, 3)) if chance.random() < 0.5) or ((0, 0),)
    if not soft:
        return Relation(name, 2, chance.choice([Semantics.SUPPORTS, Semantics.CONFLICTS]), rows)
    costs = tuple(chance.choice([INFINITE, 0, chance.randint(-(10**9), 10**9)]) for _ in rows)
    return Relation(name, 2, Semantics.SOFT, rows, costs, chance.choice([INFINITE, -5, 0, 3]))


def _priced(chance: Random, constraint: Constraint, *, soft: bool) -> Constraint:
    return replace(constraint, cost=chance.randint(-50, 50)) if soft and chance.random() < 0.6 else constraint


def price(team: Team, assignment: dict[str, int]) -> float:
    """What `assignment` costs in the team's units, functions included."""
    unit = 10 ** team.robots[0].costs.places
    return sum(
        one.price(assignment) * (unit if isinstance(one.definition, Function) else 1) for one in team.constraints()
    )


@count("seeds", 40, 1000)
def test_what_is_written_is_read_back(seeds: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    for seed in range(seeds):
        team = random_team(seed)
        check_team(team)
        folder: Path = tmp_path_factory.mktemp("teams") / team.name
        write_team(team, folder)
        again = read_team(folder)
        assert again == team, seed
        write_team(again, folder, replace=True)
        assert read_team(folder) == team, seed
        for robot in team.robots:
            assert robot_in(robot_xml(robot), robot.name) == robot, seed


@count("seeds", 25, 400)
def test_it_costs_the_same_when_normalised_and_recorded(seeds: int) -> None:
    for seed in range(seeds):
        team = random_team(seed)
        counted = normalized(team)
        recorded = TeamReader(team.name).team(TeamWriter().given(counted))
        for values in itertools.product(*(variable.domain for variable in team.variables.values())):
            assignment = dict(zip(team.variables, values, strict=True))
            paid = price(team, assignment)
            total = sum(one.price(assignment) for one in counted.constraints())
            assert (total < INFINITE) is (paid < INFINITE), (seed, assignment)
            assert sum(one.price(assignment) for one in recorded.constraints()) == total, (seed, assignment)
            if paid < INFINITE and team.kind is ProblemKind.DISWCSP:
                units = team.robots[0].costs
                assert user_cost(counted, total) == units.in_user_units(paid), (seed, assignment)

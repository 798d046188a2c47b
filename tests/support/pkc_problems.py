"""Teams with partially known constraints (PKC), and what is done to their parts."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from random import Random

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    Child,
    Constraint,
    ConstraintModel,
    Parent,
    Predicate,
    Relation,
    Robot,
    Semantics,
    Team,
)
from robochoc.protocols.protocol import Protocol
from robochoc.verification.checker import violations
from tests.support.brute_force import solutions
from tests.support.problems import PREDICATES, team_of
from tests.support.program import ROOT
from tests.support.solver_networks import compiled_by_brute_force

Row = tuple[int, ...]
"""Values of a constraint's variables, in the order of its `variables`."""

Part = tuple[str, str, str]
"""Whose part of a PKC, towards whom, and the constraint's name."""


def random_pkc_team(chance: Random) -> Team:
    """2 to 6 robots with a variable each; most constraints are PKCs of two unlike parts, others TKC, some pairs both.

    Parts are tables, stated either way, and predicates. Now and then one side's part is missing: it allows everything.
    """
    domains = {f"X{n:02}": sorted(chance.sample(range(-3, 6), chance.choice((1, 2, 3, 3, 4)))) for n in _upto(chance)}
    density = chance.uniform(0.4, 1)
    held, parts = [], {}
    for number, pair in enumerate(itertools.combinations(domains, 2)):
        if chance.random() > density:
            continue
        kinds = chance.choice(("pkc", "pkc", "pkc", "tkc", "both"))
        if kinds != "tkc":
            held.append(_random_part(chance, domains, pair, f"C{number}"))
            parts[pair] = _random_part(chance, domains, pair, f"C{number}")
        if kinds != "pkc":
            held.append(replace(_random_part(chance, domains, pair, f"T{number}"), model=ConstraintModel.TKC))
    private = (_table(chance, domains, (name,), 0.3, f"U{name}") for name in domains if chance.random() < 0.1)
    team = team_of(domains, [*held, *(replace(one, model=None) for one in private)], "pkc")
    for (parent, child), part in parts.items():
        team = with_part(team, f"R{parent}", f"R{child}", part)
    return one_sided(team, chance) if chance.random() < 0.2 else team


def with_private_parts(team: Team, chance: Random) -> Team:
    """`team` with every constraint of two robots made a PKC: what it forbids, the one part, the other or both forbid.

    The solutions are the same. Parts are tables over the declared domains.
    """
    numbers = itertools.count()
    for robot in team.robots:
        for parent in robot.parents:
            for constraint in parent.constraints:
                if len({team.owner[name] for name in constraint.variables}) == 2:
                    below, above = _split(team, constraint, chance, f"S{next(numbers)}")
                    team = _replaced(team, robot.name, constraint, below)
                    team = with_part(team, parent.name, robot.name, above)
    return team


def with_part(team: Team, parent: str, child: str, part: Constraint) -> Team:
    """`team` in which `parent` holds `part` towards `child` besides what it holds already."""
    robot = team[parent]
    children = tuple(
        replace(one, constraints=(*one.constraints, part)) if one.name == child else one for one in robot.children
    )
    return with_robot(team, replace(robot, children=children))


def with_robot(team: Team, robot: Robot) -> Team:
    """`team` with another file for one robot."""
    return replace(team, robots=tuple(robot if one.name == robot.name else one for one in team.robots))


def pkc_parts(team: Team) -> dict[Part, Constraint]:
    """All parts of PKCs by who holds them."""
    found = {}
    for robot in team.robots:
        neighbours: tuple[Parent | Child, ...] = (*robot.parents, *robot.children)
        for neighbour in neighbours:
            for constraint in neighbour.constraints:
                if constraint.model is ConstraintModel.PKC:
                    found[robot.name, neighbour.name, constraint.name] = constraint
    return found


def with_constraints(team: Team, change: Callable[[Robot, Constraint], Constraint]) -> Team:
    """`team` with each shared constraint changed by `change`, which is also told who holds it."""
    robots = []
    for robot in team.robots:
        above = (replace(p, constraints=tuple(change(robot, c) for c in p.constraints)) for p in robot.parents)
        below = (replace(p, constraints=tuple(change(robot, c) for c in p.constraints)) for p in robot.children)
        robots.append(replace(robot, parents=tuple(above), children=tuple(below)))
    return replace(team, robots=tuple(robots))


def rows(team: Team, constraint: Constraint) -> list[Row]:
    """All combinations of declared values of a constraint's variables."""
    return list(itertools.product(*(sorted(team.variables[name].domain) for name in constraint.variables)))


def allowed(constraint: Constraint, row: Row) -> bool:
    """Whether a constraint allows a combination of its variables' values."""
    return constraint.allows(dict(zip(constraint.variables, row, strict=True)))


def as_table(constraint: Constraint, listed: Sequence[Row], semantics: Semantics, name: str) -> Constraint:
    """`constraint` with another meaning: a table over its variables."""
    scope = constraint.variables
    return replace(
        constraint, definition=Relation(name, len(scope), semantics, tuple(listed)), scope=scope, parameters=scope
    )


def as_predicate(constraint: Constraint, allowing: Sequence[Row], name: str) -> Constraint:
    """`constraint` stated as an expression that is true of `allowing` only."""
    scope = constraint.variables
    formal = tuple(f"a{place}" for place in range(len(scope)))
    cases = ["ne(a0, a0)"]
    for row in allowing:
        equal = ", ".join(f"eq({one}, {value})" for one, value in zip(formal, row, strict=True))
        cases.append(f"and({equal})" if len(row) > 1 else equal)
    body = parse(f"or({', '.join(cases)})" if allowing else cases[0], formal, Type.BOOLEAN)
    return replace(constraint, definition=Predicate(name, formal, body), scope=scope, parameters=scope)


def _upto(chance: Random) -> range:
    return range(chance.randint(2, 6))


def _random_part(chance: Random, domains: Mapping[str, Sequence[int]], pair: Sequence[str], name: str) -> Constraint:
    scope = list(pair)
    chance.shuffle(scope)
    if chance.random() < 0.7:
        return _table(chance, domains, scope, chance.uniform(0, 0.45), name)
    return Constraint(name, chance.choice(PREDICATES), tuple(scope), tuple(scope), ConstraintModel.PKC)


def _table(
    chance: Random, domains: Mapping[str, Sequence[int]], scope: Sequence[str], tightness: float, name: str
) -> Constraint:
    semantics = chance.choice((Semantics.CONFLICTS, Semantics.SUPPORTS))
    every = itertools.product(*(domains[variable] for variable in scope))
    listed = [row for row in every if (chance.random() < tightness) is (semantics is Semantics.CONFLICTS)]
    relation = Relation(f"r{name}.{chance.getrandbits(40)}", len(scope), semantics, tuple(listed))
    return Constraint(name, relation, tuple(scope), tuple(scope), ConstraintModel.PKC)


def one_sided(team: Team, chance: Random) -> Team:
    """Some part is left out, on either side, where the neighbour still shows the variable that the other looks at."""
    holder, other, name = chance.choice([*pkc_parts(team)] or [("", "", "")])
    if not holder:
        return team
    robot = team[holder]
    without = replace(
        robot,
        parents=tuple(
            replace(p, constraints=tuple(c for c in p.constraints if c.name != name)) if p.name == other else p
            for p in robot.parents
        ),
        children=tuple(
            replace(p, constraints=tuple(c for c in p.constraints if c.name != name)) if p.name == other else p
            for p in robot.children
        ),
    )
    return with_robot(team, without) if without.interface == robot.interface else team


def _split(team: Team, constraint: Constraint, chance: Random, name: str) -> tuple[Constraint, Constraint]:
    forbidden: tuple[list[Row], list[Row]] = [], []
    every = rows(team, constraint)
    for row in every:
        if not allowed(constraint, row):
            sides = chance.choice(((0,), (1,), (0, 1)))
            for side in sides:
                forbidden[side].append(row)
    both = []
    for side, rejected in enumerate(forbidden):
        conflicts = chance.random() < 0.5
        listed = rejected if conflicts else [row for row in every if row not in rejected]
        semantics = Semantics.CONFLICTS if conflicts else Semantics.SUPPORTS
        part = as_table(constraint, listed, semantics, f"{name}.{side}")
        both.append(replace(part, name=name, model=ConstraintModel.PKC))
    return both[0], both[1]


def _replaced(team: Team, holder: str, old: Constraint, new: Constraint) -> Team:
    def change(robot: Robot, constraint: Constraint) -> Constraint:
        return new if robot.name == holder and constraint is old else constraint

    return with_constraints(team, change)


SECRETS = ROOT / "docs" / "examples" / "secrets"


def pkc_part(pair: str, *forbidden: tuple[int, int], name: str = "C") -> Constraint:
    """Return one robot's part of a PKC over the variables named by two letters."""
    called = "R" + "_".join(f"{one}.{other}" for one, other in forbidden)
    relation = Relation(called, 2, Semantics.CONFLICTS, forbidden)
    return Constraint(name, relation, tuple(pair), tuple(pair), ConstraintModel.PKC)


def pkc_pair(below: Constraint | None, above: Constraint | None, values: int = 2) -> Team:
    """Return the team of A above B, which share a PKC of these two parts."""
    domains = dict.fromkeys("AB", range(1, values + 1))
    team = team_of(domains, [below or pkc_part("AB")])
    return team if above is None else with_part(team, "RA", "RB", above)


def random_schedule(chance: Random) -> Schedule:
    """Return a schedule of either kind."""
    if chance.random() < 0.5:
        return RandomChannels(chance.getrandbits(32))
    return Concurrent(chance.getrandbits(32), chance.choice((0, 3, 20, 200)))


def check_against_brute_force(team: Team, protocol: type[Protocol], chance: Random) -> Verdict:
    """Solve `team` by `protocol` on the simulator; the verdict must be brute force's, and a solution must hold."""
    result = Simulation(compiled_by_brute_force(team), protocol, random_schedule(chance)).run(60)
    solvable = any(solutions(team))
    assert result.verdict is (Verdict.SOLUTION if solvable else Verdict.NO_SOLUTION), team
    if solvable:
        flat = {name: value for own in result.assignments.values() for name, value in own.items()}
        assert not list(violations(team, flat))
    return result.verdict

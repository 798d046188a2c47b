"""Teams with what no constraint needs: links without constraints, variables that are told for nothing; and orders.

The fault that they are drawn for: a robot showed less in the turned team than in the files', and its domain was
compiled from the files'.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from random import Random

from robochoc.formats import PREDEFINED
from robochoc.model.orders import Order, OrderError, with_order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import (
    INFINITE,
    Child,
    Constraint,
    Domain,
    Parent,
    ProblemKind,
    Robot,
    Team,
    Variable,
)
from robochoc.run import solve
from robochoc.run.options import Options
from robochoc.run.registry import protocol_named
from robochoc.solver.ace import AceProcess
from tests.support.allocation_problems import simple_allocation_team
from tests.support.brute_force import least_cost, solutions
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, softened
from tests.support.encrypted_problems import affordable, short_settings
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team

PAIR = 2
ENOUGH = 3000
"""Messages after which an incomplete protocol may give up."""


def loosened(team: Team, chance: Random) -> Team:
    """`team` with links, and variables that children are told, that no constraint needs: the same problem.

    Some robots get a variable more, which stands in no constraint, and which some of their children are told.
    """
    robots = {robot.name: _with_ballast(robot, chance) for robot in team.robots}
    for above, below in itertools.combinations(team.order, 2):
        if chance.random() < 0.25:
            _link(robots, above, below)
    for name, robot in robots.items():
        own = [variable.name for variable in robot.variables]
        children = tuple(
            replace(child, variables=tuple(dict.fromkeys([*child.variables, *_some(own, chance)])))
            for child in robot.children
        )
        robots[name] = replace(robot, children=children)
    return replace(team, robots=tuple(robots.values()))


def every_order(team: Team, chance: Random) -> list[Order | tuple[str, ...] | None]:
    """The files' order, each by name, and two that are listed: those that `team` can be turned to."""
    return [order for order in _orders(team, chance) if _turns(team, order)]


def any_order(team: Team, chance: Random) -> Order | tuple[str, ...] | None:
    """One of these."""
    orders = _orders(team, chance)
    while not _turns(team, order := chance.choice(orders)):
        orders.remove(order)
    return order


def _orders(team: Team, chance: Random) -> list[Order | tuple[str, ...] | None]:
    return [None, *Order, *(tuple(chance.sample(team.order, len(team.order))) for _ in range(2))]


def _turns(team: Team, order: Order | tuple[str, ...] | None) -> bool:
    """Whether `team` can be turned to `order`."""
    try:
        with_order(team, order)
    except OrderError:
        return False
    return True


def loose_team(protocol: str, chance: Random, *, costs: bool = False) -> Team:
    """A random team with superfluous links and variables that `protocol` can take; with `costs` a DisWCSP.

    No robot needs a solver for its private constraints.
    """
    traits = protocol_named(protocol).traits
    if traits.allocates:
        return loosened(simple_allocation_team(chance), chance)

    def draw() -> Team:
        if costs and chance.random() < 0.2:
            return softened(several_variables_team(chance, n_ary=traits.n_ary), chance)
        if costs:
            return random_cost_team(chance, n_ary=traits.n_ary)
        if traits.partially_known and chance.random() < 0.3:
            return random_pkc_team(chance)
        if chance.random() < 0.3:
            return several_variables_team(chance, n_ary=traits.n_ary)
        return random_team(chance, n_ary=traits.n_ary)

    return loosened(affordable(protocol, draw), chance)


def check_against_brute_force(team: Team, options: Options, solver: AceProcess | None = None) -> Outcome:
    """Solve `team` and return the outcome, after a comparison with brute force. `solve` checks the assignment.

    An incomplete protocol may find no answer, or one that is not the best. What it claims has to be true. Its search is
    short, unless the options have settings of their own.
    """
    protocol = protocol_named(options.protocol)
    if hasattr(protocol.settings, "cycles"):
        options = replace(options, settings={**short_settings(options.protocol, 20), **options.settings})
    if not protocol.traits.complete and not protocol.traits.encrypted_tables:
        options = replace(options, messages=ENOUGH)
    outcome = solve(team, options, solver=solver)
    truth = minimum_cost(team)
    best = Verdict.OPTIMAL if team.kind is ProblemKind.DISWCSP else Verdict.SOLUTION
    right = {best if truth < INFINITE else Verdict.NO_SOLUTION}
    if not protocol.traits.complete:
        right |= {Verdict.UNKNOWN, Verdict.SOLUTION} if truth < INFINITE else {Verdict.UNKNOWN}
    what = (team, options, outcome.verdict, outcome.cost, truth)
    assert outcome.verdict in right, what
    assert outcome.verified is (outcome.cost is not None), what
    if outcome.cost is None:
        assert not outcome.assignment, what
        assert outcome.verdict in {Verdict.UNKNOWN, Verdict.NO_SOLUTION}, what
    else:
        assert truth <= outcome.cost < INFINITE, what
        assert outcome.cost == truth or outcome.verdict is not best or not protocol.traits.complete, what
        assert outcome.cost == truth or outcome.verdict is not Verdict.OPTIMAL, what
    return outcome


def turned_interface() -> Team:
    """A shows y to B, with whom it shares a constraint, and x to C, with whom it does not.

    It is solvable. In the order C, A, B nobody is told x any more.
    """
    shared = Constraint("E", PREDEFINED["eq"], ("y", "b"), ("y", "b"))
    above = Robot(
        "A", (_variable("x", 1, 2, 3), _variable("y", 7, 8)), children=(Child("B", ("y",)), Child("C", ("x",)))
    )
    return Team(
        "turned-interface",
        (
            above,
            Robot("B", (_variable("b", 7, 8),), parents=(Parent("A", (shared,)),)),
            Robot("C", (_variable("c", 1, 2),), parents=(Parent("A"),)),
        ),
    )


def untold_interface() -> Team:
    """A's file says that it tells B its y; that B's constraint wants x too only B's file says."""
    below = Constraint("C", PREDEFINED["lt"], ("x", "b"), ("x", "b"))
    team = turned_interface()
    held = (*team["B"].parents[0].constraints, below)
    robots = (team["A"], replace(team["B"], parents=(Parent("A", held),)))
    above = replace(robots[0], children=(Child("B", ("y",)),))
    return Team("untold-interface", (above, robots[1]))


def minimum_cost(team: Team) -> float:
    """The least cost of a solution, by brute force; without costs 0 for one, and `INFINITE` where there is none."""
    needed = {name for constraint in team.constraints() for name in constraint.variables}
    robots = (
        replace(
            robot,
            variables=tuple(v if v.name in needed else _variable(v.name, *[*v.domain][:1]) for v in robot.variables),
        )
        for robot in team.robots
    )
    smaller = replace(team, robots=tuple(robots))
    if team.kind is ProblemKind.DISWCSP:
        return least_cost(smaller)
    return 0 if any(solutions(smaller)) else INFINITE


def _variable(name: str, *values: int) -> Variable:
    return Variable(name, Domain("D", tuple(range(value, value + 1) for value in values)))


def _some(names: Sequence[str], chance: Random) -> list[str]:
    return [name for name in names if chance.random() < 0.4]


def _with_ballast(robot: Robot, chance: Random) -> Robot:
    """`robot`, now and then with a variable more, before or after its own."""
    if chance.random() > 0.3 or len(robot.variables) > 1:
        return robot
    more = _variable(f"{robot.name}.more", *range(chance.randint(1, 2)))
    first = chance.random() < 0.5
    return replace(robot, variables=(more, *robot.variables) if first else (*robot.variables, more))


def _link(robots: dict[str, Robot], above: str, below: str) -> None:
    """A link without a constraint, if there is no link yet."""
    parent, child = robots[above], robots[below]
    if any(one.name == below for one in parent.children):
        return
    robots[above] = replace(parent, children=(*parent.children, Child(below)))
    robots[below] = replace(child, parents=(*child.parents, Parent(above)))


def several_variables_team(chance: Random, *, n_ary: bool) -> Team:
    """Robots of several variables, without private constraints: none needs a solver."""
    team = random_complex_team(chance)
    owner = team.owner

    def taken(constraint: Constraint) -> bool:
        return n_ary or len({owner[name] for name in constraint.variables}) == PAIR

    def of(robot: Robot) -> Robot:
        parents = (replace(one, constraints=tuple(filter(taken, one.constraints))) for one in robot.parents)
        return replace(robot, private=(), parents=tuple(parents))

    return replace(team, robots=tuple(map(of, team.robots)))


def loosened_cost_team(chance: Random) -> Team:
    """Return a random team with costs: one in five is of complex robots, half have what nobody needs."""
    team = random_complex_cost_team(chance) if chance.random() < 0.2 else random_cost_team(chance)
    return loosened(team, chance) if chance.random() < 0.5 else team

"""Smart lighting: lamps choose levels that give rooms the wanted luminosity with little energy.

This is the smart environment configuration problem: Rust, Picard and Ramparany, "Using message-passing DCOP algorithms
to solve energy-efficient smart environment configuration problems", IJCAI 2016. A robot is a lamp, and its variable is
its level. Each level costs the lamp's consumption. Each rule wants a luminosity in one place, to which the lamps near
it contribute; it costs its importance times the difference. In the paper a place's luminosity is a variable of its own,
equal to the weighted sum of the levels; here the sum is part of the rule.
"""

from __future__ import annotations

from robochoc.generators.draws import MAX_AGENTS, MAX_COST, check_bounds, limited, random_integer, sample, seeded
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Name, total
from robochoc.model.problem import Constraint, Domain, Function, ProblemKind, Team, Variable

MAX_LEVELS = 100
MAX_LAMPS = 10
MAX_COMBINATIONS = 1_000_000
"""The maximum number of combinations of levels of the lamps in a rule."""
MAX_CONTRIBUTION = 3
"""The maximum luminosity of a lamp per level."""


def smart_homes(
    *,
    agents: int,
    rules: int,
    levels: int = 5,
    lamps: int = 3,
    consumption: int = 3,
    importance: int = 10,
    seed: int = 0,
) -> Team:
    """Return a random smart lighting problem.

    `Robot3` owns `V3`.

    Args:
        agents: The number of lamps.
        rules: The number of rules.
        levels: The number of levels of a lamp; level 0 is off.
        lamps: The number of lamps that contribute to the luminosity in a rule.
        consumption: The maximum cost of a lamp per level; the minimum is 1.
        importance: The maximum cost of a difference of 1 in a rule; the minimum is 1.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds.
    """
    check_bounds(
        {"agents": (agents, 1, MAX_AGENTS), "rules": (rules, 0, MAX_AGENTS), "levels": (levels, 2, MAX_LEVELS)}
    )
    check_bounds({"lamps": (lamps, 1, min(agents, MAX_LAMPS)), "consumption": (consumption, 1, MAX_COST)})
    check_bounds({"importance": (importance, 1, MAX_COST)})
    if levels**lamps > MAX_COMBINATIONS:
        raise ValueError(
            f"{lamps} lamps have {levels**lamps:,} combinations of levels, more than {MAX_COMBINATIONS:,};"
            " use fewer levels or lamps"
        )
    chance = seeded(seed)
    constraints = []
    for lamp in range(1, agents + 1):
        energy = Apply("mul", (Constant(random_integer(chance, 1, consumption)), Name("X")))
        name = f"energy{lamp}"
        constraints.append(Constraint(name, Function(name, ("X",), energy), (f"V{lamp}",), (f"V{lamp}",)))
    for rule in range(1, rules + 1):
        near = [place + 1 for place in sample(chance, agents, lamps)]
        shares = [random_integer(chance, 1, MAX_CONTRIBUTION) for _ in near]
        wanted = random_integer(chance, 0, sum(shares) * (levels - 1))
        light = total(
            Apply("mul", (Constant(share), Name(f"X{lamp}"))) for lamp, share in zip(near, shares, strict=True)
        )
        missed = Apply("abs", (Apply("sub", (Constant(wanted), light)),))
        cost = Apply("mul", (Constant(random_integer(chance, 1, importance)), missed))
        scope = tuple(f"V{lamp}" for lamp in near)
        function = Function(f"rule{rule}", tuple(f"X{lamp}" for lamp in near), cost)
        constraints.append(Constraint(f"Rule{rule}", function, scope, scope))
    values = Domain("Levels", (range(levels),))
    return assemble(
        f"smart-homes-{agents}-{rules}-{levels}-{lamps}-{consumption}-{importance}-{seed}",
        {f"Robot{lamp}": [Variable(f"V{lamp}", values)] for lamp in range(1, agents + 1)},
        limited(constraints),
        kind=ProblemKind.DISWCSP,
    )

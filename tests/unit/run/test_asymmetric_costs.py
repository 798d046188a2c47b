"""Partially known constraints whose parts cost something: each side pays its own, and the sum is what counts."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from robochoc.formats import read_team, write_team
from robochoc.model.assembly import Extras, assemble
from robochoc.model.expression import Type, parse
from robochoc.model.problem import (
    Constraint,
    CostUnits,
    Domain,
    Function,
    Predicate,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)
from robochoc.protocols.protocol import Protocol
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.solver.encoding import UnsupportedError
from tests.support.examples import count
from tests.support.real_costs import best_cost

PAIR = ("X", "Y")
ORDERS = Function("ordered", PAIR, parse("sub(mul(2,X),Y)", PAIR, Type.INTEGER))
DIFFER = Predicate("differ", PAIR, parse("ne(X,Y)", PAIR, Type.BOOLEAN))


def asymmetric_team(seed: int) -> Team:
    """Three robots; of each pair one or both sides have costs of their own."""
    chance = Random(seed)
    own = {f"r{number}": [Variable(f"x{number}", Domain("D", (range(-1, 2),)))] for number in range(3)}
    parts: dict[str, list[Constraint]] = {name: [] for name in own}
    for one, other in ((0, 1), (1, 2), (0, 2)):
        scope = (f"x{one}", f"x{other}")
        for side in (one, other)[chance.randint(0, 1) :]:  # the lower one has a part, so it shows its variable
            rows = tuple((left, right) for left in range(-1, 2) for right in range(-1, 2) if chance.random() < 0.6)
            costs = tuple(chance.randint(-9, 9) for _ in rows)
            table = Relation(f"t{one}{other}", 2, Semantics.SOFT, rows, costs, chance.randint(-3, 3))
            definition = ORDERS if chance.random() < 0.5 else table
            part = Constraint(f"C{one}{other}", definition, scope, scope)
            if chance.random() < 0.3:
                part = replace(part, definition=DIFFER, cost=chance.randint(-5, 5))
            parts[f"r{side}"].append(part)
    units = CostUnits(chance.random() < 0.5, chance.choice([0, 2]))
    return assemble(f"adcop-{seed}", own, [], kind=ProblemKind.DISWCSP, costs=units, extras=Extras(parts=parts))


@count("seeds", 10, 400)
def test_the_central_solver_adds_what_both_sides_pay(seeds: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    for seed in range(seeds):
        team = asymmetric_team(seed)
        outcome = solve(team, Options(protocol="central"))
        assert outcome.cost is not None
        assert Fraction(outcome.cost) == best_cost(team), seed
        assert outcome.verified
        folder = tmp_path_factory.mktemp("teams") / team.name
        write_team(team, folder)
        assert read_team(folder) == team


def test_protocols_refuse_it_by_name() -> None:
    for protocol in ["dpop", "adopt", "afb", "dsa"]:
        with pytest.raises(UnsupportedError, match=rf"has costs of its own for .*C\d\d\), which {protocol} does not"):
            solve(asymmetric_team(1), Options(protocol=protocol, runtime=Runtime.SIMULATOR))


def test_a_trait_says_who_takes_it() -> None:
    assert not Protocol.traits.asymmetric
